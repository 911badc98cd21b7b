// Unit tests of signal/spectrum.h and signal/periodic.h on systems whose response is known in
// closed form, with and without noise; the quoted variance is checked against the scatter of many
// runs.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdlib.h>

#include "signal/excitation.h"
#include "signal/periodic.h"
#include "signal/random.h"
#include "signal/spectrum.h"

// y_o(k) = Σ_i g_oi v_i(k), v_i(k) = p_i v_i(k−1) + u_i(k−1): two inputs, two outputs.
static const double pole[2] = {0.9, 0.5};
static const double gain[2][2] = {{1, 0.3}, {-0.2, 2}};

static double complex exact(size_t o, size_t i, double hz, double rate) {
  double complex z = cexp(CMPLX(0, 2 * M_PI * hz / rate));
  return gain[o][i] / (z - pole[i]);
}

static void respond(const double *u, size_t n, double *y) {
  double v[2] = {0, 0};
  for (size_t k = 0; k < n; k++) {
    for (size_t o = 0; o < 2; o++) y[2 * k + o] = gain[o][0] * v[0] + gain[o][1] * v[1];
    for (size_t i = 0; i < 2; i++) v[i] = pole[i] * v[i] + u[2 * k + i];
  }
}

static void white(double *x, size_t count, double rms, uint64_t seed) {
  pb_random random;
  pb_random_seed(&random, seed, 99);
  for (size_t k = 0; k < count; k++) x[k] += rms * pb_random_gaussian(&random);
}

static void test_windows(void **state) {
  (void)state;
  // Sums of the periodic windows are n a_0, and their peaks 1 (flat top within its last digit).
  static const double a0[] = {1, 0.5, 0.54, 0.42, 0.21557895};
  double w[64];
  for (int kind = PB_WINDOW_RECTANGULAR; kind <= PB_WINDOW_FLAT_TOP; kind++) {
    pb_window_fill((pb_window)kind, 64, w);
    double sum = 0;
    for (int k = 0; k < 64; k++) sum += w[k];
    assert_true(fabs(sum - 64 * a0[kind]) < 1e-12);
    assert_true(fabs(w[32] - 1) < 1e-7);
  }
  double x[50];
  for (int k = 0; k < 50; k++) x[k] = 3 + 0.7 * k;
  pb_detrend_apply(PB_DETREND_LINEAR, x, 50);
  for (int k = 0; k < 50; k++) assert_true(fabs(x[k]) < 1e-12);
  pb_window window;
  assert_true(pb_window_parse("flattop", &window) && window == PB_WINDOW_FLAT_TOP);
  assert_false(pb_window_parse("kaiser", &window));
}

enum { N = 100000, RATE = 1000 };

static void make_noise(double *u, double *y, double noise, uint64_t seed) {
  for (size_t k = 0; k < 2 * N; k++) u[k] = 0;
  white(u, 2 * N, 1, seed);
  respond(u, N, y);
  white(y, 2 * N, noise, seed + 1000);
}

static void test_welch_mimo(void **state) {
  (void)state;
  double *u = malloc(2 * N * sizeof *u), *y = malloc(2 * N * sizeof *y);
  make_noise(u, y, 0.5, 1);
  pb_welch_options options = {
      .sample_rate = RATE, .length = 500, .overlap = 0.5, .window = PB_WINDOW_HANN};
  pb_frf frf;
  assert_int_equal(pb_welch_record(&options, u, 2, y, 2, N, PB_ESTIMATE_H1, &frf, NULL), PB_OK);
  assert_int_equal(frf.nf, 249);
  assert_true(frf.averages > 0.85 * N / 500 * 2 * 0.9 && frf.averages < 2.0 * N / 500);
  double chi2 = 0, worst = 0;
  for (size_t f = 5; f < frf.nf; f++) {
    for (size_t o = 0; o < 2; o++) {
      for (size_t i = 0; i < 2; i++) {
        size_t k = (f * 2 + o) * 2 + i;
        double error = cabs(frf.h[k] - exact(o, i, frf.frequency_hz[f], RATE));
        chi2 += error * error / frf.variance[k];
        worst = fmax(worst, error / sqrt(frf.variance[k]));
      }
    }
  }
  chi2 /= 4.0 * (double)(frf.nf - 5);
  // Lines are correlated by the window: 976 values of mean 1.
  if (!(chi2 > 0.85 && chi2 < 1.15)) fail_msg("error²/variance = %g", chi2);
  assert_true(worst < 5);
  // γ² = explained power / all power, with white inputs of power 1 and noise of power ¼.
  double hz = frf.frequency_hz[100], p = 0;
  for (size_t i = 0; i < 2; i++) p += pow(cabs(exact(1, i, hz, RATE)), 2);
  assert_true(fabs(frf.coherence[100 * 2 + 1] - p / (p + 0.25)) < 0.03);
  pb_frf_clear(&frf);
  free(u);
  free(y);
}

