// Snapshot files: a daemon started anew goes on bit for bit, with all that runs inside the step.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "harness.h"

enum { STEPS = 500 };

static char directory[64];

static int directory_make(void **state) {
  (void)state;
  snprintf(directory, sizeof directory, "/tmp/pb-snapshots-XXXXXX");
  return mkdtemp(directory) ? 0 : -1;
}

static int directory_remove(void **state) {
  (void)state;
  char path[128];
  snprintf(path, sizeof path, "%s/run.snapshot", directory);
  unlink(path);
  return rmdir(directory);
}

static e2e_daemon start(const char *restore) {
  char path[128];
  const char *more[8] = {"--state", directory, "--mode", "paused", NULL};
  if (restore) {
    snprintf(path, sizeof path, "%s/%s", directory, restore);
    more[4] = "--restore";
    more[5] = path;
  }
  return e2e_daemon_start(PB_CONFIG "/plants/apa300ml-bench-electronics.json", more);
}

// Filters (IFF), generators (white noise, noise of the sensors), tables (chirp), delay lines.
static void host_all(pb_session *session) {
  e2e_request(session, "host_controller",
              "{\"channel\":\"iff\",\"type\":\"iff\",\"inputs\":[\"Va\"],\"outputs\":[\"Vs\"],"
              "\"gain\":3}");
  e2e_request(session, "excite",
              "{\"channel\":\"white\",\"inputs\":[\"Va\"],\"type\":\"white\",\"rms\":0.1,"
              "\"seed\":3}");
  e2e_request(session, "excite",
              "{\"channel\":\"sweep\",\"inputs\":[\"Va\"],\"type\":\"chirp\",\"amplitude\":0.5,"
              "\"f1\":10,\"f2\":500,\"seconds\":0.07}");
}

static void steps(pb_session *session, pb_block *out) {
  pb_error err = {PB_OK, "", ""};
  if (pb_session_block(session, NULL, 0, NULL, STEPS, E2E_CAP, out, &err))
    fail_msg("%s: %s", err.where, err.message);
}

static void same(const pb_block *a, const pb_block *b) {
  assert_int_equal(a->step, b->step);
  assert_int_equal(a->output_count, b->output_count);
  assert_memory_equal(a->input, b->input, STEPS * a->input_count * sizeof(double));
  assert_memory_equal(a->output, b->output, STEPS * a->output_count * sizeof(double));
}

static void a_new_daemon_goes_on_bit_for_bit(void **state) {
  (void)state;
  pb_block before, first, again, anew;
  e2e_daemon daemon = start(NULL);
  pb_session *session = e2e_open(&daemon);
  host_all(session);
  steps(session, &before);
  char *taken = e2e_result(session, "snapshot", "{\"file\":\"run.snapshot\"}");
  assert_non_null(strstr(taken, "run.snapshot"));
  free(taken);
  steps(session, &first);
  e2e_request(session, "remove_controller", "{\"channel\":\"white\"}");
  assert_true(e2e_number(session, "restore", "{\"file\":\"run.snapshot\"}", "step") == STEPS);
  steps(session, &again);
  same(&again, &first);
  assert_int_equal(again.epoch, 2);
  char *hash = e2e_result(session, "ping", NULL);
  pb_session_close(session);
  e2e_daemon_end(&daemon);

  daemon = start("run.snapshot");
  session = e2e_open(&daemon);
  steps(session, &anew);
  same(&anew, &first);
  char *hash_anew = e2e_result(session, "ping", NULL);
  assert_memory_equal(strstr(hash, "\"hash\""), strstr(hash_anew, "\"hash\""), 26);
  free(hash);
  free(hash_anew);
  pb_block_clear(&before);
  pb_block_clear(&first);
  pb_block_clear(&again);
  pb_block_clear(&anew);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

static void what_is_no_snapshot_is_refused(void **state) {
  (void)state;
  e2e_daemon daemon = start(NULL);
  pb_session *session = e2e_open(&daemon);
  e2e_refused(session, "restore", "{\"file\":\"nothing\"}", "/file", "");
  e2e_refused(session, "snapshot", "{\"file\":\"../evil\"}", "/file", "letters");
  e2e_refused(session, "restore", "{\"snapshot\":99}", "/snapshot", "no snapshot 99");
  pb_session_close(session);
  e2e_daemon_end(&daemon);
  const char *const paused[] = {"--mode", "paused", NULL};
  daemon = e2e_daemon_start(E2E_BENCH, paused);
  session = e2e_open(&daemon);
  e2e_refused(session, "snapshot", "{\"file\":\"x\"}", "/file", "--state");
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_new_daemon_goes_on_bit_for_bit),
      cmocka_unit_test(what_is_no_snapshot_is_refused),
  };
  return cmocka_run_group_tests(tests, directory_make, directory_remove);
}
