// Unit tests of pb_loop_solver_stable on plants too large for dense eigenvalues, close to the
// border, where two poles at one place are about to leave the unit circle.
#include "support/check.h"

#include "control/loop.h"
#include "control/lti_ops.h"
#include "modal_model.h"

enum { RATE = 10000, MODES = 220, LOOPS = 2 };

static const size_t channel[LOOPS] = {0, 1};

// Loop k sees mode k at 300 Hz and half of the others, which nothing moves.
static pb_model *plant_with_a_double_mode(size_t modes, size_t loops) {
  test_mode mode[MODES];
  static double shape[MODES][2 * LOOPS];
  for (size_t k = 0; k < modes; k++) {
    double *in = shape[k], *out = in + loops;
    for (size_t j = 0; j < 2 * LOOPS; j++) shape[k][j] = 0;
    in[k % loops] = k < loops;
    out[k % loops] = 1e6;
    mode[k] = k < loops ? (test_mode){300, 0.028, in, out}
                        : (test_mode){20 * pow(1.055, (double)(k / 2)), 0.01, in, out};
  }
  return test_model(mode, modes, loops, loops, RATE, NULL);
}

// Proportional feedback that is late: it stiffens the mode and takes its damping.
static bool is_stable(size_t modes, size_t loops, double gain) {
  pb_model *m = plant_with_a_double_mode(modes, loops);
  pb_lti controller;
  pb_loop_solver *s;
  bool stable = false;
  REQUIRE(pb_lti_new(0, loops, loops, 1.0 / RATE, &controller, &err));
  for (size_t k = 0; k < loops; k++) controller.d[k * (loops + 1)] = -1;
  const pb_loop loop = {m, &controller, channel, channel, 1, 1};
  REQUIRE(pb_loop_solver_new(&loop, &s, &err));
  REQUIRE(pb_loop_solver_stable(s, gain, &stable, NULL, &err));
  pb_loop_solver_free(s);
  pb_lti_free(&controller);
  pb_model_free(m);
  return stable;
}

// The border is that of one mode with its loop, by dense eigenvalues.
static void test_double_poles(void **state) {
  (void)state;
  double low = 0.1, high = 10;
  assert_true(is_stable(1, 1, low) && !is_stable(1, 1, high));
  for (int k = 0; k < 40; k++) {
    double middle = sqrt(low * high);
    *(is_stable(1, 1, middle) ? &low : &high) = middle;
  }
  static const double off[] = {1e-2, 1e-3, 1e-4, 1e-5};
  for (size_t k = 0; k < 4; k++) {
    if (!is_stable(MODES, LOOPS, low * (1 - off[k]))) fail_msg("unstable %g below", off[k]);
    if (is_stable(MODES, LOOPS, low * (1 + off[k]))) fail_msg("stable %g above", off[k]);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_double_poles)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
