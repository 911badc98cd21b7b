// Loop shape, gains and controllers of HAC-LAC against their formulas; stability of large loops
// with integrators against dense eigenvalues.
#include "support/check.h"

#include "control/hac.h"
#include "control/iff.h"
#include "control/lti_ops.h"
#include "modal_model.h"

enum { RATE = 10000 };

static double complex z_at(double hz) {
  return cexp(CMPLX(0, 2 * M_PI * hz / RATE));
}

static double complex response(const pb_lti *lti, double hz) {
  double complex h;
  REQUIRE(pb_lti_evaluate(lti, z_at(hz), &h, NULL, &err));
  return h;
}

// Tustin's rule is the formula at s = (2/T)(z − 1)/(z + 1).
static void test_shape(void **state) {
  (void)state;
  const pb_hac_shape shape = {100, 9, 10, 1000};
  pb_lti h;
  REQUIRE(pb_hac_shape_discrete(&shape, RATE, &h, &err));
  assert_int_equal(h.nx, 3);
  for (double hz = 0.5; hz < 4900; hz *= 1.7) {
    double complex z = z_at(hz), s = 2.0 * RATE * (z - 1) / (z + 1);
    double wc = 200 * M_PI, wi = 20 * M_PI, wl = 2000 * M_PI;
    double complex expected = (s + wi) / s * 3 * (s + wc / 3) / (s + 3 * wc) * wl / (s + wl);
    ASSERT_NEAR(cabs(response(&h, hz) / expected - 1), 0, 1e-10);
  }
  double complex poles[3];
  REQUIRE(pb_lti_poles(&h, poles, &err));
  int integrators = 0;
  for (int k = 0; k < 3; k++) integrators += poles[k] == 1;
  assert_int_equal(integrators, 1);
  pb_lti_free(&h);
  // The lead alone: √a at most twice, 1 and asin((a−1)/(a+1)) at its centre, sampled slowly.
  const pb_hac_shape lead = {10, 9, 0, 0};
  REQUIRE(pb_hac_shape_discrete(&lead, RATE, &h, &err));
  ASSERT_NEAR(cabs(response(&h, 10)), 1, 1e-5);
  ASSERT_NEAR(carg(response(&h, 10)) * 180 / M_PI, 53.1301, 1e-3);
  pb_lti_free(&h);
}

static void test_refused(void **state) {
  (void)state;
  const pb_hac_shape bad[] = {{0, 9, 1, 100},    {5000, 9, 1, 100}, {100, 0.5, 1, 100},
                              {100, 9, -1, 100}, {100, 9, 1, 6000}, {NAN, 9, 1, 100}};
  const char *const where[] = {"bandwidth",  "bandwidth", "lead",
                               "integrator", "low-pass",  "bandwidth"};
  for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
    pb_lti h;
    pb_error err = {0};
    assert_int_equal(pb_hac_shape_discrete(&bad[k], RATE, &h, &err), PB_ERR_ARGUMENT);
    assert_string_equal(err.where, where[k]);
    assert_null(h.a);
  }
}

// Two coupled struts: u1, u2 → force sensors y1, y2, metrology y3, y4.
static pb_model *two_struts(double polarity) {
  static double in[2][2] = {{1, 0.9}, {0.8, -1}};
  double out[2][4];
  for (int k = 0; k < 2; k++) {
    for (int i = 0; i < 2; i++) out[k][i] = 300 * in[k][i];
    for (int i = 0; i < 2; i++) out[k][2 + i] = polarity * in[k][i];
  }
  const test_mode mode[2] = {{40, 0.002, in[0], out[0]}, {90, 0.003, in[1], out[1]}};
  return test_model(mode, 2, 2, 4, RATE, NULL);
}

static const size_t input[2] = {0, 1}, sensor[2] = {0, 1}, metrology[2] = {2, 3};
static const pb_hac_channels channels = {2, input, sensor, metrology};

static void test_gains(void **state) {
  (void)state;
  enum { NF = 400 };
  for (int polarity = -1; polarity <= 1; polarity += 2) {
    pb_model *m = two_struts(polarity);
    pb_hac_shape shape = pb_hac_shape_default(60, 1e4);
    const pb_hac_frame frame = {0};
    pb_lti h;
    double hz[NF + 1], gain[2];
    double complex plant[4 * (NF + 1)], l[4 * NF];
    REQUIRE(pb_hac_shape_discrete(&shape, RATE, &h, &err));
    for (int k = 0; k < NF; k++) hz[k] = 60 * pow(80, k / (double)(NF - 1));
    hz[NF] = 0.6;
    REQUIRE(pb_hac_plant(m, &channels, &frame, NULL, 0, hz, NF + 1, plant, &err));
    REQUIRE(pb_hac_gains(&h, hz, NF, plant, plant + 4 * NF, 2, false, gain, &err));
    REQUIRE(pb_hac_loop_gain(&h, gain, 3, hz, NF, 2, plant, l, &err));
    for (int i = 0; i < 2; i++) {
      double largest = 0;
      for (int f = 0; f < NF; f++) largest = fmax(largest, cabs(l[4 * f + 3 * i]));
      ASSERT_RELATIVE(largest, 1, 1e-12);
      assert_true(gain[i] * polarity > 0);
    }
    // The delay turns L by as many samples.
    double complex expected = gain[1] * response(&h, hz[9]) * plant[4 * 9 + 1] / (z_at(3 * hz[9]));
    ASSERT_NEAR(cabs(l[4 * 9 + 1] / expected - 1), 0, 1e-9);
    pb_lti_free(&h);
    pb_model_free(m);
  }
}

