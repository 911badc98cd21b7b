// Unit tests of control/lti.h, lti_ops.h and iff.h against closed forms.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdlib.h>

#include "control/iff.h"
#include "control/lti_ops.h"
#include "modal_model.h"

// k/(s + a)
static pb_lti first_order(double k, double a) {
  pb_lti lti;
  assert_int_equal(pb_lti_new(1, 1, 1, 0, &lti, NULL), PB_OK);
  lti.a[0] = -a;
  lti.b[0] = k;
  lti.c[0] = 1;
  return lti;
}

static pb_lti constant(double k, double dt) {
  pb_lti lti;
  assert_int_equal(pb_lti_new(0, 1, 1, dt, &lti, NULL), PB_OK);
  lti.d[0] = k;
  return lti;
}

static double complex at(const pb_lti *lti, double hz, size_t o, size_t i) {
  double complex h[16];
  assert_int_equal(pb_lti_frf(lti, &hz, 1, h, NULL), PB_OK);
  return h[o * lti->nu + i];
}

static void test_connections(void **state) {
  (void)state;
  pb_lti g = first_order(3, 2), h = first_order(5, 7), both, twice;
  double complex s = CMPLX(0, 2 * M_PI * 0.4), G = 3 / (s + 2), H = 5 / (s + 7);
  assert_int_equal(pb_lti_series(&g, &h, &both, NULL), PB_OK);
  assert_true(cabs(at(&both, 0.4, 0, 0) - G * H) < 1e-15);
  pb_lti_free(&both);
  assert_int_equal(pb_lti_parallel(&g, &h, &both, NULL), PB_OK);
  assert_true(cabs(at(&both, 0.4, 0, 0) - (G + H)) < 1e-15);
  pb_lti_free(&both);
  assert_int_equal(pb_lti_append(&g, &h, &both, NULL), PB_OK);
  assert_true(cabs(at(&both, 0.4, 1, 1) - H) < 1e-15 && at(&both, 0.4, 1, 0) == 0);
  size_t second = 1;
  assert_int_equal(pb_lti_select(&both, &second, 1, &second, 1, &twice, NULL), PB_OK);
  assert_true(cabs(at(&twice, 0.4, 0, 0) - H) < 1e-15);
  pb_lti_free(&twice);
  pb_lti_free(&both);
  assert_int_equal(pb_lti_feedback(&g, &h, -1, &both, NULL), PB_OK);
  assert_true(cabs(at(&both, 0.4, 0, 0) - G / (1 + G * H)) < 1e-15);
  pb_lti_free(&both);
  pb_lti_free(&g);
  pb_lti_free(&h);
}

// Direct terms in both branches: the algebraic loop is solved, and refused where it has no
// solution.
static void test_algebraic_loop(void **state) {
  (void)state;
  pb_lti g = constant(2, 0.1), k = constant(0.25, 0.1), closed;
  pb_error err;
  assert_int_equal(pb_lti_feedback(&g, &k, 1, &closed, &err), PB_OK);
  assert_true(fabs(closed.d[0] - 2 / (1 - 0.5)) < 1e-15);
  pb_lti_free(&closed);
  k.d[0] = 0.5;
  assert_int_equal(pb_lti_feedback(&g, &k, 1, &closed, &err), PB_ERR_SINGULAR);
  assert_null(closed.d);
  assert_int_equal(pb_lti_feedback(&g, &k, -1, &closed, &err), PB_OK);
  assert_true(fabs(closed.d[0] - 1) < 1e-15);
  pb_lti_free(&closed);
  k.dt = 0.2;
  assert_int_equal(pb_lti_feedback(&g, &k, 1, &closed, &err), PB_ERR_ARGUMENT);
  pb_lti_free(&g);
  pb_lti_free(&k);
}

static void test_expm(void **state) {
  (void)state;
  // Rotation by 100 rad with decay, and a nilpotent matrix.
  double a[4] = {-0.3, -100, 100, -0.3}, e[4];
  assert_int_equal(pb_expm(2, a, e, NULL), PB_OK);
  double decay = exp(-0.3);
  assert_true(fabs(e[0] - decay * cos(100)) < 1e-12 && fabs(e[1] + decay * sin(100)) < 1e-12);
  double n[9] = {0, 0, 0, 2, 0, 0, 5, 3, 0}, f[9];
  assert_int_equal(pb_expm(3, n, f, NULL), PB_OK);
  assert_true(fabs(f[3] - 2) < 1e-14 && fabs(f[6] - (5 + 3)) < 1e-14 && fabs(f[0] - 1) < 1e-15);
  a[0] = NAN;
  pb_error err;
  assert_int_equal(pb_expm(2, a, e, &err), PB_ERR_NUMERIC);
}

