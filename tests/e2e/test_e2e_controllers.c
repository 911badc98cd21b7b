// Several controllers at once on the real bus: their sum, standby and fail-over, silence, leases in
// plant time, a late joiner, and the envelope of an actuator.
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "harness.h"

static pb_session *attached(const e2e_daemon *daemon, const char *channel, const char *silence,
                            bool barrier, double lease) {
  pb_session *session = e2e_open(daemon);
  const char *const input = "Va";
  const pb_attach_options options = {.channel = channel,
                                     .inputs = &input,
                                     .input_count = 1,
                                     .barrier = barrier,
                                     .silence = silence,
                                     .lease = lease,
                                     .guard = 30.0};
  pb_error err = {PB_OK, "", ""};
  if (pb_session_attach(session, &options, &err)) fail_msg("%s: %s", err.where, err.message);
  return session;
}

typedef struct answerer {
  double value, seen;
  uint64_t left;
  uint32_t flags;
} answerer;

static bool answer(void *context, const pb_sample *sample, double *command) {
  answerer *a = context;
  a->seen = sample->input[0];
  a->flags |= sample->flags;
  command[0] = a->value;
  return a->left-- > 0;
}

static void run(pb_session *session, answerer *a) {
  const pb_run_options options = {.on_sample = answer, .context = a, .stall = E2E_CAP};
  pb_error err = {PB_OK, "", ""};
  if (pb_session_run(session, &options, NULL, &err)) fail_msg("%s", err.message);
}

static void rows(pb_session *session, uint32_t steps, pb_block *out) {
  pb_error err = {PB_OK, "", ""};
  if (pb_session_block(session, NULL, 0, NULL, steps, E2E_CAP, out, &err))
    fail_msg("%s: %s", err.where, err.message);
}

// A HAC on the bus, a LAC inside the step and an excitation: the actuator gets the sum of the
// three.
static void hac_lac_and_excitation_add_up(void **state) {
  (void)state;
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  pb_session *hac = attached(&daemon, "hac", "zero", true, 0.0);
  e2e_request(hac, "excite",
              "{\"channel\":\"shaker\",\"inputs\":[\"Va\"],\"type\":\"step\",\"amplitude\":2}");
  // A static gain on V_s with its own offset would hide nothing: u = 1·V_s is seen against the
  // rest.
  e2e_request(hac, "host_controller",
              "{\"channel\":\"lac\",\"type\":\"lti\",\"inputs\":[\"Va\"],\"outputs\":[\"Vs\"],"
              "\"d\":[[0.05]]}");
  answerer a = {.value = 4.0, .left = 50};
  run(hac, &a);
  pb_session_detach(hac);
  e2e_request(hac, "reset", NULL);
  pb_session_close(hac);
  hac = attached(&daemon, "hac", "zero", true, 0.0);
  answerer first = {.value = 4.0, .left = 1};  // after one step V_s was 0: u = 4 + 2 + 0.05·0
  run(hac, &first);
  assert_true(first.seen == 6.0);
  assert_true(a.seen != 6.0 && fabs(a.seen - 6.0) < 1.0);
  pb_session_close(hac);
  e2e_daemon_end(&daemon);
}

static bool later(const plantbus_PlantStatus *s) {
  static uint64_t first;
  if (first == 0) first = s->step;
  return s->step > first + 1000;
}

// Two on one channel: the second stands by, and acts when the first is killed.
static void a_standby_takes_over(void **state) {
  (void)state;
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  const e2e_raw raw = e2e_raw_join(&daemon);
  const dds_entity_t events = e2e_raw_reader(&raw, PB_TOPIC_EVENT);
  const dds_entity_t status = e2e_raw_reader(&raw, PB_TOPIC_STATUS);
  char domain[16], line[256], message[320], name[64];
  snprintf(domain, sizeof domain, "%u", daemon.domain);
  const char *const argv[] = {PB_E2E_CLIENT, domain, "loop", "Va", "0.3", NULL};
  e2e_child first = e2e_spawn(argv);
  e2e_expect_line(&first, "running", line);
  e2e_child second = e2e_spawn(argv);
  e2e_expect_line(&second, "running", line);
  assert_int_equal(kill(first.pid, SIGKILL), 0);
  e2e_reap(&first);
  e2e_event_wait(events, "takeover", message);
  snprintf(name, sizeof name, "e2e_client[%d]", (int)second.pid);
  assert_non_null(strstr(message, name));
  plantbus_PlantStatus_free(e2e_status_wait(status, later), DDS_FREE_ALL);
  kill(second.pid, SIGKILL);
  e2e_reap(&second);
  dds_delete(raw.participant);
  e2e_daemon_end(&daemon);
}

