// The daemon as a process: how it starts, refuses to start, and ends.
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <stdlib.h>
#include <unistd.h>

#include "harness.h"

static void signals_end_it_cleanly(void **state) {
  (void)state;
  const int signals[] = {SIGTERM, SIGINT};
  for (int i = 0; i < 2; i++) {
    e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
    assert_int_equal(kill(daemon.child.pid, signals[i]), 0);
    assert_int_equal(e2e_reap(&daemon.child), 0);
  }
}

static void it_ends_while_clients_run(void **state) {
  (void)state;
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  char domain[16], line[256];
  snprintf(domain, sizeof domain, "%u", daemon.domain);
  const char *const argv[] = {PB_E2E_CLIENT, domain, "running", "Va", "2", NULL};
  e2e_child client = e2e_spawn(argv);
  e2e_expect_line(&client, "running", line);
  e2e_daemon_end(&daemon);
  e2e_expect_line(&client, "failed", line);
  assert_non_null(strstr(line, "has gone"));
  assert_int_equal(e2e_reap(&client), 1);
}

static void the_ready_line_says_what_is_served(void **state) {
  (void)state;
  char domain[16], line[256], expected[128];
  const uint32_t id = e2e_domain();
  snprintf(domain, sizeof domain, "%u", id);
  const char *const argv[] = {
      PB_BIN "/plantbusd", "--plant", E2E_BENCH, "--domain", domain, "--mode", "paused", NULL};
  e2e_child child = e2e_spawn(argv);
  e2e_expect_line(&child, "plantbusd: ready", line);
  snprintf(expected, sizeof expected,
           "plantbusd: ready: plant 'bus-bench', 4 states, 10000 Hz, paused, domain %u", id);
  assert_string_equal(line, expected);
  kill(child.pid, SIGTERM);
  assert_int_equal(e2e_reap(&child), 0);
}

// Runs the daemon to its end with standard error on its standard output.
static int run_to_end(const char *arguments, char *line, const char *start) {
  char command[1024];
  snprintf(command, sizeof command, "exec %s/plantbusd %s 2>&1", PB_BIN, arguments);
  const char *const argv[] = {"/bin/sh", "-c", command, NULL};
  e2e_child child = e2e_spawn(argv);
  e2e_expect_line(&child, start, line);
  return e2e_reap(&child);
}

static void a_bad_plant_is_refused_by_pointer(void **state) {
  (void)state;
  char line[256];
  assert_int_equal(run_to_end("--plant " PB_TEST_DATA "/bus-bad.json", line, "plantbusd: "), 1);
  assert_non_null(strstr(line, "bus-bad.json: /components/mass/mass: "));
  assert_int_equal(run_to_end("--plant /no/such/file.json", line, "plantbusd: "), 1);
  assert_non_null(strstr(line, "/no/such/file.json"));
}

static void a_bad_command_line_is_a_usage_error(void **state) {
  (void)state;
  static const char *const list[] = {"",
                                     "--plant x --mode fast",
                                     "--plant x --domain -1",
                                     "--plant x --speed nan",
                                     "--plant x --config a.xml --interface lo",
                                     "--plant x extra",
                                     "--bogus"};
  for (size_t i = 0; i < sizeof list / sizeof *list; i++) {
    char line[256];
    assert_int_equal(run_to_end(list[i], line, ""), 2);
  }
}

static void shutdown_ends_it_when_allowed(void **state) {
  (void)state;
  const char *const allowed[] = {"--allow-shutdown", NULL};
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, allowed);
  pb_session *session = e2e_open(&daemon);
  e2e_request(session, "shutdown", NULL);
  assert_int_equal(e2e_reap(&daemon.child), 0);
  pb_session_close(session);
}

