// The experiments of the tools on a plant stepped in the test: every excitation, several inputs, an
// added controller, a late and lossy bus, divergence, equal bytes for equal seeds.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdlib.h>

#include "analysis.h"
#include "control/iff.h"
#include "control/loop.h"
#include "experiment.h"
#include "fake_session.h"
#include "modal_model.h"

enum { RATE = 2000 };

static pb_model *plant(void) {
  static const double in[3][2] = {{1, 0.4}, {-0.5, 1}, {0.3, 0.3}};
  static double out[3][3];
  static const double hz[3] = {40, 95, 310}, damping[3] = {0.02, 0.03, 0.02};
  test_mode mode[3];
  for (int k = 0; k < 3; k++) {
    double w = 2 * M_PI * hz[k];
    for (int i = 0; i < 2; i++) out[k][i] = 0.4 * w * w * in[k][i];
    out[k][2] = 1;
    mode[k] = (test_mode){hz[k], damping[k], in[k], out[k]};
  }
  static const double direct[6] = {-1, 0, 0, 0, -1, 0};
  return test_model(mode, 3, 2, 3, RATE, direct);
}

static const size_t both[2] = {0, 1}, all[3] = {0, 1, 2};
static const pb_experiment_channels channels = {both, all, 2, 3};

static pb_experiment_options standard(pb_excitation excitation) {
  return (pb_experiment_options){.excitation = excitation,
                                 .f1 = 5,
                                 .f2 = 500,
                                 .rms = 1,
                                 .resolution = 1,
                                 .averages = 2,
                                 .settle = 3,
                                 .seed = 4,
                                 .window = PB_WINDOW_HANN,
                                 .overlap = 0.5};
}

static pb_session *attach(const pb_model *m, fake_session_options options, size_t inputs) {
  pb_session *session = fake_session_new(m, options);
  const char *names[2] = {"u1", "u2"};
  pb_attach_options a = {.channel = "identify", .inputs = names, .input_count = (uint32_t)inputs};
  assert_int_equal(pb_session_attach(session, &a, NULL), PB_OK);
  return session;
}

static pb_experiment *make(const pb_model *m, const pb_experiment_feedback *feedback,
                           const pb_experiment_options *options, bool realtime) {
  pb_experiment *e;
  pb_error err = {0};
  if (pb_experiment_new(m, &channels, feedback, options, realtime, &e, &err) != PB_OK) {
    fail_msg("%s", err.message);
  }
  return e;
}

// Largest error against h[nf][3][2], relative to the largest magnitude of its output's row.
static double largest_error(const pb_frf *frf, const double complex *h) {
  double worst = 0;
  for (size_t f = 0; f < frf->nf; f++) {
    for (size_t o = 0; o < frf->ny; o++) {
      const double complex *a = frf->h + (f * frf->ny + o) * frf->nu,
                           *b = h + (f * frf->ny + o) * frf->nu;
      double row = 0, error = 0;
      for (size_t i = 0; i < frf->nu; i++) {
        row = fmax(row, cabs(b[i]));
        error = fmax(error, cabs(a[i] - b[i]));
      }
      worst = fmax(worst, error / row);
    }
  }
  return worst;
}

static double error_of(pb_experiment *e, const pb_model *m) {
  pb_frf frf;
  pb_error err = {0};
  if (pb_experiment_estimate(e, &frf, &err) != PB_OK) fail_msg("%s", err.message);
  double complex *h = malloc(frf.nf * 6 * sizeof *h);
  assert_int_equal(pb_model_frf(m, PB_SAMPLED, frf.frequency_hz, frf.nf, h, NULL), PB_OK);
  // Of a model's two inputs the experiment may have the first only.
  for (size_t k = 0; k < frf.nf * frf.ny * frf.nu; k++) h[k] = h[k / frf.nu * 2 + k % frf.nu];
  double worst = largest_error(&frf, h);
  free(h);
  pb_frf_clear(&frf);
  return worst;
}

static void check_open_loop(pb_experiment_options options, double tolerance) {
  pb_model *m = plant();
  pb_session *session = attach(m, (fake_session_options){0}, 2);
  pb_experiment *e = make(m, NULL, &options, false);
  uint64_t steps = pb_experiment_round_steps(e);
  pb_run_report report;
  for (int round = 0; round < 2; round++) {
    assert_int_equal(pb_experiment_run(e, session, NULL, &report, NULL), PB_OK);
    assert_int_equal(report.samples, steps);
    steps = pb_experiment_round_steps(e);
    double error = error_of(e, m);
    if (!(error < tolerance)) fail_msg("excitation %d: error %g", options.excitation, error);
  }
  const pb_experiment_trouble *t = pb_experiment_trouble_of(e);
  assert_true(t->gaps == 0 && t->late == 0 && t->disturbed == 0 && !t->over_limit);
  pb_experiment_free(e);
  fake_session_free(session);
  pb_model_free(m);
}