// Noise on the input's reading biases H1 low and leaves H2 alone; noise on the output the reverse.
static void test_h1_h2(void **state) {
  (void)state;
  double *u = calloc(N, sizeof *u), *y = malloc(N * sizeof *y);
  white(u, N, 1, 5);
  for (size_t k = 0; k < N; k++) y[k] = 2 * u[k];
  white(u, N, 0.5, 6);
  pb_welch_options options = {
      .sample_rate = RATE, .length = 200, .overlap = 0, .f1 = 100, .f2 = 200};
  pb_frf h1, h2;
  assert_int_equal(pb_welch_record(&options, u, 1, y, 1, N, PB_ESTIMATE_H1, &h1, NULL), PB_OK);
  assert_int_equal(pb_welch_record(&options, u, 1, y, 1, N, PB_ESTIMATE_H2, &h2, NULL), PB_OK);
  assert_true(h1.frequency_hz[0] == 100 && h1.frequency_hz[h1.nf - 1] == 200);
  double complex m1 = 0, m2 = 0;
  for (size_t f = 0; f < h1.nf; f++) {
    m1 += h1.h[f] / (double)h1.nf;
    m2 += h2.h[f] / (double)h1.nf;
  }
  assert_true(cabs(m1 - 2 / 1.25) < 0.02);
  assert_true(cabs(m2 - 2) < 0.02);
  assert_true(fabs(h1.averages - N / 200) < 1e-9);
  pb_frf_clear(&h1);
  pb_frf_clear(&h2);
  free(u);
  free(y);
}

static void test_welch_gap_and_refusals(void **state) {
  (void)state;
  pb_welch_options options = {.sample_rate = 100, .length = 10, .overlap = 0.5};
  pb_welch *welch;
  pb_error err;
  pb_frf frf;
  assert_int_equal(pb_welch_new(&options, 1, 1, &welch, &err), PB_OK);
  double u = 1, y = 1;
  for (int k = 0; k < 9; k++) assert_false(pb_welch_push(welch, &u, &y));
  pb_welch_break(welch);
  for (int k = 0; k < 9; k++) assert_false(pb_welch_push(welch, &u, &y));
  assert_true(pb_welch_push(welch, &u, &y));
  assert_int_equal(pb_welch_estimate(welch, PB_ESTIMATE_H1, &frf, &err), PB_ERR_STATE);
  y = NAN;
  for (int k = 0; k < 10; k++) pb_welch_push(welch, &u, &y);
  assert_int_equal(pb_welch_estimate(welch, PB_ESTIMATE_H1, &frf, &err), PB_ERR_NUMERIC);
  assert_null(frf.h);
  pb_welch_free(welch);
  assert_int_equal(pb_welch_new(&options, 2, 1, &welch, &err), PB_OK);
  for (int k = 0; k < 100; k++) pb_welch_push(welch, (double[]){k % 7, 1}, (double[]){1});
  assert_int_equal(pb_welch_estimate(welch, PB_ESTIMATE_H2, &frf, &err), PB_ERR_ARGUMENT);
  pb_welch_free(welch);
  options.overlap = 1;
  assert_int_equal(pb_welch_new(&options, 1, 1, &welch, &err), PB_ERR_ARGUMENT);
  options = (pb_welch_options){.sample_rate = NAN, .length = 10};
  assert_int_equal(pb_welch_new(&options, 1, 1, &welch, &err), PB_ERR_ARGUMENT);
  assert_null(welch);
}

