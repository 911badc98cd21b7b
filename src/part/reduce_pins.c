// What is connected with what in a model, and the six rows that hold a free part while its
// stiffness is factored.
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>

#include "part/reduce_internal.h"

// ---- pieces -------------------------------------------------------------------------------------

static size_t root_of(size_t *parent, size_t i) {
  while (parent[i] != i) i = parent[i] = parent[parent[i]];
  return i;
}

// Nodes hang together through entries of K and through rigid frames; an average ties nothing.
pb_status reduce_check_connected(const reduce_work *w, pb_error *err) {
  const pb_fem *fem = w->fem;
  size_t *parent = malloc(fem->nodes * sizeof *parent);
  if (!parent) return pb_fail_memory(err, fem->name);
  for (size_t i = 0; i < fem->nodes; i++) parent[i] = i;
  for (size_t j = 0; j < w->full; j++)
    for (int64_t at = fem->k.start[j]; at < fem->k.start[j + 1]; at++)
      if (fem->k.value[at] != 0)
        parent[root_of(parent, w->node_of_row[fem->k.row[at]])] =
            root_of(parent, w->node_of_row[j]);
  for (size_t f = 0; f < w->frames; f++)
    for (size_t i = 1; w->frame[f].rigid && i < fem->frame[f].nodes; i++)
      parent[root_of(parent, fem->frame[f].node[i])] = root_of(parent, fem->frame[f].node[0]);
  size_t first = w->node_of_row[0], whole = root_of(parent, first), apart = 0, other = 0;
  for (size_t r = 0; r < w->full; r++) {
    size_t node = w->node_of_row[r];
    if (root_of(parent, node) == whole) continue;
    if (!apart++) other = node;
  }
  free(parent);
  if (!apart) return PB_OK;
  return pb_fail(err, PB_ERR_SINGULAR, fem->name,
                 "the part falls into pieces: node %" PRId64 " is not connected with node %" PRId64
                 " (%zu of %zu rows are apart)",
                 pb_fem_node_number(fem, other), pb_fem_node_number(fem, first), apart, w->full);
}

// ---- pins ---------------------------------------------------------------------------------------

// The six rows whose motions are least alike, by Gram–Schmidt with pivoting on the rigid motions of
// all rows: the 3-2-1 support, spread as far as the part reaches.
static pb_status choose_rows(reduce_work *w, pb_error *err) {
  const pb_fem *fem = w->fem;
  double center[3] = {0}, size = 0;
  double *motion = malloc(6 * w->full * sizeof *motion);
  if (!motion) return pb_fail_memory(err, fem->name);
  for (size_t r = 0; r < w->full; r++)
    for (size_t a = 0; a < 3; a++)
      center[a] += fem->xyz[a + 3 * w->node_of_row[r]] / (double)w->full;
  for (size_t r = 0; r < w->full; r++)
    for (size_t a = 0; a < 3; a++)
      size = fmax(size, fabs(fem->xyz[a + 3 * w->node_of_row[r]] - center[a]));
  for (size_t i = 0; i < 3 * fem->nodes; i++) {
    double x[3], tie[18];
    if (fem->dof[i] < 0) continue;
    for (size_t a = 0; a < 3; a++)
      x[a] = (fem->xyz[a + 3 * (i / 3)] - center[a]) / (size > 0 ? size : 1);
    reduce_rigid_tie(x, tie);
    for (size_t c = 0; c < 6; c++) motion[c + 6 * (size_t)fem->dof[i]] = tie[i % 3 + 3 * c];
  }
  pb_status st = PB_OK;
  for (w->pins = 0; !st && w->pins < 6; w->pins++) {
    size_t best = 0;
    double largest = -1, unit[6];
    for (size_t r = 0; r < w->full; r++) {
      double sum = 0;
      for (size_t c = 0; c < 6; c++) sum += motion[c + 6 * r] * motion[c + 6 * r];
      if (sum > largest) largest = sum, best = r;
    }
    if (largest < 1e-12) {
      st = pb_fail(err, PB_ERR_ARGUMENT, fem->name, "all nodes lie on a line or in one point");
      break;
    }
    for (size_t c = 0; c < 6; c++) unit[c] = motion[c + 6 * best] / sqrt(largest);
    for (size_t r = 0; r < w->full; r++) {
      double along = 0;
      for (size_t c = 0; c < 6; c++) along += unit[c] * motion[c + 6 * r];
      for (size_t c = 0; c < 6; c++) motion[c + 6 * r] -= along * unit[c];
    }
    w->pin[w->pins] = best;
    w->held[best] = true;
  }
  free(motion);
  return st;
}

static pb_status list_pin_entries(reduce_work *w, pb_error *err) {
  const pb_sparse *k = &w->fem->k;
  size_t room = 0;
  for (int pass = 0; pass < 2; pass++) {
    size_t used = 0;
    for (size_t j = 0; j < k->n; j++) {
      for (int64_t at = k->start[j]; at < k->start[j + 1]; at++) {
        size_t i = (size_t)k->row[at];
        if (!w->held[i] && !w->held[j]) continue;
        for (size_t p = 0; p < w->pins; p++) {
          if (w->pin[p] != i && w->pin[p] != j) continue;
          if (pass) w->pin_entry[used] = (pin_entry){w->pin[p] == j ? i : j, p, k->value[at]};
          used++;
        }
      }
    }
    if (pass) break;
    room = used;
    w->pin_entry = malloc((room + 1) * sizeof *w->pin_entry);
    if (!w->pin_entry) return pb_fail_memory(err, w->fem->name);
    w->pin_entries = room;
  }
  return PB_OK;
}

pb_status reduce_choose_pins(reduce_work *w, pb_error *err) {
  pb_status st = w->averaged == w->frames ? choose_rows(w, err) : PB_OK;
  return st ? st : list_pin_entries(w, err);
}