static void test_c2d(void **state) {
  (void)state;
  double T = 0.01, hz = 13;
  pb_lti g = first_order(3, 20), zoh, tustin, fine, squared;
  assert_int_equal(pb_lti_c2d(&g, T, PB_C2D_ZOH, &zoh, NULL), PB_OK);
  assert_true(fabs(zoh.a[0] - exp(-0.2)) < 1e-15);
  assert_true(fabs(zoh.b[0] - 3 * (1 - exp(-0.2)) / 20) < 1e-15);
  // Tustin is H(s) at s = (2/T)(z−1)/(z+1), with direct terms too.
  g.d[0] = 0.7;
  assert_int_equal(pb_lti_c2d(&g, T, PB_C2D_TUSTIN, &tustin, NULL), PB_OK);
  double complex z = cexp(CMPLX(0, 2 * M_PI * hz * T)), s = 2 / T * (z - 1) / (z + 1);
  assert_true(cabs(at(&tustin, hz, 0, 0) - (3 / (s + 20) + 0.7)) < 1e-14);
  // A_d(2T) = A_d(T)².
  assert_int_equal(pb_lti_c2d(&g, 2 * T, PB_C2D_ZOH, &squared, NULL), PB_OK);
  assert_int_equal(pb_lti_c2d(&g, T, PB_C2D_ZOH, &fine, NULL), PB_OK);
  assert_true(fabs(squared.a[0] - fine.a[0] * fine.a[0]) < 1e-15);
  pb_error err;
  pb_lti again;
  assert_int_equal(pb_lti_c2d(&fine, T, PB_C2D_ZOH, &again, &err), PB_ERR_ARGUMENT);
  pb_lti_free(&squared);
  pb_lti_free(&fine);
  pb_lti_free(&tustin);
  pb_lti_free(&zoh);
  g.a[0] = 2 / T;
  assert_int_equal(pb_lti_c2d(&g, T, PB_C2D_TUSTIN, &again, &err), PB_ERR_SINGULAR);
  assert_null(again.a);
  pb_lti_free(&g);
}

static void test_delay_and_step(void **state) {
  (void)state;
  pb_lti g = first_order(3, 20), d, delayed;
  assert_int_equal(pb_lti_c2d(&g, 0.01, PB_C2D_ZOH, &d, NULL), PB_OK);
  d.d[0] = 0.5;
  assert_int_equal(pb_lti_delay(&d, 3, &delayed, NULL), PB_OK);
  double x[1] = {0}, xd[4] = {0}, scratch[4], y[40], yd[40];
  for (int k = 0; k < 40; k++) {
    double u = sin(k);
    pb_lti_step(&d, x, scratch, &u, &y[k]);
    pb_lti_step(&delayed, xd, scratch, &u, &yd[k]);
    assert_true(yd[k] == (k < 3 ? 0 : y[k - 3]));
  }
  pb_error err;
  pb_lti none;
  assert_int_equal(pb_lti_delay(&g, 1, &none, &err), PB_ERR_ARGUMENT);
  pb_lti_free(&delayed);
  pb_lti_free(&d);
  pb_lti_free(&g);
}

// A random stable system: Hessenberg responses against pb_lti_evaluate, its derivative against
// a central difference, poles against the determinant.
static void test_analysis(void **state) {
  (void)state;
  enum { N = 12 };
  pb_lti g;
  assert_int_equal(pb_lti_new(N, 2, 3, 0, &g, NULL), PB_OK);
  uint64_t seed = 1;
  for (size_t k = 0; k < N * N + 2 * N + 3 * N + 6; k++) {
    seed = seed * 6364136223846793005u + 1442695040888963407u;
    double v = (double)(seed >> 11) * 0x1p-53 - 0.5;
    if (k < N * N)
      g.a[k] = v - (k % (N + 1) == 0) * 4;
    else if (k < N * N + 2 * N)
      g.b[k - N * N] = v;
    else if (k < N * N + 5 * N)
      g.c[k - N * N - 2 * N] = v;
    else
      g.d[k - N * N - 5 * N] = v;
  }
  double hz[3] = {0, 0.3, 1.7};
  double complex h[18], e[6], de[6], up[6], down[6];
  assert_int_equal(pb_lti_frf(&g, hz, 3, h, NULL), PB_OK);
  for (size_t f = 0; f < 3; f++) {
    double complex s = CMPLX(0, 2 * M_PI * hz[f]);
    assert_int_equal(pb_lti_evaluate(&g, s, e, de, NULL), PB_OK);
    assert_int_equal(pb_lti_evaluate(&g, s + 1e-5, up, NULL, NULL), PB_OK);
    assert_int_equal(pb_lti_evaluate(&g, s - 1e-5, down, NULL, NULL), PB_OK);
    for (size_t k = 0; k < 6; k++) {
      assert_true(cabs(h[f * 6 + k] - e[k]) < 1e-14);
      assert_true(cabs(de[k] - (up[k] - down[k]) / 2e-5) < 1e-9);
    }
  }
  double complex poles[N], sum = 0;
  double trace = 0;
  assert_int_equal(pb_lti_poles(&g, poles, NULL), PB_OK);
  for (size_t k = 0; k < N; k++) {
    sum += poles[k];
    trace += g.a[k + k * N];
  }
  assert_true(cabs(sum - trace) < 1e-12);
  pb_error err;
  hz[1] = NAN;
  assert_int_equal(pb_lti_frf(&g, hz, 3, h, &err), PB_ERR_ARGUMENT);
  g.a[5] = INFINITY;
  assert_int_equal(pb_lti_poles(&g, poles, &err), PB_ERR_NUMERIC);
  pb_lti_free(&g);
}

