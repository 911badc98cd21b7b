// Block diagonalisation: see block.h.
#include "model/block.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/array.h"
#include "base/lapack.h"

// Largest entry of a Sylvester solution that still counts as well-conditioned.
static const double split_bound = 1e4;
static const double eigenvector_rcond = 1e-6;

static pb_status fail_convergence(const char *context, pb_error *err) {
  return pb_fail(err, PB_ERR_NUMERIC, context,
                 "the eigenvalues of the damped plant did not converge");
}

// LAPACK takes NaN without a word, and eigenvalues that are NaN pair up with nothing.
bool pb_all_finite(const double *x, size_t n) {
  for (size_t i = 0; i < n; i++)
    if (!isfinite(x[i])) return false;
  return true;
}

// Eigenvectors in real form; wr, wi: eigenvalues. Destroys a.
static pb_status eigenvectors(size_t size, double *a, double *v, double *wr, double *wi,
                              const char *context, pb_error *err) {
  int n = (int)size, info = 0, one = 1, lwork = -1;
  double query = 0, none = 0;
  dgeev_("N", "V", &n, a, &n, wr, wi, &none, &one, v, &n, &query, &lwork, &info);
  lwork = (int)query;
  double *work = malloc((size_t)lwork * sizeof *work);
  if (!work) return pb_fail_memory(err, context);
  dgeev_("N", "V", &n, a, &n, wr, wi, &none, &one, v, &n, work, &lwork, &info);
  free(work);
  bool ok = info == 0 && pb_all_finite(wr, size) && pb_all_finite(wi, size);
  return ok ? PB_OK : fail_convergence(context, err);
}

// Reciprocal condition number of v (1-norm); 0 when singular or out of memory (*failed).
static double condition(size_t size, const double *v, bool *failed) {
  int n = (int)size, info = 0;
  double rcond = 0, norm = 0;
  double *lu = pb_array_new(size * size, sizeof *lu), *work = pb_array_new(4 * size, sizeof *work);
  int *pivot = malloc(size * sizeof *pivot), *iwork = malloc(size * sizeof *iwork);
  *failed = !lu || !work || !pivot || !iwork;
  if (!*failed) {
    memcpy(lu, v, size * size * sizeof *lu);
    for (size_t j = 0; j < size; j++) {
      double sum = 0;
      for (size_t i = 0; i < size; i++) sum += fabs(v[i + j * size]);
      norm = fmax(norm, sum);
    }
    dgetrf_(&n, &n, lu, &n, pivot, &info);
    if (!info) dgecon_("1", &n, lu, &n, &norm, &rcond, work, iwork, &info);
  }
  free(lu);
  free(work);
  free(pivot);
  free(iwork);
  return rcond;
}

static void set_from_eigenvalues(size_t n, double *a, const double *wr, const double *wi,
                                 size_t *blocks, size_t *size) {
  memset(a, 0, n * n * sizeof *a);
  *blocks = 0;
  for (size_t i = 0; i < n;) {
    a[i + i * n] = wr[i];
    size_t width = wi[i] != 0 ? 2 : 1;
    if (width == 2) {
      a[i + 1 + (i + 1) * n] = wr[i];
      a[i + (i + 1) * n] = wi[i];
      a[i + 1 + i * n] = -wi[i];
    }
    size[(*blocks)++] = width;
    i += width;
  }
}

// Width of the diagonal block of a real Schur form that starts at i.
static size_t schur_width(const double *t, size_t n, size_t i) {
  return i + 1 < n && t[i + 1 + i * n] != 0 ? 2 : 1;
}

// Mean of the eigenvalues of t[first..last): real part and mean magnitude of the imaginary parts.
static void mean_eigenvalue(const double *t, size_t n, size_t first, size_t last, double *re,
                            double *im) {
  *re = *im = 0;
  for (size_t i = first; i < last;) {
    size_t w = schur_width(t, n, i);
    *re += t[i + i * n] + (w == 2 ? t[i + 1 + (i + 1) * n] : 0);
    if (w == 2) *im += 2 * sqrt(fabs(t[i + 1 + i * n] * t[i + (i + 1) * n]));
    i += w;
  }
  *re /= (double)(last - first);
  *im /= (double)(last - first);
}

// Moves the eigenvalue of t[last..n) that is nearest to those of t[first..last) to `last`.
static bool bring_nearest(double *t, double *q, size_t n, size_t first, size_t last, double *work) {
  double re, im, best = INFINITY;
  size_t nearest = last;
  mean_eigenvalue(t, n, first, last, &re, &im);
  for (size_t i = last; i < n;) {
    size_t w = schur_width(t, n, i);
    double r, m;
    mean_eigenvalue(t, n, i, i + w, &r, &m);
    double distance = hypot(r - re, m - im);
    if (distance < best) best = distance, nearest = i;
    i += w;
  }
  int size = (int)n, from = (int)nearest + 1, to = (int)last + 1, info = 0;
  dtrexc_("V", &size, t, &size, q, &size, &from, &to, work, &info);
  return info == 0;
}

// Solves T11 X − X T22 = −T12 into x (p × rest). False where the solution is too large.
static bool decouple(const double *t, size_t n, size_t first, size_t last, double *x) {
  int p = (int)(last - first), rest = (int)(n - last), ld = (int)n, sign = -1, info = 0;
  double scale = 1;
  for (int j = 0; j < rest; j++)
    for (int i = 0; i < p; i++) x[i + j * p] = -t[first + (size_t)i + (last + (size_t)j) * n];
  dtrsyl_("N", "N", &sign, &p, &rest, t + first + first * n, &ld, t + last + last * n, &ld, x, &p,
          &scale, &info);
  if (info || !(scale > 0)) return false;
  for (int i = 0; i < p * rest; i++) {
    x[i] /= scale;
    if (!(fabs(x[i]) <= split_bound)) return false;
  }
  return true;
}