static void test_multisine(void **state) {
  (void)state;
  pb_experiment_options options = standard(PB_EXCITE_MULTISINE);
  check_open_loop(options, 1e-5);
  options.one_at_a_time = true;
  check_open_loop(options, 1e-5);
}

// Hardly any waiting: the decay is taken out, for one input and for several.
static void test_remove_transient(void **state) {
  (void)state;
  pb_experiment_options options = standard(PB_EXCITE_MULTISINE);
  options.settle = 0;
  pb_model *m = plant();
  for (size_t inputs = 1; inputs <= 2; inputs++) {
    pb_experiment_channels some = {both, all, inputs, 3};
    pb_experiment *e;
    assert_int_equal(pb_experiment_new(m, &some, NULL, &options, false, &e, NULL), PB_OK);
    pb_session *session = attach(m, (fake_session_options){0}, inputs);
    assert_int_equal(pb_experiment_run(e, session, NULL, NULL, NULL), PB_OK);
    double error = error_of(e, m);
    assert_true(pb_experiment_trouble_of(e)->decay > 0.999);
    if (!(error < 1e-7)) fail_msg("error %g", error);
    pb_experiment_free(e);
    fake_session_free(session);
  }
  pb_model_free(m);
}

static void test_chirp_and_periodic_noise(void **state) {
  (void)state;
  // A sweep's last turn leaves the lines at the band's ends weak: the band is kept inside.
  check_open_loop(standard(PB_EXCITE_CHIRP), 1e-3);
  check_open_loop(standard(PB_EXCITE_PERIODIC_NOISE), 1e-3);
}

static void test_noise(void **state) {
  (void)state;
  pb_experiment_options options = standard(PB_EXCITE_NOISE);
  options.averages = 60;
  options.resolution = 0.25;
  check_open_loop(options, 0.2);
  options.one_at_a_time = true;
  check_open_loop(options, 0.2);
}

// Commands act one step late and some samples are lost: u is still paired with the right y.
static void test_late_bus(void **state) {
  (void)state;
  pb_model *m = plant();
  pb_session *session = attach(m, (fake_session_options){.delay = 1, .miss_every = 9000}, 2);
  pb_experiment_options options = standard(PB_EXCITE_MULTISINE);
  options.averages = 8;
  pb_experiment *e = make(m, NULL, &options, true);
  assert_int_equal(pb_experiment_run(e, session, NULL, NULL, NULL), PB_OK);
  assert_true(pb_experiment_trouble_of(e)->gaps >= 2);
  double error = error_of(e, m);
  if (!(error < 0.05)) fail_msg("error %g", error);
  pb_experiment_free(e);
  fake_session_free(session);
  pb_model_free(m);
}

// With feedback the estimate is the closed loop from w, whatever the delay of the bus.
static void check_closed_loop(pb_model *m, double gain, unsigned delay) {
  pb_lti controller;
  pb_iff iff = pb_iff_default(gain);
  assert_int_equal(pb_iff_discrete(&iff, 2, RATE, &controller, NULL), PB_OK);
  pb_experiment_feedback feedback = {&controller, both, 1, false};
  pb_experiment_options options = standard(PB_EXCITE_MULTISINE);
  options.settle = 6;  // the controller's own poles are slow
  pb_experiment *e = make(m, &feedback, &options, delay > 0);
  pb_session *session = attach(m, (fake_session_options){.delay = delay}, 2);
  assert_int_equal(pb_experiment_run(e, session, NULL, NULL, NULL), PB_OK);
  pb_frf frf;
  assert_int_equal(pb_experiment_estimate(e, &frf, NULL), PB_OK);
  pb_loop loop = {m, &controller, both, both, 1, delay};
  double complex *h = malloc(frf.nf * 6 * sizeof *h);
  assert_int_equal(pb_loop_frf(&loop, 1, frf.frequency_hz, frf.nf, h, NULL), PB_OK);
  double error = largest_error(&frf, h);
  if (!(error < 1e-4)) fail_msg("delay %u: error %g", delay, error);
  free(h);
  pb_frf_clear(&frf);
  pb_experiment_free(e);
  fake_session_free(session);
  pb_lti_free(&controller);
  pb_model_free(m);
}

static void test_closed_loop(void **state) {
  (void)state;
  check_closed_loop(plant(), 60, 0);
  check_closed_loop(plant(), 60, 1);
}

// A plant whose voltages pass through an amplifier and late electronics, and whose outputs come
// late.
static pb_model *plant_with_electronics(uint32_t delay) {
  pb_model *m = plant();
  pb_electronics in[2] = {pb_electronics_none(), pb_electronics_none()};
  pb_electronics out[3] = {in[0], in[0], in[0]};
  in[0].gain = 20, in[0].delay = delay;
  in[1].gain = 3, in[1].delay = 1, in[1].quantisation = 1e-9;
  out[0].delay = 1, out[1].delay = 60;
  assert_int_equal(pb_electronics_attach(m, in, out, NULL), PB_OK);
  return m;
}

