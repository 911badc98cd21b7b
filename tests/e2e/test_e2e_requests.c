// Requests that change time: steps, reset, snapshots, decimation, and the mode.
#include <stdlib.h>
#include <string.h>

#include "harness.h"

static void steps_are_taken_on_request(void **state) {
  (void)state;
  const char *const paused[] = {"--mode", "paused", NULL};
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, paused);
  pb_session *session = e2e_open(&daemon);
  assert_int_equal(pb_session_description(session)->mode, PB_PAUSED);
  assert_true(e2e_number(session, "step", "{\"n\":10}", "step") == 10.0);
  assert_true(e2e_number(session, "step", NULL, "step") == 11.0);
  e2e_request(session, "set_mode", "{\"mode\":\"lockstep\"}");
  e2e_attach(session, "test", "Va", 0.0);
  pb_error err;
  assert_int_equal(pb_session_request(session, "step", NULL, 0.0, NULL, &err), PB_ERR_STATE);
  assert_non_null(strstr(err.message, "attached clients step the plant"));
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

// More steps than one answer waits for: "accepted", and an event when they are done.
static void many_steps_end_with_an_event(void **state) {
  (void)state;
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  pb_session *session = e2e_open(&daemon);
  const e2e_raw raw = e2e_raw_join(&daemon);
  const dds_entity_t events = e2e_raw_reader(&raw, PB_TOPIC_EVENT);
  char message[320];
  e2e_request(session, "decimate", "{\"n\":1000}");
  e2e_request(session, "step", "{\"n\":100000}");
  e2e_event_wait(events, "stepped", message);
  assert_true(e2e_number(session, "ping", NULL, "step") == 100000.0);
  pb_session_close(session);
  dds_delete(raw.participant);
  e2e_daemon_end(&daemon);
}

enum { STEPS = 300 };

typedef struct track {
  uint64_t first, count;
  double y[STEPS][2];
} track;

static bool follow(void *context, const pb_sample *sample, double *command) {
  track *t = context;
  if (t->count == 0) t->first = sample->step;
  memcpy(t->y[t->count++], sample->output, sizeof t->y[0]);
  command[0] = sample->step % 7 < 3 ? 2.0 : -1.0;
  return t->count < STEPS;
}

static void run(pb_session *session, track *t) {
  const pb_run_options options = {.on_sample = follow, .context = t, .stall = E2E_CAP};
  pb_error err = {PB_OK, "", ""};
  t->count = 0;
  if (pb_session_run(session, &options, NULL, &err)) fail_msg("%s", err.message);
}

static void a_restored_snapshot_goes_on_bit_for_bit(void **state) {
  (void)state;
  static track warm_up, first, second;
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  pb_session *session = e2e_open(&daemon);
  e2e_attach(session, "test", "Va", 0.0);
  run(session, &warm_up);
  const double id = e2e_number(session, "snapshot", NULL, "snapshot");
  run(session, &first);
  char body[64];
  snprintf(body, sizeof body, "{\"snapshot\":%.0f}", id);
  assert_true(e2e_number(session, "restore", body, "epoch") == 2.0);
  run(session, &second);
  assert_int_equal(second.first, first.first);
  assert_int_equal(first.first, STEPS - 1);
  assert_memory_equal(second.y, first.y, sizeof first.y);
  assert_memory_not_equal(first.y, warm_up.y, sizeof first.y);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

static void a_reset_begins_again_from_rest(void **state) {
  (void)state;
  static track first, second;
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  pb_session *session = e2e_open(&daemon);
  e2e_attach(session, "test", "Va", 0.0);
  run(session, &first);
  assert_true(e2e_number(session, "reset", NULL, "epoch") == 2.0);
  run(session, &second);
  assert_int_equal(second.first, 0);
  assert_memory_equal(second.y, first.y, sizeof first.y);
  assert_int_equal(pb_session_description(session)->epoch, 2);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

static bool every_tenth(void *context, const pb_sample *sample, double *command) {
  uint64_t *next = context;
  command[0] = 1.0;
  if (sample->step != *next) *next = UINT64_MAX / 2;
  *next += 10;
  return *next < 500;
}

static void decimation_thins_the_samples(void **state) {
  (void)state;
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  pb_session *session = e2e_open(&daemon);
  e2e_request(session, "decimate", "{\"n\":10}");
  e2e_attach(session, "test", "Va", 0.0);
  uint64_t next = 0;
  pb_run_report report;
  pb_error err;
  const pb_run_options options = {.on_sample = every_tenth, .context = &next, .stall = E2E_CAP};
  assert_int_equal(pb_session_run(session, &options, &report, &err), PB_OK);
  assert_int_equal(next, 500);
  assert_int_equal(report.samples, 50);
  assert_int_equal(report.missed, 0);
  pb_session *other = e2e_open(&daemon);
  assert_int_equal(pb_session_request(other, "decimate", "{\"n\":1}", 0.0, NULL, &err),
                   PB_ERR_STATE);
  pb_session_close(other);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(steps_are_taken_on_request),
      cmocka_unit_test(many_steps_end_with_an_event),
      cmocka_unit_test(a_restored_snapshot_goes_on_bit_for_bit),
      cmocka_unit_test(a_reset_begins_again_from_rest),
      cmocka_unit_test(decimation_thins_the_samples),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
