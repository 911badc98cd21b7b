// Which signals the loops are closed between, and where the plant is disturbed and watched.
#include <stdlib.h>
#include <string.h>

#include "control_tool.h"

static const char *const forces[] = {"Fx", "Fy", "Fz", "Mx", "My", "Mz"};
static const char *const motions[] = {"Dx", "Dy", "Dz", "Rx", "Ry", "Rz"};

int control_metrology_of(const pb_model *model, size_t input) {
  static const char *const actuator[] = {"Va", "f"};
  const char *name = model->input[input].name;
  for (size_t k = 0; k < 2; k++) {
    size_t length = strlen(actuator[k]);
    char other[128];
    if (strncmp(name, actuator[k], length) != 0) continue;
    int written = snprintf(other, sizeof other, "dL%s", name + length);
    if (written < 0 || (size_t)written >= sizeof other) continue;
    int output = pb_model_output(model, other);
    if (output >= 0) return output;
  }
  return -1;
}

static pb_status choose_actuators(control_design *d, pb_error *err) {
  const iff_options *o = &d->iff_options;
  if (d->damped) return iff_prepare(o, &d->plant->bench, &d->iff, err);
  iff_loops *l = &d->iff.loops;
  if (o->outputs.count == 0 && o->inputs.count > 0) {
    return pb_bench_choose(&o->inputs, d->model->input, d->model->nu, "input", &l->input, &l->count,
                           err);
  }
  return iff_choose_loops(d->model, o, l, err);
}

static pb_status choose_metrology(control_design *d, pb_error *err) {
  const pb_name_list *names = &d->options->metrology;
  const pb_model *m = d->model;
  if (names->count > 0) {
    size_t count;
    pb_status status =
        pb_bench_choose(names, m->output, m->ny, "output", &d->metrology, &count, err);
    if (status == PB_OK && count != d->n) {
      status = pb_fail(err, PB_ERR_ARGUMENT, "--metrology", "%zu outputs for %zu actuators", count,
                       d->n);
    }
    return status;
  }
  d->metrology = malloc((d->n + 1) * sizeof *d->metrology);
  if (!d->metrology) return pb_fail_memory(err, "metrology");
  for (size_t k = 0; k < d->n; k++) {
    const char *name = m->input[d->channels.input[k]].name;
    int output = control_metrology_of(m, d->channels.input[k]);
    if (output < 0) {
      return pb_fail(err, PB_ERR_REFERENCE, name,
                     "the plant has no output dL… of the same name: use --metrology");
    }
    d->metrology[k] = (size_t)output;
  }
  return PB_OK;
}

// Those of six usual names that the plant has.
static void usual(const char *const name[6], const pb_signal *signal, size_t count, size_t *index,
                  size_t *found) {
  *found = 0;
  for (size_t k = 0; k < 6; k++) {
    for (size_t i = 0; i < count; i++) {
      if (strcmp(signal[i].name, name[k]) == 0) index[(*found)++] = i;
    }
  }
}

static bool is_actuator(const control_design *d, size_t input) {
  for (size_t k = 0; k < d->n; k++) {
    if (d->channels.input[k] == input) return true;
  }
  return false;
}

static pb_status choose_motion(control_design *d, pb_error *err) {
  const pb_model *m = d->model;
  const pb_name_list *names = &d->options->motion;
  if (names->count > 0)
    return pb_bench_choose(names, m->output, m->ny, "output", &d->motion, &d->motions, err);
  d->motion = malloc((d->n + 6) * sizeof *d->motion);
  if (!d->motion) return pb_fail_memory(err, "motion");
  usual(motions, m->output, m->ny, d->motion, &d->motions);
  for (size_t k = 0; d->motions == 0 && k < d->n; k++) d->motion[k] = d->metrology[k];
  if (d->motions == 0) d->motions = d->n;
  return PB_OK;
}

static pb_status choose_disturbance(control_design *d, pb_error *err) {
  const pb_model *m = d->model;
  const pb_name_list *names = &d->options->disturbance;
  if (names->count > 0) {
    pb_status status =
        pb_bench_choose(names, m->input, m->nu, "input", &d->disturbance, &d->disturbances, err);
    for (size_t k = 0; k < d->disturbances && status == PB_OK; k++) {
      if (!is_actuator(d, d->disturbance[k])) continue;
      status = pb_fail(err, PB_ERR_ARGUMENT, m->input[d->disturbance[k]].name,
                       "is an actuator of the loops, not a disturbance");
    }
    return status;
  }
  d->disturbance = malloc((m->nu + 6) * sizeof *d->disturbance);
  if (!d->disturbance) return pb_fail_memory(err, "disturbance");
  usual(forces, m->input, m->nu, d->disturbance, &d->disturbances);
  bool named = d->disturbances > 0;
  for (size_t i = 0; !named && i < m->nu; i++) {
    if (!is_actuator(d, i)) d->disturbance[d->disturbances++] = i;
  }
  if (d->disturbances > 0) return PB_OK;
  return pb_fail(err, PB_ERR_REFERENCE, m->name ? m->name : "",
                 "every input is an actuator of the loops: nothing can disturb the plant");
}

pb_status control_choose_channels(control_design *d, pb_error *err) {
  pb_status status = choose_actuators(d, err);
  if (status != PB_OK) return status;
  d->n = d->iff.loops.count;
  d->channels = (pb_hac_channels){d->n, d->iff.loops.input, d->iff.loops.output, NULL};
  status = choose_metrology(d, err);
  if (status != PB_OK) return status;
  d->channels.metrology = d->metrology;
  if (!d->channels.sensor) d->channels.sensor = d->metrology;  // read with a gain of zero
  status = choose_motion(d, err);
  if (status == PB_OK) status = choose_disturbance(d, err);
  return status;
}

const char *control_loop_name(const control_design *d, size_t i) {
  bool motion = d->frame.cartesian && d->motions == d->n;
  return d->model->output[motion ? d->motion[i] : d->metrology[i]].name;
}
