// The sample callback of an identification experiment, and its life: see experiment.h.
#include "experiment.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "control/lti_ops.h"
#include "control/transient.h"
#include "experiment_internal.h"

static pb_status check_channels(const pb_experiment *e, pb_error *err) {
  const pb_experiment_channels *c = &e->channels;
  const pb_lti *k = e->feedback.controller;
  if (c->inputs == 0 || c->outputs == 0) {
    return pb_fail(err, PB_ERR_ARGUMENT, "experiment", "%zu inputs, %zu outputs", c->inputs,
                   c->outputs);
  }
  for (size_t i = 0; i < c->inputs; i++) {
    if (c->input[i] >= e->model->nu)
      return pb_fail(err, PB_ERR_ARGUMENT, "experiment", "no input %zu", c->input[i]);
  }
  for (size_t o = 0; o < c->outputs; o++) {
    if (c->output[o] >= e->model->ny)
      return pb_fail(err, PB_ERR_ARGUMENT, "experiment", "no output %zu", c->output[o]);
  }
  if (k && (k->ny != c->inputs || !(fabs(k->dt * e->model->sample_rate - 1) < 1e-9))) {
    return pb_fail(err, PB_ERR_ARGUMENT, "experiment", "the controller does not fit the loop");
  }
  for (size_t i = 0; k && i < k->nu; i++) {
    if (e->feedback.output[i] >= e->model->ny)
      return pb_fail(err, PB_ERR_ARGUMENT, "experiment", "no output");
  }
  return PB_OK;
}

// Of the driven inputs' electronics.
static size_t longest_delay(const pb_experiment *e) {
  size_t longest = 0;
  for (size_t i = 0; i < e->channels.inputs; i++) {
    size_t delay = pb_model_input_electronics(e->model, e->channels.input[i]).delay;
    if (delay > longest) longest = delay;
  }
  return longest;
}

static bool allocate(pb_experiment *e) {
  size_t inputs = e->channels.inputs;
  const pb_lti *k = e->feedback.controller;
  size_t states = k ? k->nx : 0, read = k ? k->nu : 0;
  e->previous_y = calloc(e->model->ny, sizeof *e->previous_y);
  e->u = calloc(inputs, sizeof *e->u);
  e->y = calloc(e->channels.outputs, sizeof *e->y);
  e->w = calloc(inputs, sizeof *e->w);
  e->remembered = PB_EXPERIMENT_HISTORY + longest_delay(e);
  e->history_u = calloc(inputs * e->remembered, sizeof *e->history_u);
  e->history_w = calloc(inputs * e->remembered, sizeof *e->history_w);
  e->x = calloc(states + 1, sizeof *e->x);
  e->scratch = calloc(states + 1, sizeof *e->scratch);
  e->loop_y = calloc(read + 1, sizeof *e->loop_y);
  e->loop_u = calloc(inputs, sizeof *e->loop_u);
  return e->previous_y && e->u && e->y && e->w && e->history_u && e->history_w && e->x &&
         e->scratch && e->loop_y && e->loop_u;
}

pb_status pb_experiment_new(const pb_model *model, const pb_experiment_channels *channels,
                            const pb_experiment_feedback *feedback,
                            const pb_experiment_options *options, bool realtime,
                            pb_experiment **out, pb_error *err) {
  *out = NULL;
  pb_experiment *e = calloc(1, sizeof *e);
  if (!e) return pb_fail_memory(err, "experiment");
  e->model = model;
  e->channels = *channels;
  if (feedback) e->feedback = *feedback;
  e->options = *options;
  e->realtime = realtime;
  pb_status status = check_channels(e, err);
  if (status == PB_OK && !allocate(e)) status = pb_fail_memory(err, "experiment");
  if (status == PB_OK) status = pb_experiment_plan(e, err);
  if (status != PB_OK) {
    pb_experiment_free(e);
    return status;
  }
  *out = e;
  return PB_OK;
}

