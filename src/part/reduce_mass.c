// The mass matrix of isoparametric solids is the same for each direction and couples none of them:
// M = m ⊗ I₃, a ninth of the numbers to read in a product.
#include "part/reduce_internal.h"

#include <math.h>
#include <stdlib.h>

// Column 3j + d must repeat column 3j, moved down by d.
static bool repeats(const pb_sparse *m, size_t j, size_t d) {
  int64_t a = m->start[3 * j], b = m->start[3 * j + d], end = m->start[3 * j + 1];
  if (m->start[3 * j + d + 1] - b != end - a) return false;
  for (; a < end; a++, b++) {
    bool same = m->row[a] % 3 == 0 && m->row[b] == m->row[a] + (int64_t)d;
    if (!same || !(fabs(m->value[a] - m->value[b]) <= 1e-14 * fabs(m->value[a]))) return false;
  }
  return true;
}

static bool is_triple(const pb_fem *fem) {
  if (fem->m.n % 3) return false;
  for (size_t i = 0; i < fem->nodes; i++) {
    const int64_t *dof = fem->dof + 3 * i;
    bool none = dof[0] < 0 && dof[1] < 0 && dof[2] < 0;
    bool three = dof[0] >= 0 && dof[0] % 3 == 0 && dof[1] == dof[0] + 1 && dof[2] == dof[0] + 2;
    if (!none && !three) return false;
  }
  for (size_t j = 0; j < fem->m.n / 3; j++)
    if (!repeats(&fem->m, j, 1) || !repeats(&fem->m, j, 2)) return false;
  return true;
}

pb_status reduce_mass_detect(reduce_work *w, pb_error *err) {
  const pb_sparse *m = &w->fem->m;
  if (!is_triple(w->fem)) return PB_OK;
  size_t n = m->n / 3, entries = (size_t)m->start[m->n] / 3;
  pb_sparse s = {n, malloc((n + 1) * sizeof(int64_t)), malloc((entries + 1) * sizeof(int64_t)),
                 malloc((entries + 1) * sizeof(double))};
  if (!s.start || !s.row || !s.value) {
    pb_sparse_clear(&s);
    return pb_fail_memory(err, "mass");
  }
  int64_t to = 0;
  for (size_t j = 0; j < n; j++) {
    s.start[j] = to;
    for (int64_t at = m->start[3 * j]; at < m->start[3 * j + 1]; at++, to++) {
      s.row[to] = m->row[at] / 3;
      s.value[to] = m->value[at];
    }
  }
  s.start[n] = to;
  w->mass = s;
  w->triple = true;
  return PB_OK;
}

void reduce_mass_multiply(const reduce_work *w, size_t columns, const double *x, double *y) {
  if (w->triple) {
    pb_sparse_multiply_triple(&w->mass, columns, x, y);
  } else {
    pb_sparse_multiply(&w->fem->m, columns, x, y);
  }
}
