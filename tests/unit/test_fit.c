// Unit tests of control/fit.h: modes and zeros recovered from responses of known systems, clean and
// noisy, light and heavy damping, close pairs over many channels.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdlib.h>

#include "control/fit.h"
#include "modal_model.h"
#include "signal/excitation.h"
#include "signal/random.h"
#include "signal/spectrum.h"

enum { RATE = 10000 };

// Exact sampled responses of a model at lines f1, f1 + df, …; noise of relative size is added.
static pb_frf exact_frf(const pb_model *m, double f1, double df, size_t nf, double noise) {
  pb_frf frf;
  assert_int_equal(pb_frf_new(nf, m->ny, m->nu, &frf, NULL), PB_OK);
  for (size_t f = 0; f < nf; f++) frf.frequency_hz[f] = f1 + df * (double)f;
  assert_int_equal(pb_model_frf(m, PB_SAMPLED, frf.frequency_hz, nf, frf.h, NULL), PB_OK);
  pb_random random;
  pb_random_seed(&random, 3, 0);
  for (size_t k = 0; k < nf * m->ny * m->nu; k++) {
    double sigma = noise * cabs(frf.h[k]) / sqrt(2);
    double re = pb_random_gaussian(&random), im = pb_random_gaussian(&random);
    frf.variance[k] = 2 * sigma * sigma;
    frf.h[k] += sigma * CMPLX(re, im);
  }
  return frf;
}

static void check_mode(const pb_fit *fit, double hz, double damping, double tolerance) {
  double w = 2 * M_PI * hz / RATE;
  double complex s = CMPLX(-damping * w, w * sqrt(1 - damping * damping));
  pb_pole wanted = pb_pole_from_z(cexp(s), RATE);
  const pb_pole *p = pb_pole_nearest(fit->pole, fit->poles, wanted, RATE);
  assert_non_null(p);
  if (!(fabs(p->hz / hz - 1) < tolerance * 0.1 && fabs(p->damping / damping - 1) < tolerance)) {
    fail_msg("mode %g Hz, %g: fitted %.9g Hz, %.9g", hz, damping, p->hz, p->damping);
  }
}

// A force-sensor response with a known zero: H = −(s² + 2ζω_z s + ω_z²)/(s² + 2ζω_p s + ω_p²)
// sampled.
static void test_siso(void **state) {
  (void)state;
  double wp = 2 * M_PI * 93.9, wz = 2 * M_PI * 38.9, in[1] = {1}, out[1] = {wp * wp - wz * wz};
  double direct[1] = {-1};
  static const double damping[] = {0.003, 0.02, 0.2};
  for (size_t d = 0; d < 3; d++) {
    test_mode mode[1] = {{93.9, damping[d], in, out}};
    pb_model *m = test_model(mode, 1, 1, 1, RATE, direct);
    pb_frf frf = exact_frf(m, 10, 1, 300, 0);
    pb_fit_options options = {.sample_rate = RATE};
    pb_fit_channel channel = {0, 0};
    pb_fit fit;
    pb_pole_list zeros;
    assert_int_equal(pb_fit_frf(&frf, &channel, 1, &options, &fit, NULL), PB_OK);
    check_mode(&fit, 93.9, damping[d], 1e-6);
    assert_true(fit.error < 1e-7);
    for (size_t f = 0; f < frf.nf; f += 17) {
      assert_true(cabs(pb_fit_evaluate(&fit, 0, frf.frequency_hz[f]) - frf.h[f]) <
                  1e-6 * cabs(frf.h[f]));
    }
    // The zero is where the sampled response vanishes.
    assert_int_equal(pb_fit_zeros(&fit, 0, &zeros, NULL), PB_OK);
    pb_pole wanted = pb_pole_from_z(cexp(CMPLX(0, wz / RATE)), RATE);
    const pb_pole *zero = pb_pole_nearest(zeros.item, zeros.count, wanted, RATE);
    double complex h;
    pb_model_evaluate(m, PB_SAMPLED, zero->z, &h, NULL);
    if (!(cabs(h) < 1e-6) || fabs(zero->hz / 38.9 - 1) > 0.01)
      fail_msg("zero at %g Hz: %g", zero->hz, cabs(h));
    pb_pole_list_clear(&zeros);
    pb_fit_clear(&fit);
    pb_frf_clear(&frf);
    pb_model_free(m);
  }
}

