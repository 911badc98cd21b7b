// A wall clock that is set back in the middle of a session, of the daemon or of a client, cuts
// nothing off: the monotonic clock goes on, and all that is written later comes later. The clock is
// libfaketime's, which reads it from a file at each call.
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "harness.h"
#include "recording.h"

static char folder[] = "/tmp/pb-clock-XXXXXX";

static const char *path_of(const char *name) {
  static char path[8][256];
  static int next;
  char *p = path[next++ % 8];
  snprintf(p, sizeof path[0], "%s/%s", folder, name);
  return p;
}

static void clock_set(const char *offset) {
  FILE *file = fopen(path_of("new"), "w");
  assert_non_null(file);
  fprintf(file, "%s\n", offset);
  assert_int_equal(fclose(file), 0);
  assert_int_equal(rename(path_of("new"), path_of("clock")), 0);  // at once, for who reads it
}

// What is started from here on, until clock_own, has the wall clock of the file.
static void clock_fake(void) {
  clock_set("+0");
  setenv("LD_PRELOAD", PB_FAKETIME, 1);
  setenv("FAKETIME_TIMESTAMP_FILE", path_of("clock"), 1);
  setenv("FAKETIME_NO_CACHE", "1", 1);
  setenv("FAKETIME_DONT_FAKE_MONOTONIC", "1", 1);
  setenv("FAKETIME_DISABLE_SHM", "1", 1);
}

static void clock_own(void) {
  unsetenv("LD_PRELOAD");
}

static int folder_make(void **state) {
  (void)state;
  return mkdtemp(folder) ? 0 : -1;
}

static int folder_remove(void **state) {
  (void)state;
  unlink(path_of("clock"));
  unlink(path_of("a.mcap"));
  return rmdir(folder);
}

static e2e_daemon daemon_start(bool fake, const char *const *more) {
  if (fake) clock_fake();
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, more);
  clock_own();
  return daemon;
}

static e2e_child client_start(bool fake, const e2e_daemon *daemon, const char *name,
                              const char *const *more) {
  char file[256], domain[16];
  const char *argv[24] = {file, "--domain", domain};
  snprintf(file, sizeof file, PB_BIN "/%s", name);
  snprintf(domain, sizeof domain, "%u", daemon->domain);
  for (int n = 3; *more && n < 23; n++) argv[n] = *more++;
  if (fake) clock_fake();
  e2e_child child = e2e_spawn(argv);
  clock_own();
  return child;
}

// ---- sessions -----------------------------------------------------------------------------------

static bool count_down(void *context, const pb_sample *sample, double *command) {
  uint64_t *left = context;
  command[0] = (double)(sample->step % 5);
  return --*left > 0;
}

static void run_steps(pb_session *session, uint64_t steps) {
  pb_error err = {PB_OK, "", ""};
  const pb_run_options run = {
      .on_sample = count_down, .context = &steps, .stall = E2E_CAP, .any_revision = true};
  if (pb_session_run(session, &run, NULL, &err)) fail_msg("%s: %s", err.where, err.message);
}

static void block_of(pb_session *session, uint32_t steps) {
  pb_error err = {PB_OK, "", ""};
  pb_block block;
  if (pb_session_block(session, NULL, 0, NULL, steps, E2E_CAP, &block, &err))
    fail_msg("%s: %s", err.where, err.message);
  pb_block_clear(&block);
}

// Everything that a session does: requests, blocks, steps, an event, a change of the description.
static void session_uses_all(pb_session *session) {
  e2e_request(session, "ping", NULL);
  block_of(session, 10);
  e2e_attach(session, "clock", "Va", 60.0);
  run_steps(session, 50);
  pb_session_detach(session);
  e2e_change(session, "configure", "{\"patch\":{}}", "revision");
}

