// The plan of an experiment: lengths, signals and estimators. See experiment.h.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "experiment_internal.h"
#include "signal/excitation.h"

// Without gaps the next round of a single stage continues where the last one ended.
static size_t settle_of_round(const pb_experiment *e) {
  bool continues = e->round > 0 && e->stages == 1 && !e->realtime;
  return continues ? 0 : e->settle;
}

uint64_t pb_experiment_round_steps(const pb_experiment *e) {
  return (uint64_t)e->stages * (settle_of_round(e) + e->measure);
}

pb_experiment_layout pb_experiment_layout_of(const pb_experiment *e) {
  return (pb_experiment_layout){e->stages, settle_of_round(e), e->measure};
}

static pb_status check(const pb_experiment *e, pb_error *err) {
  const pb_experiment_options *o = &e->options;
  if (!(isfinite(o->resolution) && o->resolution > 0) || !(o->settle >= 0) ||
      !isfinite(o->settle) || !(o->limit >= 0)) {
    return pb_fail(err, PB_ERR_ARGUMENT, "experiment", "resolution %g Hz, settling %g s, limit %g",
                   o->resolution, o->settle, o->limit);
  }
  if (o->averages < (e->periodic ? 2 : 1) || o->averages > 100000) {
    return pb_fail(err, PB_ERR_ARGUMENT, "experiment", "%zu averages are %s", o->averages,
                   o->averages < 2 ? "too few" : "too many");
  }
  double samples = e->model->sample_rate / o->resolution;
  if (!(samples >= 16) || samples > 4e6) {
    return pb_fail(err, PB_ERR_ARGUMENT, "experiment",
                   "a resolution of %g Hz at %g Hz is a record of %.0f samples (16 … 4000000)",
                   o->resolution, e->model->sample_rate, samples);
  }
  return PB_OK;
}

static pb_status make_estimators(pb_experiment *e, pb_error *err) {
  const pb_experiment_options *o = &e->options;
  double rate = e->model->sample_rate;
  if (e->periodic) {
    pb_periodic_options options = {rate, e->period, e->stages, o->f1, o->f2};
    return pb_periodic_new(&options, e->channels.inputs, e->channels.outputs, &e->averages, err);
  }
  pb_welch_options options = {.sample_rate = rate,
                              .length = e->period,
                              .overlap = o->overlap,
                              .window = o->window,
                              .f1 = o->f1,
                              .f2 = o->f2};
  e->welches = e->stages;
  e->welch = calloc(e->welches, sizeof(pb_welch *));
  if (!e->welch) return pb_fail_memory(err, "experiment");
  size_t inputs = e->stages == 1 ? e->channels.inputs : 1;
  pb_status status = PB_OK;
  for (size_t k = 0; k < e->welches && status == PB_OK; k++) {
    status = pb_welch_new(&options, inputs, e->channels.outputs, &e->welch[k], err);
  }
  return status;
}

pb_status pb_experiment_plan(pb_experiment *e, pb_error *err) {
  const pb_experiment_options *o = &e->options;
  size_t inputs = e->channels.inputs;
  e->periodic = o->excitation != PB_EXCITE_NOISE;
  if (o->excitation == PB_EXCITE_CHIRP) e->options.one_at_a_time = true;
  pb_status status = check(e, err);
  if (status != PB_OK) return status;
  e->period = (size_t)lround(e->model->sample_rate / o->resolution);
  e->stages = e->periodic || o->one_at_a_time ? inputs : 1;
  double settle = ceil(o->settle * e->model->sample_rate / (double)e->period);
  e->settle = (size_t)settle * e->period;
  // Periods come first at their steady state: at least one is spent on the way there.
  if (e->periodic && e->settle == 0) e->settle = e->period;
  e->measure = e->period * o->averages;
  if (!e->periodic) {
    double hop = round((double)e->period * (1 - o->overlap));
    e->measure = e->period + (size_t)hop * (o->averages - 1);
  }
  e->signal_length = e->periodic ? e->period : e->settle + e->measure;
  if ((double)e->signal_length * (double)e->stages * (double)inputs > 4e8) {
    return pb_fail(err, PB_ERR_ARGUMENT, "experiment", "%zu samples of %zu signals are too many",
                   e->signal_length, e->stages * inputs);
  }
  e->signal = malloc(e->stages * e->signal_length * inputs * sizeof *e->signal);
  return e->signal ? make_estimators(e, err) : pb_fail_memory(err, "experiment");
}

