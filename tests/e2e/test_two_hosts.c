// Daemon and client on two hosts (hosts.h): discovery by multicast and by listed peers, an outage
// of the link shorter and longer than the time after which the middleware gives a host up (3 s in
// the shipped configuration), lost packets. The test is on host A, with the daemon; the remote
// client (e2e_remote.c) on host B. Skipped where namespaces may not be made.
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "hosts.h"

#define LONG "60"  // s: a guard or a stall that no test comes to

static const double short_outage = 1.0;  // s
enum { STEPS = 2000 };

typedef struct setting {
  e2e_daemon daemon;
  e2e_child survivor;  // another member, on the daemon's host
  pb_session *session;
  e2e_raw raw;
  dds_entity_t events;
  uint64_t from;  // has_advanced counts from here
} setting;

static e2e_daemon daemon_start(hosts_discovery discovery) {
  const char *const more[] = {"--config", hosts_configure(discovery), NULL};
  return e2e_daemon_start(E2E_BENCH, more);
}

// steps "0": until it is told to end.
static e2e_child remote_start(const e2e_daemon *daemon, const char *guard, const char *steps,
                              const char *timeout, const char *stall) {
  char domain[16];
  snprintf(domain, sizeof domain, "%u", daemon->domain);
  const char *const argv[] = {PB_E2E_REMOTE, domain,  "remote", "F", guard,
                              steps,         timeout, stall,    NULL};
  return hosts_spawn(argv);
}

static setting setting_open(hosts_discovery discovery, bool survivor) {
  setting s = {.daemon = daemon_start(discovery)};
  char domain[16], line[256];
  s.session = e2e_open(&s.daemon);
  s.raw = e2e_raw_join(&s.daemon);
  s.events = e2e_raw_reader(&s.raw, PB_TOPIC_EVENT);
  if (!survivor) return s;
  snprintf(domain, sizeof domain, "%u", s.daemon.domain);
  const char *const argv[] = {PB_E2E_CLIENT, domain, "survivor", "Va", LONG, NULL};
  s.survivor = e2e_spawn(argv);
  e2e_expect_line(&s.survivor, "running", line);
  return s;
}

static void setting_close(setting *s) {
  if (s->survivor.pid) {
    kill(s->survivor.pid, SIGKILL);
    assert_int_equal(e2e_reap(&s->survivor), -SIGKILL);
  }
  pb_session_close(s->session);
  dds_delete(s->raw.participant);
  e2e_daemon_end(&s->daemon);
}

static uint64_t step_of(setting *s) {
  char *result = NULL;
  pb_error err;
  unsigned long long step = 0;
  if (pb_session_request(s->session, "ping", NULL, E2E_CAP, &result, &err))
    fail_msg("the daemon does not serve its own host: %s", err.message);
  const char *at = strstr(result, "\"step\":");
  assert_non_null(at);
  assert_int_equal(sscanf(at, "\"step\":%llu", &step), 1);
  free(result);
  return step;
}

static bool has_advanced(void *context) {
  setting *s = context;
  return step_of(s) >= s->from + 200;
}

static void expect_steps(setting *s, const char *what) {
  s->from = step_of(s);
  e2e_until(has_advanced, s, what);
}

// How long the link is down is what is tested: no condition to wait for.
static void outage_last(double seconds) {
  const struct timespec t = {(time_t)seconds, (long)((seconds - (double)(time_t)seconds) * 1e9)};
  nanosleep(&t, NULL);
}

static void expect_done(e2e_child *remote, unsigned long long steps) {
  unsigned long long last = 0, compared = 0;
  char line[256];
  e2e_expect_line_within(remote, "done ", line, E2E_CAP);
  assert_int_equal(sscanf(line, "done %llu compared %llu", &last, &compared), 2);
  assert_int_equal(compared, last + 1);
  if (steps) assert_int_equal(last, steps);
  assert_int_equal(e2e_reap(remote), 0);
}

// The same client attaches again; and a new one finds the daemon.
static void expect_recovery(setting *s, e2e_child *remote) {
  char line[256];
  e2e_expect_line_within(remote, "again ", line, E2E_CAP);
  assert_int_equal(e2e_reap(remote), 0);
  e2e_child fresh = remote_start(&s->daemon, LONG, "200", LONG, LONG);
  e2e_expect_line_within(&fresh, "done ", line, E2E_CAP);
  assert_int_equal(e2e_reap(&fresh), 0);
}

static void expect_said(e2e_child *remote, const char *start, const char *part) {
  char line[256];
  e2e_expect_line_within(remote, start, line, E2E_CAP);
  if (!strstr(line, part)) fail_msg("expected '%s', was told '%s'", part, line);
}

static void expect_event(setting *s, const e2e_child *remote) {
  char message[320], name[64];
  snprintf(name, sizeof name, "e2e_remote[%d]", (int)remote->pid);
  e2e_event_wait(s->events, "evicted lost", message);
  if (!strstr(message, name)) fail_msg("expected an event about %s, was '%s'", name, message);
}

static hosts_discovery discovery_of(void **state) {
  return *(const hosts_discovery *)*state;
}

static void a_remote_client_runs(void **state) {
  e2e_daemon daemon = daemon_start(discovery_of(state));
  e2e_child remote = remote_start(&daemon, LONG, "2000", LONG, LONG);
  expect_done(&remote, STEPS);
  e2e_daemon_end(&daemon);
}

