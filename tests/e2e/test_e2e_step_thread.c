// The daemon's step thread neither allocates nor takes a lock, whatever clients do: watched from
// within by a preloaded library, while commands come, the model changes and items are hosted.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "harness.h"

typedef struct watch {
  uint64_t count;
} watch;

static bool look(void *context, const pb_sample *sample, double *command) {
  watch *w = context;
  command[0] = (double)(sample->step % 5);
  return ++w->count < 2000;
}

static void read_counts(const char *path, char text[96]) {
  FILE *file = fopen(path, "r");
  assert_non_null(file);
  assert_non_null(fgets(text, 96, file));
  fclose(file);
  unlink(path);
}

static void the_step_thread_keeps_to_itself(void **state) {
  (void)state;
  const char *const realtime[] = {"--mode", "realtime", NULL};
  char path[64], text[96];
  pb_error err = {PB_OK, "", ""};
  watch w = {0};
  snprintf(path, sizeof path, "/tmp/pb-step-watch-%ld", (long)getpid());
  setenv("PB_STEP_WATCH", path, 1);
  setenv("LD_PRELOAD", PB_STEP_WATCH_LIBRARY, 1);
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, realtime);
  unsetenv("LD_PRELOAD");
  pb_session *session = e2e_open(&daemon), *other = e2e_open(&daemon);
  e2e_attach(session, "loop", "Va", 0.0);
  e2e_request(other, "host_controller",
              "{\"channel\":\"iff\",\"type\":\"iff\",\"inputs\":[\"Va\"],\"outputs\":[\"Vs\"],"
              "\"gain\":10}");
  assert_true(e2e_change(other, "configure", "{\"patch\":{\"components\":{\"mass\":{\"mass\":7}}}}",
                         "revision") == 2.0);
  const pb_run_options options = {
      .on_sample = look, .context = &w, .stall = E2E_CAP, .any_revision = true};
  if (pb_session_run(session, &options, NULL, &err)) fail_msg("%s", err.message);
  assert_true(e2e_number(other, "ping", NULL, "revision") == 2.0);
  pb_session_close(other);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
  read_counts(path, text);
  assert_string_equal(text, "0 allocations 0 locks\n");
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(the_step_thread_keeps_to_itself)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
