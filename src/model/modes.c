// Undamped modes: see modes.h.
#include "model/modes.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"

static const double two_pi = 6.283185307179586476925286766559;

// omega2 and shape from (K, M) of the system.
static pb_status eigen(const pb_system *s, double *omega2, double *shape, pb_error *err) {
  int n = (int)s->n, info = 0, lwork = 1 + 6 * n + 2 * n * n, liwork = 3 + 5 * n, type = 1;
  size_t bytes = s->n * s->n * sizeof(double);
  double *mass = malloc(bytes), *work = malloc((size_t)lwork * sizeof *work);
  int *iwork = malloc((size_t)liwork * sizeof *iwork);
  pb_status st = PB_OK;
  if (!mass || !work || !iwork) {
    st = pb_fail_memory(err, "");
    goto done;
  }
  memcpy(mass, s->m, bytes);
  memcpy(shape, s->k, bytes);
  dsygvd_(&type, "V", "U", &n, shape, &n, mass, &n, omega2, work, &lwork, iwork, &liwork, &info);
  if (info > n)
    st = pb_fail(err, PB_ERR_SINGULAR, "/components",
                 "the assembled mass matrix is not positive definite");
  else if (info)
    st = pb_fail(err, PB_ERR_NUMERIC, "", "the modes of the plant did not converge");
done:
  free(mass);
  free(work);
  free(iwork);
  return st;
}

// A solver for all eigenvalues at once errs by a multiple of ε ω_max², which is 1e-9 of a 100 Hz
// mode beside one at 300 kHz. Jacobi rotations on S = ΦᵀKΦ, which is diagonal to that error and
// computed entry by entry, restore the slow modes to their own accuracy (as one-sided methods do:
// Demmel and Veselić, SIAM J. Matrix Anal. Appl. 13, 1992).
static void rotate(double *x, double *y, size_t n, double c, double s) {
  for (size_t i = 0; i < n; i++) {
    double xi = x[i], yi = y[i];
    x[i] = c * xi - s * yi;
    y[i] = s * xi + c * yi;
  }
}

// One rotation that annihilates S_ij, applied to S from both sides and to the mode shapes.
static void annihilate(double *stiffness, double *shape, size_t n, size_t i, size_t j) {
  double sij = stiffness[i + j * n];
  double tau = (stiffness[j + j * n] - stiffness[i + i * n]) / (2 * sij);
  double t = (tau >= 0 ? 1 : -1) / (fabs(tau) + sqrt(1 + tau * tau));
  double c = 1 / sqrt(1 + t * t), s = t * c;
  rotate(stiffness + i * n, stiffness + j * n, n, c, s);
  for (size_t k = 0; k < n; k++) {
    double x = stiffness[i + k * n], y = stiffness[j + k * n];
    stiffness[i + k * n] = c * x - s * y;
    stiffness[j + k * n] = s * x + c * y;
  }
  stiffness[i + j * n] = stiffness[j + i * n] = 0;
  rotate(shape + i * n, shape + j * n, n, c, s);
}

// All pairs with a slow mode in them; the fast ones are as exact as they get.
static size_t sweep(double *stiffness, double *shape, size_t n, size_t slow) {
  size_t rotations = 0;
  for (size_t j = 1; j < n; j++) {
    for (size_t i = 0; i < j && i < slow; i++) {
      double size = sqrt(fabs(stiffness[i + i * n] * stiffness[j + j * n]));
      if (fabs(stiffness[i + j * n]) <= 1e-14 * size) continue;
      annihilate(stiffness, shape, n, i, j);
      rotations++;
    }
  }
  return rotations;
}

static void multiply(const char *ta, size_t m, size_t n, size_t k, const double *a, size_t lda,
                     const double *b, double *c) {
  int im = (int)m, in = (int)n, ik = (int)k, la = (int)lda;
  double one = 1, zero = 0;
  if (m && n) dgemm_(ta, "N", &im, &in, &ik, &one, a, &la, b, &ik, &zero, c, &im);
}