static void test_iff(void **state) {
  (void)state;
  pb_iff iff = pb_iff_default(-80);
  pb_lti k, d;
  assert_int_equal(pb_iff_continuous(&iff, 3, &k, NULL), PB_OK);
  double complex s = CMPLX(0, 2 * M_PI * 1.3);
  double complex expected = -80 / (s + 2 * 2 * M_PI) * s / (s + 0.5 * 2 * M_PI);
  assert_true(cabs(at(&k, 1.3, 1, 1) - expected) < 1e-13);
  assert_true(at(&k, 1.3, 1, 2) == 0);
  assert_int_equal(pb_iff_discrete(&iff, 1, 10000, &d, NULL), PB_OK);
  double complex z = cexp(CMPLX(0, 2 * M_PI * 1.3 / 10000));
  s = 20000 * (z - 1) / (z + 1);
  expected = -80 / (s + 2 * 2 * M_PI) * s / (s + 0.5 * 2 * M_PI);
  assert_true(cabs(at(&d, 1.3, 0, 0) - expected) < 1e-10);
  pb_lti_free(&k);
  pb_lti_free(&d);
  pb_error err;
  iff.highpass_hz = 0;
  assert_int_equal(pb_iff_continuous(&iff, 1, &k, &err), PB_ERR_ARGUMENT);
  iff = pb_iff_default(NAN);
  assert_int_equal(pb_iff_discrete(&iff, 1, 1000, &k, &err), PB_ERR_ARGUMENT);
}

// A model with a direct term: the sampled state space gives the response of the model, and steps
// alike.
static void test_from_model(void **state) {
  (void)state;
  static const double in[2][2] = {{1, 2}, {-1, 0.5}}, out[2][2] = {{3, 1}, {0.2, 4}};
  test_mode mode[2] = {{40, 0.01, in[0], out[0]}, {170, 0.03, in[1], out[1]}};
  double direct[4] = {1e-4, 0, 2e-5, -1e-4};
  pb_model *m = test_model(mode, 2, 2, 2, 1000, direct);
  pb_lti lti[2];
  assert_int_equal(pb_lti_from_model(m, PB_CONTINUOUS, &lti[0], NULL), PB_OK);
  assert_int_equal(pb_lti_from_model(m, PB_SAMPLED, &lti[1], NULL), PB_OK);
  assert_int_equal(lti[1].nx, 6);
  double hz[3] = {3, 39, 300};
  for (int base = 0; base < 2; base++) {
    double complex h[12], g[12];
    assert_int_equal(pb_lti_frf(&lti[base], hz, 3, h, NULL), PB_OK);
    assert_int_equal(pb_model_frf(m, base ? PB_SAMPLED : PB_CONTINUOUS, hz, 3, g, NULL), PB_OK);
    for (int k = 0; k < 12; k++) assert_true(cabs(h[k] - g[k]) < 1e-12 * cabs(g[0]));
  }
  pb_state *s = pb_state_new(m);
  double x[6] = {0}, scratch[6], y[2], ym[2];
  for (int k = 0; k < 200; k++) {
    double u[2] = {cos(0.3 * k), k % 5};
    pb_step_output(m, s, ym);
    pb_lti_step(&lti[1], x, scratch, u, y);
    pb_step_advance(m, s, u);
    for (int o = 0; o < 2; o++) assert_true(fabs(y[o] - ym[o]) < 1e-15);
  }
  free(s);
  pb_lti_free(&lti[0]);
  pb_lti_free(&lti[1]);
  pb_model_free(m);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_connections),
      cmocka_unit_test(test_algebraic_loop),
      cmocka_unit_test(test_expm),
      cmocka_unit_test(test_c2d),
      cmocka_unit_test(test_delay_and_step),
      cmocka_unit_test(test_analysis),
      cmocka_unit_test(test_iff),
      cmocka_unit_test(test_from_model),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
