// Experiments on a running bench: see actuator.h.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "actuator.h"
#include "bench.h"
#include "control/fit.h"
#include "interrupt.h"
#include "roots.h"

enum { KEY_LIVE = 0x580, KEY_VA, KEY_Y, KEY_VS, KEY_FORCE };

static const struct argp_option live_table[] = {
    {"live", KEY_LIVE, NULL, 0, "Identify the plant that a daemon serves, in place of a FILE", 8},
    {"voltage-input", KEY_VA, "NAME", 0, "Of the actuator (default Va)", 8},
    {"displacement-output", KEY_Y, "NAME", 0, "Of the load (default y)", 8},
    {"sensor-output", KEY_VS, "NAME", 0, "Of the sensor stack (default Vs)", 8},
    {"force-input", KEY_FORCE, "NAME", 0, "On the load, where there is one (default F)", 8},
    {0},
};

static error_t live_parse(int key, char *text, struct argp_state *state) {
  live_options *o = state->input;
  switch (key) {
  case ARGP_KEY_INIT:
    state->child_inputs[0] = &o->common;
    state->child_inputs[1] = &o->excite;
    return 0;
  case KEY_LIVE:
    o->live = true;
    return 0;
  case KEY_VA:
    o->va = text;
    return 0;
  case KEY_Y:
    o->y = text;
    return 0;
  case KEY_VS:
    o->vs = text;
    return 0;
  case KEY_FORCE:
    o->force = text;
    return 0;
  default:
    return ARGP_ERR_UNKNOWN;
  }
}

static const struct argp_child live_children[] = {
    {&pb_common_argp, 0, NULL, 0}, {&pb_excite_argp, 0, "Excitation (--live):", 9}, {0}};
const struct argp live_argp = {live_table, live_parse, NULL, NULL, live_children, NULL, NULL};

void live_defaults(live_options *o) {
  *o = (live_options){.va = "Va", .y = "y", .vs = "Vs", .force = "F"};
  pb_excite_options_default(&o->excite);
}

void live_result_clear(live_result *r) {
  pb_apa_data_clear(&r->data);
}

// A multisine from 1 Hz on, whose start decays as plantbus-identify has it.
static pb_status choose_experiment(const live_options *o, const pb_bench *bench,
                                   pb_experiment_options *e, pb_error *err) {
  const double rate = bench->model->sample_rate;
  *e = o->excite.experiment;
  if (e->rms == 0) e->rms = 1;
  if (e->f2 == 0) e->f1 = 1, e->f2 = fmin(1000, 0.4 * rate);
  if (e->resolution == 0) e->resolution = 0.5;
  if (e->averages == 0) e->averages = 2;
  if (o->excite.settle_given) return PB_OK;
  return pb_settle_seconds(bench->model, e->f1, e->f2, !bench->realtime, &e->settle, err);
}

static pb_status find(const pb_model *m, bool input, const char *name, const char *flag,
                      size_t *index, pb_error *err) {
  return pb_signal_find(input ? m->input : m->output, input ? m->nu : m->ny,
                        input ? "input" : "output", name, flag, index, err);
}

static pb_status measure(const live_options *o, pb_bench *bench,
                         const pb_experiment_channels *channels, pb_frf *frf, pb_error *err) {
  pb_experiment_options e;
  pb_experiment *experiment = NULL;
  pb_run_report report = {0};
  pb_status st = choose_experiment(o, bench, &e, err);
  if (!st)
    st = pb_experiment_new(bench->model, channels, NULL, &e, bench->realtime, &experiment, err);
  if (!st) st = pb_experiment_begin(experiment, err);
  if (!st) st = pb_bench_attach(bench, "actuator", channels->input, channels->inputs, 0, err);
  if (!st) st = pb_bench_run(bench, experiment, "identify", &report, err);
  pb_bench_detach(bench);
  if (!st) st = pb_experiment_estimate(experiment, frf, err);
  if (experiment) pb_bench_tell_trouble(experiment);
  pb_experiment_free(experiment);
  return st;
}

// The first input's responses out of all.
static pb_status take_voltage(const pb_frf *frf, double sample_rate, pb_apa_data *out,
                              pb_error *err) {
  out->sample_rate = sample_rate;
  pb_status st = pb_frf_new(frf->nf, PB_APA_OUTPUTS, 1, &out->frf, err);
  for (size_t f = 0; f < frf->nf && !st; f++) {
    out->frf.frequency_hz[f] = frf->frequency_hz[f];
    for (size_t k = 0; k < PB_APA_OUTPUTS; k++) {
      const size_t to = f * PB_APA_OUTPUTS + k;
      out->frf.h[to] = frf->h[to * frf->nu];
      out->frf.variance[to] = frf->variance[to * frf->nu];
      out->frf.coherence[to] = frf->coherence[to];
    }
  }
  out->frf.averages = frf->averages;
  return st;
}

static pb_status find_compliance(const pb_frf *frf, double sample_rate, double *compliance,
                                 pb_error *err) {
  const pb_fit_channel channel = {PB_APA_Y, 1};
  const pb_fit_options options = {.sample_rate = sample_rate, .weight = PB_FIT_NOISE};
  pb_fit fit = {0};
  pb_status st = pb_fit_frf(frf, &channel, 1, &options, &fit, err);
  if (!st) *compliance = creal(pb_fit_evaluate(&fit, 0, 0));
  pb_fit_clear(&fit);
  return st;
}

static pb_status identify(const live_options *o, pb_bench *bench, bool with_force, live_result *out,
                          pb_error *err) {
  const pb_model *m = bench->model;
  size_t input[2], output[PB_APA_OUTPUTS];
  pb_frf frf = {0};
  const bool force = with_force && pb_model_input(m, o->force) >= 0;
  pb_status st = find(m, true, o->va, "--voltage-input", &input[0], err);
  if (!st) st = find(m, false, o->y, "--displacement-output", &output[PB_APA_Y], err);
  if (!st) st = find(m, false, o->vs, "--sensor-output", &output[PB_APA_VS], err);
  if (!st && force) st = find(m, true, o->force, "--force-input", &input[1], err);
  const pb_experiment_channels channels = {input, output, force ? 2 : 1, PB_APA_OUTPUTS};
  if (!st) st = measure(o, bench, &channels, &frf, err);
  if (!st) st = take_voltage(&frf, m->sample_rate, &out->data, err);
  if (!st && force) st = find_compliance(&frf, m->sample_rate, &out->compliance, err);
  pb_frf_clear(&frf);
  return st;
}

pb_status live_identify(const live_options *o, bool with_force, live_result *out, pb_error *err) {
  pb_bench bench = {0};
  *out = (live_result){.compliance = NAN};
  pb_interrupt_install();
  pb_status st = pb_bench_open(&o->common, o->excite.reset, &bench, err);
  if (st) return st;
  snprintf(out->plant, sizeof out->plant, "%s", bench.description->name);
  out->revision = bench.description->revision;
  st = identify(o, &bench, with_force, out, err);
  pb_bench_close(&bench);
  if (st) live_result_clear(out);
  return st;
}
