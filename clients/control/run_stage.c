// One stage of the run: controllers put in place, disturbance, estimate.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "run.h"

enum { BLOCK = 2000 };  // steps of an exchange where nobody answers step by step

static pb_status host(pb_bench *bench, const iff_result *iff, const control_design *hac,
                      pb_error *err) {
  char *body = NULL;
  size_t size;
  FILE *stream = open_memstream(&body, &size);
  if (!stream) return pb_fail_memory(err, "host_controller");
  if (iff) control_write_iff(stream, iff);
  if (hac) control_write_hac(stream, hac);
  bool failed = ferror(stream);
  if (fclose(stream) || failed) {
    free(body);
    return pb_fail_memory(err, "host_controller");
  }
  pb_status status = pb_session_request(bench->session, "host_controller", body, 0, NULL, err);
  free(body);
  return status;
}

static void unhost(pb_bench *bench, const char *channel) {
  char body[64];
  pb_error ignored;
  snprintf(body, sizeof body, "{\"channel\": \"%s\"}", channel);
  pb_session_request(bench->session, "remove_controller", body, 0, NULL, &ignored);
}

// Until what the switching-on has set off has died down: in the band to a thousandth, for the
// spectra see it; above and below it to a hundredth, for the estimate takes the rest out.
static pb_status settle(const run_result *r, control_stage stage, double *seconds, pb_error *err) {
  const control_design *d = r->design;
  const pb_experiment_options *e = &r->experiment;
  double rate = d->model->sample_rate;
  pb_loop_solver *solver = d->solver[stage];
  pb_pole_list poles = {0};
  // pb_settling_time looks at what lies above a quarter of the frequency it is given.
  pb_status status = pb_all_poles(d->model, &poles, err);
  if (status != PB_OK) return status;
  *seconds = pb_settling_time(&poles, rate, 4 * e->f2, 1e-2, 2);
  if (solver) {
    pb_pole_list_clear(&poles);
    status = pb_loop_solver_poles(solver, 1, 0, e->f2, &poles, err);
  }
  for (size_t k = 0; k < poles.count; k++) {
    if (poles.item[k].hz > e->f2) poles.item[k--] = poles.item[--poles.count];
  }
  *seconds = fmax(*seconds, pb_settling_time(&poles, rate, 0, 1e-2, 20));
  *seconds = fmax(*seconds, pb_settling_time(&poles, rate, 4 * e->f1, 1e-3, 40));
  pb_pole_list_clear(&poles);
  return status;
}

static pb_status make_experiment(const run_result *r, control_stage stage, pb_experiment **out,
                                 pb_error *err) {
  pb_experiment_options e = r->experiment;
  pb_status status = PB_OK;
  if (!r->design->options->iff.excite.settle_given) status = settle(r, stage, &e.settle, err);
  e.settle += (double)pb_model_delay(r->design->model) / r->design->model->sample_rate;
  const pb_experiment_feedback feedback = {
      .sign = 1, .from_command = r->design->model->input_electronics != NULL};
  if (status == PB_OK) {
    status = pb_experiment_new(r->design->model, &r->channels, &feedback, &e, r->bench->realtime,
                               out, err);
  }
  return status == PB_OK ? pb_experiment_begin(*out, err) : status;
}

// The disturbance over the bus; in blocks where nothing has to answer each step.
static pb_status disturb(run_result *r, control_stage stage, pb_experiment *experiment,
                         bool answered, pb_error *err) {
  pb_bench *b = r->bench;
  bool alone = b->description->mode == PB_PAUSED || (!b->realtime && b->was_reset);
  b->block = alone && !answered ? BLOCK : 0;
  pb_status status =
      pb_bench_attach(b, "disturbance", r->design->disturbance, r->design->disturbances, 0, err);
  if (status == PB_OK) {
    status = pb_bench_run(b, experiment, control_stage_name[stage],
                          &r->stage[stage].response.report, err);
  }
  pb_bench_detach(b);
  return status;
}

static pb_status with_controllers(run_result *r, control_stage stage, pb_experiment *experiment,
                                  pb_error *err) {
  const control_design *d = r->design;
  pb_bench *b = r->bench;
  bool iff = stage >= STAGE_IFF && d->damped, hac = stage == STAGE_HAC;
  bool hosted = hac && d->options->hosted, keep = d->options->keep && hac;
  hac_client *client = NULL;
  pb_status status = iff ? host(b, &d->iff, NULL, err) : PB_OK;
  iff = iff && status == PB_OK;
  if (status == PB_OK && hosted) {
    status = host(b, NULL, d, err);
    hosted = status == PB_OK;
  }
  if (status == PB_OK && b->was_reset) {
    status = pb_session_request(b->session, "reset", NULL, 0, NULL, err);
  }
  if (status == PB_OK && hac && !d->options->hosted)
    status = hac_client_start(d, b->realtime, &client, err);
  if (status == PB_OK) status = disturb(r, stage, experiment, client != NULL, err);
  pb_error late;
  pb_status ended = hac_client_stop(client, &late);
  if (status == PB_OK && ended != PB_OK) {
    if (err) *err = late;
    status = ended;
  }
  if (hosted && (!keep || status != PB_OK)) unhost(b, "hac");
  if (iff && (!keep || status != PB_OK)) unhost(b, "iff");
  return status;
}

static pb_status expect(const run_result *r, control_stage stage, iff_measurement *m,
                        pb_error *err) {
  const pb_model *model = r->design->model;
  const pb_experiment_channels *ch = &r->channels;
  size_t some = ch->outputs * ch->inputs;
  double complex *full = malloc(model->ny * model->nu * sizeof *full);
  m->expected = malloc(m->frf.nf * some * sizeof *m->expected);
  m->floor = malloc(m->frf.nf * ch->outputs * sizeof *m->floor);
  pb_status status = full && m->expected && m->floor ? PB_OK : pb_fail_memory(err, "prediction");
  for (size_t f = 0; f < m->frf.nf && status == PB_OK; f++) {
    status = control_response(r->design, stage, &m->frf.frequency_hz[f], 1, full, err);
    if (status == PB_OK)
      pb_response_floor(full, model->nu, ch->output, ch->outputs, m->floor + f * ch->outputs);
    for (size_t k = 0; k < some && status == PB_OK; k++) {
      m->expected[f * some + k] =
          full[ch->output[k / ch->inputs] * model->nu + ch->input[k % ch->inputs]];
    }
  }
  free(full);
  if (status == PB_OK) iff_compare(m);
  return status;
}

pb_status run_stage_carry_out(run_result *r, control_stage stage, pb_error *err) {
  run_stage *s = &r->stage[stage];
  pb_experiment *experiment = NULL;
  pb_experiment_layout layout = {0};
  FILE *samples = tmpfile();
  pb_status status = samples ? make_experiment(r, stage, &experiment, err)
                             : pb_fail(err, PB_ERR_IO, "samples", "no temporary file can be made");
  if (status == PB_OK) {
    pb_experiment_save_to(experiment, samples);
    layout = pb_experiment_layout_of(experiment);
    status = with_controllers(r, stage, experiment, err);
    s->trouble = *pb_experiment_trouble_of(experiment);
  }
  if (status == PB_OK) status = pb_experiment_estimate(experiment, &s->response.frf, err);
  if (status == PB_OK) status = expect(r, stage, &s->response, err);
  if (status == PB_OK) {
    status = run_spectra(r, stage, &layout, pb_experiment_period(experiment), samples, err);
  }
  s->done = status == PB_OK;
  pb_experiment_free(experiment);
  if (samples) fclose(samples);
  return status;
}
