// Real time: the plant runs by the clock whatever clients do, and commands act in it.
#include <stdatomic.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "harness.h"

typedef struct watch {
  uint64_t first, last, want;
  double begin, end;
  bool acted, ordered;
} watch;

static double clock_seconds(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static bool look(void *context, const pb_sample *sample, double *command) {
  watch *w = context;
  w->end = clock_seconds();
  if (w->begin == 0.0) {
    w->begin = w->end;
    w->first = sample->step;
    w->ordered = true;
  } else if (sample->step <= w->last) {
    w->ordered = false;
  }
  w->last = sample->step;
  w->acted = w->acted || sample->input[0] == 2.5;
  command[0] = 2.5;
  return sample->step - w->first < w->want;
}

static void run(pb_session *session, watch *w) {
  const pb_run_options options = {.on_sample = look, .context = w, .stall = E2E_CAP};
  pb_error err = {PB_OK, "", ""};
  if (pb_session_run(session, &options, NULL, &err)) fail_msg("%s", err.message);
}

// Steps a second within 10 % of `wanted` in one of several runs: what else the machine does may
// hold up the daemon or this program for a while, a wrong rate is wrong in all.
static watch run_at(pb_session *session, double wanted, uint64_t steps) {
  enum { RUNS = 10 };
  double rate = 0.0;
  for (int i = 0; i < RUNS; i++) {
    watch w = {.want = steps};
    run(session, &w);
    rate = (double)(w.last - w.first) / (w.end - w.begin);
    assert_true(w.ordered);
    if (rate > 0.9 * wanted && rate < 1.1 * wanted) return w;
  }
  fail_msg("%g steps a second instead of %g", rate, wanted);
  return (watch){0};
}

static void the_plant_runs_at_its_rate(void **state) {
  (void)state;
  const char *const realtime[] = {"--mode", "realtime", NULL};
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, realtime);
  pb_session *session = e2e_open(&daemon);
  assert_int_equal(pb_session_description(session)->mode, PB_REALTIME);
  e2e_attach(session, "test", "Va", 0.0);
  assert_true(run_at(session, 10000.0, 10000).acted);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

static void the_speed_is_a_factor(void **state) {
  (void)state;
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  pb_session *session = e2e_open(&daemon);
  e2e_request(session, "set_mode", "{\"mode\":\"realtime\",\"speed\":0.1}");
  assert_false(run_at(session, 1000.0, 500).acted);  // an observer: not attached
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

static bool lease_is_over(const plantbus_PlantStatus *s) {
  return s->attached._length == 0;
}
static bool running(const plantbus_PlantStatus *s) {
  return s->step > 2000;
}

// A client that stops keeps nobody waiting in real time, and is dropped after its lease.
static void a_stopped_client_loses_its_lease(void **state) {
  (void)state;
  const char *const realtime[] = {"--mode", "realtime", "--lease", "0.2", NULL};
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, realtime);
  const e2e_raw raw = e2e_raw_join(&daemon);
  const dds_entity_t events = e2e_raw_reader(&raw, PB_TOPIC_EVENT);
  const dds_entity_t status = e2e_raw_reader(&raw, PB_TOPIC_STATUS);
  char domain[16], line[256], message[320], name[64];
  snprintf(domain, sizeof domain, "%u", daemon.domain);
  const char *const argv[] = {PB_E2E_CLIENT, domain, "stopped", "Va", "60", NULL};
  e2e_child client = e2e_spawn(argv);
  e2e_expect_line(&client, "running", line);
  assert_int_equal(kill(client.pid, SIGSTOP), 0);
  e2e_event_wait(events, "lease_over", message);
  snprintf(name, sizeof name, "e2e_client[%d]", (int)client.pid);
  assert_non_null(strstr(message, name));
  plantbus_PlantStatus_free(e2e_status_wait(status, lease_is_over), DDS_FREE_ALL);
  plantbus_PlantStatus_free(e2e_status_wait(status, running), DDS_FREE_ALL);
  kill(client.pid, SIGKILL);
  e2e_reap(&client);
  dds_delete(raw.participant);
  e2e_daemon_end(&daemon);
}

// Far faster than the bus can follow: steps are left out on the bus, but when lockstep begins, what
// it publishes and steps from is where the plant is.
static void lockstep_begins_where_the_plant_is(void **state) {
  (void)state;
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  pb_session *session = e2e_open(&daemon);
  e2e_attach(session, "test", "Va", 0.0);
  for (int i = 0; i < 5; i++) {
    e2e_request(session, "set_mode", "{\"mode\":\"realtime\",\"speed\":1000}");
    e2e_request(session, "ping", NULL);
    e2e_request(session, "set_mode", "{\"mode\":\"lockstep\"}");
    pb_session_detach(session);  // its lease may be over
    e2e_attach(session, "test", "Va", 0.0);
    watch w = {.want = 3};
    run(session, &w);
    assert_int_equal(w.last, w.first + 3);
  }
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

static plantbus_Sample sample_newest(dds_entity_t reader) {
  plantbus_Sample sample = {0};
  for (int i = 0; i < 10000 * (int)E2E_CAP; i++) {
    void *out[1] = {&sample};
    dds_sample_info_t info;
    if (dds_take(reader, out, &info, 1, 1) == 1 && info.valid_data) return sample;
    dds_sleepfor(DDS_USECS(100));
  }
  fail_msg("no sample");
  return sample;
}

static bool late_counted(const plantbus_PlantStatus *s) {
  return s->late > 0 && s->attached._length == 1 && s->attached._buffer[0].commands == 2;
}

// At ten steps a second: a command for a step that is over acts, and is late once.
static void a_late_command_is_counted_once(void **state) {
  (void)state;
  const char *const slow[] = {"--mode", "realtime", "--speed", "0.001", "--lease", "1000", NULL};
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, slow);
  const e2e_raw raw = e2e_raw_join(&daemon);
  const dds_entity_t status = e2e_raw_reader(&raw, PB_TOPIC_STATUS);
  const dds_entity_t samples = e2e_raw_reader(&raw, PB_TOPIC_SAMPLE);
  const dds_entity_t commands = e2e_raw_writer(&raw, PB_TOPIC_COMMAND);
  plantbus_Command command = {.session = e2e_raw_attach(&raw, "late", "Va"), .count = 1};
  plantbus_Sample sample;
  do sample = sample_newest(samples);
  while (sample.step < 4);
  command.step = sample.step - 2;
  command.input[0] = 3.0;
  assert_int_equal(dds_write(commands, &command), DDS_RETCODE_OK);
  do sample = sample_newest(samples);
  while (sample.input[0] != 3.0);
  assert_true(sample.flags & plantbus_FLAG_LATE);
  command.step = 0;  // whichever is next: on time
  assert_int_equal(dds_write(commands, &command), DDS_RETCODE_OK);
  plantbus_PlantStatus *told = e2e_status_wait(status, late_counted);
  assert_int_equal(told->late, 1);
  assert_int_equal(told->attached._buffer[0].late, 1);
  plantbus_PlantStatus_free(told, DDS_FREE_ALL);
  dds_delete(raw.participant);
  e2e_daemon_end(&daemon);
}

// From one mode to the other and back, with the state of the plant carried over.
static void modes_may_change(void **state) {
  (void)state;
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  pb_session *session = e2e_open(&daemon);
  e2e_attach(session, "test", "Va", 0.0);
  watch lockstep = {.want = 100};
  run(session, &lockstep);
  assert_int_equal(lockstep.last, 100);
  e2e_request(session, "set_mode", "{\"mode\":\"realtime\"}");
  watch realtime = {.want = 1000};
  run(session, &realtime);
  assert_true(realtime.first >= 100);
  e2e_request(session, "set_mode", "{\"mode\":\"lockstep\"}");
  watch again = {.want = 100};
  run(session, &again);
  assert_true(again.first >= realtime.last);
  assert_int_equal(again.last, again.first + 100);
  assert_int_equal(pb_session_description(session)->mode, PB_LOCKSTEP);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

static bool paused_by_overrun(const plantbus_PlantStatus *s) {
  return s->mode == plantbus_PAUSED && s->overruns > 0;
}

// A thousand times ten thousand steps a second cannot be kept: the plant is paused, told by an
// event.
static void the_policy_stop_pauses_the_plant(void **state) {
  (void)state;
  char message[320];
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  pb_session *session = e2e_open(&daemon);
  const e2e_raw raw = e2e_raw_join(&daemon);
  const dds_entity_t events = e2e_raw_reader(&raw, PB_TOPIC_EVENT);
  const dds_entity_t status = e2e_raw_reader(&raw, PB_TOPIC_STATUS);
  e2e_refused(session, "set_mode", "{\"mode\":\"realtime\",\"overrun\":\"wait\"}", "/overrun",
              "skip");
  e2e_request(session, "set_mode", "{\"mode\":\"realtime\",\"speed\":1000,\"overrun\":\"stop\"}");
  e2e_event_wait(events, "overrun", message);
  assert_non_null(strstr(message, "a deadline was missed"));
  plantbus_PlantStatus *s = e2e_status_wait(status, paused_by_overrun);
  assert_string_equal(s->overrun_policy, "stop");
  plantbus_PlantStatus_free(s, DDS_FREE_ALL);
  e2e_request(session, "step", "{\"n\":5}");
  dds_delete(raw.participant);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

static bool has_run(const plantbus_PlantStatus *s) {
  return s->jitter.count > 1000;
}

static void the_status_has_times_and_ages(void **state) {
  (void)state;
  const char *const realtime[] = {"--mode", "realtime", "--overrun", "skip", NULL};
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, realtime);
  pb_session *session = e2e_open(&daemon);
  const e2e_raw raw = e2e_raw_join(&daemon);
  const dds_entity_t status = e2e_raw_reader(&raw, PB_TOPIC_STATUS);
  e2e_attach(session, "test", "Va", 0.0);
  watch w = {.want = 3000};
  run(session, &w);
  plantbus_PlantStatus *s = e2e_status_wait(status, has_run);
  uint64_t steps = 0, waits = 0;
  for (int i = 0; i < 64; i++) steps += s->step_time.bin[i], waits += s->jitter.bin[i];
  assert_true(steps >= s->step_time.count && waits >= s->jitter.count);
  assert_true(s->step_time.sum > 0.0 && s->step_time.largest > 0.0);
  assert_string_equal(s->overrun_policy, "skip");
  assert_non_null(strstr(s->real_time, "denormals: flushed to zero"));
  assert_int_equal(s->attached._length, 1);
  assert_true(s->attached._buffer[0].age_max <= s->step);
  plantbus_PlantStatus_free(s, DDS_FREE_ALL);
  dds_delete(raw.participant);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(the_plant_runs_at_its_rate),
      cmocka_unit_test(the_speed_is_a_factor),
      cmocka_unit_test(a_stopped_client_loses_its_lease),
      cmocka_unit_test(lockstep_begins_where_the_plant_is),
      cmocka_unit_test(a_late_command_is_counted_once),
      cmocka_unit_test(modes_may_change),
      cmocka_unit_test(the_policy_stop_pauses_the_plant),
      cmocka_unit_test(the_status_has_times_and_ages),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