// Fully correlated inputs: no line can be told apart, and the estimate says so.
static void test_unexcited(void **state) {
  (void)state;
  double *u = malloc(2 * 2000 * sizeof *u), *y = calloc(2000, sizeof *y);
  pb_random random;
  pb_random_seed(&random, 1, 1);
  for (size_t k = 0; k < 2000; k++) u[2 * k] = u[2 * k + 1] = pb_random_gaussian(&random);
  pb_welch_options options = {.sample_rate = 100, .length = 50};
  pb_frf frf;
  assert_int_equal(pb_welch_record(&options, u, 2, y, 1, 2000, PB_ESTIMATE_H1, &frf, NULL), PB_OK);
  for (size_t f = 0; f < frf.nf; f++) {
    assert_true(frf.coherence[f] == 0 && isinf(frf.variance[2 * f]) && frf.h[2 * f] == 0);
  }
  pb_frf_clear(&frf);
  free(u);
  free(y);
}

enum { PERIOD = 500, PERIODS = 12, TRANSIENT = 1 };

static pb_periodic *run_periodic(double noise, uint64_t seed) {
  pb_multisine_spec spec = {.sample_rate = RATE, .f1 = 4, .f2 = 400, .rms = 1, .seed = 5};
  double *u = malloc(2 * PERIOD * 2 * sizeof *u), *all = malloc(PERIODS * PERIOD * 2 * sizeof *all);
  double *y = malloc(PERIODS * PERIOD * 2 * sizeof *y);
  assert_int_equal(pb_excite_orthogonal(&spec, PERIOD, 2, u, NULL), PB_OK);
  pb_periodic_options options = {RATE, PERIOD, 2, 4, 400};
  pb_periodic *periodic;
  assert_int_equal(pb_periodic_new(&options, 2, 2, &periodic, NULL), PB_OK);
  for (size_t e = 0; e < 2; e++) {
    for (size_t k = 0; k < PERIODS * PERIOD * 2; k++) all[k] = u[e * PERIOD * 2 + k % (PERIOD * 2)];
    respond(all, PERIODS * PERIOD, y);
    white(y, PERIODS * PERIOD * 2, noise, seed * 2 + e);
    for (size_t k = TRANSIENT * PERIOD; k < PERIODS * PERIOD; k++) {
      pb_periodic_push(periodic, e, all + 2 * k, y + 2 * k);
    }
  }
  free(u);
  free(all);
  free(y);
  return periodic;
}

static void test_periodic_exact(void **state) {
  (void)state;
  pb_periodic *periodic = run_periodic(0, 1);
  assert_int_equal(pb_periodic_count(periodic, 1), PERIODS - TRANSIENT);
  pb_frf frf;
  assert_int_equal(pb_periodic_estimate(periodic, &frf, NULL), PB_OK);
  for (size_t f = 0; f < frf.nf; f++) {
    for (size_t k = 0; k < 4; k++) {
      double complex h = exact(k / 2, k % 2, frf.frequency_hz[f], RATE);
      assert_true(cabs(frf.h[4 * f + k] - h) < 1e-11 * cabs(h) + 1e-12);
      assert_true(frf.variance[4 * f + k] < 1e-20);
    }
    assert_true(frf.coherence[2 * f] > 1 - 1e-12);
  }
  pb_frf_clear(&frf);
  pb_periodic_free(periodic);
}

static void test_periodic_noise(void **state) {
  (void)state;
  double chi2 = 0;
  size_t values = 0;
  for (uint64_t seed = 1; seed <= 5; seed++) {
    pb_periodic *periodic = run_periodic(0.3, seed);
    pb_frf frf;
    assert_int_equal(pb_periodic_estimate(periodic, &frf, NULL), PB_OK);
    for (size_t f = 0; f < frf.nf; f++) {
      for (size_t k = 0; k < 4; k++) {
        double error = cabs(frf.h[4 * f + k] - exact(k / 2, k % 2, frf.frequency_hz[f], RATE));
        chi2 += error * error / frf.variance[4 * f + k];
        values++;
      }
    }
    pb_frf_clear(&frf);
    pb_periodic_free(periodic);
  }
  // The variance pools two experiments of 11 periods: E[1/s²] = 20/19 with 2·2·10 degrees of
  // freedom.
  chi2 /= (double)values;
  if (!(fabs(chi2 - 20.0 / 19) < 0.08)) fail_msg("error²/variance = %g", chi2);
}