// out = A φ in extended precision.
static void multiply_exact(const double *a, size_t n, const double *phi, long double *out) {
  for (size_t r = 0; r < n; r++) out[r] = 0;
  for (size_t k = 0; k < n; k++)
    for (size_t r = 0; r < n; r++) out[r] += (long double)a[r + k * n] * phi[k];
}

static long double dot_exact(const double *x, const long double *y, size_t n) {
  long double sum = 0;
  for (size_t r = 0; r < n; r++) sum += x[r] * y[r];
  return sum;
}

static size_t count_slow(const double *omega2, size_t n) {
  size_t slow = 0;
  while (slow < n && omega2[slow] < 1e-4 * omega2[n - 1]) slow++;
  return slow;
}

// ΦᵀMΦ = I again among the slow modes, to full precision (Gram and Schmidt).
static void orthonormalize_slow(const pb_system *s, double *shape, size_t slow,
                                long double *product) {
  size_t n = s->n;
  for (size_t j = 0; j < slow; j++) {
    double *phi = shape + j * n;
    multiply_exact(s->m, n, phi, product);
    double norm = (double)sqrtl(dot_exact(phi, product, n));
    for (size_t i = 0; i < j; i++) {
      double along = (double)dot_exact(shape + i * n, product, n);
      for (size_t r = 0; r < n; r++) phi[r] -= along * shape[r + i * n];
    }
    for (size_t r = 0; r < n; r++) phi[r] /= norm;
  }
}

// The rows of S that belong to slow modes again, in extended precision: they are small differences
// of large products, as when a stiff element hardly deforms.
static void recompute_slow(const pb_system *s, const double *shape, size_t slow, double *stiffness,
                           long double *product) {
  size_t n = s->n;
  for (size_t j = 0; j < slow; j++) {
    multiply_exact(s->k, n, shape + j * n, product);
    for (size_t i = 0; i < n; i++)
      stiffness[i + j * n] = stiffness[j + i * n] = (double)dot_exact(shape + i * n, product, n);
  }
}