enum { STRUTS = 6, MODES = 7 };
static const double hexapod_hz[MODES] = {39.02, 39.05, 77.8, 122.7, 122.9, 141.9, 751};
static const double hexapod_damping[MODES] = {0.004, 0.0045, 0.006, 0.01, 0.011, 0.012, 0.005};
static double shape[MODES][STRUTS], reading[MODES][STRUTS];

// Six modes, two near pairs of them, seen by six struts, and one far above the band.
static pb_model *hexapod(void) {
  test_mode mode[MODES];
  pb_random random;
  pb_random_seed(&random, 11, 0);
  double direct[STRUTS * STRUTS] = {0};
  for (size_t i = 0; i < STRUTS; i++) direct[i * (STRUTS + 1)] = -0.8;
  for (size_t k = 0; k < MODES; k++) {
    for (size_t i = 0; i < STRUTS; i++) {
      shape[k][i] = pb_random_gaussian(&random);
      double w = 2 * M_PI * hexapod_hz[k];
      reading[k][i] = 0.3 * shape[k][i] * w * w / STRUTS;
    }
    mode[k] = (test_mode){hexapod_hz[k], hexapod_damping[k], shape[k], reading[k]};
  }
  return test_model(mode, MODES, STRUTS, STRUTS, RATE, direct);
}

static void all_channels(pb_fit_channel *channel) {
  for (size_t k = 0; k < STRUTS * STRUTS; k++)
    channel[k] = (pb_fit_channel){k / STRUTS, k % STRUTS};
}

static void test_near_pairs(void **state) {
  (void)state;
  pb_model *m = hexapod();
  pb_frf frf = exact_frf(m, 10, 0.5, 500, 0);
  pb_fit_channel channel[STRUTS * STRUTS];
  all_channels(channel);
  pb_fit_options options = {.sample_rate = RATE};
  pb_fit fit;
  assert_int_equal(pb_fit_frf(&frf, channel, STRUTS * STRUTS, &options, &fit, NULL), PB_OK);
  for (size_t k = 0; k < 6; k++) check_mode(&fit, hexapod_hz[k], hexapod_damping[k], 1e-4);
  for (size_t k = 1; k < fit.poles; k++) assert_true(fit.pole[k].hz >= fit.pole[k - 1].hz);
  pb_fit_clear(&fit);
  // Two channels only see both members of the pairs as well.
  assert_int_equal(pb_fit_frf(&frf, channel, 2, &options, &fit, NULL), PB_OK);
  for (size_t k = 0; k < 6; k++) check_mode(&fit, hexapod_hz[k], hexapod_damping[k], 1e-2);
  pb_fit_clear(&fit);
  pb_frf_clear(&frf);
  pb_model_free(m);
}

// 1 % noise: weighted by its variance the modes come within 1 % in damping, and the order stays
// low.
static void test_noisy(void **state) {
  (void)state;
  pb_model *m = hexapod();
  pb_frf frf = exact_frf(m, 10, 0.25, 1000, 0.01);
  pb_fit_channel channel[STRUTS * STRUTS];
  all_channels(channel);
  pb_fit_options options = {.sample_rate = RATE, .weight = PB_FIT_NOISE};
  pb_fit fit;
  assert_int_equal(pb_fit_frf(&frf, channel, STRUTS * STRUTS, &options, &fit, NULL), PB_OK);
  assert_true(fit.poles <= 12);
  for (size_t k = 0; k < 6; k++) check_mode(&fit, hexapod_hz[k], hexapod_damping[k], 0.01);
  pb_fit_clear(&fit);
  pb_frf_clear(&frf);
  pb_model_free(m);
}