static void test_periodic_refusals(void **state) {
  (void)state;
  pb_periodic *periodic;
  pb_error err;
  pb_frf frf;
  pb_periodic_options options = {100, 10, 1, 10, 40};
  assert_int_equal(pb_periodic_new(&options, 2, 1, &periodic, &err), PB_ERR_ARGUMENT);
  options.f2 = NAN;
  assert_int_equal(pb_periodic_new(&options, 1, 1, &periodic, &err), PB_ERR_ARGUMENT);
  assert_null(periodic);
  options.f2 = 40;
  assert_int_equal(pb_periodic_new(&options, 1, 1, &periodic, &err), PB_OK);
  for (int k = 0; k < 15; k++) pb_periodic_push(periodic, 0, (double[]){k % 3}, (double[]){1});
  pb_periodic_break(periodic);
  for (int k = 0; k < 9; k++) pb_periodic_push(periodic, 0, (double[]){k % 3}, (double[]){1});
  assert_int_equal(pb_periodic_count(periodic, 0), 1);
  assert_int_equal(pb_periodic_estimate(periodic, &frf, &err), PB_ERR_STATE);
  pb_periodic_push(periodic, 0, (double[]){1}, (double[]){INFINITY});
  assert_int_equal(pb_periodic_estimate(periodic, &frf, &err), PB_ERR_NUMERIC);
  pb_periodic_free(periodic);
}

// A gap parts a decay; of experiments that are not equally long nothing is taken out.
static void test_periodic_gaps(void **state) {
  (void)state;
  const pb_periodic_options options = {100, 10, 2, 10, 40};
  pb_periodic *periodic;
  pb_frf frf;
  assert_int_equal(pb_periodic_new(&options, 1, 1, &periodic, NULL), PB_OK);
  for (size_t e = 0; e < 2; e++) {
    for (int k = 0; k < 7; k++) pb_periodic_push(periodic, e, (double[]){0}, (double[]){0});
    pb_periodic_break(periodic);
    for (size_t k = 0; k < 20 + 10 * e; k++)
      pb_periodic_push(periodic, e, (double[]){k % 10 == 0}, (double[]){pow(0.9, (double)k)});
  }
  assert_int_equal(pb_periodic_difference(periodic, &frf, NULL), PB_OK);
  pb_frf_clear(&frf);
  double explained = 1;
  assert_int_equal(pb_periodic_settle(periodic, (double complex[]){0.9}, 1, &explained, NULL),
                   PB_OK);
  assert_true(explained == 0);
  pb_periodic_break(periodic);
  for (int k = 0; k < 10; k++) pb_periodic_push(periodic, 1, (double[]){k == 0}, (double[]){1});
  assert_int_equal(pb_periodic_difference(periodic, &frf, NULL), PB_ERR_STATE);
  pb_periodic_free(periodic);
}

// A mass on a spring of `hz` (0: free), moved by a multisine from rest, with noise on the force and
// on the reading; kick: a speed that it has at the start.
typedef struct soft_mass {
  double hz, force_noise, noise, kick;
  uint64_t seed;
} soft_mass;

// x(k+1) = (2 − q) x(k) − x(k−1) + u(k), y = x.
static double complex soft_exact(double hz, double line) {
  double complex z = cexp(CMPLX(0, 2 * M_PI * line / RATE));
  return 1 / (z - 2 * cos(2 * M_PI * hz / RATE) + 1 / z);
}

