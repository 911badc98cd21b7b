// soak_client DOMAIN PLANT SEED: a client without a plan. Until SIGTERM it attaches to a channel
// that it draws, with a role, a priority and a silence policy that it draws, runs for a while in
// which it commands small sines, and detaches; or it only looks on. It expects to be stopped, and
// the plant to be reset, reconfigured and switched between its modes: whatever ends a run, it tries
// again, with the same session or a new one. At its end it tells what it met.
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "interrupt.h"
#include "session.h"
#include "signal/random.h"

enum { CHANNELS = 6, MOST_INPUTS = 3 };

typedef struct soak_client {
  pb_session_options options;
  pb_random random;
  pb_session *session;
  uint64_t sessions, attaches, refused, runs, broken, evicted, changed, samples, bad;
} soak_client;

typedef struct soak_run {
  uint32_t inputs;
  uint64_t left, last;
  uint32_t epoch;
  bool begun, bad;
  double amplitude;
} soak_run;

static uint64_t draw(soak_client *c, uint64_t below) {
  return (uint64_t)(pb_random_uniform(&c->random) * (double)below);
}

// A sample that is not finite, or a step that goes back within an epoch, must never be seen.
static bool is_bad(const soak_run *r, const pb_sample *x) {
  for (uint32_t i = 0; i < x->input_count; i++)
    if (!isfinite(x->input[i])) return true;
  for (uint32_t i = 0; i < x->output_count; i++)
    if (!isfinite(x->output[i])) return true;
  return r->begun && x->epoch == r->epoch && x->step <= r->last;
}

static bool on_sample(void *context, const pb_sample *sample, double *command) {
  soak_run *r = context;
  r->bad = r->bad || is_bad(r, sample);
  r->begun = true;
  r->last = sample->step;
  r->epoch = sample->epoch;
  for (uint32_t i = 0; i < r->inputs; i++)
    command[i] = r->amplitude * sin(1e-7 * (double)sample->time_ns);
  return r->left-- > 0 && !pb_interrupted();
}

static pb_status attach(soak_client *c, soak_run *run, pb_error *err) {
  static const char *const silence[] = {"hold", "zero", "ramp"};
  const pb_model *model = pb_session_model(c->session);
  const char *input[MOST_INPUTS];
  char channel[16];
  uint64_t first = draw(c, model->nu);
  snprintf(channel, sizeof channel, "channel%d", (int)draw(c, CHANNELS));
  run->inputs = 1 + (uint32_t)draw(c, model->nu < MOST_INPUTS ? model->nu : MOST_INPUTS);
  for (uint32_t i = 0; i < run->inputs; i++) input[i] = model->input[(first + i) % model->nu].name;
  const pb_attach_options options = {.channel = channel,
                                     .inputs = input,
                                     .input_count = run->inputs,
                                     .barrier = draw(c, 3) > 0,
                                     .priority = (int32_t)draw(c, 4),
                                     .silence = silence[draw(c, 3)],
                                     .lease = 0.05 + 2.0 * pb_random_uniform(&c->random),
                                     .guard = 0.1 + 0.5 * pb_random_uniform(&c->random)};
  const pb_status status = pb_session_attach(c->session, &options, err);
  if (status)
    c->refused++;
  else
    c->attaches++;
  return status;
}

// One stay on the plant. A session of a model that is no longer there is of no more use.
static pb_status stay(soak_client *c, pb_error *err) {
  pb_run_report report = {0};
  soak_run run = {.left = 100 + draw(c, 10000), .amplitude = 0.1 * pb_random_uniform(&c->random)};
  const pb_run_options options = {.on_sample = on_sample,
                                  .context = &run,
                                  .stall = 2.0,
                                  .interrupted = pb_interrupted,
                                  .any_revision = draw(c, 2) > 0};
  pb_status status = draw(c, 6) > 0 ? attach(c, &run, err) : PB_OK;
  if (status) return status;
  status = pb_session_run(c->session, &options, &report, err);
  pb_session_detach(c->session);
  c->runs++;
  c->samples += report.samples;
  c->bad += run.bad;
  if (status && !pb_interrupted()) {
    c->broken++;
    c->changed += strstr(err->message, "changed") != NULL;
    c->evicted += strstr(err->message, "late at step") != NULL;
  }
  return status;
}

static void work(soak_client *c) {
  pb_error err;
  while (!pb_interrupted()) {
    c->options.history = draw(c, 2) ? 64 : 0;
    if (pb_session_open(&c->options, &c->session, &err)) continue;  // has waited for its timeout
    c->sessions++;
    pb_status status = PB_OK;
    // After an eviction the session is still good; after anything else it may be.
    for (uint64_t failures = 0; failures < 2 && !pb_interrupted(); failures += status != PB_OK)
      status = stay(c, &err);
    pb_session_close(c->session);
    c->session = NULL;
  }
}

int main(int argc, char **argv) {
  if (argc != 4) return 2;
  soak_client c = {
      .options = {.domain = (uint32_t)atoi(argv[1]), .plant = argv[2], .timeout = 5.0}};
  pb_random_seed(&c.random, strtoull(argv[3], NULL, 10), 0);
  pb_interrupt_install();
  sigset_t end;  // the driver has it wait until here
  sigemptyset(&end);
  sigaddset(&end, SIGTERM);
  sigprocmask(SIG_UNBLOCK, &end, NULL);
  work(&c);
  printf("client: sessions %llu attaches %llu refused %llu runs %llu broken %llu evicted %llu "
         "changed %llu samples %llu bad %llu\n",
         (unsigned long long)c.sessions, (unsigned long long)c.attaches,
         (unsigned long long)c.refused, (unsigned long long)c.runs, (unsigned long long)c.broken,
         (unsigned long long)c.evicted, (unsigned long long)c.changed,
         (unsigned long long)c.samples, (unsigned long long)c.bad);
  return c.bad > 0;
}