// What a client is told when there is nothing to talk to.
static void clients_of_nothing_are_told(void **state) {
  (void)state;
  const pb_session_options options = {.domain = e2e_domain(), .timeout = 0.3};
  pb_session *session = NULL;
  pb_error err;
  assert_int_equal(pb_session_open(&options, &session, &err), PB_ERR_STATE);
  assert_null(session);
  assert_non_null(strstr(err.message, "no daemon serves it"));
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  const pb_session_options other = {.domain = daemon.domain, .plant = "another", .timeout = 0.3};
  assert_int_equal(pb_session_open(&other, &session, &err), PB_ERR_STATE);
  assert_string_equal(err.where, "another");
  assert_non_null(strstr(err.message, "served there: "));
  e2e_daemon_end(&daemon);
}

// The shipped configuration and the built-in one talk to each other; a bad one is refused.
static void configurations_are_files(void **state) {
  (void)state;
  const char *const shipped[] = {"--config", PB_CONFIG "/dds-loopback.xml", NULL};
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, shipped);
  pb_session *session = e2e_open(&daemon);
  e2e_request(session, "ping", NULL);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
  char line[256];
  assert_int_equal(run_to_end("--plant " E2E_BENCH " --config /no/such.xml", line, "plantbusd: "),
                   1);
  assert_non_null(strstr(line, "/no/such.xml"));
  assert_int_equal(run_to_end("--plant " E2E_BENCH " --interface 'no\"such'", line, "plantbusd: "),
                   1);
  assert_non_null(strstr(line, "not the name of an interface"));
}

// What the middleware would silently take for an empty configuration: every network of the host.
static void what_is_no_configuration_is_refused(void **state) {
  (void)state;
  static const char *const list[] = {"/tmp", "/dev/null", PB_CONFIG "/dds,loopback.xml"};
  for (size_t i = 0; i < sizeof list / sizeof *list; i++) {
    char arguments[512], line[256];
    snprintf(arguments, sizeof arguments, "--plant " E2E_BENCH " --config %s", list[i]);
    assert_int_equal(run_to_end(arguments, line, "plantbusd: "), 1);
    assert_non_null(strstr(line, list[i]));
  }
}

// Neither the daemon nor a client leaves a file where it is started, and so they start anywhere.
static void the_working_directory_stays_empty(void **state) {
  (void)state;
  char before[1024], path[] = "/tmp/plantbus-empty-XXXXXX";
  assert_non_null(getcwd(before, sizeof before));
  assert_non_null(mkdtemp(path));
  assert_int_equal(chdir(path), 0);
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  pb_session *session = e2e_open(&daemon);
  e2e_request(session, "ping", NULL);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
  const char *const shipped[] = {"--config", PB_CONFIG "/dds-loopback.xml", NULL};
  daemon = e2e_daemon_start(E2E_BENCH, shipped);
  e2e_daemon_end(&daemon);
  const char *const lan[] = {"--config", PB_CONFIG "/dds-lan.xml", NULL};
  daemon = e2e_daemon_start(E2E_BENCH, lan);
  e2e_daemon_end(&daemon);
  assert_int_equal(chdir(before), 0);
  assert_int_equal(rmdir(path), 0);  // fails when a file is in it
}

// Loading a large plant takes seconds; here it takes for ever, because nobody writes into the pipe.
static void a_signal_ends_it_while_it_loads(void **state) {
  (void)state;
  char directory[] = "/tmp/plantbus-load-XXXXXX", path[64];
  assert_non_null(mkdtemp(directory));
  snprintf(path, sizeof path, "%s/plant.json", directory);
  assert_int_equal(mkfifo(path, 0600), 0);
  const char *const argv[] = {PB_BIN "/plantbusd", "--plant", path, NULL};
  e2e_child child = e2e_spawn(argv);
  const int fd = open(path, O_WRONLY | O_CLOEXEC);  // returns once the daemon reads
  assert_true(fd >= 0);
  kill(child.pid, SIGTERM);
  assert_int_equal(e2e_reap(&child), -SIGTERM);
  close(fd);
  unlink(path);
  rmdir(directory);
}