void pb_experiment_free(pb_experiment *e) {
  if (!e) return;
  for (size_t k = 0; e->welch && k < e->welches; k++) pb_welch_free(e->welch[k]);
  free(e->welch);
  pb_periodic_free(e->averages);
  free(e->signal);
  free(e->previous_y);
  free(e->u);
  free(e->y);
  free(e->w);
  free(e->history_u);
  free(e->history_w);
  free(e->x);
  free(e->scratch);
  free(e->loop_y);
  free(e->loop_u);
  free(e);
}

void pb_experiment_save_to(pb_experiment *e, FILE *stream) {
  e->save = stream;
}

const pb_experiment_trouble *pb_experiment_trouble_of(const pb_experiment *e) {
  return &e->trouble;
}

size_t pb_experiment_period(const pb_experiment *e) {
  return e->period;
}

pb_status pb_experiment_begin(pb_experiment *e, pb_error *err) {
  if (e->begun) return PB_OK;
  pb_status status = pb_experiment_draw(e, err);
  if (status != PB_OK) return status;
  e->begun = true;
  // A round that settles anew does not go on where the last one ended.
  if (e->averages && pb_experiment_layout_of(e).settle > 0) pb_periodic_break(e->averages);
  e->started = e->previous_known = e->ending = false;
  e->gap_until = 0;
  if (e->realtime || e->round == 0)
    memset(e->history_u, 0, e->channels.inputs * e->remembered * sizeof *e->history_u);
  return PB_OK;
}

// Stage and sample within it of index n of the round; false after the last.
static bool locate(const pb_experiment *e, uint64_t n, size_t *stage, size_t *m, size_t *settle) {
  uint64_t steps = pb_experiment_round_steps(e), length = steps / e->stages;
  *settle = (size_t)length - e->measure;
  *stage = (size_t)(n / length);
  *m = (size_t)(n % length);
  return n < steps;
}

static void break_record(pb_experiment *e) {
  if (e->averages) pb_periodic_break(e->averages);
  for (size_t k = 0; k < e->welches; k++) pb_welch_break(e->welch[k]);
}

// How many steps late the command came that the sample found applied, behind the electronics' own
// delay: the newest that fits best.
static size_t applied_age(const pb_experiment *e, const pb_sample *sample) {
  size_t best = 0;
  double least = INFINITY;
  for (size_t age = 0; age < PB_EXPERIMENT_HISTORY; age++) {
    double distance = 0;
    for (size_t i = 0; i < e->channels.inputs; i++) {
      pb_electronics at = pb_model_input_electronics(e->model, e->channels.input[i]);
      double command = e->history_u[i * e->remembered + age + at.delay];
      distance += fabs(sample->input[e->channels.input[i]] - pb_electronics_steady(&at, command));
    }
    if (distance < least * (1 - 1e-9)) least = distance, best = age;
  }
  return best;
}

// The pair of the step before: y(k−1) with what acted from then on.
static void fill_pair(pb_experiment *e, const pb_sample *sample) {
  size_t age = e->realtime ? applied_age(e, sample) : 0;
  bool from_command = e->feedback.controller || e->feedback.from_command;
  e->trouble.late += age > 1 || (age > 0 && !e->realtime);
  for (size_t i = 0; i < e->channels.inputs; i++) {
    e->u[i] =
        from_command ? e->history_w[i * e->remembered + age] : sample->input[e->channels.input[i]];
  }
  for (size_t o = 0; o < e->channels.outputs; o++) e->y[o] = e->previous_y[e->channels.output[o]];
}

static void feed(pb_experiment *e, uint64_t n) {
  size_t stage, m, settle;
  if (!locate(e, n, &stage, &m, &settle) || m < settle) return;
  if (e->averages) {
    // After a gap a period starts again at a period's start, or the mean would mix phases.
    if (n < e->gap_until) return;
    pb_periodic_push(e->averages, stage, e->u, e->y);
  } else if (e->welches == 1) {
    pb_welch_push(e->welch[0], e->u, e->y);
  } else {
    if (m == settle) break_record(e);
    pb_welch_push(e->welch[stage], &e->u[stage], e->y);
  }
}

