// Measured poles beside exact ones (control/pole_match.h), and how a pole is told
// (control/poles.h).
#include <math.h>
#include <string.h>

#include "control/pole_match.h"
#include "support/check.h"

static const double rate = 10000;

static pb_pole pole(double hz, double damping) {
  const double w = 2 * M_PI * hz;
  const double complex s = w * (-damping + I * sqrt(1 - damping * damping));
  return (pb_pole){cexp(s / rate), hz, damping};
}

// The nearest to each by itself would take 442.436 twice or swap the two.
static void neighbours_are_not_swapped_nor_taken_twice(void **state) {
  (void)state;
  const pb_pole exact[] = {pole(442.330, 8e-4), pole(442.437, 8e-4), pole(600, 0.01)};
  const pb_pole found[] = {pole(442.436, 8e-4), pole(442.384, 8e-4), pole(900, 0.01)};
  pb_pole of[3];
  REQUIRE(pb_pole_match(exact, 3, found, 3, rate, of, &err));
  ASSERT_NEAR(of[0].hz, 442.384, 1e-9);
  ASSERT_NEAR(of[1].hz, 442.436, 1e-9);
  assert_true(isnan(of[2].hz));  // 900 Hz is out of reach
}

static void one_pole_is_one_mode(void **state) {
  (void)state;
  const pb_pole exact[] = {pole(39.22, 1e-3), pole(39.22, 1e-3), {.hz = NAN, .damping = NAN}};
  const pb_pole found[] = {pole(39.2201, 1e-3)};
  pb_pole of[3];
  REQUIRE(pb_pole_match(exact, 3, found, 1, rate, of, &err));
  assert_int_equal(isnan(of[0].hz) + isnan(of[1].hz), 1);
  assert_true(isnan(of[2].hz));
  REQUIRE(pb_pole_match(exact, 3, NULL, 0, rate, of, &err));
  assert_true(isnan(of[0].hz));
}

static void clusters_are_closer_than_the_resolution(void **state) {
  (void)state;
  const pb_pole p[] = {pole(10, 0.01), pole(10.4, 0.01), pole(10.8, 0.01),
                       pole(12, 0.01), pole(20, 0.01),   pole(20.2, 0.01)};
  size_t cluster[6];
  assert_int_equal(pb_pole_clusters(p, 6, rate, 0.5, cluster), 2);
  static const size_t expected[] = {1, 1, 1, 0, 2, 2};
  assert_memory_equal(cluster, expected, sizeof expected);
  assert_int_equal(pb_pole_clusters(p, 6, rate, 0.1, cluster), 0);
}

static void a_pole_is_told_as_what_it_is(void **state) {
  (void)state;
  char text[96];
  pb_pole_format(pole(45, -0.003), rate, text, sizeof text);
  assert_string_equal(text, "45 Hz with damping -0.3 %");
  ASSERT_RELATIVE(pb_pole_damped_hz(pole(61.8911, 0.6823)), 45.2472, 1e-3);
  // |ln z| f_s/2π is beyond half the sample rate there: no frequency of this plant.
  pb_pole_format(pb_pole_from_z(-2e4, rate), rate, text, sizeof text);
  assert_string_equal(text, "z = -20000");
  pb_pole_format(pb_pole_from_z(1.25, rate), rate, text, sizeof text);
  assert_string_equal(text, "z = 1.25");
  assert_true(isnan(pb_pole_damped_hz(pb_pole_from_z(1.25, rate))));
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(neighbours_are_not_swapped_nor_taken_twice),
      cmocka_unit_test(one_pole_is_one_mode),
      cmocka_unit_test(clusters_are_closer_than_the_resolution),
      cmocka_unit_test(a_pole_is_told_as_what_it_is),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