static pb_periodic *run_soft(const soft_mass *m, size_t periods) {
  pb_multisine_spec spec = {.sample_rate = RATE, .f1 = 4, .f2 = 400, .rms = 1, .seed = 5};
  double u[PERIOD], before = 0, x = m->kick;
  assert_int_equal(pb_excite_multisine(&spec, PERIOD, 1, u, NULL), PB_OK);
  pb_periodic_options options = {RATE, PERIOD, 1, 4, 400};
  pb_periodic *periodic;
  assert_int_equal(pb_periodic_new(&options, 1, 1, &periodic, NULL), PB_OK);
  pb_random random;
  pb_random_seed(&random, m->seed, 7);
  for (size_t k = 0; k < periods * PERIOD; k++) {
    double y = x + m->noise * pb_random_gaussian(&random);
    pb_periodic_push(periodic, 0, &u[k % PERIOD], &y);
    double force = u[k % PERIOD] + m->force_noise * pb_random_gaussian(&random);
    double next = 2 * cos(2 * M_PI * m->hz / RATE) * x - before + force;
    before = x;
    x = next;
  }
  return periodic;
}

// What never dies and what outlasts the record is told from the response: the level of the periods
// shows a ramp that their lines have alike.
static void test_periodic_trends(void **state) {
  (void)state;
  static const double hz[] = {0, 0.0003, 0.001, 0.003, 0.01};
  for (size_t k = 0; k < sizeof hz / sizeof *hz; k++) {
    for (size_t periods = 2; periods <= 5; periods += 3) {
      pb_periodic *periodic = run_soft(&(soft_mass){.hz = hz[k], .kick = 3}, periods);
      double explained, worst = 0;
      pb_frf frf;
      assert_int_equal(pb_periodic_settle(periodic, NULL, 0, &explained, NULL), PB_OK);
      assert_int_equal(pb_periodic_estimate(periodic, &frf, NULL), PB_OK);
      for (size_t f = 0; f < frf.nf; f++) {
        double complex h = soft_exact(hz[k], frf.frequency_hz[f]);
        worst = fmax(worst, cabs(frf.h[f] / h - 1));
      }
      if (!(worst < 1e-6)) fail_msg("%g Hz, %zu periods: error %g", hz[k], periods, worst);
      assert_true(frf.coherence[0] > 0.999999);
      pb_frf_clear(&frf);
      pb_periodic_free(periodic);
    }
  }
}

// What the trend leaves open is in the variance: of noise on the reading all of it, and of noise on
// the force, which walks away with the mass, as far as few periods can tell.
static void test_periodic_trend_noise(void **state) {
  (void)state;
  static const soft_mass mass[2] = {{.noise = 1, .kick = 1}, {.force_noise = 0.02, .kick = 1}};
  static const double most[2] = {0.005, 0.1};
  for (int kind = 0; kind < 2; kind++) {
    double beyond = 0, chi2 = 0, all = 0;
    for (uint64_t seed = 1; seed <= 40; seed++) {
      soft_mass m = mass[kind];
      m.seed = seed;
      pb_periodic *periodic = run_soft(&m, 8);
      double explained;
      pb_frf frf;
      assert_int_equal(pb_periodic_settle(periodic, NULL, 0, &explained, NULL), PB_OK);
      assert_int_equal(pb_periodic_estimate(periodic, &frf, NULL), PB_OK);
      for (size_t f = 0; f < frf.nf; f++, all++) {
        double error = cabs(frf.h[f] - soft_exact(0, frf.frequency_hz[f]));
        chi2 += error * error / frf.variance[f];
        beyond += error * error > 9 * frf.variance[f];
      }
      pb_frf_clear(&frf);
      pb_periodic_free(periodic);
    }
    // |e|²/s² is an F(2, 14): 7/6 in the mean, and 0.0031 of it beyond 9.
    if (!(beyond / all < most[kind])) fail_msg("kind %d: %g beyond 3 s", kind, beyond / all);
    if (kind == 0 && !(fabs(chi2 / all - 7.0 / 6) < 0.15)) fail_msg("|e|²/s² = %g", chi2 / all);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_windows),
      cmocka_unit_test(test_welch_mimo),
      cmocka_unit_test(test_h1_h2),
      cmocka_unit_test(test_welch_gap_and_refusals),
      cmocka_unit_test(test_unexcited),
      cmocka_unit_test(test_periodic_exact),
      cmocka_unit_test(test_periodic_noise),
      cmocka_unit_test(test_periodic_refusals),
      cmocka_unit_test(test_periodic_gaps),
      cmocka_unit_test(test_periodic_trends),
      cmocka_unit_test(test_periodic_trend_noise),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
