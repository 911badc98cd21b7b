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

// States z, w, ż, ẇ.
static void fill_states(const pb_apa_2dof *p, double a[16], double b[4]) {
  memset(a, 0, 16 * sizeof *a);
  memset(b, 0, 4 * sizeof *b);
  a[0 + 4 * 2] = a[1 + 4 * 3] = 1;
  a[2 + 4 * 0] = -(p->k_1 + p->k_e) / p->moving;
  a[2 + 4 * 1] = p->k_e / p->moving;
  a[2 + 4 * 2] = -(p->c_1 + p->c_e) / p->moving;
  a[2 + 4 * 3] = p->c_e / p->moving;
  a[3 + 4 * 0] = p->k_e / p->inner;
  a[3 + 4 * 1] = -(p->k_a + p->k_e) / p->inner;
  a[3 + 4 * 2] = p->c_e / p->inner;
  a[3 + 4 * 3] = -(p->c_a + p->c_e) / p->inner;
  b[3] = p->g_a / p->inner;
}

// (λ − A_d) x = b by elimination with pivots.
static void solve4(const double *ad, double complex lambda, const double *b, double complex x[4]) {
  double complex m[4][5];
  for (int i = 0; i < 4; i++) {
    for (int j = 0; j < 4; j++) m[i][j] = (i == j ? lambda : 0) - ad[i + 4 * j];
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

pb_status pb_apa_2dof_response(const pb_apa_2dof *p, double sample_rate, const double *hz,
                               size_t nf, double complex *h, pb_error *err) {
  double a[16], b[4], ad[16], gd[16], bd[4] = {0};
  pb_status st = PB_OK;
  if (sample_rate > 0) {
    fill_states(p, a, b);
    st = pb_block_discretize(4, a, 1 / sample_rate, ad, gd, err);
    for (int i = 0; i < 4 && !st; i++)
      for (int j = 0; j < 4; j++) bd[i] += gd[i + 4 * j] * b[j];
  }
  for (size_t f = 0; f < nf && !st; f++) {
    double complex *at = h + PB_APA_OUTPUTS * f;
    if (sample_rate > 0) {
      double complex x[4];
      solve4(ad, cexp(I * two_pi * hz[f] / sample_rate), bd, x);
      at[PB_APA_Y] = x[0];
      at[PB_APA_VS] = p->g_s * (x[0] - x[1]);
    } else {
      continuous(p, I * two_pi * hz[f], at);
    }
    if (!isfinite(cabs(at[PB_APA_Y])) || !isfinite(cabs(at[PB_APA_VS])))
      st = pb_fail(err, PB_ERR_NUMERIC, "apa_2dof", "the response at %g Hz is not finite", hz[f]);
  }
  return st;
}
