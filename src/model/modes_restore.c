// Slow modes to an accuracy of their own: see modes_internal.h.
//
// A solver for all eigenvalues at once errs by a multiple of ε ω_max², which is 1e-9 of a 100 Hz
// mode beside one at 300 kHz. S = ΦᵀKΦ is diagonal to that error and computed entry by entry; its
// slow rows, and Jacobi rotations among them, restore the slow modes to their own accuracy (as
// one-sided methods do: Demmel and Veselić, SIAM J. Matrix Anal. Appl. 13, 1992).
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/array.h"
#include "base/lapack.h"
#include "base/product.h"
#include "model/modes_internal.h"

static void rotate(double *x, double *y, size_t n, double c, double s) {
  for (size_t i = 0; i < n; i++) {
    double xi = x[i], yi = y[i];
    x[i] = c * xi - s * yi;
    y[i] = s * xi + c * yi;
  }
}

// One rotation that annihilates S_ij, applied to S (m × m) from both sides and to mode shapes.
static void annihilate(double *stiffness, size_t m, double *shape, size_t n, size_t i, size_t j) {
  double sij = stiffness[i + j * m];
  double tau = (stiffness[j + j * m] - stiffness[i + i * m]) / (2 * sij);
  double t = (tau >= 0 ? 1 : -1) / (fabs(tau) + sqrt(1 + tau * tau));
  double c = 1 / sqrt(1 + t * t), s = t * c;
  rotate(stiffness + i * m, stiffness + j * m, m, c, s);
  for (size_t k = 0; k < m; k++) {
    double x = stiffness[i + k * m], y = stiffness[j + k * m];
    stiffness[i + k * m] = c * x - s * y;
    stiffness[j + k * m] = s * x + c * y;
  }
  stiffness[i + j * m] = stiffness[j + i * m] = 0;
  rotate(shape + i * n, shape + j * n, n, c, s);
}

static size_t sweep(double *stiffness, size_t m, double *shape, size_t n) {
  size_t rotations = 0;
  for (size_t j = 1; j < m; j++) {
    for (size_t i = 0; i < j; i++) {
      double size = sqrt(fabs(stiffness[i + i * m] * stiffness[j + j * m]));
      if (fabs(stiffness[i + j * m]) <= 1e-14 * size) continue;
      annihilate(stiffness, m, shape, n, i, j);
      rotations++;
    }
  }
  return rotations;
}

enum { CHAINS = 4 };  // sums side by side: the processor need not wait for one

// out[c] = column c of a (n × n) times x in extended precision, for `count` columns.
static void dot_columns(const double *a, size_t n, size_t count, const double *x,
                        long double *out) {
  size_t c = 0;
  for (; c + CHAINS <= count; c += CHAINS) {
    const double *p = a + c * n;
    long double sum[CHAINS] = {0};
    for (size_t r = 0; r < n; r++)
      for (size_t k = 0; k < CHAINS; k++) sum[k] += (long double)p[r + k * n] * x[r];
    for (size_t k = 0; k < CHAINS; k++) out[c + k] = sum[k];
  }
  for (; c < count; c++) {
    out[c] = 0;
    for (size_t r = 0; r < n; r++) out[c] += (long double)a[r + c * n] * x[r];
  }
}

// out[c] = column c of a (n × n) times a vector in extended precision, for `count` columns.
static void dot_columns_exact(const double *a, size_t n, size_t count, const long double *x,
                              long double *out) {
  size_t c = 0;
  for (; c + CHAINS <= count; c += CHAINS) {
    const double *p = a + c * n;
    long double sum[CHAINS] = {0};
    for (size_t r = 0; r < n; r++)
      for (size_t k = 0; k < CHAINS; k++) sum[k] += p[r + k * n] * x[r];
    for (size_t k = 0; k < CHAINS; k++) out[c + k] = sum[k];
  }
  for (; c < count; c++) {
    out[c] = 0;
    for (size_t r = 0; r < n; r++) out[c] += a[r + c * n] * x[r];
  }
}

static size_t count_slow(const double *omega2, size_t n) {
  size_t slow = 0;
  while (slow < n && omega2[slow] < 1e-4 * omega2[n - 1]) slow++;
  return slow;
}

// A of slow modes in extended precision, mode by mode, and what Φ makes of it.
typedef struct exact {
  const double *a;      // n × n, symmetric: its columns are its rows
  const double *shape;  // n × n
  size_t n;
  long double *product;  // n × slow: A Φ
  long double *along;    // n × slow: Φᵀ A Φ, where it is asked for
} exact;

static void exact_product(void *context, size_t j, size_t worker) {
  (void)worker;
  const exact *e = context;
  dot_columns(e->a, e->n, e->n, e->shape + j * e->n, e->product + j * e->n);
}

static void exact_along(void *context, size_t j, size_t worker) {
  const exact *e = context;
  exact_product(context, j, worker);
  dot_columns_exact(e->shape, e->n, e->n, e->product + j * e->n, e->along + j * e->n);
}