static void note_gap(pb_experiment *e, uint64_t n, uint64_t missed) {
  e->trouble.gaps += missed;
  break_record(e);
  e->gap_until = (n / e->period + 1) * e->period;
}

static void take_pair(pb_experiment *e, const pb_sample *sample) {
  if (!e->previous_known) return;
  uint64_t n = e->previous_step - e->first_step;
  if (sample->step == e->previous_step + 1) {
    fill_pair(e, sample);
    feed(e, n);
  } else {
    note_gap(e, sample->step - e->first_step, sample->step - e->previous_step - 1);
  }
}

static void note_faults(pb_experiment *e, const pb_sample *sample) {
  e->trouble.flagged += sample->flags != 0;
  pb_flags_count(sample->flags, e->trouble.flag);
  bool moved = false;
  for (size_t i = 0; i < sample->input_count; i++) {
    bool driven = false;
    for (size_t j = 0; j < e->channels.inputs; j++) driven = driven || e->channels.input[j] == i;
    double noise = 10 * pb_model_input_electronics(e->model, i).noise;
    moved = moved || (!driven && !(fabs(sample->input[i]) <= noise));
  }
  e->trouble.disturbed += moved;
}

static void save_sample(const pb_experiment *e, const pb_sample *sample) {
  if (!e->save) return;
  fwrite(&sample->step, sizeof sample->step, 1, e->save);
  fwrite(sample->input, sizeof(double), sample->input_count, e->save);
  fwrite(sample->output, sizeof(double), sample->output_count, e->save);
}

void pb_experiment_excite(pb_experiment *e, uint64_t n) {
  size_t stage, m, settle, inputs = e->channels.inputs;
  locate(e, n, &stage, &m, &settle);
  // A round without settling starts where the signal's own settling part ends.
  size_t at = e->periodic ? m % e->period : e->settle - settle + m;
  memcpy(e->w, e->signal + (stage * e->signal_length + at) * inputs, inputs * sizeof *e->w);
}

// command = w + sign·K y, remembered.
static void control(pb_experiment *e, const pb_sample *sample, double *command) {
  size_t inputs = e->channels.inputs;
  const pb_lti *k = e->feedback.controller;
  memcpy(command, e->w, inputs * sizeof *command);
  if (k) {
    for (size_t i = 0; i < k->nu; i++) e->loop_y[i] = sample->output[e->feedback.output[i]];
    pb_lti_step(k, e->x, e->scratch, e->loop_y, e->loop_u);
    for (size_t i = 0; i < inputs; i++) command[i] += e->feedback.sign * e->loop_u[i];
  }
  for (size_t i = 0; i < inputs; i++) {
    double *u = e->history_u + i * e->remembered, *w = e->history_w + i * e->remembered;
    memmove(u + 1, u, (e->remembered - 1) * sizeof *u);
    memmove(w + 1, w, (e->remembered - 1) * sizeof *w);
    u[0] = command[i];
    w[0] = e->w[i];
  }
}

// True when a command exceeds the limit or is not a number: it is then replaced by zero.
static bool over_limit(pb_experiment *e, const pb_sample *sample, double *command) {
  for (size_t i = 0; i < e->channels.inputs; i++) {
    bool inside =
        isfinite(command[i]) && (e->options.limit == 0 || fabs(command[i]) <= e->options.limit);
    if (inside) continue;
    e->trouble.over_limit = true;
    e->trouble.limit_step = sample->step;
    e->trouble.limit_input = i;
    e->trouble.limit_value = command[i];
    memset(command, 0, e->channels.inputs * sizeof *command);
    return true;
  }
  return false;
}

bool pb_experiment_on_sample(void *context, const pb_sample *sample, double *command) {
  pb_experiment *e = context;
  if (!e->started) {
    e->started = true;
    e->first_step = sample->step;
  }
  if (e->ending) return false;  // the zeros of the sample before have been sent
  take_pair(e, sample);
  uint64_t n = sample->step - e->first_step;
  e->previous_known = false;
  if (n >= pb_experiment_round_steps(e)) return false;
  note_faults(e, sample);
  save_sample(e, sample);
  pb_experiment_excite(e, n);
  control(e, sample, command);
  e->ending = over_limit(e, sample, command);
  memcpy(e->previous_y, sample->output, e->model->ny * sizeof *e->previous_y);
  e->previous_step = sample->step;
  e->previous_known = true;
  return true;
}

