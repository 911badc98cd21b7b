// The two runs over the bus, undamped and damped, and what is read from them.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "control/fit.h"
#include "iff_tool.h"
#include "plant/plant.h"

#include "control/pole_match.h"

enum { FIT_CHANNELS = 8 };

static pb_status settle_open(const iff_result *r, bool removable, double *seconds, pb_error *err) {
  return pb_settle_seconds(r->model, r->experiment.f1, r->experiment.f2, removable, seconds, err);
}

// Closed, the controller's own poles come below the band, too slow for their decay to be told from
// the lines: it is waited for.
static pb_status settle_closed(iff_result *r, bool removable, double *seconds, pb_error *err) {
  double f1 = r->experiment.f1, f2 = r->experiment.f2, rate = r->model->sample_rate, above = 0;
  pb_pole_list poles = {0};
  pb_status status = removable ? settle_open(r, true, &above, err) : PB_OK;
  if (status == PB_OK) {
    status =
        pb_loop_solver_poles(r->solver, r->law.gain, 0, removable ? 2 * f1 : 3 * f2, &poles, err);
  }
  *seconds = removable ? fmax(above, pb_settling_time(&poles, rate, 0, 1e-2, 10))
                       : pb_settling_time(&poles, rate, 0, 1e-4, 120);
  *seconds += (double)pb_model_delay(r->model) / rate;
  pb_pole_list_clear(&poles);
  return status;
}

static pb_status make_experiment(iff_result *r, bool closed, pb_experiment **out, pb_error *err) {
  pb_experiment_options e = r->experiment;
  bool removable = e.excitation != PB_EXCITE_NOISE && !r->bench->realtime;
  pb_status status = PB_OK;
  if (!r->options->excite.settle_given) {
    status = closed ? settle_closed(r, removable, &e.settle, err)
                    : settle_open(r, removable, &e.settle, err);
  }
  // Undamped and damped are compared: with electronics at the inputs both are from the command.
  pb_experiment_feedback feedback = {closed ? &r->controller_used : NULL, r->loops.output,
                                     r->loop.sign, r->model->input_electronics != NULL};
  if (status == PB_OK) {
    status = pb_experiment_new(r->model, &r->channels, &feedback, &e, r->bench->realtime, out, err);
  }
  return status == PB_OK ? pb_experiment_begin(*out, err) : status;
}

// Closed-loop responses at the experiment's lines and channels.
static pb_status predict(const iff_result *r, iff_measurement *m, pb_error *err) {
  const pb_experiment_channels *ch = &r->channels;
  size_t all = r->model->ny * r->model->nu, some = ch->outputs * ch->inputs;
  double complex *h = malloc(all * sizeof *h);
  m->expected = malloc(m->frf.nf * some * sizeof *m->expected);
  m->floor = malloc(m->frf.nf * ch->outputs * sizeof *m->floor);
  pb_status status = h && m->expected && m->floor ? PB_OK : pb_fail_memory(err, "prediction");
  for (size_t f = 0; f < m->frf.nf && status == PB_OK; f++) {
    status = pb_loop_frf(&r->loop, r->law.gain, &m->frf.frequency_hz[f], 1, h, err);
    if (status == PB_OK)
      pb_response_floor(h, r->model->nu, ch->output, ch->outputs, m->floor + f * ch->outputs);
    for (size_t k = 0; k < some && status == PB_OK; k++) {
      m->expected[f * some + k] =
          h[ch->output[k / ch->inputs] * r->model->nu + ch->input[k % ch->inputs]];
    }
  }
  free(h);
  return status;
}

void iff_compare(iff_measurement *m) {
  m->agreement = (pb_agreement){.coherence = 1};
  for (size_t o = 0; o < m->frf.ny; o++) {
    pb_agreement one = pb_agreement_of(&m->frf, m->expected, m->floor, o), *all = &m->agreement;
    all->below += one.below;
    all->lines += one.lines;
    if (one.used == 0) continue;
    if (one.magnitude_percent >= all->magnitude_percent) all->worst_hz = one.worst_hz;
    all->magnitude_percent = fmax(all->magnitude_percent, one.magnitude_percent);
    all->phase_degree = fmax(all->phase_degree, one.phase_degree);
    all->coherence = fmin(all->coherence, one.coherence);
    all->used += one.used;
  }
}

