// Unit tests of control/loop.h and rootlocus.h: the cheap formulas against dense state space, the
// large plant's iteration against the dense eigenvalues, the pole where theory puts it.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdlib.h>

#include "control/iff.h"
#include "control/loop.h"
#include "control/lti_ops.h"
#include "control/rootlocus.h"
#include "modal_model.h"

enum { RATE = 10000, MODES = 130, NU = 3, NY = 4 };

static double shape[MODES][NU + NY];

// A large plant: force-sensor-like collocated pairs (outputs 0, 1 with inputs 0, 1), one further
// input and two further outputs, two modes at the same frequency, one that the loop does not see.
static pb_model *large_plant(void) {
  test_mode mode[MODES];
  uint64_t seed = 7;
  for (size_t k = 0; k < MODES; k++) {
    double hz = k < 2 ? 39 : 39 * pow(1.045, (double)k);
    for (size_t j = 0; j < NU + NY; j++) {
      seed = seed * 6364136223846793005u + 1442695040888963407u;
      double v = (double)(seed >> 11) * 0x1p-53 - 0.5;
      shape[k][j] = v * 40 * (j < NU ? 1 : 100) / (1 + 0.05 * (double)k);
    }
    for (size_t j = 0; j < 2; j++) {
      if (k == 5) shape[k][j] = 0;
      shape[k][NU + j] = 100 * shape[k][j];  // collocated: positive integral feedback damps
    }
    mode[k] = (test_mode){hz, 0.002 + 0.0001 * (double)(k % 9), shape[k], shape[k] + NU};
  }
  return test_model(mode, MODES, NU, NY, RATE, NULL);
}

static const size_t output[2] = {0, 1}, input[2] = {0, 1};

static pb_loop make_loop(const pb_model *m, pb_lti *controller, unsigned delay) {
  pb_iff iff = pb_iff_default(1);
  assert_int_equal(pb_iff_discrete(&iff, 2, RATE, controller, NULL), PB_OK);
  return (pb_loop){m, controller, output, input, 1, delay};
}

static void test_frf_dense(void **state) {
  (void)state;
  pb_model *m = large_plant();
  for (unsigned delay = 0; delay < 3; delay++) {
    pb_lti controller, closed;
    pb_loop loop = make_loop(m, &controller, delay);
    double hz[4] = {5, 38, 140, 2900};
    double complex h[4 * NY * NU], g[4 * NY * NU];
    assert_int_equal(pb_loop_closed(&loop, 30, &closed, NULL), PB_OK);
    assert_int_equal(pb_loop_frf(&loop, 30, hz, 4, h, NULL), PB_OK);
    assert_int_equal(pb_lti_frf(&closed, hz, 4, g, NULL), PB_OK);
    for (size_t k = 0; k < 4 * NY * NU; k++) {
      if (!(cabs(h[k] - g[k]) < 1e-9 * cabs(g[k]) + 1e-13)) {
        fail_msg("delay %u, entry %zu: %g and %g", delay, k, cabs(h[k]), cabs(g[k]));
      }
    }
    pb_lti_free(&controller);
    pb_lti_free(&closed);
  }
  pb_model_free(m);
}

// Runs plant and controller sample by sample and compares with the closed system's own simulation.
static void test_closed_steps(void **state) {
  (void)state;
  static const double in[2] = {3, 1}, out[2] = {-40, 2};
  test_mode mode[1] = {{80, 0.01, in, out}};
  double direct[4] = {0.3, 0, 0, 0};
  pb_model *m = test_model(mode, 1, 2, 2, RATE, direct);
  for (unsigned delay = 0; delay < 3; delay++) {
    pb_lti controller, closed;
    pb_iff iff = pb_iff_default(100);
    assert_int_equal(pb_iff_discrete(&iff, 1, RATE, &controller, NULL), PB_OK);
    size_t zero = 0;
    pb_loop loop = {m, &controller, &zero, &zero, 1, delay};
    assert_int_equal(pb_loop_closed(&loop, 1, &closed, NULL), PB_OK);
    pb_state *s = pb_state_new(m);
    double xk[2] = {0}, scratch[32], x[32] = {0}, held[4] = {0};
    for (size_t k = 0; k < 400; k++) {
      double w[2] = {k < 10, sin(0.1 * (double)k)}, y[2], yc[2], v;
      pb_step_output(m, s, y);
      pb_lti_step(&controller, xk, scratch, y, &v);
      for (unsigned j = 3; j > 0; j--) held[j] = held[j - 1];
      held[0] = v;
      double u[2] = {w[0] + held[delay], w[1]};
      pb_step_advance(m, s, u);
      pb_lti_step(&closed, x, scratch, w, yc);
      for (int o = 0; o < 2; o++) assert_true(fabs(y[o] - yc[o]) < 1e-12);
    }
    free(s);
    pb_lti_free(&controller);
    pb_lti_free(&closed);
  }
  pb_model_free(m);
}