// Nothing is lost, nothing acts twice: the whole run equals the library's plant.
static void a_patient_run_goes_on_after_a_short_outage(void **state) {
  setting s = setting_open(discovery_of(state), false);
  e2e_child remote = remote_start(&s.daemon, LONG, "0", LONG, LONG);
  expect_said(&remote, "running", "");
  expect_steps(&s, "steps before the outage");
  hosts_link(false);
  const uint64_t stands = step_of(&s);
  outage_last(short_outage);
  assert_in_range(step_of(&s), stands, stands + 10);  // packets that were under way
  hosts_link(true);
  s.from = step_of(&s);
  e2e_until(has_advanced, &s, "steps after the outage");
  assert_int_equal(kill(remote.pid, SIGTERM), 0);
  expect_done(&remote, 0);
  setting_close(&s);
}

static void an_outage_longer_than_the_guard_evicts(void **state) {
  setting s = setting_open(discovery_of(state), true);
  e2e_child remote = remote_start(&s.daemon, "0.3", "0", LONG, LONG);
  expect_said(&remote, "running", "");
  hosts_link(false);
  expect_event(&s, &remote);
  expect_steps(&s, "steps of the other member during the outage");
  hosts_link(true);
  expect_said(&remote, "failed: ", "late at step");
  expect_recovery(&s, &remote);
  expect_steps(&s, "steps of the other member after the outage");
  setting_close(&s);
}

static void a_client_tells_that_the_plant_stands_still(void **state) {
  setting s = setting_open(discovery_of(state), false);
  e2e_child remote = remote_start(&s.daemon, LONG, "0", LONG, "1.5");
  expect_said(&remote, "running", "");
  hosts_link(false);
  expect_said(&remote, "failed: ", "the plant stands still");
  expect_said(&remote, "ping: ", "plant 'bus-bench' did not answer within 0.5 s");
  hosts_link(true);
  expect_recovery(&s, &remote);
  setting_close(&s);
}

// Longer than the lease of discovery: both hosts have given each other up.
static void a_long_outage_is_told_on_both_sides(void **state) {
  setting s = setting_open(discovery_of(state), true);
  e2e_child remote = remote_start(&s.daemon, LONG, "0", LONG, LONG);
  expect_said(&remote, "running", "");
  hosts_link(false);
  expect_event(&s, &remote);
  expect_steps(&s, "steps of the other member during the outage");
  expect_said(&remote, "failed: ", "the daemon has gone");
  expect_said(&remote, "ping: ", "did not answer");
  e2e_child lonely = remote_start(&s.daemon, LONG, "200", "0.5", LONG);
  expect_said(&lonely, "failed: ", "no daemon serves it on domain");
  assert_int_equal(e2e_reap(&lonely), 1);
  hosts_link(true);
  expect_recovery(&s, &remote);
  expect_steps(&s, "steps of the other member after the outage");
  setting_close(&s);
}

// The middleware itself leaves packets out, one of a hundred on each side. That it does so is seen
// where it leaves them all out.
static void lost_packets_do_not_harm_a_run(void **state) {
  (void)state;
  e2e_daemon daemon = daemon_start(HOSTS_LOSSY);
  e2e_child remote = remote_start(&daemon, LONG, "2000", LONG, LONG);
  expect_done(&remote, STEPS);
  e2e_daemon_end(&daemon);
  daemon = daemon_start(HOSTS_MUTE);
  remote = remote_start(&daemon, LONG, "1", "1.5", LONG);
  expect_said(&remote, "failed: ", "no daemon serves it on domain");
  assert_int_equal(e2e_reap(&remote), 1);
  e2e_daemon_end(&daemon);
}

static void delay_and_loss_of_the_network_do_not_harm_a_run(void **state) {
  (void)state;
  if (!hosts_disturb("1ms", "1%")) {
    print_message("skipped: no netem in this kernel\n");
    skip();
  }
  e2e_daemon daemon = daemon_start(HOSTS_MULTICAST);
  e2e_child remote = remote_start(&daemon, LONG, "1000", LONG, LONG);
  expect_done(&remote, 1000);
  hosts_calm();
  e2e_daemon_end(&daemon);
}

#define WITH(test, discovery) \
  { #test " (" #discovery ")", test, NULL, link_restore, &discovery }

// Also after a test that failed during its outage.
static int link_restore(void **state) {
  (void)state;
  hosts_link(true);
  return 0;
}

int main(void) {
  static hosts_discovery multicast = HOSTS_MULTICAST, peers = HOSTS_PEERS;
  const struct CMUnitTest tests[] = {
      WITH(a_remote_client_runs, multicast),
      WITH(a_remote_client_runs, peers),
      WITH(a_patient_run_goes_on_after_a_short_outage, multicast),
      WITH(a_patient_run_goes_on_after_a_short_outage, peers),
      WITH(an_outage_longer_than_the_guard_evicts, multicast),
      WITH(an_outage_longer_than_the_guard_evicts, peers),
      WITH(a_client_tells_that_the_plant_stands_still, multicast),
      WITH(a_long_outage_is_told_on_both_sides, multicast),
      WITH(a_long_outage_is_told_on_both_sides, peers),
      WITH(lost_packets_do_not_harm_a_run, multicast),
      WITH(delay_and_loss_of_the_network_do_not_harm_a_run, multicast),
  };
  char why[256];
  if (!hosts_make(why)) {
    printf("skipped: two hosts cannot be made here: %s\n", why);
    hosts_remove();
    return 77;
  }
  int failed = cmocka_run_group_tests(tests, NULL, NULL);
  if (!hosts_remove()) {
    printf("namespaces or files of the test are left\n");
    failed++;
  }
  return failed;
}
