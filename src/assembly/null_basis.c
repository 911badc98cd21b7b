// The basis of the constraints' null space: see eliminate.h.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "assembly/eliminate.h"
#include "base/lapack.h"

static pb_status factor(pb_null_basis *b, const pb_stack_equations *s, int *pivot, pb_error *err) {
  int n = (int)s->n, m = (int)s->constraints, info = 0, lwork = 64 * (m + 1) + 2 * m;
  double *work = malloc((size_t)lwork * sizeof *work);
  if (!work) return pb_fail_memory(err, "/connections");
  memset(pivot, 0, (size_t)m * sizeof *pivot);
  dgeqp3_(&n, &m, b->q, &n, pivot, b->tau, work, &lwork, &info);
  free(work);
  return info ? pb_fail(err, PB_ERR_NUMERIC, "/connections", "the constraints cannot be factored")
              : PB_OK;
}

pb_status pb_null_build(const pb_stack_equations *s, pb_warnings *warnings, pb_null_basis *out,
                        pb_error *err) {
  *out = (pb_null_basis){.n = s->n};
  size_t m = s->constraints, smaller = m < s->n ? m : s->n;
  if (!m) return PB_OK;
  out->q = malloc(s->n * m * sizeof *out->q);
  out->tau = malloc(m * sizeof *out->tau);
  int *pivot = malloc(m * sizeof *pivot);
  pb_status st = PB_OK;
  if (!out->q || !out->tau || !pivot) {
    st = pb_fail_memory(err, "/connections");
    goto done;
  }
  memcpy(out->q, s->g, s->n * m * sizeof *out->q);
  st = factor(out, s, pivot, err);
  while (!st && out->rank < smaller) {
    size_t j = out->rank;
    double size = fabs(out->q[j + j * s->n]);
    if (size <= 1e-9) break;
    if (size < 1e-6)
      st = pb_warn(warnings, err, s->owner[pivot[j] - 1],
                   "one of its constraints is nearly redundant (%.1e of it is independent of the "
                   "others): the motion it locks is badly determined",
                   size);
    out->rank++;
  }
done:
  free(pivot);
  if (st) pb_null_clear(out);
  return st;
}

void pb_null_clear(pb_null_basis *b) {
  free(b->q);
  free(b->tau);
  *b = (pb_null_basis){0};
}

// a ← Qᵀ a (side 'L') or a Q (side 'R'); a is rows × cols.
static pb_status apply(const pb_null_basis *b, const char *side, const char *trans, size_t rows,
                       size_t cols, double *a, pb_error *err) {
  if (!b->rank || !rows || !cols) return PB_OK;
  int m = (int)rows, n = (int)cols, k = (int)b->rank, lda = (int)b->n, info = 0;
  int lwork = 64 * (int)(rows > cols ? rows : cols) + 64 * 65;
  double *work = malloc((size_t)lwork * sizeof *work);
  if (!work) return pb_fail_memory(err, "/connections");
  dormqr_(side, trans, &m, &n, &k, b->q, &lda, b->tau, a, &m, work, &lwork, &info);
  free(work);
  return info ? pb_fail(err, PB_ERR_NUMERIC, "/connections", "cannot project") : PB_OK;
}

// Takes the block of rows and columns from `first` on out of a (rows × cols) into new storage.
static double *trailing(const double *a, size_t rows, size_t cols, size_t first_row,
                        size_t first_col) {
  size_t m = rows - first_row, n = cols - first_col;
  double *out = malloc((m * n + 1) * sizeof *out);
  for (size_t j = 0; out && j < n; j++)
    memcpy(out + j * m, a + first_row + (first_col + j) * rows, m * sizeof *out);
  return out;
}

static pb_status project_square(const pb_null_basis *b, double *a, double **out, pb_error *err) {
  pb_status st = apply(b, "L", "T", b->n, b->n, a, err);
  if (!st) st = apply(b, "R", "N", b->n, b->n, a, err);
  if (st) return st;
  *out = trailing(a, b->n, b->n, b->rank, b->rank);
  if (!*out) return pb_fail_memory(err, "/connections");
  size_t n = b->n - b->rank;
  for (size_t j = 0; j < n; j++)  // exactly symmetric, as every method after this assumes
    for (size_t i = 0; i < j; i++)
      (*out)[i + j * n] = (*out)[j + i * n] = 0.5 * ((*out)[i + j * n] + (*out)[j + i * n]);
  return PB_OK;
}

// Yᵀ (n × ny) projected and transposed into ny × (n − rank).
static pb_status project_output(const pb_null_basis *b, double *yt, size_t ny, double **out,
                                pb_error *err) {
  pb_status st = apply(b, "L", "T", b->n, ny, yt, err);
  if (st) return st;
  size_t n = b->n - b->rank;
  *out = malloc((n * ny + 1) * sizeof **out);
  if (!*out) return pb_fail_memory(err, "/outputs");
  for (size_t o = 0; o < ny; o++)
    for (size_t i = 0; i < n; i++) (*out)[o + i * ny] = yt[b->rank + i + o * b->n];
  return PB_OK;
}

pb_status pb_null_project(const pb_null_basis *b, pb_stack_equations *s, pb_system *sys,
                          pb_error *err) {
  sys->n = b->n - b->rank;
  sys->nu = s->nu;
  sys->ny = s->ny;
  pb_status st = project_square(b, s->m, &sys->m, err);
  if (!st) st = project_square(b, s->c, &sys->c, err);
  if (!st) st = project_square(b, s->k, &sys->k, err);
  if (!st) st = apply(b, "L", "T", b->n, s->nu, s->f, err);
  if (st) return st;
  sys->f = trailing(s->f, b->n, s->nu, b->rank, 0);
  if (!sys->f) return pb_fail_memory(err, "/inputs");
  double **const y[3] = {&sys->y0, &sys->y1, &sys->y2};
  for (int i = 0; i < 3 && !st; i++) st = project_output(b, s->y[i], s->ny, y[i], err);
  sys->d = s->d;
  s->d = NULL;
  return st;
}

pb_status pb_null_expand(const pb_null_basis *b, const double *v, double *q, pb_error *err) {
  memset(q, 0, b->n * sizeof *q);
  memcpy(q + b->rank, v, (b->n - b->rank) * sizeof *q);
  return apply(b, "L", "N", b->n, 1, q, err);
}