// Applies [[I, X], [0, I]]: the block is decoupled, and the later columns of the basis change.
static void apply_split(double *t, double *q, size_t n, size_t first, size_t last,
                        const double *x) {
  int rows = (int)n, p = (int)(last - first), rest = (int)(n - last);
  double one = 1;
  dgemm_("N", "N", &rows, &rest, &p, &one, q + first * n, &rows, x, &p, &one, q + last * n, &rows);
  for (size_t j = last; j < n; j++)
    for (size_t i = first; i < last; i++) t[i + j * n] = 0;
}

static pb_status schur_form(size_t size, double *t, double *q, const char *context, pb_error *err) {
  int n = (int)size, info = 0, sdim = 0, lwork = -1;
  double query = 0;
  double *wr = malloc(size * sizeof *wr), *wi = malloc(size * sizeof *wi), *work = NULL;
  pb_status st = PB_OK;
  if (!wr || !wi) {
    st = pb_fail_memory(err, context);
    goto done;
  }
  dgees_("V", "N", NULL, &n, t, &n, &sdim, wr, wi, q, &n, &query, &lwork, NULL, &info);
  lwork = (int)query;
  work = malloc((size_t)lwork * sizeof *work);
  if (!work) {
    st = pb_fail_memory(err, context);
    goto done;
  }
  dgees_("V", "N", NULL, &n, t, &n, &sdim, wr, wi, q, &n, work, &lwork, NULL, &info);
  if (info) st = fail_convergence(context, err);
done:
  free(wr);
  free(wi);
  free(work);
  return st;
}

static pb_status by_schur(size_t n, double *t, double *q, size_t *blocks, size_t *size,
                          const char *context, pb_error *err) {
  pb_status st = schur_form(n, t, q, context, err);
  if (st) return st;
  double *x = pb_array_new(n * n, sizeof *x), *work = malloc(n * sizeof *work);
  if (!x || !work) {
    st = pb_fail_memory(err, context);
    goto done;
  }
  *blocks = 0;
  for (size_t first = 0; first < n && !st;) {
    size_t last = first + schur_width(t, n, first);
    while (last < n && !st && !decouple(t, n, first, last, x)) {
      if (!bring_nearest(t, q, n, first, last, work)) st = fail_convergence(context, err);
      last += schur_width(t, n, last);
    }
    if (!st && last < n) apply_split(t, q, n, first, last, x);
    size[(*blocks)++] = last - first;
    first = last;
  }
done:
  free(x);
  free(work);
  return st;
}

pb_status pb_block_diagonalize(size_t n, double *a, double *v, size_t *blocks, size_t *size,
                               const char *context, pb_error *err) {
  if (!pb_all_finite(a, n * n)) return fail_convergence(context, err);
  bool failed = false;
  double *copy = pb_array_new(n * n, sizeof *copy);
  double *wr = malloc(n * sizeof *wr), *wi = malloc(n * sizeof *wi);
  pb_status st = PB_OK;
  if (!copy || !wr || !wi) {
    st = pb_fail_memory(err, context);
    goto done;
  }
  memcpy(copy, a, n * n * sizeof *copy);
  st = eigenvectors(n, copy, v, wr, wi, context, err);
  if (st) goto done;
  if (condition(n, v, &failed) >= eigenvector_rcond) {
    set_from_eigenvalues(n, a, wr, wi, blocks, size);
  } else {
    st = failed ? pb_fail_memory(err, context) : by_schur(n, a, v, blocks, size, context, err);
  }
done:
  free(copy);
  free(wr);
  free(wi);
  return st;
}

// ---- eigenvalues --------------------------------------------------------------------------------

static void pair_poles(const double *a, double complex out[2]) {
  double mean = 0.5 * (a[0] + a[3]), half = 0.5 * (a[0] - a[3]);
  double discriminant = half * half + a[1] * a[2];
  if (discriminant < 0) {
    out[0] = mean + I * sqrt(-discriminant);
    out[1] = conj(out[0]);
    return;
  }
  // The larger root first; the other from the product, free of cancellation.
  double root = mean < 0 ? mean - sqrt(discriminant) : mean + sqrt(discriminant);
  out[0] = root;
  out[1] = root != 0 ? (a[0] * a[3] - a[1] * a[2]) / root : 0;
}

static pb_status wide_poles(const double *a, size_t size, double complex *out, pb_error *err) {
  int n = (int)size, one = 1, info = 0, lwork = 8 * n;
  double none = 0;
  double *copy = malloc(size * size * sizeof *copy), *work = malloc((size_t)lwork * sizeof *work);
  double *wr = malloc(size * sizeof *wr), *wi = malloc(size * sizeof *wi);
  pb_status st = PB_OK;
  if (!copy || !work || !wr || !wi) {
    st = pb_fail_memory(err, "");
    goto done;
  }
  memcpy(copy, a, size * size * sizeof *copy);
  dgeev_("N", "N", &n, copy, &n, wr, wi, &none, &one, &none, &one, work, &lwork, &info);
  if (info) st = pb_fail(err, PB_ERR_NUMERIC, "", "the poles of a block did not converge");
  for (size_t i = 0; i < size && !st; i++) out[i] = wr[i] + I * wi[i];
done:
  free(copy);
  free(work);
  free(wr);
  free(wi);
  return st;
}

pb_status pb_block_poles(size_t n, const double *a, double complex *out, pb_error *err) {
  if (n > 2) return wide_poles(a, n, out, err);
  if (n == 2) pair_poles(a, out);
  if (n == 1) out[0] = a[0];
  return PB_OK;
}
