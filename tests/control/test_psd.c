// Power spectral density: a sine's power in its line, white noise's variance over all of them.
#include "support/check.h"

#include "signal/psd.h"
#include "signal/random.h"

static void test_sine(void **state) {
  (void)state;
  enum { LENGTH = 500, RATE = 1000 };
  double x[2 * LENGTH], density[LENGTH / 2 + 1], amplitude[LENGTH / 2 + 1];
  pb_psd *psd;
  for (int n = 0; n < LENGTH; n++)
    x[2 * n] = 3 * sin(2 * M_PI * 40 * n / RATE) + 0.5, x[2 * n + 1] = NAN;
  REQUIRE(pb_psd_new(RATE, LENGTH, PB_WINDOW_RECTANGULAR, &psd, &err));
  assert_int_equal(pb_psd_lines(psd), LENGTH / 2 + 1);
  pb_psd_density(psd, density);
  assert_true(isnan(density[3]));
  pb_psd_add(psd, x, 2);
  pb_psd_add(psd, x, 2);
  assert_int_equal(pb_psd_segments(psd), 2);
  pb_psd_density(psd, density);
  ASSERT_RELATIVE(density[20] * 2, 4.5, 1e-12);  // A²/2, lines are 2 Hz apart
  ASSERT_RELATIVE(density[0] * 2, 0.25, 1e-12);  // the mean is not doubled
  ASSERT_NEAR(density[21], 0, 1e-20);
  pb_cumulative_amplitude(density, LENGTH / 2 + 1, 2, 10, 100, amplitude);
  ASSERT_RELATIVE(amplitude[0], 3 / sqrt(2), 1e-12);
  ASSERT_RELATIVE(amplitude[20], 3 / sqrt(2), 1e-12);
  ASSERT_NEAR(amplitude[21], 0, 1e-9);
  pb_psd_free(psd);
}

static void test_noise(void **state) {
  (void)state;
  enum { LENGTH = 256, SEGMENTS = 400 };
  double x[LENGTH], density[LENGTH / 2 + 1], total[2] = {0};
  for (int w = 0; w < 2; w++) {
    pb_psd *psd;
    pb_random random;
    pb_random_seed(&random, 5, 0);
    REQUIRE(pb_psd_new(50, LENGTH, w ? PB_WINDOW_HANN : PB_WINDOW_RECTANGULAR, &psd, &err));
    for (int s = 0; s < SEGMENTS; s++) {
      for (int n = 0; n < LENGTH; n++) x[n] = 2 * pb_random_gaussian(&random);
      pb_psd_add(psd, x, 1);
    }
    pb_psd_density(psd, density);
    for (int k = 0; k <= LENGTH / 2; k++) total[w] += density[k] * 50 / LENGTH;
    ASSERT_RELATIVE(total[w], 4, 0.02);  // variance; standard deviation of the estimate 0.4 %
    pb_psd_free(psd);
  }
  assert_true(total[0] != total[1]);
}

static void test_refused(void **state) {
  (void)state;
  pb_psd *psd;
  pb_error err = {0};
  assert_int_equal(pb_psd_new(50, 3, PB_WINDOW_HANN, &psd, &err), PB_ERR_ARGUMENT);
  assert_null(psd);
  assert_int_equal(pb_psd_new(0, 100, PB_WINDOW_HANN, &psd, &err), PB_ERR_ARGUMENT);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_sine), cmocka_unit_test(test_noise),
                                     cmocka_unit_test(test_refused)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
