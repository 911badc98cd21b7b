// A client of another host for the tests: e2e_remote DOMAIN CHANNEL INPUT GUARD STEPS TIMEOUT
// STALL. Attaches as a barrier member, tells "running" with its first answer, and runs STEPS steps
// (0: until SIGTERM). A run that begins at step 0 is compared with the library's plant, driven by
// the inputs that the samples tell. It ends with "done STEP compared N". When the run fails, it
// says "failed: …" and "ping: …", attaches once more with the same session as soon as that is
// possible, runs AGAIN steps and ends with "again STEP".
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fpenv.h"
#include "interrupt.h"
#include "session.h"

enum { AGAIN = 200 };

static const double again_cap = 10.0;  // s

typedef struct remote {
  const pb_model *model;
  pb_state *here;  // the library's plant; NULL: not compared
  int own;         // the input that is commanded, by nobody else
  uint64_t steps, count, compared, last;
  const char *wrong;
} remote;

// Deterministic, different per step.
static double excitation(uint64_t step) {
  return (double)((step * 7919u) % 1000u) / 333.0 - 1.5;
}

// Under the library's plant the same inputs must give the same bits.
static void compare(remote *r, const pb_sample *sample) {
  double y[64];
  const uint64_t saved = pb_flush_denormals();
  if (sample->step > 0) pb_step_advance(r->model, r->here, sample->input);
  pb_step_output(r->model, r->here, y);
  pb_restore_denormals(saved);
  if (memcmp(y, sample->output, r->model->ny * sizeof *y) != 0) r->wrong = "the outputs differ";
  r->compared++;
}

static void run_begins(remote *r, const pb_sample *sample) {
  if (sample->step > 0) {  // the plant's state is not known
    free(r->here);
    r->here = NULL;
  }
  puts("running");
  fflush(stdout);
}

static bool on_sample(void *context, const pb_sample *sample, double *command) {
  remote *r = context;
  if (r->count == 0)
    run_begins(r, sample);
  else if (r->here && sample->step != r->last + 1)
    r->wrong = "a step is missing";
  else if (r->here && sample->input[r->own] != excitation(r->last))
    r->wrong = "another command acted";
  if (r->here && !r->wrong) compare(r, sample);
  r->last = sample->step;
  if ((r->steps > 0 && r->count == r->steps) || pb_interrupted() || r->wrong) return false;
  r->count++;
  command[0] = excitation(sample->step);
  return true;
}

static void tell(const char *what, const pb_error *err) {
  char text[800];
  pb_error_format(err, text, sizeof text);
  printf("%s: %s\n", what, text);
  fflush(stdout);
}

static double clock_seconds(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

// The same session, as soon as the daemon is there again.
static int attach_again(pb_session *session, const pb_attach_options *attach) {
  const double end = clock_seconds() + again_cap;
  remote r;
  const pb_run_options run = {.on_sample = on_sample, .context = &r, .stall = again_cap};
  pb_error err;
  pb_status status;
  do {
    r = (remote){.steps = AGAIN};
    pb_session_detach(session);
    status = pb_session_attach(session, attach, &err);
    if (!status) status = pb_session_run(session, &run, NULL, &err);
  } while (status && clock_seconds() < end);
  if (status)
    tell("not again", &err);
  else if (r.wrong)
    printf("wrong: %s at step %llu\n", r.wrong, (unsigned long long)r.last);
  else
    printf("again %llu\n", (unsigned long long)r.last);
  return status || r.wrong ? 1 : 0;
}

static int run_told(pb_session *session, const pb_attach_options *attach, uint64_t steps,
                    double stall) {
  remote r = {.model = pb_session_model(session), .steps = steps};
  r.own = pb_model_input(r.model, attach->inputs[0]);
  const pb_run_options run = {.on_sample = on_sample, .context = &r, .stall = stall};
  pb_error err;
  r.here = pb_state_new(r.model);
  pb_status status = pb_session_attach(session, attach, &err);
  if (!status) status = pb_session_run(session, &run, NULL, &err);
  free(r.here);
  if (r.wrong) printf("wrong: %s at step %llu\n", r.wrong, (unsigned long long)r.last);
  if (!status && !r.wrong)
    printf("done %llu compared %llu\n", (unsigned long long)r.last, (unsigned long long)r.compared);
  if (!status) return r.wrong ? 1 : 0;
  tell("failed", &err);
  if (pb_session_request(session, "ping", NULL, 0.5, NULL, &err))
    tell("ping", &err);
  else
    puts("ping: answered");
  fflush(stdout);
  return attach_again(session, attach);
}

int main(int argc, char **argv) {
  if (argc != 8) return 2;
  const pb_session_options options = {.domain = (uint32_t)atoi(argv[1]), .timeout = atof(argv[6])};
  const pb_attach_options attach = {.channel = argv[2],
                                    .inputs = (const char *const *)&argv[3],
                                    .input_count = 1,
                                    .barrier = true,
                                    .guard = atof(argv[4])};
  pb_session *session;
  pb_error err;
  pb_interrupt_install();
  if (pb_session_open(&options, &session, &err)) {
    tell("failed", &err);
    return 1;
  }
  const int code = run_told(session, &attach, strtoull(argv[5], NULL, 10), atof(argv[7]));
  pb_session_close(session);
  return code;
}
