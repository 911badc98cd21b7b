// Extended-precision step response: see oracle.h.
//
// With M = L Lᵀ, K' = L⁻¹ K L⁻ᵀ, C' alike and q' = Lᵀ q, the state [α q'; q̇'] obeys
//   A = [[0, α I], [−K'/α, −C']],  α² = ‖K'‖,
// whose norm is the highest natural frequency; e^{[A b; 0 0] dt} by Taylor series, scaling and
// squaring.
#include "support/oracle.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef long double real;

static int cholesky(real *a, size_t n) {
  for (size_t j = 0; j < n; j++) {
    for (size_t k = 0; k < j; k++)
      for (size_t i = j; i < n; i++) a[i + j * n] -= a[i + k * n] * a[j + k * n];
    if (!(a[j + j * n] > 0)) return -1;
    real d = sqrtl(a[j + j * n]);
    for (size_t i = j; i < n; i++) a[i + j * n] /= d;
  }
  return 0;
}

// b (n × m) ← L⁻¹ b
static void forward(const real *l, size_t n, real *b, size_t m) {
  for (size_t c = 0; c < m; c++)
    for (size_t j = 0; j < n; j++) {
      b[j + c * n] /= l[j + j * n];
      for (size_t i = j + 1; i < n; i++) b[i + c * n] -= l[i + j * n] * b[j + c * n];
    }
}

static void transpose(real *a, size_t n) {
  for (size_t j = 0; j < n; j++)
    for (size_t i = 0; i < j; i++) {
      real t = a[i + j * n];
      a[i + j * n] = a[j + i * n];
      a[j + i * n] = t;
    }
}

// L⁻¹ X L⁻ᵀ for a symmetric X, into out.
static void congruence(const real *l, const double *x, size_t n, real *out) {
  for (size_t i = 0; i < n * n; i++) out[i] = x[i];
  forward(l, n, out, n);
  transpose(out, n);
  forward(l, n, out, n);
}

static void multiply(const real *a, const real *b, real *c, size_t n) {
  memset(c, 0, n * n * sizeof *c);
  for (size_t j = 0; j < n; j++)
    for (size_t k = 0; k < n; k++) {
      real s = b[k + j * n];
      if (s == 0) continue;
      for (size_t i = 0; i < n; i++) c[i + j * n] += a[i + k * n] * s;
    }
}

// e ← e^a (a destroyed); t, p are scratch.
static void exponential(real *a, real *e, real *t, real *p, size_t n) {
  real norm = 0;
  for (size_t j = 0; j < n; j++) {
    real sum = 0;
    for (size_t i = 0; i < n; i++) sum += fabsl(a[i + j * n]);
    if (sum > norm) norm = sum;
  }
  int squarings = 0;
  for (; norm > 0.25L; norm /= 2) squarings++;
  for (size_t i = 0; i < n * n; i++) a[i] = ldexpl(a[i], -squarings);
  memset(e, 0, n * n * sizeof *e);
  for (size_t i = 0; i < n; i++) e[i + i * n] = 1;
  memcpy(t, e, n * n * sizeof *t);
  for (int k = 1; k <= 14; k++) {  // 0.25¹⁵/15! < 1e-21
    multiply(t, a, p, n);
    for (size_t i = 0; i < n * n; i++) {
      t[i] = p[i] / k;
      e[i] += t[i];
    }
  }
  for (int k = 0; k < squarings; k++) {
    multiply(e, e, p, n);
    memcpy(e, p, n * n * sizeof *e);
  }
}

// Fills a ((2n+1)²) with the augmented matrix times dt; l holds the factor of M; returns α.
static real fill(const pb_system *s, double dt, size_t input, const real *l, real *a, real *work) {
  size_t n = s->n, m = 2 * n + 1;
  real alpha = 0;
  memset(a, 0, m * m * sizeof *a);
  congruence(l, s->k, n, work);
  for (size_t i = 0; i < n * n; i++) alpha = fmaxl(alpha, fabsl(work[i]));
  alpha = sqrtl(alpha);
  for (size_t j = 0; j < n; j++) {
    a[j + (n + j) * m] = alpha * dt;
    for (size_t i = 0; i < n; i++) a[n + i + j * m] = -work[i + j * n] / alpha * dt;
  }
  congruence(l, s->c, n, work);
  for (size_t j = 0; j < n; j++)
    for (size_t i = 0; i < n; i++) a[n + i + (n + j) * m] = -work[i + j * n] * dt;
  for (size_t i = 0; i < n; i++) work[i] = s->f[i + input * n];
  forward(l, n, work, 1);
  for (size_t i = 0; i < n; i++) a[n + i + 2 * n * m] = work[i] * dt;
  return alpha;
}

// Row of outputs from the state: q = L⁻ᵀ q'.
static void output(const pb_system *s, const real *l, real alpha, size_t input, const real *x,
                   real *q, double *y) {
  size_t n = s->n;
  for (int part = 0; part < 2; part++)
    for (size_t j = n; j-- > 0;) {
      real v = part ? x[n + j] : x[j] / alpha;
      for (size_t i = j + 1; i < n; i++) v -= l[i + j * n] * q[part * n + i];
      q[part * n + j] = v / l[j + j * n];
    }
  for (size_t o = 0; o < s->ny; o++) {
    real sum = s->d[o + input * s->ny];
    for (size_t j = 0; j < n; j++)
      sum += s->y0[o + j * s->ny] * q[j] + s->y1[o + j * s->ny] * q[n + j];
    y[o] = (double)sum;
  }
}

int oracle_step(const pb_system *s, double dt, size_t input, const size_t *step, size_t count,
                double *y) {
  size_t n = s->n, m = 2 * n + 1, mm = m * m, k = 0;
  real *l = malloc(n * n * sizeof *l), *a = malloc(mm * sizeof *a), *e = malloc(mm * sizeof *e);
  real *t = malloc(mm * sizeof *t), *p = malloc(mm * sizeof *p), *x = calloc(3 * m, sizeof *x);
  int failed = !l || !a || !e || !t || !p || !x;
  for (size_t i = 0; !failed && i < n * n; i++) l[i] = s->m[i];
  if (!failed) failed = cholesky(l, n);
  if (!failed) {
    real alpha = fill(s, dt, input, l, a, t), *next = x + m;
    exponential(a, e, t, p, m);
    x[2 * n] = 1;
    for (size_t c = 0; c < count; c++) {
      for (; k < step[c]; k++) {
        memset(next, 0, m * sizeof *next);
        for (size_t j = 0; j < m; j++)
          for (size_t i = 0; i < m; i++) next[i] += e[i + j * m] * x[j];
        memcpy(x, next, m * sizeof *x);
      }
      output(s, l, alpha, input, x, t, y + c * s->ny);
    }
  }
  free(l), free(a), free(e), free(t), free(p), free(x);
  return failed ? -1 : 0;
}