static void the_daemons_clock_set_back_cuts_no_session(void **state) {
  (void)state;
  e2e_daemon daemon = daemon_start(true, NULL);
  pb_session *session = e2e_open(&daemon);
  session_uses_all(session);
  clock_set("-3600");
  session_uses_all(session);
  pb_session *later = e2e_open(&daemon);
  assert_int_equal(pb_session_description(later)->revision, 3);
  pb_session_close(later);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

// ---- monitor and recorder -----------------------------------------------------------------------

static void the_monitor_goes_on(bool daemons_clock) {
  e2e_daemon daemon = daemon_start(daemons_clock, NULL);
  char line[256];
  e2e_child monitor =
      client_start(!daemons_clock, &daemon, "plantbus-monitor", (const char *const[]){NULL});
  pb_session *session = e2e_open(&daemon);
  e2e_expect_line(&monitor, "bus-bench lockstep epoch 1 step 0 ", line);
  clock_set("-3600");
  e2e_request(session, "step", "{\"n\":7}");
  e2e_expect_line(&monitor, "bus-bench lockstep epoch 1 step 7 ", line);
  e2e_request(session, "reset", NULL);
  e2e_expect_line(&monitor, "bus-bench lockstep epoch 2 step 0 ", line);
  kill(monitor.pid, SIGTERM);
  assert_int_equal(e2e_reap(&monitor), 0);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

static void the_monitor_goes_on_when_the_daemons_clock_is_set_back(void **state) {
  (void)state;
  the_monitor_goes_on(true);
}

static void the_monitor_goes_on_when_its_own_clock_is_set_back(void **state) {
  (void)state;
  the_monitor_goes_on(false);
}

// Samples, events and statuses are in the file, from before and after, in the order of their log
// times, and both revisions are described.
static pb_status log_time_grows(void *context, const pb_mcap_message *message, pb_error *err) {
  uint64_t *last = context;
  (void)err;
  assert_true(message->log_time >= *last);
  *last = message->log_time;
  return PB_OK;
}

static void recording_check(void) {
  pb_error err = {PB_OK, "", ""};
  pb_recording *recording = NULL;
  uint64_t last = 0;
  const pb_mcap_visitor visitor = {.context = &last, .message = log_time_grows};
  pb_mcap_report report;
  assert_int_equal(pb_mcap_read(path_of("a.mcap"), &visitor, &report, &err), PB_OK);
  assert_int_equal(pb_recording_open(path_of("a.mcap"), &recording, &err), PB_OK);
  assert_int_equal(recording->spans.samples, 101);
  assert_int_equal(recording->spans.missing, 0);
  assert_int_equal(recording->revisions, 2);
  bool reconfigured = false;
  for (size_t i = 0; i < recording->events; i++)
    reconfigured = reconfigured || !strcmp(recording->event[i].kind, "reconfigured");
  assert_true(reconfigured);
  assert_true(recording->statuses >= 2);  // one is there at the start, one follows the events
  const uint64_t length = recording->log_last - recording->log_first;
  assert_true(length < (uint64_t)(E2E_CAP * 1e9));  // no hour is in it
  pb_recording_free(recording);
}

static void the_recorder_goes_on(bool daemons_clock) {
  e2e_daemon daemon = daemon_start(daemons_clock, NULL);
  char line[256];
  const char *const more[] = {"--force", "-o", path_of("a.mcap"), "--steps", "101", NULL};
  e2e_child recorder = client_start(!daemons_clock, &daemon, "plantbus-record", more);
  e2e_expect_line(&recorder, "recording bus-bench", line);
  pb_session *session = e2e_open(&daemon);
  e2e_request(session, "step", "{\"n\":50}");
  clock_set("-3600");
  e2e_change(session, "configure", "{\"patch\":{}}", "revision");
  e2e_request(session, "step", "{\"n\":50}");
  assert_int_equal(e2e_reap(&recorder), 0);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
  recording_check();
  unlink(path_of("a.mcap"));
}

static void the_recorder_goes_on_when_the_daemons_clock_is_set_back(void **state) {
  (void)state;
  the_recorder_goes_on(true);
}

static void the_recorder_goes_on_when_its_own_clock_is_set_back(void **state) {
  (void)state;
  the_recorder_goes_on(false);
}

// ---- a tool that attaches, runs and reports
// ------------------------------------------------------

static bool somebody_attached(const plantbus_PlantStatus *status) {
  return status->attached._length > 0 && status->step > 100;
}

static void an_identification_goes_on(bool daemons_clock) {
  e2e_daemon daemon = daemon_start(daemons_clock, NULL);
  const char *const more[] = {"--input", "Va",           "--band", "10,1000", "--averages",
                              "20",      "--resolution", "5",      NULL};
  e2e_raw raw = e2e_raw_join(&daemon);
  const dds_entity_t status = e2e_raw_reader(&raw, PB_TOPIC_STATUS);
  e2e_child tool = client_start(!daemons_clock, &daemon, "plantbus-identify", more);
  plantbus_PlantStatus_free(e2e_status_wait(status, somebody_attached), DDS_FREE_ALL);
  clock_set("-3600");
  assert_int_equal(e2e_reap(&tool), 0);
  dds_delete(raw.participant);
  e2e_daemon_end(&daemon);
}

static void an_identification_goes_on_when_the_daemons_clock_is_set_back(void **state) {
  (void)state;
  an_identification_goes_on(true);
}

static void an_identification_goes_on_when_its_own_clock_is_set_back(void **state) {
  (void)state;
  an_identification_goes_on(false);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(the_daemons_clock_set_back_cuts_no_session),
      cmocka_unit_test(the_monitor_goes_on_when_the_daemons_clock_is_set_back),
      cmocka_unit_test(the_monitor_goes_on_when_its_own_clock_is_set_back),
      cmocka_unit_test(the_recorder_goes_on_when_the_daemons_clock_is_set_back),
      cmocka_unit_test(the_recorder_goes_on_when_its_own_clock_is_set_back),
      cmocka_unit_test(an_identification_goes_on_when_the_daemons_clock_is_set_back),
      cmocka_unit_test(an_identification_goes_on_when_its_own_clock_is_set_back),
  };
  return cmocka_run_group_tests(tests, folder_make, folder_remove);
}
