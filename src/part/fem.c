// A part's full finite-element model: see fem.h.
#include "part/fem.h"

#include <stdlib.h>

void pb_fem_clear(pb_fem *fem) {
  for (size_t f = 0; fem->frame && f < fem->frames; f++) {
    free(fem->frame[f].name);
    free(fem->frame[f].node);
    free(fem->frame[f].moment);
  }
  free(fem->frame);
  free(fem->name);
  free(fem->xyz);
  free(fem->number);
  free(fem->dof);
  pb_sparse_clear(&fem->k);
  pb_sparse_clear(&fem->m);
  *fem = (pb_fem){0};
}

int64_t pb_fem_node_number(const pb_fem *fem, size_t node) {
  return fem->number ? fem->number[node] : (int64_t)node + 1;
}

pb_status pb_fem_frame_weights(const pb_fem *fem, pb_fem_frame *frame, const double *w,
                               pb_error *err) {
  double *moment = malloc((4 * frame->nodes + 1) * sizeof *moment);
  if (!moment) return pb_fail_memory(err, frame->name);
  for (size_t i = 0; i < frame->nodes; i++) {
    double weight = w ? w[i] : 1;
    moment[4 * i] = weight;
    for (size_t a = 0; a < 3; a++)
      moment[1 + a + 4 * i] = weight * (fem->xyz[a + 3 * frame->node[i]] - frame->origin[a]);
  }
  free(frame->moment);
  frame->moment = moment;
  return PB_OK;
}
