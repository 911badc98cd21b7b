// Undamped modes: see modes.h.
#include "model/modes.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"

static const double two_pi = 6.283185307179586476925286766559;

// Work space that eigen needs, for n modes; the steps after it share it.
static size_t space_size(size_t n) {
  return 3 * n * n + 6 * n + 1;
}

// omega2 and shape from (K, M) of the system.
static pb_status eigen(const pb_system *s, double *omega2, double *shape, double *space,
                       pb_error *err) {
  int n = (int)s->n, info = 0, lwork = 1 + 6 * n + 2 * n * n, liwork = 3 + 5 * n, type = 1;
  size_t bytes = s->n * s->n * sizeof(double);
  double *mass = space, *work = space + s->n * s->n;
  int *iwork = malloc((size_t)liwork * sizeof *iwork);
  if (!iwork) return pb_fail_memory(err, "");
  memcpy(mass, s->m, bytes);
  memcpy(shape, s->k, bytes);
  dsygvd_(&type, "V", "U", &n, shape, &n, mass, &n, omega2, work, &lwork, iwork, &liwork, &info);
  free(iwork);
  if (info > n)
    return pb_fail(err, PB_ERR_SINGULAR, "/components",
                   "the assembled mass matrix is not positive definite");
  if (info) return pb_fail(err, PB_ERR_NUMERIC, "", "the modes of the plant did not converge");
  return PB_OK;
}

// A solver for all eigenvalues at once errs by a multiple of ε ω_max², which is 1e-9 of a 100 Hz
// mode beside one at 300 kHz. S = ΦᵀKΦ is diagonal to that error and computed entry by entry; its
// slow rows, and Jacobi rotations among them, restore the slow modes to their own accuracy (as
// one-sided methods do: Demmel and Veselić, SIAM J. Matrix Anal. Appl. 13, 1992).
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

static void multiply(const char *ta, size_t m, size_t n, size_t k, const double *a, size_t lda,
                     const double *b, double *c) {
  int im = (int)m, in = (int)n, ik = (int)k, la = (int)lda;
  double one = 1, zero = 0;
  if (m && n) dgemm_(ta, "N", &im, &in, &ik, &one, a, &la, b, &ik, &zero, c, &im);
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

// ΦᵀMΦ = I again among the slow modes, to full precision (Gram and Schmidt). M is symmetric: its
// columns are its rows. work: 2 n numbers.
static void orthonormalize_slow(const pb_system *s, double *shape, size_t slow, long double *work) {
  size_t n = s->n;
  long double *product = work, *along = work + n;
  for (size_t j = 0; j < slow; j++) {
    double *phi = shape + j * n;
    dot_columns(s->m, n, n, phi, product);
    dot_columns_exact(shape, n, j + 1, product, along);
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
                           double *stiffness, double *product, long double *work) {
  size_t n = s->n;
  long double *force = work, *along = work + n;
  multiply("N", n, n - slow, n, s->k, n, shape + slow * n, product);
  for (size_t j = slow; j < n; j++) {
    omega2[j] = 0;
    for (size_t i = 0; i < n; i++) omega2[j] += shape[i + j * n] * product[i + (j - slow) * n];
  }
  for (size_t j = 0; j < slow; j++) {
    dot_columns(s->k, n, n, shape + j * n, force);
    dot_columns_exact(shape, n, n, force, along);
    for (size_t i = 0; i < n; i++) stiffness[i + j * n] = (double)along[i];
  }
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

// Modes slower than 1e-4 of the largest ω² are restored to the accuracy that their M and K allow.
// space: n × n.
static pb_status polish(const pb_system *s, double *omega2, double *shape, double *space,
                        pb_error *err) {
  size_t n = s->n, slow = count_slow(omega2, n);
  double *stiffness = malloc((n * slow + 1) * sizeof *stiffness);
  double *t = malloc((n * slow + 1) * sizeof *t), *old = malloc((n * slow + 1) * sizeof *old);
  double *among = malloc((slow * slow + 1) * sizeof *among);
  long double *work = malloc(2 * n * sizeof *work);
  bool ok = stiffness && t && old && among && work;
  if (ok) {
    orthonormalize_slow(s, shape, slow, work);
    make_stiffness(s, shape, slow, omega2, stiffness, space, work);
    decouple(n, slow, omega2, stiffness, shape, t, old, among);
    for (int k = 0; k < 4 && sweep(among, slow, shape, n); k++) continue;
    for (size_t j = 0; j < slow; j++) omega2[j] = among[j + j * slow];
  }
  free(stiffness);
  free(t);
  free(old);
  free(among);
  free(work);
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

// Ĉ, ΦᵀF and Y Φ. space: n × n.
static void project(const pb_system *s, const double *shape, double *space, pb_modes *m) {
  size_t n = s->n;
  multiply("N", n, n, n, s->c, n, shape, space);
  multiply("T", n, n, n, shape, n, space, m->damping);
  for (size_t j = 0; j < n; j++)
    for (size_t i = 0; i < j; i++)
      m->damping[i + j * n] = m->damping[j + i * n] =
          0.5 * (m->damping[i + j * n] + m->damping[j + i * n]);
  multiply("T", n, s->nu, n, shape, n, s->f, m->force);
  const double *y[3] = {s->y0, s->y1, s->y2};
  for (int i = 0; i < 3; i++) multiply("N", s->ny, n, n, y[i], s->ny, shape, m->output[i]);
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
  double *space = malloc(space_size(s->n) * sizeof *space);
  pb_status st = allocate(s, out, err);
  if (!st && (!omega2 || !shape || !space)) st = pb_fail_memory(err, "");
  if (!st) st = eigen(s, omega2, shape, space, err);
  if (!st) st = polish(s, omega2, shape, space, err);
  if (!st) sort(omega2, shape, s->n);
  if (!st) st = clean(s, omega2, shape, out, warnings, err);
  if (!st) project(s, shape, space, out);
  if (!st && out->rigid)
    st = pb_warn(warnings, err, "/connections",
                 "the plant floats: %zu of its %zu modes are rigid-body motions without stiffness",
                 out->rigid, out->n);
  free(omega2);
  free(shape);
  free(space);
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