// No socket of the bus takes the place of a closed standard stream.
static void closed_streams_stay_closed(void **state) {
  (void)state;
  const e2e_daemon daemon = {.domain = e2e_domain()};
  char command[1024];
  snprintf(command, sizeof command, "exec %s/plantbusd --plant %s --domain %u <&- >&- 2>&-", PB_BIN,
           E2E_BENCH, daemon.domain);
  const char *const argv[] = {"/bin/sh", "-c", command, NULL};
  e2e_child child = e2e_spawn(argv);
  pb_session *session = e2e_open(&daemon);  // it serves
  for (int fd = 0; fd <= 2; fd++) {
    char link[64], target[64] = "";
    snprintf(link, sizeof link, "/proc/%d/fd/%d", (int)child.pid, fd);
    assert_true(readlink(link, target, sizeof target - 1) > 0);
    assert_string_equal(target, "/dev/null");
  }
  pb_session_close(session);
  kill(child.pid, SIGTERM);
  assert_int_equal(e2e_reap(&child), 0);
}

// A copy of the bench under another name, in a file of its own.
static void bench_rename(const char *name, char path[64]) {
  char text[4096];
  FILE *in = fopen(E2E_BENCH, "r");
  assert_non_null(in);
  const size_t n = fread(text, 1, sizeof text - 1, in);
  text[n] = '\0';
  fclose(in);
  char *at = strstr(text, "bus-bench");
  assert_non_null(at);
  snprintf(path, 64, "/tmp/plantbus-%d-%s.json", (int)getpid(), name);
  FILE *out = fopen(path, "w");
  assert_non_null(out);
  fprintf(out, "%.*s%s%s", (int)(at - text), text, name, at + strlen("bus-bench"));
  assert_int_equal(fclose(out), 0);
}

static void several_plants_share_a_domain_and_are_told_apart(void **state) {
  (void)state;
  e2e_daemon one = e2e_daemon_start(E2E_BENCH, NULL);
  char path[64], domain[16], line[256];
  snprintf(domain, sizeof domain, "%u", one.domain);
  bench_rename("second", path);
  const char *const argv[] = {PB_BIN "/plantbusd", "--plant", path, "--domain", domain, NULL};
  e2e_child two = e2e_spawn(argv);
  e2e_expect_line(&two, "plantbusd: ready", line);
  unlink(path);
  // By name; and with that, this process has heard of both.
  static const char *const names[] = {"second", "bus-bench"};
  pb_session *session = NULL, *named[2];
  pb_error err;
  for (int i = 0; i < 2; i++) {
    const pb_session_options options = {
        .domain = one.domain, .plant = names[i], .timeout = E2E_CAP};
    assert_int_equal(pb_session_open(&options, &named[i], &err), PB_OK);
    assert_string_equal(pb_session_description(named[i])->name, names[i]);
  }
  const pb_session_options any = {.domain = one.domain, .timeout = E2E_CAP};
  assert_int_equal(pb_session_open(&any, &session, &err), PB_ERR_STATE);
  assert_non_null(strstr(err.message, "'bus-bench'"));
  assert_non_null(strstr(err.message, "'second'"));
  for (int i = 0; i < 2; i++) pb_session_close(named[i]);
  kill(two.pid, SIGTERM);
  assert_int_equal(e2e_reap(&two), 0);
  e2e_daemon_end(&one);
}

// A name is a partition: a wildcard would meet every plant, and a line break forge the ready line.
static void a_name_that_is_no_partition_is_refused(void **state) {
  (void)state;
  static const char *const list[] = {"*", "plant?", "plant[1]", "two\\nlines"};
  for (size_t i = 0; i < sizeof list / sizeof *list; i++) {
    char path[64], arguments[128], line[256];
    bench_rename(list[i], path);
    snprintf(arguments, sizeof arguments, "--plant '%s'", path);
    assert_int_equal(run_to_end(arguments, line, "plantbusd: "), 1);
    assert_non_null(strstr(line, "/name: expected"));
    unlink(path);
  }
}