// From a Welch estimate of a simulated record with 1 % measurement noise.
static void test_welch(void **state) {
  (void)state;
  enum { N = 400000 };
  double wp = 2 * M_PI * 93.9, in[1] = {1}, out[1] = {0.83 * wp * wp}, direct[1] = {-1};
  test_mode mode[1] = {{93.9, 0.01, in, out}};
  pb_model *m = test_model(mode, 1, 1, 1, RATE, direct);
  double *u = malloc(N * sizeof *u), *y = malloc(N * sizeof *y);
  pb_noise_spec noise = {.sample_rate = RATE, .f1 = 1, .f2 = 500, .rms = 1, .seed = 2};
  assert_int_equal(pb_excite_noise(&noise, N, 1, u, NULL), PB_OK);
  pb_state *s = pb_state_new(m);
  pb_random random;
  pb_random_seed(&random, 9, 0);
  for (size_t k = 0; k < N; k++) {
    pb_step_output(m, s, &y[k]);
    pb_step_advance(m, s, &u[k]);
    y[k] += 0.05 * pb_random_gaussian(&random);
  }
  pb_welch_options welch = {.sample_rate = RATE,
                            .length = 20000,
                            .overlap = 0.5,
                            .window = PB_WINDOW_HANN,
                            .f1 = 10,
                            .f2 = 400};
  pb_frf frf;
  assert_int_equal(pb_welch_record(&welch, u, 1, y, 1, N, PB_ESTIMATE_H1, &frf, NULL), PB_OK);
  pb_fit_options options = {.sample_rate = RATE, .weight = PB_FIT_NOISE};
  pb_fit_channel channel = {0, 0};
  pb_fit fit;
  pb_pole_list zeros;
  assert_int_equal(pb_fit_frf(&frf, &channel, 1, &options, &fit, NULL), PB_OK);
  // Hann windows of 2 s widen a resonance of 1.9 Hz half-width by about 5 %.
  check_mode(&fit, 93.9, 0.01, 0.08);
  assert_int_equal(pb_fit_zeros(&fit, 0, &zeros, NULL), PB_OK);
  pb_pole wanted = pb_pole_from_z(cexp(CMPLX(0, 2 * M_PI * 38.7 / RATE)), RATE);
  assert_true(fabs(pb_pole_nearest(zeros.item, zeros.count, wanted, RATE)->hz / 38.715 - 1) < 0.01);
  pb_pole_list_clear(&zeros);
  pb_fit_clear(&fit);
  pb_frf_clear(&frf);
  free(s);
  free(u);
  free(y);
  pb_model_free(m);
}

static void test_refusals(void **state) {
  (void)state;
  pb_model *m = hexapod();
  pb_frf frf = exact_frf(m, 10, 1, 50, 0);
  pb_fit_channel channel = {0, 0}, beyond = {6, 0};
  pb_fit fit;
  pb_error err;
  pb_fit_options options = {.sample_rate = RATE};
  assert_int_equal(pb_fit_frf(&frf, &beyond, 1, &options, &fit, &err), PB_ERR_ARGUMENT);
  options.f1 = 20, options.f2 = 22;
  assert_int_equal(pb_fit_frf(&frf, &channel, 1, &options, &fit, &err), PB_ERR_ARGUMENT);
  options.f2 = NAN;
  assert_int_equal(pb_fit_frf(&frf, &channel, 1, &options, &fit, &err), PB_ERR_ARGUMENT);
  options = (pb_fit_options){.sample_rate = RATE};
  frf.h[36] = NAN;
  assert_int_equal(pb_fit_frf(&frf, &channel, 1, &options, &fit, &err), PB_ERR_NUMERIC);
  assert_null(fit.pole);
  pb_frf_clear(&frf);
  pb_model_free(m);
}

// The highest order that the lines allow, odd: it is spread as one pole more.
static void test_odd_order(void **state) {
  (void)state;
  const double in[1] = {1}, out[1] = {1e5};
  test_mode mode[3] = {{20, 0.02, in, out}, {45, 0.02, in, out}, {80, 0.02, in, out}};
  pb_model *m = test_model(mode, 3, 1, 1, RATE, NULL);
  pb_frf frf = exact_frf(m, 10, 10, 9, 0);
  pb_fit_channel channel = {0, 0};
  pb_fit_options options = {.sample_rate = RATE, .poles = 7};
  pb_fit fit;
  assert_int_equal(pb_fit_frf(&frf, &channel, 1, &options, &fit, NULL), PB_OK);
  for (size_t k = 0; k < 3; k++) check_mode(&fit, mode[k].hz, 0.02, 1e-3);
  pb_fit_clear(&fit);
  pb_frf_clear(&frf);
  pb_model_free(m);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_siso),      cmocka_unit_test(test_near_pairs),
      cmocka_unit_test(test_noisy),     cmocka_unit_test(test_welch),
      cmocka_unit_test(test_odd_order), cmocka_unit_test(test_refusals),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
