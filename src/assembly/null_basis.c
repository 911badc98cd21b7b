// The basis of the constraints' null space: see eliminate.h.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "assembly/eliminate.h"
#include "base/lapack.h"

static pb_status factor(pb_null_basis *b, const pb_stack_equations *s, int *pivot, double *tau,
                        pb_error *err) {
  int n = (int)s->n, m = (int)s->constraints, info = 0, lwork = 64 * (m + 1) + 2 * m;
  double *work = malloc((size_t)lwork * sizeof *work);
  if (!work) return pb_fail_memory(err, "/connections");
  memset(pivot, 0, (size_t)m * sizeof *pivot);
  dgeqp3_(&n, &m, b->v, &n, pivot, tau, work, &lwork, &info);
  free(work);
  return info ? pb_fail(err, PB_ERR_NUMERIC, "/connections", "the constraints cannot be factored")
              : PB_OK;
}

// The rank, by the diagonal of R.
static pb_status find_rank(pb_null_basis *b, const pb_stack_equations *s, const int *pivot,
                           pb_warnings *warnings, pb_error *err) {
  const size_t smaller = s->constraints < s->n ? s->constraints : s->n;
  pb_status st = PB_OK;
  while (!st && b->rank < smaller) {
    const size_t j = b->rank;
    const double size = fabs(b->v[j + j * s->n]);
    if (size <= 1e-9) break;
    if (size < 1e-6)
      st = pb_warn(warnings, err, s->owner[pivot[j] - 1],
                   "one of its constraints is nearly redundant (%.1e of it is independent of the "
                   "others): the motion it locks is badly determined",
                   size);
    b->rank++;
  }
  return st;
}

// V with its zeros and ones, T from it.
static void block_reflector(pb_null_basis *b, const double *tau) {
  const int n = (int)b->n, rank = (int)b->rank;
  for (size_t j = 0; j < b->rank; j++) {
    for (size_t i = 0; i < j; i++) b->v[i + j * b->n] = 0;
    b->v[j + j * b->n] = 1;
  }
  if (rank) dlarft_("F", "C", &n, &rank, b->v, &n, tau, b->t, &rank);
}

pb_status pb_null_build(const pb_stack_equations *s, pb_warnings *warnings, pb_null_basis *out,
                        pb_error *err) {
  *out = (pb_null_basis){.n = s->n};
  const size_t m = s->constraints;
  if (!m) return PB_OK;
  out->v = malloc(s->n * m * sizeof *out->v);
  out->t = calloc(m * m, sizeof *out->t);
  double *tau = malloc(m * sizeof *tau);
  int *pivot = malloc(m * sizeof *pivot);
  pb_status st = PB_OK;
  if (!out->v || !out->t || !tau || !pivot) {
    st = pb_fail_memory(err, "/connections");
    goto done;
  }
  memcpy(out->v, s->g, s->n * m * sizeof *out->v);
  st = factor(out, s, pivot, tau, err);
  if (!st) st = find_rank(out, s, pivot, warnings, err);
  if (!st) block_reflector(out, tau);
done:
  free(tau);
  free(pivot);
  if (st) pb_null_clear(out);
  return st;
}

void pb_null_clear(pb_null_basis *b) {
  free(b->v);
  free(b->t);
  *b = (pb_null_basis){0};
}

// c = alpha op(a) op(b) + beta c, rows × cols.
static void multiply(const char *ta, const char *tb, size_t rows, size_t cols, size_t inner,
                     double alpha, const double *a, size_t lda, const double *b, size_t ldb,
                     double beta, double *c, size_t ldc) {
  const int m = (int)rows, n = (int)cols, k = (int)inner;
  const int la = (int)lda, lb = (int)ldb, lc = (int)ldc;
  if (m && n) dgemm_(ta, tb, &m, &n, &k, &alpha, a, &la, b, &lb, &beta, c, &lc);
}

// Few reflectors are applied one by one: each touches only what its constraint touches, so that
// masses and inertias of any ratio do not round each other away.
static bool one_by_one(const pb_null_basis *b) {
  return b->rank < 32;
}

