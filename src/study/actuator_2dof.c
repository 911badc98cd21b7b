// The 2-DoF amplified actuator under a mass: see actuator_2dof.h.
#include "study/actuator_2dof.h"

#include <math.h>
#include <string.h>

#include "model/block.h"

static const double two_pi = 6.283185307179586476925286766559;

static void continuous(const pb_apa_2dof *p, double complex s, double complex h[2]) {
  const double complex ke = p->k_e + p->c_e * s;
  const double complex a = p->moving * s * s + p->k_1 + p->c_1 * s + ke;
  const double complex b = p->inner * s * s + p->k_a + p->c_a * s + ke;
  const double complex det = a * b - ke * ke;
  h[PB_APA_Y] = p->g_a * ke / det;
  h[PB_APA_VS] = p->g_a * p->g_s * (ke - a) / det;
}

// States z, e = z − w, ż/ω_z, ė/ω_e: V_s is a state, not a small difference of two, and all weigh
// alike, so that the exponential keeps its digits.
static void fill_states(const pb_apa_2dof *p, double a[16], double b[4]) {
  const double up = 1 / p->moving, in = 1 / p->inner;
  memset(a, 0, 16 * sizeof *a);
  memset(b, 0, 4 * sizeof *b);
  a[0 + 4 * 2] = a[1 + 4 * 3] = 1;
  a[2 + 4 * 0] = -p->k_1 * up;
  a[2 + 4 * 1] = -p->k_e * up;
  a[2 + 4 * 2] = -p->c_1 * up;
  a[2 + 4 * 3] = -p->c_e * up;
  a[3 + 4 * 0] = a[2 + 4 * 0] + p->k_a * in;
  a[3 + 4 * 1] = a[2 + 4 * 1] - (p->k_a + p->k_e) * in;
  a[3 + 4 * 2] = a[2 + 4 * 2] + p->c_a * in;
  a[3 + 4 * 3] = a[2 + 4 * 3] - (p->c_a + p->c_e) * in;
  b[3] = -p->g_a * in;
  const double scale[4] = {1, 1, sqrt((p->k_1 + p->k_e) * up), sqrt((p->k_a + p->k_e) * in)};
  for (int i = 0; i < 4; i++) {
    for (int j = 0; j < 4; j++) a[i + 4 * j] *= scale[j] / scale[i];
    b[i] /= scale[i];
  }
}

// (λ − A) x = b by elimination with pivots.
static void solve4(const double *a, double complex lambda, const double *b, double complex x[4]) {
  double complex m[4][5];
  for (int i = 0; i < 4; i++) {
    for (int j = 0; j < 4; j++) m[i][j] = (i == j ? lambda : 0) - a[i + 4 * j];
    m[i][4] = b[i];
  }
  for (int k = 0; k < 4; k++) {
    int best = k;
    for (int i = k + 1; i < 4; i++)
      if (cabs(m[i][k]) > cabs(m[best][k])) best = i;
    for (int j = 0; j < 5; j++) {
      const double complex swap = m[k][j];
      m[k][j] = m[best][j];
      m[best][j] = swap;
    }
    for (int i = k + 1; i < 4; i++) {
      const double complex factor = m[i][k] / m[k][k];
      for (int j = k; j < 5; j++) m[i][j] -= factor * m[k][j];
    }
  }
  for (int i = 3; i >= 0; i--) {
    x[i] = m[i][4];
    for (int j = i + 1; j < 4; j++) x[i] -= m[i][j] * x[j];
    x[i] /= m[i][i];
  }
}

// A_d − 1 = A ∫ e^{As} ds and B_d of the zero-order hold. With z − 1 beside it no digits are lost
// where z is near 1.
static pb_status sample(const pb_apa_2dof *p, double sample_rate, double turned[16], double bd[4],
                        pb_error *err) {
  double a[16], b[4], ad[16], gd[16];
  fill_states(p, a, b);
  pb_status st = pb_block_discretize(4, a, 1 / sample_rate, ad, gd, err);
  for (int i = 0; i < 4; i++) {
    bd[i] = 0;
    for (int j = 0; j < 4 && !st; j++) {
      bd[i] += gd[i + 4 * j] * b[j];
      turned[i + 4 * j] = 0;
      for (int k = 0; k < 4; k++) turned[i + 4 * j] += a[i + 4 * k] * gd[k + 4 * j];
    }
  }
  return st;
}

// e^w − 1
static double complex turn(double complex w) {
  const double x = creal(w), y = cimag(w), half = sin(0.5 * y);
  return expm1(x) * cos(y) - 2 * half * half + I * (exp(x) * sin(y));
}

// At z = e^w.
static void sampled(const pb_apa_2dof *p, const double *turned, const double *bd, double complex w,
                    double complex h[2]) {
  double complex x[4];
  solve4(turned, turn(w), bd, x);
  h[PB_APA_Y] = x[0];
  h[PB_APA_VS] = p->g_s * x[1];
}

pb_status pb_apa_2dof_response(const pb_apa_2dof *p, double sample_rate, const double *hz,
                               size_t nf, double complex *h, pb_error *err) {
  double turned[16], bd[4];
  pb_status st = sample_rate > 0 ? sample(p, sample_rate, turned, bd, err) : PB_OK;
  for (size_t f = 0; f < nf && !st; f++) {
    double complex *at = h + PB_APA_OUTPUTS * f;
    const double complex s = I * two_pi * hz[f];
    if (sample_rate > 0)
      sampled(p, turned, bd, s / sample_rate, at);
    else
      continuous(p, s, at);
    if (!isfinite(cabs(at[PB_APA_Y])) || !isfinite(cabs(at[PB_APA_VS])))
      st = pb_fail(err, PB_ERR_NUMERIC, "apa_2dof", "the response at %g Hz is not finite", hz[f]);
  }
  return st;
}

// The secant method: the response is smooth around its zero.
pb_status pb_apa_2dof_sampled_zero(const pb_apa_2dof *p, double sample_rate, double complex start,
                                   double complex *zero, pb_error *err) {
  double turned[16], bd[4];
  double complex h[2], s0 = start * (1 + 1e-4), s1 = start;
  pb_status st = sample(p, sample_rate, turned, bd, err);
  if (st) return st;
  sampled(p, turned, bd, s0 / sample_rate, h);
  double complex h0 = h[PB_APA_VS];
  for (int k = 0; k < 50; k++) {
    sampled(p, turned, bd, s1 / sample_rate, h);
    const double complex h1 = h[PB_APA_VS], step = h1 * (s1 - s0) / (h1 - h0);
    if (h1 == 0 || cabs(s1 - s0) < 1e-10 * cabs(s1)) {
      *zero = s1;
      return PB_OK;
    }
    s0 = s1, h0 = h1;
    s1 -= step;
    if (!(cabs(s1 - start) < 0.5 * cabs(start))) break;
  }
  return pb_fail(err, PB_ERR_NUMERIC, "apa_2dof", "the zero of the sampled response is not found");
}