// One experiment on it; the estimate against the response of that base.
static void check_electronics(pb_experiment_feedback *feedback, unsigned delay, pb_time_base base) {
  pb_model *m = plant_with_electronics(12);
  pb_experiment_options options = standard(PB_EXCITE_MULTISINE);
  pb_session *session = attach(m, (fake_session_options){.delay = delay}, 2);
  pb_experiment *e = make(m, feedback, &options, delay > 0);
  pb_frf frf;
  assert_int_equal(pb_experiment_run(e, session, NULL, NULL, NULL), PB_OK);
  assert_int_equal(pb_experiment_estimate(e, &frf, NULL), PB_OK);
  double complex *h = malloc(frf.nf * 6 * sizeof *h);
  assert_int_equal(pb_model_frf(m, base, frf.frequency_hz, frf.nf, h, NULL), PB_OK);
  double error = largest_error(&frf, h);
  if (!(error < 1e-5)) fail_msg("delay %u, base %d: error %g", delay, (int)base, error);
  assert_int_equal(pb_experiment_trouble_of(e)->late, 0);
  free(h);
  pb_frf_clear(&frf);
  pb_experiment_free(e);
  fake_session_free(session);
  pb_model_free(m);
}

// The estimate is from the applied inputs, on request from the commands, on a prompt bus and on a
// late one whose lateness is told from the electronics' delay.
static void test_electronics(void **state) {
  (void)state;
  pb_experiment_feedback from_command = {.from_command = true};
  check_electronics(NULL, 0, PB_APPLIED);
  check_electronics(NULL, 1, PB_APPLIED);
  check_electronics(&from_command, 0, PB_SAMPLED);
  check_electronics(&from_command, 1, PB_SAMPLED);
  check_closed_loop(plant_with_electronics(1), 2, 0);
  check_closed_loop(plant_with_electronics(1), 2, 1);
}

// Fits do not spend poles on known delays, and static gains are those from the applied inputs.
static void test_analysis_with_electronics(void **state) {
  (void)state;
  pb_model *m = plant_with_electronics(12);
  pb_experiment_options options = standard(PB_EXCITE_MULTISINE);
  pb_session *session = attach(m, (fake_session_options){0}, 2);
  pb_experiment *e = make(m, NULL, &options, false);
  pb_frf frf;
  pb_analysis a;
  pb_error err = {0};
  assert_int_equal(pb_experiment_run(e, session, NULL, NULL, NULL), PB_OK);
  assert_int_equal(pb_experiment_estimate(e, &frf, NULL), PB_OK);
  if (pb_analyse(m, &channels, &frf, 1e-6, &a, &err) != PB_OK) fail_msg("%s", err.message);
  assert_true(a.overall.magnitude_percent < 0.01 && a.overall.phase_degree < 0.01);
  assert_int_equal(a.modes, 3);
  for (size_t k = 0; k < a.modes; k++) {
    const pb_mode_row *row = &a.mode[k];
    assert_true(fabs(row->measured.hz - row->exact.hz) < 1e-5 * row->exact.hz);
    assert_true(fabs(row->measured.damping - row->exact.damping) < 1e-3 * row->exact.damping);
  }
  assert_int_equal(a.rows, 6);
  for (size_t k = 0; k < a.rows; k++) {
    double error = fabs(a.row[k].dc_measured - a.row[k].dc_exact);
    if (!(error < 1e-3 * fabs(a.row[k].dc_exact) + 1e-6))
      fail_msg("row %zu: %g, not %g", k, a.row[k].dc_measured, a.row[k].dc_exact);
  }
  pb_analysis_clear(&a);
  pb_experiment_free(e);
  fake_session_free(session);
  pb_model_free(m);
}

// Noise of an input that nobody drives is no disturbance; a change by another client is.
static void test_undriven_noise(void **state) {
  (void)state;
  pb_model *m = plant();
  pb_electronics in[2] = {pb_electronics_none(), pb_electronics_none()};
  in[1].noise = 1e-3;
  assert_int_equal(pb_electronics_attach(m, in, NULL, NULL), PB_OK);
  const pb_experiment_channels one = {both, all, 1, 3};
  pb_experiment_options options = standard(PB_EXCITE_MULTISINE);
  pb_experiment *e;
  assert_int_equal(pb_experiment_new(m, &one, NULL, &options, false, &e, NULL), PB_OK);
  pb_session *session = attach(m, (fake_session_options){0}, 1);
  assert_int_equal(pb_experiment_run(e, session, NULL, NULL, NULL), PB_OK);
  assert_int_equal(pb_experiment_trouble_of(e)->disturbed, 0);
  pb_experiment_free(e);
  fake_session_free(session);
  assert_int_equal(pb_experiment_new(m, &one, NULL, &options, false, &e, NULL), PB_OK);
  assert_int_equal(pb_experiment_begin(e, NULL), PB_OK);
  const double u[2] = {0, 0.1}, y[3] = {0};
  double command[2];
  const pb_sample sample = {.input_count = 2, .output_count = 3, .input = u, .output = y};
  assert_true(pb_experiment_on_sample(e, &sample, command));
  assert_int_equal(pb_experiment_trouble_of(e)->disturbed, 1);
  pb_experiment_free(e);
  pb_model_free(m);
}

