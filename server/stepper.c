// See stepper.h.
#include "stepper.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "hash.h"

static void record_make(pb_stepper *stepper, uint32_t flags) {
  const pb_model *model = stepper->model;
  pb_record *now = &stepper->now;
  pb_step_output(model, stepper->state, stepper->y);
  now->step = stepper->state->step;
  now->revision = stepper->revision;
  now->nu = (uint32_t)model->nu;
  now->ny = (uint32_t)model->ny;
  memcpy(now->u, stepper->state->data + stepper->state->nx, model->nu * sizeof(double));
  memcpy(now->y, stepper->y, model->ny * sizeof(double));
  for (size_t i = 0; i < model->ny; i++)
    if (!isfinite(now->y[i])) flags |= PB_FLAG_NON_FINITE;
  if (stepper->state->saturated) flags |= PB_FLAG_SATURATED;
  now->flags = flags;
}

pb_status pb_stepper_admits(const pb_model *model, pb_error *err) {
  if (model->nu > PB_STEPPER_INPUTS)
    return pb_fail(err, PB_ERR_ARGUMENT, "/inputs", "%zu inputs, the bus carries up to %d",
                   model->nu, PB_STEPPER_INPUTS);
  if (model->ny > PB_STEPPER_OUTPUTS)
    return pb_fail(err, PB_ERR_ARGUMENT, "/outputs", "%zu outputs, the bus carries up to %d",
                   model->ny, PB_STEPPER_OUTPUTS);
  return PB_OK;
}

pb_status pb_stepper_init(pb_stepper *stepper, const pb_model *model, pb_error *err) {
  memset(stepper, 0, sizeof *stepper);
  pb_status status = pb_stepper_admits(model, err);
  if (status) return status;
  stepper->state = pb_state_new(model);
  if (!stepper->state) return pb_fail_memory(err, "state");
  stepper->model = model;
  stepper->revision = 1;
  pb_stepper_restart(stepper, NULL, PB_HASH_START, 1);
  return PB_OK;
}

void pb_stepper_free(pb_stepper *stepper) {
  free(stepper->state);
  pb_host_free(stepper->host);
  memset(stepper, 0, sizeof *stepper);
}

void pb_stepper_step(pb_stepper *stepper, const double *u, uint32_t flags) {
  double sum[PB_STEPPER_INPUTS];
  const pb_model *model = stepper->model;
  memcpy(sum, u, model->nu * sizeof *sum);
  if (stepper->host) pb_host_run(stepper->host, stepper->y, sum);
  pb_step_advance(model, stepper->state, sum);
  record_make(stepper, flags);
  pb_record *now = &stepper->now;
  now->hash = pb_hash_step(now->hash, now->step, now->revision, now->u, now->nu, now->y, now->ny);
}

static void model_swap(pb_stepper *stepper, pb_change *change) {
  const pb_model *old_model = stepper->model;
  pb_state *old_state = stepper->state;
  if (change->handover)
    pb_handover_apply(change->handover, old_state, change->state);
  else if (change->transfer)
    pb_transfer_apply(change->transfer, old_state, change->state);
  stepper->model = change->model;
  stepper->state = change->state;
  stepper->revision = change->revision;
  change->model = old_model;
  change->state = old_state;
  pb_step_output(stepper->model, stepper->state, stepper->y);
}

void pb_stepper_change(pb_stepper *stepper, pb_change *change) {
  change->made_step = stepper->state->step;
  if (change->model) model_swap(stepper, change);
  if (!change->swaps_host) return;
  pb_host *old = stepper->host;
  if (change->host && old) pb_host_take_state(change->host, old);
  stepper->host = change->host;
  change->host = old;
}

void pb_stepper_renew(pb_stepper *stepper) {
  record_make(stepper, stepper->now.flags & ~(uint32_t)PB_FLAG_NON_FINITE);
}

void pb_stepper_restart(pb_stepper *stepper, const pb_state *state, uint64_t hash, uint32_t epoch) {
  if (state)
    memcpy(stepper->state, state, pb_state_bytes(stepper->model));
  else
    pb_state_reset(stepper->model, stepper->state);
  if (stepper->host) pb_host_reset(stepper->host);
  stepper->now.epoch = epoch;
  stepper->now.hash = hash;
  record_make(stepper, 0);
}
