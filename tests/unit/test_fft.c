// Unit tests of signal/fft.h: against the defining sum, for lengths of every kind.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdlib.h>

#include "signal/fft.h"
#include "signal/random.h"

static double complex *random_vector(size_t n, uint64_t seed) {
  double complex *x = malloc(n * sizeof *x);
  pb_random random;
  pb_random_seed(&random, seed, 0);
  for (size_t k = 0; k < n; k++) {
    double re = pb_random_gaussian(&random), im = pb_random_gaussian(&random);
    x[k] = CMPLX(re, im);
  }
  return x;
}

static double complex defining_sum(const double complex *x, size_t n, size_t k) {
  double complex sum = 0;
  for (size_t j = 0; j < n; j++) {
    double angle = -2 * M_PI * (double)(j * k % n) / (double)n;
    sum += x[j] * CMPLX(cos(angle), sin(angle));
  }
  return sum;
}

static void check_length(size_t n) {
  pb_fft fft;
  assert_int_equal(pb_fft_init(n, &fft, NULL), PB_OK);
  double complex *x = random_vector(n, n), *X = malloc(n * sizeof *X),
                 *back = malloc(n * sizeof *X);
  pb_fft_forward(&fft, x, X);
  double worst = 0;
  for (size_t k = 0; k < n; k += 1 + n / 97) {
    worst = fmax(worst, cabs(X[k] - defining_sum(x, n, k)) / sqrt((double)n));
  }
  if (!(worst < 1e-12)) fail_msg("length %zu: error %g", n, worst);
  pb_fft_inverse(&fft, X, back);
  pb_fft_forward(&fft, x, x);
  for (size_t k = 0; k < n; k++) {
    assert_true(x[k] == X[k]);  // in place gives the same bits
  }
  pb_fft_inverse(&fft, x, x);
  for (size_t k = 0; k < n; k++) assert_true(x[k] == back[k]);
  double complex *original = random_vector(n, n);
  for (size_t k = 0; k < n; k++) assert_true(cabs(back[k] - original[k]) < 1e-12);
  free(original);
  free(back);
  free(X);
  free(x);
  pb_fft_clear(&fft);
}

static void test_lengths(void **state) {
  (void)state;
  static const size_t length[] = {1,    2,    3,    4,    5,    6,    7,    8,   9,
                                  10,   11,   12,   13,   16,   17,   35,   100, 210,
                                  1000, 1024, 1009, 2187, 4096, 5005, 10000};
  for (size_t i = 0; i < sizeof length / sizeof *length; i++) check_length(length[i]);
}

static void test_refusals(void **state) {
  (void)state;
  pb_fft fft;
  pb_error err;
  assert_int_equal(pb_fft_init(0, &fft, &err), PB_ERR_ARGUMENT);
  assert_int_equal(pb_fft_init(PB_FFT_MAX_LENGTH + 1, &fft, &err), PB_ERR_ARGUMENT);
  assert_null(fft.root);
  pb_fft_clear(&fft);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_lengths),
      cmocka_unit_test(test_refusals),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
