// plantbus-example: a controller of your own in one page. Integral force feedback on one actuator:
//   u(k) = (1 − ε) u(k−1) + g T y(k)        an integrator that forgets slow offsets (ε = 2π·2 Hz ·
//   T)
// Usage: plantbus-example INPUT OUTPUT GAIN SECONDS [DOMAIN]
#include <stdio.h>
#include <string.h>

#include "options.h"
#include "session.h"
#include "standard_output.h"

typedef struct controller {
  int output;  // index of y in a sample
  double u, keep, gain, peak;
  uint64_t steps;
} controller;

// Answers one sample with one command. Runs in a DDS thread: no printing, no waiting.
static bool on_sample(void *context, const pb_sample *sample, double *command) {
  controller *c = context;
  double y = sample->output[c->output];
  if (c->steps-- == 0) return false;
  c->u = c->keep * c->u + c->gain * y;
  command[0] = c->u;
  if (y > c->peak) c->peak = y;
  return true;
}

static int fail(const pb_error *err) {
  char text[900];
  pb_error_format(err, text, sizeof text);
  fprintf(stderr, "plantbus-example: %s\n", text);
  return 1;
}

int main(int argc, char **argv) {
  pb_stdout_guard();
  double gain, seconds;
  uint64_t domain = 0;
  bool good = (argc == 5 || argc == 6) && pb_parse_double(argv[3], &gain) &&
              pb_parse_double(argv[4], &seconds) && seconds >= 0 &&
              (argc == 5 || pb_parse_uint64(argv[5], &domain));
  if (!good) {
    bool help = argc == 2 && !strcmp(argv[1], "--help");
    fprintf(help ? stdout : stderr, "usage: plantbus-example INPUT OUTPUT GAIN SECONDS [DOMAIN]\n");
    return help ? 0 : 2;
  }
  pb_error err = {0};
  pb_session *session = NULL;
  pb_session_options where = {.domain = (uint32_t)domain};
  if (pb_session_open(&where, &session, &err)) return fail(&err);

  const pb_model *model = pb_session_model(session);
  double dt = 1 / model->sample_rate;
  controller c = {.output = pb_model_output(model, argv[2]),
                  .keep = 1 - 2 * 3.14159265 * 2 * dt,
                  .gain = gain * dt,
                  .steps = (uint64_t)(seconds * model->sample_rate)};
  if (c.output < 0) {
    fprintf(stderr, "plantbus-example: the plant has no output \"%s\"\n", argv[2]);
    pb_session_close(session);
    return 1;
  }
  const char *inputs[] = {argv[1]};
  pb_attach_options attach = {
      .channel = "example", .inputs = inputs, .input_count = 1, .barrier = true};
  pb_run_options run = {.on_sample = on_sample, .context = &c, .stall = 5};
  pb_run_report report;
  pb_status status = pb_session_attach(session, &attach, &err);
  if (!status) status = pb_session_run(session, &run, &report, &err);
  pb_session_close(session);
  if (status) return fail(&err);
  printf("%llu steps in %.2f s, largest %s %g\n", (unsigned long long)report.samples,
         report.seconds, argv[2], c.peak);
  return 0;
}
