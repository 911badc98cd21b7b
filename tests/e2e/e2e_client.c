// A client for the tests: e2e_client DOMAIN CHANNEL INPUT GUARD. Attaches as a barrier member,
// tells "running" with its first answer, and answers for ever.
#include <stdio.h>
#include <stdlib.h>

#include "session.h"

static bool on_sample(void *context, const pb_sample *sample, double *command) {
  (void)context;
  static bool told;
  command[0] = (double)(sample->step % 3);
  if (!told) {
    puts("running");
    fflush(stdout);
  }
  told = true;
  return true;
}

static int failed(const pb_error *err) {
  char text[800];
  pb_error_format(err, text, sizeof text);
  printf("failed: %s\n", text);
  fflush(stdout);
  return 1;
}

int main(int argc, char **argv) {
  if (argc != 5) return 2;
  const pb_session_options options = {.domain = (uint32_t)atoi(argv[1])};
  const pb_attach_options attach = {.channel = argv[2],
                                    .inputs = (const char *const *)&argv[3],
                                    .input_count = 1,
                                    .barrier = true,
                                    .guard = atof(argv[4])};
  const pb_run_options run = {.on_sample = on_sample, .stall = 60.0};
  pb_session *session;
  pb_error err;
  if (pb_session_open(&options, &session, &err)) return failed(&err);
  pb_status status = pb_session_attach(session, &attach, &err);
  if (!status) status = pb_session_run(session, &run, NULL, &err);
  pb_session_close(session);
  return status ? failed(&err) : 0;
}
