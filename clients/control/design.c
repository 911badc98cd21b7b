// From the options to controllers: IFF, then HAC around what it damps.
#include <math.h>
#include <stdlib.h>

#include "control/lti_ops.h"
#include "control_tool.h"

const char *const control_stage_name[STAGES] = {"undamped", "IFF", "HAC-LAC"};
const char *const control_stage_key[STAGES] = {"undamped", "iff", "hac"};

static pb_hac_shape shape_of(const control_options *o, double sample_rate) {
  pb_hac_shape s = pb_hac_shape_default(o->bandwidth_hz, sample_rate);
  if (o->lead >= 0) s.lead = o->lead;
  if (o->integrator_hz >= 0) s.integrator_hz = o->integrator_hz;
  if (o->lowpass_hz >= 0) s.lowpass_hz = o->lowpass_hz;
  return s;
}

static const pb_lti *iff_of(const control_design *d) {
  return d->damped ? &d->iff.controller_used : NULL;
}

// From the bandwidth on, fine where the damped plant has modes.
static pb_status gain_grid(const control_design *d, double **hz, size_t *count, pb_error *err) {
  enum { POINTS = 300 };
  pb_pole_list poles = {0};
  *hz = NULL;
  pb_status status = control_near_poles(d, &poles, err);
  if (status == PB_OK) {
    status = pb_margins_grid(d->shape.bandwidth_hz, d->model->sample_rate / 2, POINTS, &poles, hz,
                             count, err);
  }
  pb_pole_list_clear(&poles);
  return status;
}

static pb_status find_gains(control_design *d, pb_error *err) {
  size_t n = d->n, count = 0;
  const double far_below = 0.01 * d->shape.bandwidth_hz;
  double *hz;
  pb_status status = gain_grid(d, &hz, &count, err);
  if (status != PB_OK) return status;
  double complex *plant = malloc((count + 1) * n * n * sizeof *plant);
  d->gain = malloc(n * sizeof *d->gain);
  if (!plant || !d->gain) status = pb_fail_memory(err, "gains");
  const pb_hac_frame *frame = &d->frame.transform;
  if (status == PB_OK) {
    status =
        pb_hac_plant(d->model, &d->channels, frame, iff_of(d), d->iff_delay, hz, count, plant, err);
  }
  if (status == PB_OK) {
    status = pb_hac_plant(d->model, &d->channels, frame, iff_of(d), d->iff_delay, &far_below, 1,
                          plant + count * n * n, err);
  }
  bool floating = d->model->modes > 0 && d->model->mode_hz[0] == 0;
  if (status == PB_OK) {
    status = pb_hac_gains(&d->shape_lti, hz, count, plant, plant + count * n * n, n, floating,
                          d->gain, err);
  }
  free(plant);
  free(hz);
  return status;
}

static pb_status close_stage(control_design *d, control_stage stage, pb_lti *controller,
                             pb_error *err) {
  d->loop[stage] =
      (pb_loop){d->model, controller, d->read, d->channels.input, 1, 0};  // delays are in it
  return pb_loop_solver_new(&d->loop[stage], &d->solver[stage], err);
}

static pb_status close_iff(control_design *d, pb_error *err) {
  size_t n = d->n;
  d->read = malloc(2 * n * sizeof *d->read);
  if (!d->read) return pb_fail_memory(err, "loops");
  for (size_t k = 0; k < n; k++) {
    d->read[k] = d->channels.sensor[k];
    d->read[n + k] = d->metrology[k];
  }
  if (!d->damped) return PB_OK;
  pb_status status = pb_hac_combine(iff_of(d), d->iff_delay, NULL, 0, n, &d->low, err);
  return status == PB_OK ? close_stage(d, STAGE_IFF, &d->low, err) : status;
}

static pb_status close_hac(control_design *d, pb_error *err) {
  size_t n = d->n;
  pb_status status =
      pb_hac_controller(&d->shape_lti, d->gain, &d->frame.transform, n, &d->hac, err);
  if (status == PB_OK) {
    status = pb_hac_combine(iff_of(d), d->iff_delay, &d->hac, d->hac_delay, n, &d->both, err);
  }
  return status == PB_OK ? close_stage(d, STAGE_HAC, &d->both, err) : status;
}

// In real time a client's answer acts a step later; what the daemon hosts acts at once, as in
// lockstep.
static void choose_delays(control_design *d) {
  const control_options *o = d->options;
  bool late = d->plant->bench.realtime && !o->hosted;
  d->iff_delay = o->iff.delay >= 0 ? (unsigned)o->iff.delay : 0;
  d->hac_delay = o->iff.delay >= 0 ? (unsigned)o->iff.delay : late;
  d->iff_options = o->iff;
  d->iff_options.delay = (int)d->iff_delay;
}

pb_status control_design_make(const control_options *options, const control_plant *plant,
                              control_design *d, pb_error *err) {
  *d = (control_design){.options = options,
                        .plant = plant,
                        .model = plant->bench.model,
                        .damped = !options->no_iff,
                        .shape = shape_of(options, plant->bench.model->sample_rate)};
  choose_delays(d);
  pb_status status = pb_hac_shape_discrete(&d->shape, d->model->sample_rate, &d->shape_lti, err);
  if (status == PB_OK) status = control_choose_channels(d, err);
  if (status == PB_OK) status = control_make_frame(d, err);
  if (status == PB_OK) status = close_iff(d, err);
  if (status == PB_OK) status = find_gains(d, err);
  if (status == PB_OK) status = close_hac(d, err);
  if (status == PB_OK) status = control_prove(d, err);
  if (status != PB_OK) control_design_clear(d);
  return status;
}

pb_status control_response(const control_design *d, control_stage stage, const double *hz,
                           size_t nf, double complex *h, pb_error *err) {
  if (stage == STAGE_UNDAMPED || (stage == STAGE_IFF && !d->damped))
    return pb_model_frf(d->model, PB_SAMPLED, hz, nf, h, err);
  return pb_loop_frf(&d->loop[stage], 1, hz, nf, h, err);
}

void control_design_clear(control_design *d) {
  for (int s = 0; s < STAGES; s++) pb_loop_solver_free(d->solver[s]);
  iff_result_clear(&d->iff);
  control_frame_clear(&d->frame);
  pb_lti_free(&d->shape_lti);
  pb_lti_free(&d->hac);
  pb_lti_free(&d->low);
  pb_lti_free(&d->both);
  pb_pole_list_clear(&d->modes);
  free(d->metrology);
  free(d->motion);
  free(d->disturbance);
  free(d->gain);
  free(d->read);
  *d = (control_design){0};
}