static void check_poles(pb_loop_solver *solver, const pb_loop *loop, double gain, double f2) {
  pb_lti closed;
  pb_pole_list list;
  assert_int_equal(pb_loop_closed(loop, gain, &closed, NULL), PB_OK);
  double complex *z = malloc(closed.nx * sizeof *z);
  assert_int_equal(pb_lti_poles(&closed, z, NULL), PB_OK);
  pb_error err = {0};
  if (pb_loop_solver_poles(solver, gain, 0.1, f2, &list, &err) != PB_OK) {
    fail_msg("gain %g: %s", gain, err.message);
  }
  size_t expected = 0;
  for (size_t k = 0; k < closed.nx; k++) {
    if (cimag(z[k]) < 0 || cabs(z[k]) < 0.3) continue;
    pb_pole p = pb_pole_from_z(z[k], RATE);
    if (p.hz < 0.1 || p.hz > f2) continue;
    expected++;
    double nearest = INFINITY;
    for (size_t j = 0; j < list.count; j++) nearest = fmin(nearest, cabs(list.item[j].z - z[k]));
    if (!(nearest < 1e-9))
      fail_msg("gain %g: pole of %g Hz, %g missed by %g", gain, p.hz, p.damping, nearest);
  }
  if (list.count != expected)
    fail_msg("gain %g: %zu poles, expected %zu", gain, list.count, expected);
  pb_pole_list_clear(&list);
  free(z);
  pb_lti_free(&closed);
}

static void test_poles_large(void **state) {
  (void)state;
  pb_model *m = large_plant();
  assert_true(m->nx > PB_LOOP_DENSE);
  for (unsigned delay = 0; delay < 2; delay++) {
    pb_lti controller;
    pb_loop loop = make_loop(m, &controller, delay);
    pb_loop_solver *solver;
    assert_int_equal(pb_loop_solver_new(&loop, &solver, NULL), PB_OK);
    static const double gain[] = {0, 0.1, 10, 100, 1000};
    for (size_t k = 0; k < 5; k++) check_poles(solver, &loop, gain[k], 600);
    check_poles(solver, &loop, 30, 4900);
    pb_loop_solver_free(solver);
    pb_lti_free(&controller);
  }
  pb_model_free(m);
}

// Gains and delays of the electronics, also of a channel outside the loop, in what the iteration on
// the whole plant solves.
static void test_poles_large_with_electronics(void **state) {
  (void)state;
  pb_model *m = large_plant();
  pb_electronics in[NU], out[NY];
  for (size_t i = 0; i < NU; i++) in[i] = pb_electronics_none();
  for (size_t o = 0; o < NY; o++) out[o] = pb_electronics_none();
  in[0].gain = 4, in[0].delay = 2, in[1].gain = 0.5;
  out[0].delay = 1, out[3].delay = 5;
  assert_int_equal(pb_electronics_attach(m, in, out, NULL), PB_OK);
  pb_lti controller;
  pb_loop loop = make_loop(m, &controller, 1);
  pb_loop_solver *solver;
  assert_int_equal(pb_loop_solver_new(&loop, &solver, NULL), PB_OK);
  static const double gain[] = {0, 0.1, 10, 100};
  for (size_t k = 0; k < 4; k++) check_poles(solver, &loop, gain[k], 600);
  pb_loop_solver_free(solver);
  pb_lti_free(&controller);
  pb_model_free(m);
}

static void test_stability(void **state) {
  (void)state;
  pb_model *m = large_plant();
  pb_lti controller;
  pb_loop loop = make_loop(m, &controller, 1);
  pb_loop_solver *solver;
  assert_int_equal(pb_loop_solver_new(&loop, &solver, NULL), PB_OK);
  static const double gain[] = {0, 1, 30, 1000, 10000};
  for (size_t k = 0; k < 5; k++) {
    pb_lti closed;
    assert_int_equal(pb_loop_closed(&loop, gain[k], &closed, NULL), PB_OK);
    double complex *z = malloc(closed.nx * sizeof *z);
    assert_int_equal(pb_lti_poles(&closed, z, NULL), PB_OK);
    double largest = 0;
    for (size_t j = 0; j < closed.nx; j++) largest = fmax(largest, cabs(z[j]));
    bool stable;
    pb_pole worst;
    assert_int_equal(pb_loop_solver_stable(solver, gain[k], &stable, &worst, NULL), PB_OK);
    assert_int_equal(stable, largest < 1);
    assert_true(fabs(cabs(worst.z) - largest) < 1e-9);
    free(z);
    pb_lti_free(&closed);
  }
  pb_loop_solver_free(solver);
  pb_lti_free(&controller);
  pb_model_free(m);
}

