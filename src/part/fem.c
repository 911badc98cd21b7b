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

pb_status pb_fem_frame_mass(const pb_fem *fem, pb_fem_frame *frame, pb_error *err) {
  double *moment = calloc(4 * frame->nodes + 1, sizeof *moment), total = 0;
  size_t *place = calloc(fem->m.n + 1, sizeof *place);  // of a row's node in the frame, from 1
  pb_status st = moment && place ? PB_OK : pb_fail_memory(err, frame->name);
  for (size_t i = 0; !st && i < 3 * frame->nodes; i++) {
    int64_t row = fem->dof[i % 3 + 3 * frame->node[i / 3]];
    if (row >= 0) place[row] = 3 * (i / 3 + 1) + i % 3;
  }
  for (size_t j = 0; !st && j < fem->m.n; j++) {
    for (int64_t at = place[j] ? fem->m.start[j] : 0; place[j] && at < fem->m.start[j + 1]; at++) {
      size_t a = place[fem->m.row[at]], b = place[j];
      if (!a || a % 3 != b % 3) continue;  // another direction, or not of the frame
      size_t pair[2] = {a / 3 - 1, b / 3 - 1};
      for (size_t side = 0; side < (pair[0] == pair[1] ? 1 : 2); side++) {
        double *to = moment + 4 * pair[side], g = fem->m.value[at] / 3;
        const double *x = fem->xyz + 3 * frame->node[pair[1 - side]];
        to[0] += g;
        for (size_t d = 0; d < 3; d++) to[1 + d] += g * (x[d] - frame->origin[d]);
        total += g;
      }
    }
  }
  free(place);
  if (!st && !(total > 0))
    st = pb_fail(err, PB_ERR_ARGUMENT, frame->name, "M has no mass at the frame's nodes");
  if (st) {
    free(moment);
    return st;
  }
  free(frame->moment);
  frame->moment = moment;
  return PB_OK;
}
