// See stepper.h.
#include "stepper.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static void record_make(pb_stepper *stepper, uint32_t flags) {
  const pb_model *model = stepper->model;
  pb_record *now = &stepper->now;
  pb_step_output(model, stepper->state, now->y);
  now->step = stepper->state->step;
  memcpy(now->u, stepper->state->data + stepper->state->nx, model->nu * sizeof(double));
  for (size_t i = 0; i < model->ny; i++)
    if (!isfinite(now->y[i])) flags |= PB_FLAG_NON_FINITE;
  if (stepper->state->saturated) flags |= PB_FLAG_SATURATED;
  now->flags = flags;
}

pb_status pb_stepper_init(pb_stepper *stepper, const pb_model *model, pb_error *err) {
  memset(stepper, 0, sizeof *stepper);
  if (model->nu > PB_STEPPER_INPUTS)
    return pb_fail(err, PB_ERR_ARGUMENT, "/inputs", "%zu inputs, the bus carries up to %d",
                   model->nu, PB_STEPPER_INPUTS);
  if (model->ny > PB_STEPPER_OUTPUTS)
    return pb_fail(err, PB_ERR_ARGUMENT, "/outputs", "%zu outputs, the bus carries up to %d",
                   model->ny, PB_STEPPER_OUTPUTS);
  stepper->state = pb_state_new(model);
  if (!stepper->state) return pb_fail_memory(err, "state");
  stepper->model = model;
  pb_stepper_restart(stepper, NULL, 1);
  return PB_OK;
}

void pb_stepper_free(pb_stepper *stepper) {
  free(stepper->state);
  memset(stepper, 0, sizeof *stepper);
}

void pb_stepper_step(pb_stepper *stepper, const double *u, uint32_t flags) {
  pb_step_advance(stepper->model, stepper->state, u);
  record_make(stepper, flags);
}

void pb_stepper_restart(pb_stepper *stepper, const pb_state *state, uint32_t epoch) {
  if (state)
    memcpy(stepper->state, state, pb_state_bytes(stepper->model));
  else
    pb_state_reset(stepper->model, stepper->state);
  stepper->now.epoch = epoch;
  record_make(stepper, 0);
}