// One mode with a force sensor: the classical result that a pure integrator reaches, at its best
// gain, ζ = (ω_p − ω_z) / (2 ω_z), here for ω_p = 94 Hz, ω_z = 39 Hz with the corners far below.
static void test_best_gain(void **state) {
  (void)state;
  double wp = 2 * M_PI * 94, wz = 2 * M_PI * 39, in[1] = {1}, out[1] = {1};
  // H = (s² + ω_z²)/(s² + ω_p²) = 1 − (ω_p² − ω_z²)/(s² + ω_p²); negative sign for positive
  // feedback.
  out[0] = wp * wp - wz * wz;
  double direct[1] = {-1};
  test_mode mode[1] = {{94, 1e-5, in, out}};
  pb_model *m = test_model(mode, 1, 1, 1, 200000, direct);
  pb_iff iff = {1, 1e-3, 1e-3};
  pb_lti controller;
  assert_int_equal(pb_iff_discrete(&iff, 1, 200000, &controller, NULL), PB_OK);
  size_t zero = 0;
  pb_loop loop = {m, &controller, &zero, &zero, 1, 0};
  pb_loop_solver *solver;
  assert_int_equal(pb_loop_solver_new(&loop, &solver, NULL), PB_OK);
  pb_best_gain best;
  pb_error err = {0};
  if (pb_best_gain_find(solver, 20, 300, 2, &best, &err) != PB_OK) fail_msg("%s", err.message);
  double expected = (94.0 - 39) / (2 * 39);
  if (!(fabs(best.smallest_damping - expected) < 0.01 * expected)) {
    fail_msg("damping %g, expected %g", best.smallest_damping, expected);
  }
  assert_true(fabs(best.gain / (wp * sqrt(wp / wz)) - 1) < 0.03);
  assert_int_equal(best.modes, 1);
  assert_true(best.attainable[0] >= best.smallest_damping);
  pb_best_gain_clear(&best);
  pb_loop_solver_free(solver);
  pb_lti_free(&controller);
  pb_model_free(m);
}

// Branches are continuous and end where the poles of the last gain are.
static void test_rootlocus(void **state) {
  (void)state;
  pb_model *m = large_plant();
  pb_lti controller;
  pb_loop loop = make_loop(m, &controller, 0);
  pb_loop_solver *solver;
  assert_int_equal(pb_loop_solver_new(&loop, &solver, NULL), PB_OK);
  enum { GAINS = 60 };
  double gain[GAINS];
  for (int k = 0; k < GAINS; k++) gain[k] = k == 0 ? 0 : 0.05 * pow(1.15, k);
  pb_rootlocus locus;
  assert_int_equal(pb_rootlocus_compute(solver, gain, GAINS, 30, 60, &locus, NULL), PB_OK);
  size_t modes = 0;
  for (size_t b = 0; b < locus.branches; b++) {
    modes += locus.is_mode[b];
    for (size_t k = 1; k < GAINS; k++) {
      const pb_pole *p = &locus.pole[b * GAINS + k];
      assert_false(isnan(p->hz));
      assert_true(cabs(p->z - p[-1].z) < 0.01);
    }
  }
  assert_true(modes >= 8);
  assert_true(locus.smallest[20] > locus.smallest[0] * 0.999);
  double backwards[2] = {1, 0.5};
  pb_error err;
  pb_rootlocus none;
  assert_int_equal(pb_rootlocus_compute(solver, backwards, 2, 30, 60, &none, &err),
                   PB_ERR_ARGUMENT);
  pb_rootlocus_clear(&locus);
  pb_loop_solver_free(solver);
  pb_lti_free(&controller);
  pb_model_free(m);
}

static void test_refusals(void **state) {
  (void)state;
  pb_model *m = large_plant();
  pb_lti controller, closed;
  pb_loop loop = make_loop(m, &controller, 0);
  pb_error err;
  assert_int_equal(pb_loop_closed(&loop, NAN, &closed, &err), PB_ERR_ARGUMENT);
  size_t beyond[2] = {0, NY};
  loop.output = beyond;
  assert_int_equal(pb_loop_closed(&loop, 1, &closed, &err), PB_ERR_ARGUMENT);
  loop.output = output;
  loop.sign = 0.5;
  assert_int_equal(pb_loop_closed(&loop, 1, &closed, &err), PB_ERR_ARGUMENT);
  loop.sign = 1;
  controller.dt *= 2;
  pb_loop_solver *solver;
  assert_int_equal(pb_loop_solver_new(&loop, &solver, &err), PB_ERR_ARGUMENT);
  assert_null(solver);
  pb_lti_free(&controller);
  pb_model_free(m);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_frf_dense),   cmocka_unit_test(test_closed_steps),
      cmocka_unit_test(test_poles_large), cmocka_unit_test(test_poles_large_with_electronics),
      cmocka_unit_test(test_stability),   cmocka_unit_test(test_best_gain),
      cmocka_unit_test(test_rootlocus),   cmocka_unit_test(test_refusals),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
