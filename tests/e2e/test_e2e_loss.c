// Clients that die or stop: the others go on within the guard, and an event says who was late.
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "harness.h"

#define GUARD 0.4

typedef struct survivor {
  pb_session *session;
  atomic_uint_fast64_t steps;
  atomic_bool stop;
  double last, gap;  // s, between two samples
  pb_status status;
  pthread_t thread;
} survivor;

static double clock_seconds(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static bool answer(void *context, const pb_sample *sample, double *command) {
  survivor *s = context;
  const double now = clock_seconds();
  if (s->last > 0.0 && now - s->last > s->gap) s->gap = now - s->last;
  s->last = now;
  command[0] = 0.5;
  atomic_store(&s->steps, sample->step);
  return !atomic_load(&s->stop);
}

static void *survive(void *context) {
  survivor *s = context;
  const pb_run_options options = {.on_sample = answer, .context = s, .stall = E2E_CAP};
  pb_error err = {PB_OK, "", ""};
  s->status = pb_session_run(s->session, &options, NULL, &err);
  if (s->status) print_error("%s: %s\n", err.where, err.message);
  return NULL;
}

static bool has_advanced(void *context) {
  survivor *s = context;
  static uint64_t from;
  const uint64_t steps = atomic_load(&s->steps);
  if (from == 0) from = steps + 1;
  if (steps < from + 200) return false;
  from = 0;
  return true;
}

// What happens to a running victim when it is sent `signal_number`, beside a survivor: for how long
// the latter got no sample.
static double lose(int signal_number) {
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  survivor s = {.session = e2e_open(&daemon), .status = PB_ERR_STATE};
  const e2e_raw raw = e2e_raw_join(&daemon);
  const dds_entity_t events = e2e_raw_reader(&raw, PB_TOPIC_EVENT);
  char domain[16], guard[16], line[256], message[320], name[64];
  snprintf(domain, sizeof domain, "%u", daemon.domain);
  snprintf(guard, sizeof guard, "%g", GUARD);
  e2e_attach(s.session, "survivor", "Va", 0.0);
  const char *const argv[] = {PB_E2E_CLIENT, domain, "victim", "F", guard, NULL};
  e2e_child victim = e2e_spawn(argv);
  assert_int_equal(pthread_create(&s.thread, NULL, survive, &s), 0);
  e2e_expect_line(&victim, "running", line);
  e2e_until(has_advanced, &s, "steps of both clients");
  assert_int_equal(kill(victim.pid, signal_number), 0);
  snprintf(name, sizeof name, "e2e_client[%d]", (int)victim.pid);
  // By its guard or by its missing sign of life, whichever is noticed first.
  e2e_event_wait(events, "evicted lost", message);
  e2e_until(has_advanced, &s, "steps after the loss");
  atomic_store(&s.stop, true);
  pthread_join(s.thread, NULL);
  assert_int_equal(s.status, PB_OK);
  assert_non_null(strstr(message, name));
  assert_non_null(strstr(message, "victim"));
  assert_non_null(strstr(message, "late at step"));
  kill(victim.pid, SIGKILL);
  assert_int_equal(e2e_reap(&victim), -SIGKILL);
  pb_session_close(s.session);
  dds_delete(raw.participant);
  e2e_daemon_end(&daemon);
  return s.gap;
}

// One of several: what else the machine does may hold up the survivor too.
static void holds_nobody_up(int signal_number) {
  enum { TRIES = 5 };
  double gap = 0.0;
  for (int i = 0; i < TRIES; i++) {
    gap = lose(signal_number);
    if (gap <= GUARD + 0.5) return;
  }
  fail_msg("stood still for %g s, the guard is %g s", gap, GUARD);
}

static void a_killed_client_holds_nobody_up(void **state) {
  (void)state;
  holds_nobody_up(SIGKILL);
}

static void a_stopped_client_holds_nobody_up(void **state) {
  (void)state;
  holds_nobody_up(SIGSTOP);
}

static bool forever(void *context, const pb_sample *sample, double *command) {
  (void)context, (void)sample;
  command[0] = 0.0;
  return true;
}

static bool interrupted(void) {
  return true;
}

static void a_run_tells_why_it_ends(void **state) {
  (void)state;
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  pb_session *session = e2e_open(&daemon);
  e2e_attach(session, "test", "Va", 0.0);
  pb_run_options options = {.on_sample = forever, .stall = 0.2, .interrupted = interrupted};
  pb_error err;
  assert_int_equal(pb_session_run(session, &options, NULL, &err), PB_ERR_STATE);
  assert_string_equal(err.message, "interrupted");
  options.interrupted = NULL;
  pb_session_detach(session);
  e2e_request(session, "set_mode", "{\"mode\":\"paused\"}");
  assert_int_equal(pb_session_run(session, &options, NULL, &err), PB_ERR_STATE);
  assert_non_null(strstr(err.message, "stands still"));
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

// Between two runs the client says nothing; longer than its guard, and it is out.
static bool once(void *context, const pb_sample *sample, double *command) {
  (void)context, (void)sample, (void)command;
  return false;
}

static void a_mute_client_is_evicted_and_may_come_back(void **state) {
  (void)state;
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  pb_session *session = e2e_open(&daemon);
  const e2e_raw raw = e2e_raw_join(&daemon);
  const dds_entity_t events = e2e_raw_reader(&raw, PB_TOPIC_EVENT);
  char message[320];
  e2e_attach(session, "test", "Va", 0.1);
  e2e_event_wait(events, "evicted", message);
  assert_non_null(strstr(message, "test_e2e_loss["));
  const pb_run_options run = {.on_sample = forever, .stall = 2.0};
  pb_error err;
  assert_int_equal(pb_session_run(session, &run, NULL, &err), PB_ERR_STATE);
  assert_non_null(strstr(err.message, "evicted"));
  pb_session_detach(session);
  e2e_attach(session, "test", "Va", 2.0);
  const pb_run_options again = {.on_sample = once, .stall = 2.0};
  assert_int_equal(pb_session_run(session, &again, NULL, &err), PB_OK);
  pb_session_close(session);
  dds_delete(raw.participant);
  e2e_daemon_end(&daemon);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_killed_client_holds_nobody_up),
      cmocka_unit_test(a_stopped_client_holds_nobody_up),
      cmocka_unit_test(a_run_tells_why_it_ends),
      cmocka_unit_test(a_mute_client_is_evicted_and_may_come_back),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