// T_u diag(k H) T_y, and with IFF as one controller.
static void test_controllers(void **state) {
  (void)state;
  const double j[4] = {1, 0.3, -0.2, 2}, jt[4] = {1, -0.2, 0.3, 2}, gain[2] = {5, -7};
  const pb_hac_frame frame = {j, jt};
  const pb_hac_shape shape = {100, 4, 5, 0};
  pb_iff law = pb_iff_default(30);
  pb_lti h, hac, iff, both;
  REQUIRE(pb_hac_shape_discrete(&shape, RATE, &h, &err));
  REQUIRE(pb_hac_controller(&h, gain, &frame, 2, &hac, &err));
  REQUIRE(pb_iff_discrete(&law, 2, RATE, &iff, &err));
  REQUIRE(pb_hac_combine(&iff, 1, &hac, 2, 2, &both, &err));
  double complex k[4], low[4], all[8], z = z_at(70), shaped = response(&h, 70);
  REQUIRE(pb_lti_evaluate(&hac, z, k, NULL, &err));
  REQUIRE(pb_lti_evaluate(&iff, z, low, NULL, &err));
  REQUIRE(pb_lti_evaluate(&both, z, all, NULL, &err));
  for (int r = 0; r < 2; r++) {
    for (int c = 0; c < 2; c++) {
      double complex sum = 0;
      for (int i = 0; i < 2; i++) sum += jt[r + 2 * i] * gain[i] * shaped * j[i + 2 * c];
      ASSERT_NEAR(cabs(k[2 * r + c] - sum), 0, 1e-10);
      ASSERT_NEAR(cabs(all[4 * r + c] - low[2 * r + c] / z), 0, 1e-10);
      ASSERT_NEAR(cabs(all[4 * r + 2 + c] + k[2 * r + c] / (z * z)), 0, 1e-10);
    }
  }
  pb_lti_free(&both);
  pb_error err = {0};
  assert_int_equal(pb_hac_combine(NULL, 0, NULL, 0, 2, &both, &err), PB_ERR_ARGUMENT);
  assert_int_equal(pb_hac_combine(&iff, 0, &hac, 0, 3, &both, &err), PB_ERR_ARGUMENT);
  pb_lti_free(&h);
  pb_lti_free(&hac);
  pb_lti_free(&iff);
}

// ---- stability of a large loop ------------------------------------------------------------------

enum { MODES = 198 };  // with the controller beyond PB_LOOP_STABLE_DENSE

static pb_model *large_plant(void) {
  static double shape[MODES][6];
  static test_mode mode[MODES];
  for (size_t k = 0; k < MODES; k++) {
    for (size_t i = 0; i < 2; i++) {
      double v = cos(1.3 * (double)(k * k + 1) + (double)i) / (1 + 0.1 * (double)k);
      shape[k][i] = v;
      shape[k][2 + i] = 300 * v;
      shape[k][4 + i] = v;
    }
    mode[k] = (test_mode){40 * pow(1.02, (double)k), 0.002, shape[k], shape[k] + 2};
  }
  return test_model(mode, MODES, 2, 4, RATE, NULL);
}

static bool dense_stable(const pb_loop *loop, double gain) {
  pb_lti closed;
  REQUIRE(pb_loop_closed(loop, gain, &closed, &err));
  double complex *z = malloc(closed.nx * sizeof *z);
  double largest = 0;
  REQUIRE(pb_lti_poles(&closed, z, &err));
  for (size_t k = 0; k < closed.nx; k++) largest = fmax(largest, cabs(z[k]));
  free(z);
  pb_lti_free(&closed);
  return largest < 1;
}

// The argument principle with integrators in the loop, on either side of the border.
static void test_large(void **state) {
  (void)state;
  pb_model *m = large_plant();
  pb_hac_shape shape = pb_hac_shape_default(60, 1e4);
  const pb_hac_frame frame = {0};
  const double hz[2] = {60, 0.6};
  double complex plant[8];
  double gain[2];
  pb_iff law = pb_iff_default(10);
  pb_lti h, hac, iff, both;
  const size_t read[4] = {0, 1, 2, 3};
  REQUIRE(pb_hac_shape_discrete(&shape, RATE, &h, &err));
  REQUIRE(pb_iff_discrete(&law, 2, RATE, &iff, &err));
  REQUIRE(pb_hac_plant(m, &channels, &frame, &iff, 0, hz, 2, plant, &err));
  REQUIRE(pb_hac_gains(&h, hz, 1, plant, plant + 4, 2, false, gain, &err));
  bool seen[2] = {false, false};
  for (double factor = 1; factor < 100; factor *= 30) {
    double scaled[2] = {factor * gain[0], factor * gain[1]};
    REQUIRE(pb_hac_controller(&h, scaled, &frame, 2, &hac, &err));
    REQUIRE(pb_hac_combine(&iff, 0, &hac, 0, 2, &both, &err));
    assert_true(m->nx + both.nx > PB_LOOP_STABLE_DENSE);
    pb_loop loop = {m, &both, read, input, 1, 0};
    pb_loop_solver *solver;
    bool stable, expected = dense_stable(&loop, 1);
    REQUIRE(pb_loop_solver_new(&loop, &solver, &err));
    REQUIRE(pb_loop_solver_stable(solver, 1, &stable, NULL, &err));
    assert_int_equal(stable, expected);
    seen[expected] = true;
    pb_loop_solver_free(solver);
    pb_lti_free(&hac);
    pb_lti_free(&both);
  }
  assert_true(seen[0] && seen[1]);
  pb_lti_free(&h);
  pb_lti_free(&iff);
  pb_model_free(m);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_shape), cmocka_unit_test(test_refused), cmocka_unit_test(test_gains),
      cmocka_unit_test(test_controllers), cmocka_unit_test(test_large)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