// a (n × cols) ← H_j a
static void reflect(const pb_null_basis *b, size_t j, size_t cols, double *a) {
  const double *v = b->v + j * b->n, tau = b->t[j + j * b->rank];
  for (size_t c = 0; c < cols; c++) {
    double *x = a + c * b->n, along = 0;
    for (size_t i = j; i < b->n; i++) along += v[i] * x[i];
    if (along != 0)
      for (size_t i = j; i < b->n; i++) x[i] -= tau * along * v[i];
  }
}

// a (n × cols) ← Qᵀ a (transpose "T") or Q a ("N").
static pb_status apply(const pb_null_basis *b, const char *transpose, size_t cols, double *a,
                       pb_error *err) {
  const size_t n = b->n, r = b->rank;
  if (!r || !cols) return PB_OK;
  if (one_by_one(b)) {
    for (size_t j = 0; j < r; j++) reflect(b, *transpose == 'T' ? j : r - 1 - j, cols, a);
    return PB_OK;
  }
  double *w = malloc(2 * r * cols * sizeof *w), *tw = w + r * cols;
  if (!w) return pb_fail_memory(err, "/connections");
  multiply("T", "N", r, cols, n, 1, b->v, n, a, n, 0, w, r);
  multiply(transpose, "N", r, cols, r, 1, b->t, r, w, r, 0, tw, r);
  multiply("N", "N", n, cols, r, -1, b->v, n, tw, r, 1, a, n);
  free(w);
  return PB_OK;
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

static void transpose(double *a, size_t n) {
  for (size_t j = 0; j < n; j++)
    for (size_t i = 0; i < j; i++) {
      const double swap = a[i + j * n];
      a[i + j * n] = a[j + i * n];
      a[j + i * n] = swap;
    }
}

// The trailing block of QᵀAQ = A − V Zᵀ − Z Vᵀ with Z = P − ½ V Tᵀ Vᵀ P, P = A V T; out holds that
// of A, its upper triangle is replaced. z: n × rank, work: (n + 2 rank) × rank.
static void project_blocked(const pb_null_basis *b, const double *a, double *z, double *work,
                            double *out) {
  const size_t n = b->n, r = b->rank;
  const int left = (int)(n - r), rank = (int)r, ld = (int)n;
  const double one = 1, minus = -1;
  double *vp = work + n * r, *tvp = vp + r * r;
  multiply("N", "N", n, r, n, 1, a, n, b->v, n, 0, work, n);
  multiply("N", "N", n, r, r, 1, work, n, b->t, r, 0, z, n);
  multiply("T", "N", r, r, n, 1, b->v, n, z, n, 0, vp, r);
  multiply("T", "N", r, r, r, 1, b->t, r, vp, r, 0, tvp, r);
  multiply("N", "N", n, r, r, -0.5, b->v, n, tvp, r, 1, z, n);
  dsyr2k_("U", "N", &left, &rank, &minus, b->v + r, &ld, z + r, &ld, &one, out, &left);
}

// NᵀAN of a symmetric A, exactly symmetric, as every method after this assumes. a is destroyed.
static pb_status project_square(const pb_null_basis *b, double *a, double **out, pb_error *err) {
  const size_t n = b->n, r = b->rank, left = n - r;
  double *z = NULL;
  if (one_by_one(b)) {
    for (size_t j = 0; j < r; j++) reflect(b, j, n, a);
    transpose(a, n);
    for (size_t j = 0; j < r; j++) reflect(b, j, n, a);
  } else {
    z = malloc((2 * n + 2 * r) * r * sizeof *z);
  }
  *out = trailing(a, n, n, r, r);
  if (!*out || (!z && !one_by_one(b))) {
    free(z);
    return pb_fail_memory(err, "/connections");
  }
  if (z) project_blocked(b, a, z, z + n * r, *out);
  for (size_t j = 0; j < left; j++)
    for (size_t i = 0; i < j; i++) {
      double *upper = *out + i + j * left, *lower = *out + j + i * left;
      *upper = *lower = z ? *upper : 0.5 * (*upper + *lower);
    }
  free(z);
  return PB_OK;
}

// Yᵀ (n × ny) projected and transposed into ny × (n − rank).
static pb_status project_output(const pb_null_basis *b, double *yt, size_t ny, double **out,
                                pb_error *err) {
  pb_status st = apply(b, "T", ny, yt, err);
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
  if (!st) st = apply(b, "T", s->nu, s->f, err);
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
  return apply(b, "N", 1, q, err);
}
