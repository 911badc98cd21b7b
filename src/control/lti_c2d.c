// Discretisation of dense linear systems and the matrix exponential: see lti_ops.h.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"
#include "control/lti_ops.h"

// c = alpha·a b + beta·c, all n × n.
static void multiply(size_t n, double alpha, const double *a, const double *b, double beta,
                     double *c) {
  int in = (int)n;
  dgemm_("N", "N", &in, &in, &in, &alpha, a, &in, b, &in, &beta, c, &in);
}

static double norm_1(const double *m, size_t n) {
  double norm = 0;
  for (size_t c = 0; c < n; c++) {
    double sum = 0;
    for (size_t r = 0; r < n; r++) sum += fabs(m[r + c * n]);
    norm = sum > norm || isnan(sum) ? sum : norm;
  }
  return norm;
}

// out = b[0] a6 + b[1] a4 + b[2] a2 + b[3] I
static void combine(size_t n, const double *const power[3], const double b[4], double *out) {
  for (size_t k = 0; k < n * n; k++) {
    out[k] = b[0] * power[2][k] + b[1] * power[1][k] + b[2] * power[0][k];
  }
  for (size_t k = 0; k < n; k++) out[k + k * n] += b[3];
}

// Numerator and denominator of the [13/13] approximant: U odd, V even part; a is scaled. work: 6
// n².
static void pade_13(size_t n, const double *a, double *work, double *u, double *v) {
  size_t nn = n * n;
  double *a2 = work, *a4 = work + nn, *a6 = work + 2 * nn, *t = work + 3 * nn;
  const double *const power[3] = {a2, a4, a6};
  multiply(n, 1, a, a, 0, a2);
  multiply(n, 1, a2, a2, 0, a4);
  multiply(n, 1, a4, a2, 0, a6);
  combine(n, power, (double[]){1, 16380, 40840800, 0}, t);
  combine(n, power, (double[]){33522128640, 10559470521600, 1187353796428800, 32382376266240000},
          v);
  multiply(n, 1, a6, t, 1, v);
  multiply(n, 1, a, v, 0, u);
  combine(n, power, (double[]){182, 960960, 1323241920, 0}, t);
  combine(n, power, (double[]){670442572800, 129060195264000, 7771770303897600, 64764752532480000},
          v);
  multiply(n, 1, a6, t, 1, v);
}

pb_status pb_expm(size_t n, const double *a, double *e, pb_error *err) {
  size_t nn = n * n;
  if (n == 0) return PB_OK;
  double norm = norm_1(a, n);
  if (!isfinite(norm)) return pb_fail(err, PB_ERR_NUMERIC, "expm", "the matrix is not finite");
  int squarings = norm > 5.371920351148152 ? (int)ceil(log2(norm / 5.371920351148152)) : 0;
  double *work = malloc(7 * nn * sizeof *work);
  int *pivot = malloc(n * sizeof *pivot);
  pb_status status = PB_OK;
  if (!work || !pivot) {
    status = pb_fail_memory(err, "expm");
    goto done;
  }
  double *u = work + 4 * nn, *v = work + 5 * nn, *scaled = work + 6 * nn;
  for (size_t k = 0; k < nn; k++) scaled[k] = ldexp(a[k], -squarings);
  pade_13(n, scaled, work, u, v);
  for (size_t k = 0; k < nn; k++) {
    e[k] = v[k] + u[k];
    v[k] -= u[k];
  }
  int in = (int)n, info;
  dgesv_(&in, &in, v, &in, pivot, e, &in, &info);
  if (info != 0) status = pb_fail(err, PB_ERR_NUMERIC, "expm", "the Padé denominator is singular");
  for (int s = 0; s < squarings && status == PB_OK; s++) {
    multiply(n, 1, e, e, 0, work);
    memcpy(e, work, nn * sizeof *e);
  }
done:
  free(work);
  free(pivot);
  return status;
}

