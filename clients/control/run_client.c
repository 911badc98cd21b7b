// HAC as a client of the bus beside the one that disturbs the plant: see run.h.
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>

#include "control/lti_ops.h"
#include "interrupt.h"
#include "run.h"

struct hac_client {
  const control_design *design;
  pb_session *session;
  double *x, *scratch, *y;  // of the controller
  atomic_bool stop;
  pthread_t thread;
  bool running;
  pb_status status;  // of the thread, once it has been joined
  pb_error error;
};

static bool on_sample(void *context, const pb_sample *sample, double *command) {
  hac_client *c = context;
  const control_design *d = c->design;
  if (atomic_load(&c->stop)) return false;
  for (size_t i = 0; i < d->n; i++) c->y[i] = sample->output[d->metrology[i]];
  pb_lti_step(&d->hac, c->x, c->scratch, c->y, command);
  for (size_t i = 0; i < d->n; i++) command[i] = -command[i];
  return true;
}

static void *serve(void *context) {
  hac_client *c = context;
  pb_run_report report;
  const pb_run_options options = {
      .on_sample = on_sample, .context = c, .stall = 20, .interrupted = pb_interrupted};
  c->status = pb_session_run(c->session, &options, &report, &c->error);
  return NULL;
}

static pb_status attach(hac_client *c, bool realtime, pb_error *err) {
  const control_design *d = c->design;
  const char **name = malloc(d->n * sizeof *name);
  if (!name) return pb_fail_memory(err, "hac");
  for (size_t i = 0; i < d->n; i++) name[i] = d->model->input[d->channels.input[i]].name;
  const pb_attach_options options = {.channel = "hac",
                                     .inputs = name,
                                     .input_count = (uint32_t)d->n,
                                     .barrier = !realtime,
                                     .silence = "zero"};
  pb_status status = pb_session_attach(c->session, &options, err);
  free(name);
  return status;
}

pb_status hac_client_start(const control_design *d, bool realtime, hac_client **out,
                           pb_error *err) {
  hac_client *c = *out = calloc(1, sizeof *c);
  if (!c) return pb_fail_memory(err, "hac");
  c->design = d;
  c->x = calloc(d->hac.nx + 1, sizeof *c->x);
  c->scratch = calloc(d->hac.nx + 1, sizeof *c->scratch);
  c->y = calloc(d->n, sizeof *c->y);
  pb_session_options options = pb_common_session(&d->options->iff.common);
  options.plant = d->plant->bench.description->name;
  pb_status status = c->x && c->scratch && c->y ? pb_session_open(&options, &c->session, err)
                                                : pb_fail_memory(err, "hac");
  if (status == PB_OK) status = attach(c, realtime, err);
  if (status == PB_OK) {
    c->running = pthread_create(&c->thread, NULL, serve, c) == 0;
    if (!c->running) status = pb_fail(err, PB_ERR_STATE, "hac", "a thread cannot be made");
  }
  if (status != PB_OK) {
    hac_client_stop(c, NULL);
    *out = NULL;
  }
  return status;
}

pb_status hac_client_stop(hac_client *c, pb_error *err) {
  if (!c) return PB_OK;
  atomic_store(&c->stop, true);
  if (c->running) pthread_join(c->thread, NULL);
  pb_status status = c->status;
  if (status != PB_OK) pb_fail(err, status, c->error.where, "HAC's client: %s", c->error.message);
  pb_session_close(c->session);
  free(c->x);
  free(c->scratch);
  free(c->y);
  free(c);
  return status;
}