static void test_divergence(void **state) {
  (void)state;
  pb_model *m = plant();
  pb_lti controller;
  pb_iff iff = pb_iff_default(-300);  // drives instead of damping
  assert_int_equal(pb_iff_discrete(&iff, 2, RATE, &controller, NULL), PB_OK);
  pb_experiment_feedback feedback = {&controller, both, 1, false};
  pb_experiment_options options = standard(PB_EXCITE_MULTISINE);
  options.limit = 50;
  pb_experiment *e = make(m, &feedback, &options, false);
  pb_session *session = attach(m, (fake_session_options){0}, 2);
  pb_error err;
  assert_int_equal(pb_experiment_run(e, session, NULL, NULL, &err), PB_ERR_STATE);
  const pb_experiment_trouble *t = pb_experiment_trouble_of(e);
  assert_true(t->over_limit && fabs(t->limit_value) > 50);
  assert_non_null(strstr(err.message, "limit of 50"));
  // The last command was zero on both inputs.
  double command[2] = {1, 1};
  double y[3] = {0}, u[2] = {0};
  pb_sample sample = {
      .step = t->limit_step + 1, .input_count = 2, .output_count = 3, .input = u, .output = y};
  assert_false(pb_experiment_on_sample(e, &sample, command));
  pb_experiment_free(e);
  fake_session_free(session);
  pb_lti_free(&controller);
  pb_model_free(m);
}

static size_t saved_bytes(uint64_t seed, char **bytes) {
  pb_model *m = plant();
  pb_experiment_options options = standard(PB_EXCITE_NOISE);
  options.seed = seed;
  options.averages = 4;
  pb_experiment *e = make(m, NULL, &options, false);
  pb_session *session = attach(m, (fake_session_options){0}, 2);
  size_t size = 0;
  FILE *stream = open_memstream(bytes, &size);
  pb_experiment_save_to(e, stream);
  assert_int_equal(pb_experiment_run(e, session, NULL, NULL, NULL), PB_OK);
  fclose(stream);
  assert_int_equal(size, (6000 + 2000 + 3 * 1000) * 8 * (1 + 2 + 3));
  pb_experiment_free(e);
  fake_session_free(session);
  pb_model_free(m);
  return size;
}

static void test_same_bytes(void **state) {
  (void)state;
  char *a, *b, *c;
  size_t na = saved_bytes(5, &a), nb = saved_bytes(5, &b), nc = saved_bytes(6, &c);
  assert_int_equal(na, nb);
  assert_memory_equal(a, b, na);
  assert_int_equal(na, nc);
  assert_memory_not_equal(a, c, na);
  free(a);
  free(b);
  free(c);
}

static void test_refusals(void **state) {
  (void)state;
  pb_model *m = plant();
  pb_experiment *e;
  pb_error err;
  pb_experiment_options options = standard(PB_EXCITE_MULTISINE);
  options.averages = 1;
  assert_int_equal(pb_experiment_new(m, &channels, NULL, &options, false, &e, &err),
                   PB_ERR_ARGUMENT);
  options = standard(PB_EXCITE_MULTISINE);
  options.resolution = 1e-6;
  assert_int_equal(pb_experiment_new(m, &channels, NULL, &options, false, &e, &err),
                   PB_ERR_ARGUMENT);
  options.resolution = NAN;
  assert_int_equal(pb_experiment_new(m, &channels, NULL, &options, false, &e, &err),
                   PB_ERR_ARGUMENT);
  assert_null(e);
  pb_model_free(m);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_multisine),
      cmocka_unit_test(test_remove_transient),
      cmocka_unit_test(test_chirp_and_periodic_noise),
      cmocka_unit_test(test_noise),
      cmocka_unit_test(test_late_bus),
      cmocka_unit_test(test_closed_loop),
      cmocka_unit_test(test_electronics),
      cmocka_unit_test(test_analysis_with_electronics),
      cmocka_unit_test(test_undriven_noise),
      cmocka_unit_test(test_divergence),
      cmocka_unit_test(test_same_bytes),
      cmocka_unit_test(test_refusals),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
