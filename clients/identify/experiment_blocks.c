// An experiment without a round trip a step: its commands do not depend on the samples, so that
// many are sent at once and the samples they led to come back together. See experiment.h.
#include <stdlib.h>
#include <string.h>

#include "experiment_internal.h"

typedef struct block_run {
  pb_experiment *experiment;
  pb_session *session;
  pb_run_report *report;
  uint32_t *input;    // [inputs] indices as the bus counts them
  double *values;     // [steps][inputs]
  double *command;    // [inputs]
  uint64_t sent;      // commands of this round
  uint32_t steps;     // of a block
  uint32_t revision;  // of the session's model
} block_run;

// Rows of a block as samples to the callback; *more is false once it has had enough.
static pb_status rows_take(block_run *r, const pb_block *block, bool *more, pb_error *err) {
  pb_experiment *e = r->experiment;
  if (block->input_count != e->model->nu || block->output_count != e->model->ny ||
      block->revision != r->revision)
    return pb_fail(err, PB_ERR_STATE, "block",
                   "the plant's model was changed: revision %u became %u", r->revision,
                   block->revision);
  for (uint32_t row = 0; row < block->steps && *more; row++) {
    const pb_sample sample = {
        .step = block->step + 1 + row,
        .epoch = block->epoch,
        .revision = block->revision,
        .flags = block->flags[row],
        .input_count = block->input_count,
        .output_count = block->output_count,
        .input = block->input + (size_t)row * block->input_count,
        .output = block->output + (size_t)row * block->output_count,
    };
    *more = pb_experiment_on_sample(e, &sample, r->command);
    r->report->samples++;
  }
  return PB_OK;
}

static uint32_t values_fill(block_run *r, uint64_t total) {
  pb_experiment *e = r->experiment;
  const size_t inputs = e->channels.inputs;
  const uint64_t left = total - r->sent;
  const uint32_t steps = left < r->steps ? (uint32_t)left : r->steps;
  for (uint32_t row = 0; row < steps; row++) {
    pb_experiment_excite(e, r->sent + row);
    memcpy(r->values + row * inputs, e->w, inputs * sizeof *r->values);
  }
  r->sent += steps;
  return steps;
}

// The first block, a step without excitation, brings the sample that the round begins with.
static pb_status blocks_run(block_run *r, pb_error *err) {
  pb_experiment *e = r->experiment;
  const uint32_t inputs = (uint32_t)e->channels.inputs;
  const uint64_t total = pb_experiment_round_steps(e);
  bool more = true;
  pb_status status = PB_OK;
  memset(r->values, 0, inputs * sizeof *r->values);
  for (uint32_t steps = 1; status == PB_OK && more; steps = values_fill(r, total)) {
    pb_block block;
    if (e->watch.interrupted && e->watch.interrupted())
      return pb_fail(err, PB_ERR_STATE, "", "interrupted");
    status = pb_session_block(r->session, r->input, inputs, r->values, steps, 60.0, &block, err);
    if (status == PB_OK) status = rows_take(r, &block, &more, err);
    pb_block_clear(&block);
    if (e->watch.progress) e->watch.progress(e->watch.context, r->report->samples);
  }
  return status;
}

pb_status pb_experiment_run_blocks(pb_experiment *e, pb_session *session, uint32_t steps,
                                   const pb_experiment_watch *watch, pb_run_report *report,
                                   pb_error *err) {
  const size_t inputs = e->channels.inputs;
  pb_run_report unused;
  *(report ? report : &unused) = (pb_run_report){0};
  if (e->feedback.controller || e->realtime)
    return pb_fail(err, PB_ERR_ARGUMENT, "blocks",
                   "an experiment with feedback, or in real time, goes step by step");
  pb_status status = pb_experiment_begin(e, err);
  if (status != PB_OK) return status;
  e->watch = watch ? *watch : (pb_experiment_watch){0};
  block_run r = {.experiment = e,
                 .session = session,
                 .report = report ? report : &unused,
                 .input = malloc(inputs * sizeof *r.input),
                 .values = malloc(steps * inputs * sizeof *r.values),
                 .command = malloc(inputs * sizeof *r.command),
                 .steps = steps,
                 .revision = pb_session_description(session)->revision};
  const double begin = pb_experiment_seconds();
  if (!r.input || !r.values || !r.command) status = pb_fail_memory(err, "blocks");
  for (size_t i = 0; status == PB_OK && i < inputs; i++)
    r.input[i] = (uint32_t)e->channels.input[i];
  if (status == PB_OK) status = blocks_run(&r, err);
  r.report->seconds = pb_experiment_seconds() - begin;
  free(r.input);
  free(r.values);
  free(r.command);
  return pb_experiment_finish(e, status, err);
}