static pb_status evaluate(const iff_result *r, pb_experiment *experiment, bool closed,
                          iff_measurement *m, pb_error *err) {
  pb_status status = pb_experiment_estimate(experiment, &m->frf, err);
  if (status == PB_OK) {
    status = closed ? predict(r, m, err)
                    : pb_exact_responses(r->model, PB_SAMPLED, &r->channels, m->frf.frequency_hz,
                                         m->frf.nf, &m->expected, &m->floor, err);
  }
  if (status != PB_OK) return status;
  iff_compare(m);
  pb_fit_channel channel[FIT_CHANNELS];
  size_t channels = pb_fit_channels(&m->frf, channel, FIT_CHANNELS);
  pb_fit_options options = {.sample_rate = r->model->sample_rate,
                            .weight = PB_FIT_NOISE,
                            .floor = r->experiment.excitation == PB_EXCITE_NOISE ? 1e-3 : 1e-6};
  pb_frf early;
  status = pb_responses_advance(r->model, PB_SAMPLED, &r->channels, &m->frf, &early, err);
  if (status == PB_OK) status = pb_fit_frf(&early, channel, channels, &options, &m->fit, err);
  if (early.h != m->frf.h) free(early.h);
  return status;
}

// The fitted poles that are meant by these members of the modes: a mode that the loops do not reach
// does not show in the measurement.
static pb_status find(iff_result *r, const pb_fit *fit, bool closed, pb_error *err) {
  pb_pole *wanted = malloc((r->modes + 1) * sizeof *wanted);
  pb_pole *of = malloc((r->modes + 1) * sizeof *of);
  pb_status status = wanted && of ? PB_OK : pb_fail_memory(err, "modes");
  for (size_t k = 0; k < r->modes && status == PB_OK; k++)
    wanted[k] = closed ? r->mode[k].closed_predicted : r->mode[k].open_exact;
  if (status == PB_OK)
    status = pb_pole_match(wanted, r->modes, fit->pole, fit->poles, r->model->sample_rate, of, err);
  for (size_t k = 0; k < r->modes && status == PB_OK; k++)
    *(closed ? &r->mode[k].closed_measured : &r->mode[k].open_measured) = of[k];
  free(wanted);
  free(of);
  return status;
}

static pb_status run_both(iff_result *r, pb_bench *bench, pb_experiment *open,
                          pb_experiment *closed, pb_error *err) {
  pb_status status = pb_bench_attach(bench, "iff", r->loops.input, r->loops.count, 0, err);
  if (status == PB_OK && open) {
    status = pb_bench_run(bench, open, "undamped", &r->open.report, err);
  }
  if (status == PB_OK) status = pb_bench_run(bench, closed, "damped", &r->closed.report, err);
  pb_bench_detach(bench);
  return status;
}

pb_status iff_measure(iff_result *r, pb_bench *bench, pb_error *err) {
  pb_experiment *open = NULL, *closed = NULL;
  pb_status status = PB_OK;
  if (!r->options->skip_open_loop) status = make_experiment(r, false, &open, err);
  if (status == PB_OK) status = make_experiment(r, true, &closed, err);
  if (status == PB_OK) status = run_both(r, bench, open, closed, err);
  if (open) pb_bench_tell_trouble(open);
  if (closed) pb_bench_tell_trouble(closed);
  if (status == PB_OK && open) status = evaluate(r, open, false, &r->open, err);
  if (status == PB_OK) status = evaluate(r, closed, true, &r->closed, err);
  if (status == PB_OK && open) status = find(r, &r->open.fit, false, err);
  if (status == PB_OK) status = find(r, &r->closed.fit, true, err);
  pb_experiment_free(open);
  pb_experiment_free(closed);
  return status;
}