// What a channel leaves behind: nothing, its last value, or a ramp of 50 ms of plant time.
static void silence_is_as_asked_for(void **state) {
  (void)state;
  static const char *const policy[] = {"zero", "hold", "ramp"};
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  pb_session *harness = e2e_open(&daemon);
  for (int p = 0; p < 3; p++) {
    pb_block b;
    answerer a = {.value = 8.0, .left = 20};
    pb_session *session = attached(&daemon, policy[p], policy[p], true, 0.0);
    run(session, &a);
    pb_session_close(session);
    rows(harness, 600, &b);
    const double *u = b.input;
    if (p == 0) assert_true(u[0] == 0.0 && u[2 * 599] == 0.0);
    if (p == 1) assert_true(u[0] == 8.0 && u[2 * 599] == 8.0);
    if (p == 2) {
      assert_true(u[0] > 7.9 && fabs(u[2 * 250] - 4.0) < 0.1 && u[2 * 599] == 0.0);
      for (int k = 1; k < 600; k++) assert_true(u[2 * k] <= u[2 * (k - 1)]);
    }
    pb_block_clear(&b);
    e2e_request(harness, "reset", NULL);
  }
  pb_session_close(harness);
  e2e_daemon_end(&daemon);
}

// 10 ms of plant time are 100 steps, however long they take on the wall clock.
static void a_lease_is_counted_in_plant_time(void **state) {
  (void)state;
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  const e2e_raw raw = e2e_raw_join(&daemon);
  const dds_entity_t events = e2e_raw_reader(&raw, PB_TOPIC_EVENT);
  pb_session *harness = e2e_open(&daemon);
  pb_session *silent = attached(&daemon, "silent", "zero", false, 0.01);
  char message[320];
  pb_block b;
  rows(harness, 99, &b);
  pb_block_clear(&b);
  assert_true(e2e_number(harness, "ping", NULL, "members") == 1.0);
  rows(harness, 3, &b);
  pb_block_clear(&b);
  e2e_event_wait(events, "lease_over", message);
  assert_non_null(strstr(message, "0.01 s of plant time"));
  assert_true(e2e_number(harness, "ping", NULL, "members") == 0.0);
  pb_session_close(silent);
  pb_session_close(harness);
  dds_delete(raw.participant);
  e2e_daemon_end(&daemon);
}

// Who comes while a loop runs is waited for from then on, and both go on.
static void a_late_joiner_steps_with_the_others(void **state) {
  (void)state;
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  char domain[16], line[256];
  snprintf(domain, sizeof domain, "%u", daemon.domain);
  const char *const argv[] = {PB_E2E_CLIENT, domain, "first", "F", "30", NULL};
  e2e_child first = e2e_spawn(argv);
  e2e_expect_line(&first, "running", line);
  pb_session *joiner = attached(&daemon, "joiner", "zero", true, 0.0);
  answerer a = {.value = 1.0, .left = 500};
  run(joiner, &a);
  assert_true(a.seen == 1.0);
  assert_true(e2e_number(joiner, "ping", NULL, "members") == 2.0);
  pb_session_close(joiner);
  kill(first.pid, SIGKILL);
  e2e_reap(&first);
  e2e_daemon_end(&daemon);
}

// 100 V of command times an amplifier of 20 stay at the 150 V that the actuator may see, flagged.
static void an_envelope_is_kept_and_flagged(void **state) {
  (void)state;
  e2e_daemon daemon = e2e_daemon_start(PB_CONFIG "/plants/apa300ml-bench-electronics.json", NULL);
  pb_session *session = attached(&daemon, "wild", "zero", true, 0.0);
  answerer calm = {.value = 1.0, .left = 100}, wild = {.value = 100.0, .left = 100};
  run(session, &calm);
  assert_true(fabs(calm.seen - 20.0) < 0.1);
  assert_false(calm.flags & plantbus_FLAG_SATURATED);
  run(session, &wild);
  assert_true(wild.seen == 150.0);
  assert_true(wild.flags & plantbus_FLAG_SATURATED);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(hac_lac_and_excitation_add_up),
      cmocka_unit_test(a_standby_takes_over),
      cmocka_unit_test(silence_is_as_asked_for),
      cmocka_unit_test(a_lease_is_counted_in_plant_time),
      cmocka_unit_test(a_late_joiner_steps_with_the_others),
      cmocka_unit_test(an_envelope_is_kept_and_flagged),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
