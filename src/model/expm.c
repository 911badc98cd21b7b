// Zero-order hold of one diagonal block: see block.h.
#include <complex.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/array.h"
#include "base/lapack.h"
#include "model/block.h"

// e^z − 1 without cancellation at small z.
static double complex expm1_complex(double complex z) {
  double x = creal(z), y = cimag(z), s = sin(0.5 * y);
  return expm1(x) * cos(y) - 2 * s * s + I * exp(x) * sin(y);
}

// A = [[σ, ·], [·, σ]] with eigenvalues λ = μ ± iν: f(A h) = Re f(λh) I + Im f(λh)/ν (A − μ I).
static bool pair(const double *a, double h, double *ad, double *gd) {
  double mu = 0.5 * (a[0] + a[3]), half = 0.5 * (a[0] - a[3]);
  double discriminant = half * half + a[1] * a[2];
  if (!(discriminant < 0)) return false;
  double nu = sqrt(-discriminant);
  if (nu < 1e-3 * fabs(mu)) return false;
  double complex z = h * (mu + I * nu), e = expm1_complex(z), phi = e / z;
  const double b[4] = {a[0] - mu, a[1], a[2], a[3] - mu};
  for (int i = 0; i < 4; i++) {
    double identity = i == 0 || i == 3;
    ad[i] = identity * (creal(e) + 1) + cimag(e) / nu * b[i];
    gd[i] = h * (identity * creal(phi) + cimag(phi) / nu * b[i]);
  }
  return true;
}

// ∫₀ʰ e^{λ s} ds.
static double held(double lambda, double h) {
  return lambda != 0 ? expm1(lambda * h) / lambda : h;
}

// A = [[a_0, ·], [·, a_3]] with real eigenvalues λ_1, λ_2, |λ_1| the larger: f(A h) = f(λ_1 h) P +
// f(λ_2 h) (I − P), P = (A − λ_2 I)/(λ_1 − λ_2). Each eigenvalue and both diagonal entries of P,
// whose sum is 1, are formed without cancellation, so that the slow one keeps its digits beside a
// fast one of any size.
static bool real_pair(const double *a, double h, double *ad, double *gd) {
  double mu = 0.5 * (a[0] + a[3]), half = 0.5 * (a[0] - a[3]), off = a[1] * a[2];
  double discriminant = half * half + off;
  if (!(discriminant > 0.01 * mu * mu) || !isfinite(discriminant)) return false;
  double nu = sqrt(discriminant), fast = mu < 0 ? mu - nu : mu + nu;
  if (!(fabs(fast) * h > 1)) return false;  // no squaring is needed, and differences would cancel
  double slow = (a[0] * a[3] - off) / fast, gap = fast - slow, p0 = a[0] - slow, p3 = a[3] - slow;
  if (fabs(p0) < fabs(p3))
    p0 = off / p3;
  else
    p3 = off / p0;
  const double e[2] = {exp(fast * h), exp(slow * h)}, g[2] = {held(fast, h), held(slow, h)};
  p0 /= gap, p3 /= gap;
  ad[0] = e[0] * p0 + e[1] * p3, ad[3] = e[0] * p3 + e[1] * p0;
  gd[0] = g[0] * p0 + g[1] * p3, gd[3] = g[0] * p3 + g[1] * p0;
  for (int i = 1; i < 3; i++) {
    ad[i] = (g[0] * fast - g[1] * slow) / gap * a[i];
    gd[i] = (g[0] - g[1]) / gap * a[i];
  }
  return true;
}

static void multiply(int n, const double *a, const double *b, double *c) {
  double one = 1, zero = 0;
  dgemm_("N", "N", &n, &n, &n, &one, a, &n, b, &n, &zero, c, &n);
}

static double one_norm(size_t n, const double *a) {
  double norm = 0;
  for (size_t j = 0; j < n; j++) {
    double sum = 0;
    for (size_t i = 0; i < n; i++) sum += fabs(a[i + j * n]);
    norm = fmax(norm, sum);
  }
  return norm;
}

static const double pade[14] = {64764752532480000.0,
                                32382376266240000.0,
                                7771770303897600.0,
                                1187353796428800.0,
                                129060195264000.0,
                                10559470521600.0,
                                670442572800.0,
                                33522128640.0,
                                1323241920.0,
                                40840800.0,
                                960960.0,
                                16380.0,
                                182.0,
                                1.0};

// x ← e^x in place; work holds 7 n² doubles, pivot n integers. False: the solve failed.
static bool exponential(size_t size, double *x, double *work, int *pivot) {
  int n = (int)size, info = 0, squarings = 0;
  size_t nn = size * size;
  double *x2 = work, *x4 = x2 + nn, *x6 = x4 + nn, *u = x6 + nn, *v = u + nn, *t = v + nn;
  double norm = one_norm(size, x);
  if (!isfinite(norm)) return false;
  for (; norm > 5.371920351148152; norm *= 0.5) squarings++;
  for (size_t i = 0; i < nn; i++) x[i] = ldexp(x[i], -squarings);
  multiply(n, x, x, x2);
  multiply(n, x2, x2, x4);
  multiply(n, x4, x2, x6);
  for (size_t i = 0; i < nn; i++) t[i] = pade[13] * x6[i] + pade[11] * x4[i] + pade[9] * x2[i];
  multiply(n, x6, t, v);
  for (size_t i = 0; i < nn; i++)
    v[i] += pade[7] * x6[i] + pade[5] * x4[i] + pade[3] * x2[i] + pade[1] * (i % (size + 1) == 0);
  multiply(n, x, v, u);
  for (size_t i = 0; i < nn; i++) t[i] = pade[12] * x6[i] + pade[10] * x4[i] + pade[8] * x2[i];
  multiply(n, x6, t, v);
  for (size_t i = 0; i < nn; i++) {
    v[i] += pade[6] * x6[i] + pade[4] * x4[i] + pade[2] * x2[i] + pade[0] * (i % (size + 1) == 0);
    x[i] = v[i] + u[i];
    t[i] = v[i] - u[i];
  }
  dgesv_(&n, &n, t, &n, pivot, x, &n, &info);
  for (int k = 0; k < squarings; k++) {
    multiply(n, x, x, t);
    memcpy(x, t, nn * sizeof *x);
  }
  return info == 0;
}

pb_status pb_block_discretize(size_t n, const double *a, double h, double *ad, double *gd,
                              pb_error *err) {
  if (n == 1) {
    ad[0] = exp(a[0] * h);
    gd[0] = held(a[0], h);
    return PB_OK;
  }
  if (n == 2 && (pair(a, h, ad, gd) || real_pair(a, h, ad, gd))) return PB_OK;
  size_t m = 2 * n;
  double *x = pb_array_zero(8 * m * m, sizeof *x);
  int *pivot = malloc(m * sizeof *pivot);
  pb_status st = PB_OK;
  if (!x || !pivot) {
    st = pb_fail_memory(err, "");
    goto done;
  }
  for (size_t j = 0; j < n; j++) {
    for (size_t i = 0; i < n; i++) x[i + j * m] = h * a[i + j * n];
    x[j + (j + n) * m] = h;
  }
  if (!exponential(m, x, x + m * m, pivot)) {
    st = pb_fail(err, PB_ERR_NUMERIC, "", "a mode cannot be discretised at this sample rate");
    goto done;
  }
  for (size_t j = 0; j < n; j++) {
    for (size_t i = 0; i < n; i++) {
      ad[i + j * n] = x[i + j * m];
      gd[i + j * n] = x[i + (j + n) * m];
    }
  }
done:
  free(x);
  free(pivot);
  return st;
}