static pb_status limit_error(const pb_experiment *e, pb_error *err) {
  const pb_experiment_trouble *t = &e->trouble;
  const char *name = e->model->input[e->channels.input[t->limit_input]].name;
  return pb_fail(
      err, PB_ERR_STATE, name,
      "the command reached %g at step %llu, beyond the limit of %g: the loop diverges or the "
      "excitation is too large; the commands were set to zero",
      t->limit_value, (unsigned long long)t->limit_step, e->options.limit);
}

pb_status pb_experiment_finish(pb_experiment *e, pb_status status, pb_error *err) {
  e->begun = false;
  if (status == PB_OK && e->trouble.over_limit) status = limit_error(e, err);
  if (status == PB_OK) e->round++;
  return status;
}

double pb_experiment_seconds(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

// The session has one context for all its callbacks: the experiment passes the progress on.
static void pass_progress(void *context, uint64_t samples) {
  const pb_experiment *e = context;
  if (e->watch.progress) e->watch.progress(e->watch.context, samples);
}

pb_status pb_experiment_run(pb_experiment *e, pb_session *session, const pb_experiment_watch *watch,
                            pb_run_report *report, pb_error *err) {
  pb_status status = pb_experiment_begin(e, err);
  if (status != PB_OK) return status;
  e->watch = watch ? *watch : (pb_experiment_watch){0};
  pb_run_options options = {.on_sample = pb_experiment_on_sample,
                            .context = e,
                            .stall = 10,
                            .interrupted = e->watch.interrupted,
                            .progress = pass_progress};
  status = pb_session_run(session, &options, report, err);
  return pb_experiment_finish(e, status, err);
}

// One column of the response from each single-input estimate.
static pb_status merge_columns(const pb_experiment *e, pb_frf *out, pb_error *err) {
  pb_status status = PB_OK;
  for (size_t i = 0; i < e->welches && status == PB_OK; i++) {
    pb_frf one;
    status = pb_welch_estimate(e->welch[i], e->options.estimator, &one, err);
    if (status == PB_OK && i == 0) {
      status = pb_frf_new(one.nf, one.ny, e->welches, out, err);
      if (status == PB_OK) memcpy(out->frequency_hz, one.frequency_hz, one.nf * sizeof(double));
      out->averages = one.averages;
      for (size_t k = 0; status == PB_OK && k < one.nf * one.ny; k++) out->coherence[k] = 1;
    }
    for (size_t k = 0; status == PB_OK && k < one.nf * one.ny; k++) {
      out->h[k * e->welches + i] = one.h[k];
      out->variance[k * e->welches + i] = one.variance[k];
      out->coherence[k] = fmin(out->coherence[k], one.coherence[k]);
    }
    pb_frf_clear(&one);
  }
  if (status != PB_OK) pb_frf_clear(out);
  return status;
}

pb_status pb_experiment_estimate(pb_experiment *e, pb_frf *out, pb_error *err) {
  pb_status status = PB_OK;
  if (e->averages) {
    status = pb_transient_remove(e->averages, e->model->sample_rate, &e->trouble.decay, err);
    // Without periods in a row nothing can be told apart; their scatter tells.
    if (status == PB_ERR_STATE) status = PB_OK;
  }
  if (status != PB_OK) return status;
  if (e->averages) {
    status = pb_periodic_estimate(e->averages, out, err);
    if (status == PB_ERR_STATE && e->trouble.gaps > 0) {
      return pb_fail(
          err, status, "experiment",
          "%llu steps were missed, so that no two whole periods are left: run the plant slower, "
          "or in lockstep",
          (unsigned long long)e->trouble.gaps);
    }
    return status;
  }
  if (e->welches == 1) return pb_welch_estimate(e->welch[0], e->options.estimator, out, err);
  *out = (pb_frf){0};
  return merge_columns(e, out, err);
}