// Input i of stage i alone, from one column of n samples drawn by `draw`.
typedef pb_status (*draw_one)(const pb_experiment *e, size_t input, size_t n, double *u,
                              pb_error *err);

static pb_status draw_alone(pb_experiment *e, draw_one draw, pb_error *err) {
  size_t n = e->signal_length, inputs = e->channels.inputs;
  double *column = malloc(n * sizeof *column);
  if (!column) return pb_fail_memory(err, "experiment");
  memset(e->signal, 0, e->stages * n * inputs * sizeof *e->signal);
  pb_status status = PB_OK;
  for (size_t i = 0; i < e->stages && status == PB_OK; i++) {
    status = draw(e, i, n, column, err);
    for (size_t k = 0; k < n; k++) e->signal[(i * n + k) * inputs + i] = column[k];
  }
  free(column);
  return status;
}

static pb_multisine_spec multisine_spec(const pb_experiment *e) {
  const pb_experiment_options *o = &e->options;
  return (pb_multisine_spec){.sample_rate = e->model->sample_rate,
                             .f1 = o->f1,
                             .f2 = o->f2,
                             .rms = o->rms,
                             .crest_iterations = e->channels.inputs == 1 ? 20 : 0,
                             .seed = o->seed};
}

// Rounds of noise differ, periods repeat.
static pb_noise_spec noise_spec(const pb_experiment *e, size_t stage) {
  const pb_experiment_options *o = &e->options;
  uint64_t variant = e->periodic ? stage : (uint64_t)e->round * 1000003u + stage;
  return (pb_noise_spec){.sample_rate = e->model->sample_rate,
                         .f1 = o->f1,
                         .f2 = o->f2,
                         .rms = o->rms,
                         .periodic = e->periodic,
                         .seed = o->seed + variant * 0x9e3779b97f4a7c15u};
}

static pb_status draw_multisine(const pb_experiment *e, size_t input, size_t n, double *u,
                                pb_error *err) {
  pb_multisine_spec spec = multisine_spec(e);
  spec.crest_iterations = 20;
  spec.seed += input;
  return pb_excite_multisine(&spec, n, 1, u, err);
}

static pb_status draw_noise(const pb_experiment *e, size_t input, size_t n, double *u,
                            pb_error *err) {
  pb_noise_spec spec = noise_spec(e, input);
  return pb_excite_noise(&spec, n, 1, u, err);
}

static pb_status draw_chirp(const pb_experiment *e, size_t input, size_t n, double *u,
                            pb_error *err) {
  (void)input;
  const pb_experiment_options *o = &e->options;
  return pb_excite_chirp(e->model->sample_rate, o->f1, o->f2, sqrt(2) * o->rms, n, u, err);
}

pb_status pb_experiment_draw(pb_experiment *e, pb_error *err) {
  size_t inputs = e->channels.inputs, n = e->signal_length;
  if (e->periodic && e->round > 0) return PB_OK;  // the same periods again
  switch (e->options.excitation) {
  case PB_EXCITE_CHIRP:
    return draw_alone(e, draw_chirp, err);
  case PB_EXCITE_MULTISINE: {
    pb_multisine_spec spec = multisine_spec(e);
    if (e->options.one_at_a_time) return draw_alone(e, draw_multisine, err);
    return pb_excite_orthogonal(&spec, n, inputs, e->signal, err);
  }
  case PB_EXCITE_NOISE:
  case PB_EXCITE_PERIODIC_NOISE:
    break;
  }
  if (e->options.one_at_a_time) return draw_alone(e, draw_noise, err);
  pb_status status = PB_OK;
  for (size_t s = 0; s < e->stages && status == PB_OK; s++) {
    pb_noise_spec spec = noise_spec(e, s);
    status = pb_excite_noise(&spec, n, inputs, e->signal + s * n * inputs, err);
  }
  return status;
}
