// The controller, its gain, and what the published model predicts of the closed loop.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "control/lti_ops.h"
#include "iff_tool.h"

enum { BELOW = 90, ABOVE = 45 };  // gains of the root locus on either side of the chosen one

static pb_status make_controller(iff_result *r, pb_error *err) {
  const iff_options *o = r->options;
  r->law = pb_iff_default(1);
  if (o->integrator_hz > 0) r->law.integrator_hz = o->integrator_hz;
  if (o->highpass_hz > 0) r->law.highpass_hz = o->highpass_hz;
  pb_status status =
      pb_iff_discrete(&r->law, r->loops.count, r->model->sample_rate, &r->controller, err);
  if (status != PB_OK) return status;
  unsigned delay = o->delay >= 0 ? (unsigned)o->delay : r->bench->realtime;
  r->loop = (pb_loop){r->model, &r->controller, r->loops.output, r->loops.input, o->sign, delay};
  return pb_loop_solver_new(&r->loop, &r->solver, err);
}

static pb_status choose_gain(iff_result *r, pb_error *err) {
  const pb_experiment_options *e = &r->experiment;
  pb_status status = PB_OK;
  r->law.gain = r->options->gain;
  if (!r->options->gain_given) {
    status = pb_best_gain_find(r->solver, e->f1, e->f2, 0, &r->best, err);
    r->law.gain = r->best.gain;
    r->searched = status == PB_OK;
  }
  if (status == PB_OK) status = pb_lti_copy(&r->controller, &r->controller_used, err);
  if (status == PB_OK) pb_lti_scale(&r->controller_used, r->law.gain);
  return status;
}

static pb_status check_stability(iff_result *r, pb_error *err) {
  pb_status status = pb_loop_solver_stable(r->solver, r->law.gain, &r->stable, &r->worst, err);
  if (status != PB_OK || r->stable || r->options->force) return status;
  char pole[96];
  pb_pole_format(r->worst, r->model->sample_rate, pole, sizeof pole);
  return pb_fail(
      err, PB_ERR_STATE, "gain",
      "with %g the loop is predicted to be unstable: a pole at %s (--force closes it all "
      "the same)",
      r->law.gain, pole);
}

// 0, then even ratios from a hundredth of the gain to ten times it.
static pb_status make_locus(iff_result *r, pb_error *err) {
  double gain[BELOW + ABOVE + 2] = {0};
  for (int k = 0; k <= BELOW + ABOVE; k++) {
    gain[k + 1] =
        r->law.gain * pow(10, k < BELOW ? 2.0 * (k - BELOW) / BELOW : 1.0 * (k - BELOW) / ABOVE);
  }
  r->chosen = BELOW + 1;
  return pb_rootlocus_compute(r->solver, gain, BELOW + ABOVE + 2, r->experiment.f1,
                              r->experiment.f2, &r->locus, err);
}

static int by_open_frequency(const void *a, const void *b) {
  const iff_mode *p = a, *q = b;
  return (p->open_exact.hz > q->open_exact.hz) - (p->open_exact.hz < q->open_exact.hz);
}

static pb_status list_modes(iff_result *r, pb_error *err) {
  const pb_pole unknown = {.z = NAN, .hz = NAN, .damping = NAN};
  r->mode = calloc(r->locus.branches + 1, sizeof *r->mode);
  if (!r->mode) return pb_fail_memory(err, "modes");
  for (size_t b = 0; b < r->locus.branches; b++) {
    const pb_pole *p = r->locus.pole + b * r->locus.gains;
    if (!r->locus.is_mode[b]) continue;
    r->mode[r->modes++] = (iff_mode){p[0], unknown, p[r->chosen], unknown};
  }
  qsort(r->mode, r->modes, sizeof *r->mode, by_open_frequency);
  if (r->modes > 0) return PB_OK;
  return pb_fail(err, PB_ERR_STATE, "--band", "the plant has no mode within %g … %g Hz",
                 r->experiment.f1, r->experiment.f2);
}

static pb_status design(iff_result *r, pb_error *err) {
  pb_status status = make_controller(r, err);
  if (status == PB_OK) status = choose_gain(r, err);
  if (status == PB_OK && r->law.gain <= 0) {
    status = pb_fail(err, PB_ERR_ARGUMENT, "gain",
                     "%g is not positive; --sign=-1 turns the feedback", r->law.gain);
  }
  if (status == PB_OK) status = check_stability(r, err);
  if (status == PB_OK) status = make_locus(r, err);
  if (status == PB_OK) status = list_modes(r, err);
  return status;
}

pb_status iff_prepare(const iff_options *o, const pb_bench *bench, iff_result *r, pb_error *err) {
  *r = (iff_result){.options = o, .bench = bench, .model = bench->model};
  iff_experiment_defaults(o, r->model, &r->experiment);
  pb_status status = iff_choose_loops(r->model, o, &r->loops, err);
  r->output = malloc((r->model->ny + 1) * sizeof *r->output);
  if (status == PB_OK && !r->output) status = pb_fail_memory(err, "outputs");
  for (size_t k = 0; r->output && k < r->model->ny; k++) r->output[k] = k;
  r->channels = (pb_experiment_channels){r->loops.input, r->output, r->loops.count, r->model->ny};
  return status == PB_OK ? design(r, err) : status;
}

void iff_measurement_clear(iff_measurement *m) {
  pb_frf_clear(&m->frf);
  free(m->expected);
  free(m->floor);
  pb_fit_clear(&m->fit);
  *m = (iff_measurement){0};
}

void iff_result_clear(iff_result *r) {
  iff_measurement_clear(&r->open);
  iff_measurement_clear(&r->closed);
  free(r->mode);
  pb_rootlocus_clear(&r->locus);
  pb_best_gain_clear(&r->best);
  pb_loop_solver_free(r->solver);
  pb_lti_free(&r->controller);
  pb_lti_free(&r->controller_used);
  iff_loops_clear(&r->loops);
  free(r->output);
  *r = (iff_result){0};
}
