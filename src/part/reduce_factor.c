// Order and factor of the stiffness without held rows, and what it means when that fails.
#include <inttypes.h>
#include <stdlib.h>

#include "part/reduce_internal.h"

// Pivots below this of their diagonal are what rounding leaves of zero.
static const double smallest_pivot = 1e-13;

static pb_status fail_singular(const reduce_work *w, size_t row, double pivot, pb_error *err) {
  size_t node = w->node_of_row[row];
  const double *x = w->fem->xyz + 3 * node;
  return pb_fail(err, PB_ERR_SINGULAR, w->fem->name,
                 "the part has a mechanism, or K is not positive definite: node %" PRId64
                 " at (%.6g, %.6g, %.6g) moves without stiffness (pivot %.1e of its diagonal)",
                 pb_fem_node_number(w->fem, node), x[0], x[1], x[2], pivot);
}

// Whether every entry of m has its place in k.
static bool contains(const pb_sparse *k, const pb_sparse *m) {
  for (size_t j = 0; j < m->n; j++) {
    int64_t at = k->start[j], end = k->start[j + 1];
    for (int64_t e = m->start[j]; e < m->start[j + 1]; e++) {
      while (at < end && k->row[at] < m->row[e]) at++;
      if (at == end || k->row[at] != m->row[e]) return false;
    }
  }
  return true;
}

// K and M in one pattern, its values without meaning.
static pb_status unite(const pb_sparse *k, const pb_sparse *m, pb_sparse *out, pb_error *err) {
  size_t nk = (size_t)k->start[k->n], count = nk + (size_t)m->start[m->n], to = 0;
  int64_t *row = malloc((count + 1) * sizeof *row), *col = malloc((count + 1) * sizeof *col);
  double *value = calloc(count + 1, sizeof *value);
  pb_status st = row && col && value ? PB_OK : pb_fail_memory(err, "stiffness");
  for (const pb_sparse *a = k; !st; a = m) {
    for (size_t j = 0; j < a->n; j++) {
      for (int64_t at = a->start[j]; at < a->start[j + 1]; at++, to++) {
        row[to] = a->row[at];
        col[to] = (int64_t)j;
      }
    }
    if (a == m) break;
  }
  if (!st) st = pb_sparse_from_entries(k->n, count, row, col, value, out, err);
  free(row);
  free(col);
  free(value);
  return st;
}

// The order serves K − ω²M too, so M must find its places in the analysis.
static pb_status order(reduce_work *w, pb_error *err) {
  const pb_fem *fem = w->fem;
  if (contains(&fem->k, &fem->m))
    return pb_factor_order(&fem->k, fem->nodes, fem->dof, w->held, &w->factor, err);
  pb_sparse both = {0};
  pb_status st = unite(&fem->k, &fem->m, &both, err);
  if (!st) st = pb_factor_order(&both, fem->nodes, fem->dof, w->held, &w->factor, err);
  pb_sparse_clear(&both);
  return st;
}

pb_status reduce_factor(reduce_work *w, pb_error *err) {
  size_t weak, left = 0;
  double pivot;
  pb_status st = reduce_begin(w, PB_REDUCE_ORDER, err);
  for (size_t r = 0; r < w->full; r++) left += !w->held[r];
  if (!st && !left)
    st = pb_fail(err, PB_ERR_ARGUMENT, w->fem->name, "nothing is left between the frames");
  if (!st) st = order(w, err);
  if (!st) st = reduce_begin(w, PB_REDUCE_FACTOR, err);
  if (!st) st = pb_factor_numeric(&w->factor, &w->fem->k, &weak, &pivot, err);
  if (!st && pivot < smallest_pivot) st = fail_singular(w, weak, pivot, err);
  return st;
}