static pb_status discretise_zoh(const pb_lti *lti, pb_lti *out, pb_error *err) {
  size_t nx = lti->nx, n = nx + lti->nu;
  double *m = calloc(n * n, sizeof *m), *e = malloc(n * n * sizeof *e);
  pb_status status = PB_OK;
  if (!m || !e) {
    status = pb_fail_memory(err, "c2d");
    goto done;
  }
  for (size_t r = 0; r < nx; r++) {
    for (size_t c = 0; c < nx; c++) m[r + c * n] = lti->a[r + c * nx] * out->dt;
    for (size_t c = 0; c < lti->nu; c++) m[r + (nx + c) * n] = lti->b[r + c * nx] * out->dt;
  }
  status = pb_expm(n, m, e, err);
  if (status != PB_OK) goto done;
  for (size_t r = 0; r < nx; r++) {
    for (size_t c = 0; c < nx; c++) out->a[r + c * nx] = e[r + c * n];
    for (size_t c = 0; c < lti->nu; c++) out->b[r + c * nx] = e[r + (nx + c) * n];
  }
  memcpy(out->c, lti->c, lti->ny * nx * sizeof *out->c);
  memcpy(out->d, lti->d, lti->ny * lti->nu * sizeof *out->d);
done:
  free(m);
  free(e);
  return status;
}

// With M = (I − A T/2)⁻¹: A_d = M (I + A T/2), B_d = M B T, C_d = C M, D_d = D + C M B T/2.
// The solve is of the transpose for C_d, hence M itself is formed.
static pb_status discretise_tustin(const pb_lti *lti, pb_lti *out, pb_error *err) {
  size_t n = lti->nx, nu = lti->nu, ny = lti->ny;
  double half = out->dt / 2;
  double *f = malloc((n * n + 1) * sizeof *f), *m = calloc(n * n + 1, sizeof *m);
  int *pivot = malloc((n + 1) * sizeof *pivot);
  pb_status status = PB_OK;
  if (!f || !m || !pivot) {
    status = pb_fail_memory(err, "c2d");
    goto done;
  }
  for (size_t k = 0; k < n * n; k++) f[k] = -half * lti->a[k];
  for (size_t k = 0; k < n; k++) f[k + k * n] += 1, m[k + k * n] = 1;
  int in = (int)n, iu = (int)nu, iy = (int)ny, info = 0;
  double size = norm_1(f, n), one = 1, zero = 0;
  if (n > 0) dgesv_(&in, &in, f, &in, pivot, m, &in, &info);
  if (info != 0 || !(size * norm_1(m, n) < 1e14)) {
    status = pb_fail(err, PB_ERR_SINGULAR, "c2d", "a pole lies at 2/T = %g rad/s", 1 / half);
    goto done;
  }
  memcpy(out->d, lti->d, ny * nu * sizeof *out->d);
  if (n == 0) goto done;
  // M (I + A T/2) = 2 M − I
  for (size_t k = 0; k < n * n; k++) out->a[k] = 2 * m[k];
  for (size_t k = 0; k < n; k++) out->a[k + k * n] -= 1;
  dgemm_("N", "N", &in, &iu, &in, &out->dt, m, &in, lti->b, &in, &zero, out->b, &in);
  dgemm_("N", "N", &iy, &in, &in, &one, lti->c, &iy, m, &in, &zero, out->c, &iy);
  dgemm_("N", "N", &iy, &iu, &in, &half, out->c, &iy, lti->b, &in, &one, out->d, &iy);
done:
  free(f);
  free(m);
  free(pivot);
  return status;
}

pb_status pb_lti_c2d(const pb_lti *lti, double dt, pb_c2d_method method, pb_lti *out,
                     pb_error *err) {
  *out = (pb_lti){0};
  if (lti->dt != 0 || !isfinite(dt) || !(dt > 0)) {
    return pb_fail(err, PB_ERR_ARGUMENT, "c2d", "from period %g s to %g s", lti->dt, dt);
  }
  pb_status status = pb_lti_new(lti->nx, lti->nu, lti->ny, dt, out, err);
  if (status != PB_OK) return status;
  status = method == PB_C2D_ZOH ? discretise_zoh(lti, out, err) : discretise_tustin(lti, out, err);
  if (status != PB_OK) pb_lti_free(out);
  return status;
}
