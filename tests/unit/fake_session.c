// A session without a bus: see fake_session.h.
#include "fake_session.h"

#include <stdlib.h>
#include <string.h>

#include "signal/random.h"

enum { MAX_DELAY = 4 };

struct pb_session {
  const pb_model *model;
  fake_session_options options;
  pb_state *state;
  size_t inputs, input[32];
  double command[MAX_DELAY + 1][32];  // newest first
  double *y, *u;
  pb_random random;
};

pb_session *fake_session_new(const pb_model *model, fake_session_options options) {
  pb_session *s = calloc(1, sizeof *s);
  s->model = model;
  s->options = options;
  s->state = pb_state_new(model);
  s->y = calloc(model->ny, sizeof *s->y);
  s->u = calloc(model->nu, sizeof *s->u);
  pb_random_seed(&s->random, 77, 0);
  return s;
}

void fake_session_free(pb_session *s) {
  free(s->state);
  free(s->y);
  free(s->u);
  free(s);
}

const pb_model *pb_session_model(const pb_session *s) {
  return s->model;
}

pb_status pb_session_attach(pb_session *s, const pb_attach_options *o, pb_error *err) {
  s->inputs = o->input_count;
  for (size_t i = 0; i < s->inputs; i++) {
    int index = pb_model_input(s->model, o->inputs[i]);
    if (index < 0) return pb_fail(err, PB_ERR_REFERENCE, o->inputs[i], "no such input");
    s->input[i] = (size_t)index;
  }
  return PB_OK;
}

static void advance(pb_session *s) {
  memset(s->u, 0, s->model->nu * sizeof *s->u);
  for (size_t i = 0; i < s->inputs; i++) s->u[s->input[i]] = s->command[s->options.delay][i];
  pb_step_advance(s->model, s->state, s->u);
  memmove(s->command[1], s->command[0], MAX_DELAY * sizeof s->command[0]);
}

pb_status pb_session_run(pb_session *s, const pb_run_options *o, pb_run_report *report,
                         pb_error *err) {
  (void)err;
  if (report) *report = (pb_run_report){0};
  for (;;) {
    uint64_t step = s->state->step;
    pb_step_output(s->model, s->state, s->y);
    for (size_t k = 0; k < s->model->ny; k++) {
      s->y[k] += s->options.noise * pb_random_gaussian(&s->random);
    }
    pb_sample sample = {.step = step,
                        .input_count = (uint32_t)s->model->nu,
                        .output_count = (uint32_t)s->model->ny,
                        .input = s->state->data + s->model->nx,
                        .output = s->y};
    bool seen = s->options.miss_every == 0 || step % s->options.miss_every != 17;
    if (seen && !o->on_sample(o->context, &sample, s->command[0])) return PB_OK;
    if (report) report->samples++;
    advance(s);
  }
}