// Modes slower than 1e-4 of the largest ω² are restored to the accuracy that their M and K allow.
static pb_status polish(const pb_system *s, double *omega2, double *shape, pb_error *err) {
  size_t n = s->n, slow = count_slow(omega2, n);
  double *product = malloc(n * n * sizeof *product), *stiffness = malloc(n * n * sizeof *stiffness);
  long double *exact = malloc((n + 1) * sizeof *exact);
  bool ok = product && stiffness && exact;
  if (ok) {
    orthonormalize_slow(s, shape, slow, exact);
    multiply("N", n, n, n, s->k, n, shape, product);
    multiply("T", n, n, n, shape, n, product, stiffness);
    recompute_slow(s, shape, slow, stiffness, exact);
    for (int k = 0; k < 4 && sweep(stiffness, shape, n, slow); k++) continue;
    for (size_t j = 0; j < n; j++) omega2[j] = stiffness[j + j * n];
  }
  free(product);
  free(stiffness);
  free(exact);
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

// Rounding of φᵀKφ: below it a mode counts as rigid.
static double noise_of(const pb_system *s, const double *phi) {
  double sum = 0;
  for (size_t j = 0; j < s->n; j++)
    for (size_t i = 0; i < s->n; i++) sum += fabs(phi[i] * s->k[i + j * s->n] * phi[j]);
  return 8 * DBL_EPSILON * sum;
}

// ω from ω², rigid-body modes set to 0 exactly, indefinite stiffness refused.
static pb_status clean(const pb_system *s, double *omega2, const double *shape, pb_modes *m,
                       pb_warnings *warnings, pb_error *err) {
  double largest = omega2[s->n - 1];
  for (size_t j = 0; j < s->n; j++) {
    double hz = sqrt(fabs(omega2[j])) / two_pi;
    if (!isfinite(hz))
      return pb_fail(err, PB_ERR_NUMERIC, "/components",
                     "a natural frequency overflows: a mass is too small for its stiffness");
    bool small = omega2[j] < 1e-9 * largest || s->n == 1;
    if (small && fabs(omega2[j]) <= noise_of(s, shape + j * s->n)) {
      omega2[j] = 0;
    } else if (omega2[j] < 0 && hz > 1) {
      return pb_fail(err, PB_ERR_SINGULAR, "/components",
                     "the assembled stiffness is indefinite (a mode at −%.4g Hz): check the "
                     "elements' rigid-body residuals",
                     hz);
    } else if (omega2[j] < 0) {
      omega2[j] = 0;
      pb_status st =
          pb_warn(warnings, err, "/components",
                  "a mode at −%.3g Hz, an element's rigid-body residual, counts as 0", hz);
      if (st) return st;
    }
    m->omega[j] = sqrt(omega2[j]);
    if (m->omega[j] == 0) m->rigid++;
  }
  return PB_OK;
}

// Ĉ, ΦᵀF and Y Φ.
static pb_status project(const pb_system *s, const double *shape, pb_modes *m, pb_error *err) {
  size_t n = s->n;
  double *product = malloc(n * n * sizeof *product);
  if (!product) return pb_fail_memory(err, "");
  multiply("N", n, n, n, s->c, n, shape, product);
  multiply("T", n, n, n, shape, n, product, m->damping);
  for (size_t j = 0; j < n; j++)
    for (size_t i = 0; i < j; i++)
      m->damping[i + j * n] = m->damping[j + i * n] =
          0.5 * (m->damping[i + j * n] + m->damping[j + i * n]);
  free(product);
  multiply("T", n, s->nu, n, shape, n, s->f, m->force);
  const double *y[3] = {s->y0, s->y1, s->y2};
  for (int i = 0; i < 3; i++) multiply("N", s->ny, n, n, y[i], s->ny, shape, m->output[i]);
  return PB_OK;
}

static pb_status allocate(const pb_system *s, pb_modes *m, pb_error *err) {
  size_t n = s->n;
  *m = (pb_modes){
      .n = n, .nu = s->nu, .ny = s->ny, .displacing = s->displacing, .displacings = s->displacings};
  m->omega = malloc(n * sizeof(double));
  m->damping = malloc(n * n * sizeof(double));
  m->force = malloc(n * s->nu * sizeof(double));
  bool ok = m->omega && m->damping && m->force;
  for (int i = 0; i < 3; i++) {
    m->output[i] = malloc(n * s->ny * sizeof(double));
    ok = ok && m->output[i];
  }
  return ok ? PB_OK : pb_fail_memory(err, "");
}

pb_status pb_modes_solve(const pb_system *s, pb_warnings *warnings, pb_modes *out, pb_error *err) {
  double *omega2 = malloc(s->n * sizeof *omega2), *shape = malloc(s->n * s->n * sizeof *shape);
  pb_status st = allocate(s, out, err);
  if (!st && (!omega2 || !shape)) st = pb_fail_memory(err, "");
  if (!st) st = eigen(s, omega2, shape, err);
  if (!st) st = polish(s, omega2, shape, err);
  if (!st) sort(omega2, shape, s->n);
  if (!st) st = clean(s, omega2, shape, out, warnings, err);
  if (!st) st = project(s, shape, out, err);
  if (!st && out->rigid)
    st = pb_warn(warnings, err, "/connections",
                 "the plant floats: %zu of its %zu modes are rigid-body motions without stiffness",
                 out->rigid, out->n);
  free(omega2);
  free(shape);
  if (st) pb_modes_clear(out);
  return st;
}

void pb_modes_clear(pb_modes *m) {
  free(m->omega);
  free(m->damping);
  free(m->force);
  for (int i = 0; i < 3; i++) free(m->output[i]);
  *m = (pb_modes){0};
}