// ΦᵀMΦ = I again among the slow modes, to full precision (Gram and Schmidt).
static void orthonormalize_slow(const pb_system *s, double *shape, size_t slow, exact *work,
                                const pb_workers *workers) {
  size_t n = s->n;
  long double *along = work->along;
  work->a = s->m;
  pb_workers_run(workers, slow, exact_product, work);
  for (size_t j = 0; j < slow; j++) {
    double *phi = shape + j * n;
    dot_columns_exact(shape, n, j + 1, work->product + j * n, along);
    const double norm = (double)sqrtl(along[j]);
    for (size_t i = 0; i < j; i++) {
      const double a = (double)along[i];
      for (size_t r = 0; r < n; r++) phi[r] -= a * shape[r + i * n];
    }
    for (size_t r = 0; r < n; r++) phi[r] /= norm;
  }
}

// S = ΦᵀKΦ: of fast modes the diagonal only (what couples them is rounding), into omega2; rows of
// slow modes, as columns of S (n × slow), in extended precision: they are small differences of
// large products when a stiff element hardly deforms. product: n × n work space.
static void make_stiffness(const pb_system *s, const double *shape, size_t slow, double *omega2,
                           double *stiffness, double *product, exact *work,
                           const pb_workers *workers) {
  size_t n = s->n;
  const pb_product fast = {"N", "N", n, n - slow, n, s->k, shape + slow * n, n, n, 0, product, n};
  pb_product_make(&fast, workers);
  for (size_t j = slow; j < n; j++) {
    omega2[j] = 0;
    for (size_t i = 0; i < n; i++) omega2[j] += shape[i + j * n] * product[i + (j - slow) * n];
  }
  work->a = s->k;
  pb_workers_run(workers, slow, exact_along, work);
  for (size_t i = 0; i < n * slow; i++) stiffness[i] = (double)work->along[i];
}

// Decouples slow modes from fast ones. Both are exact to rounding, so that first order serves:
// φ_i += t_ji φ_j and φ_j −= t_ji φ_i with t_ji = S_ij / (S_ii − S_jj); `among` (slow × slow) is
// what S is among slow modes afterwards. t: n × slow, old: n × slow work space.
static void decouple(size_t n, size_t slow, const double *omega2, const double *stiffness,
                     double *shape, double *t, double *old, double *among) {
  const size_t fast = n - slow;
  for (size_t i = 0; i < slow; i++)
    for (size_t j = 0; j < fast; j++)
      t[j + i * fast] = stiffness[slow + j + i * n] / (stiffness[i + i * n] - omega2[slow + j]);
  for (size_t i = 0; i < slow; i++)
    for (size_t k = 0; k < slow; k++) {
      double second = 0;
      for (size_t j = 0; j < fast; j++) second += t[j + i * fast] * stiffness[slow + j + k * n];
      among[k + i * slow] = stiffness[k + i * n] + second;
    }
  for (size_t i = 0; i < slow; i++)
    for (size_t k = 0; k < i; k++)
      among[i + k * slow] = among[k + i * slow] = 0.5 * (among[i + k * slow] + among[k + i * slow]);
  int in = (int)n, is = (int)slow, jf = (int)fast;
  double one = 1, minus = -1;
  memcpy(old, shape, n * slow * sizeof *old);
  if (!fast || !slow) return;
  dgemm_("N", "N", &in, &is, &jf, &one, shape + slow * n, &in, t, &jf, &one, shape, &in);
  dgemm_("N", "T", &in, &jf, &is, &minus, old, &in, t, &jf, &one, shape + slow * n, &in);
}

static pb_status polish(const pb_system *s, const pb_workers *workers, double *omega2,
                        double *shape, double *space, pb_error *err) {
  size_t n = s->n, slow = count_slow(omega2, n);
  double *stiffness = pb_array_new(n * slow + 1, sizeof *stiffness);
  double *t = pb_array_new(n * slow + 1, sizeof *t), *old = pb_array_new(n * slow + 1, sizeof *old);
  double *among = pb_array_new(slow * slow + 1, sizeof *among);
  exact work = {.shape = shape, .n = n};
  work.product = pb_array_new(n * slow + 1, sizeof *work.product);
  work.along = pb_array_new(n * slow + 1, sizeof *work.along);
  bool ok = stiffness && t && old && among && work.product && work.along;
  workers = pb_workers_for(workers, 4.0 * (double)slow * (double)n * (double)n);
  if (ok) {
    orthonormalize_slow(s, shape, slow, &work, workers);
    make_stiffness(s, shape, slow, omega2, stiffness, space, &work, workers);
    decouple(n, slow, omega2, stiffness, shape, t, old, among);
    for (int k = 0; k < 4 && sweep(among, slow, shape, n); k++) continue;
    for (size_t j = 0; j < slow; j++) omega2[j] = among[j + j * slow];
  }
  free(stiffness);
  free(t);
  free(old);
  free(among);
  free(work.product);
  free(work.along);
  return ok ? PB_OK : pb_fail_memory(err, "");
}

// Rotations may leave neighbours out of order.
static void sort(double *omega2, double *shape, size_t n) {
  for (size_t j = 1; j < n; j++) {
    for (size_t i = j; i > 0 && omega2[i - 1] > omega2[i]; i--) {
      double swap = omega2[i];
      omega2[i] = omega2[i - 1];
      omega2[i - 1] = swap;
      rotate(shape + (i - 1) * n, shape + i * n, n, 0, 1);
    }
  }
}

pb_status pb_modes_restore(const pb_system *s, const pb_workers *workers, double *omega2,
                           double *shape, double *space, pb_error *err) {
  pb_status st = polish(s, workers, omega2, shape, space, err);
  if (!st) sort(omega2, shape, s->n);
  return st;
}