static bool two_matched(void *context) {
  dds_publication_matched_status_t status;
  return dds_get_publication_matched_status(*(dds_entity_t *)context, &status) == DDS_RETCODE_OK &&
         status.current_count == 2;
}

// Two daemons with one plant name would both answer: a client must not choose by chance.
static void two_daemons_of_one_name_are_refused(void **state) {
  (void)state;
  e2e_daemon one = e2e_daemon_start(E2E_BENCH, NULL);
  char domain[16], line[256];
  snprintf(domain, sizeof domain, "%u", one.domain);
  const char *const argv[] = {PB_BIN "/plantbusd", "--plant", E2E_BENCH, "--domain", domain, NULL};
  e2e_child two = e2e_spawn(argv);
  e2e_expect_line(&two, "plantbusd: ready", line);
  const e2e_raw raw = e2e_raw_join(&one);
  dds_entity_t requests = e2e_raw_writer(&raw, PB_TOPIC_REQUEST);
  e2e_until(two_matched, &requests, "both daemons");
  pb_session *session = NULL;
  pb_error err;
  // One of them may be about to end: all of the time is waited for.
  const pb_session_options any = {.domain = one.domain, .timeout = 5.0};
  assert_int_equal(pb_session_open(&any, &session, &err), PB_ERR_STATE);
  assert_non_null(strstr(err.message, "2 daemons"));
  dds_delete(raw.participant);
  kill(two.pid, SIGTERM);
  assert_int_equal(e2e_reap(&two), 0);
  e2e_daemon_end(&one);
}

#ifdef PB_HAVE_SYSTEMD
static void systemd_is_notified(void **state) {
  (void)state;
  char path[] = "/tmp/plantbus-notify-XXXXXX";
  assert_non_null(mkdtemp(path));
  struct sockaddr_un address = {.sun_family = AF_UNIX};
  snprintf(address.sun_path, sizeof address.sun_path, "%s/socket", path);
  const int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  assert_int_equal(bind(fd, (struct sockaddr *)&address, sizeof address), 0);
  setenv("NOTIFY_SOCKET", address.sun_path, 1);
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  unsetenv("NOTIFY_SOCKET");
  static const char *const expected[] = {"READY=1", "STOPPING=1"};
  for (int i = 0; i < 2; i++) {
    char text[64] = "";
    struct pollfd p = {.fd = fd, .events = POLLIN};
    if (i == 1) kill(daemon.child.pid, SIGTERM);
    assert_int_equal(poll(&p, 1, (int)(E2E_CAP * 1e3)), 1);
    assert_true(recv(fd, text, sizeof text - 1, 0) > 0);
    assert_string_equal(text, expected[i]);
  }
  assert_int_equal(e2e_reap(&daemon.child), 0);
  close(fd);
  unlink(address.sun_path);
  rmdir(path);
}
#endif

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(signals_end_it_cleanly),
      cmocka_unit_test(it_ends_while_clients_run),
      cmocka_unit_test(the_ready_line_says_what_is_served),
      cmocka_unit_test(a_bad_plant_is_refused_by_pointer),
      cmocka_unit_test(a_bad_command_line_is_a_usage_error),
      cmocka_unit_test(shutdown_ends_it_when_allowed),
      cmocka_unit_test(clients_of_nothing_are_told),
      cmocka_unit_test(configurations_are_files),
      cmocka_unit_test(what_is_no_configuration_is_refused),
      cmocka_unit_test(the_working_directory_stays_empty),
      cmocka_unit_test(a_signal_ends_it_while_it_loads),
      cmocka_unit_test(closed_streams_stay_closed),
      cmocka_unit_test(a_name_that_is_no_partition_is_refused),
      cmocka_unit_test(several_plants_share_a_domain_and_are_told_apart),
      cmocka_unit_test(two_daemons_of_one_name_are_refused),
#ifdef PB_HAVE_SYSTEMD
      cmocka_unit_test(systemd_is_notified),
#endif
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
