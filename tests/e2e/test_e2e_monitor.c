// plantbus-monitor: once, in a pipe, and on a terminal of its own.
#include <pty.h>
#include <utmp.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/wait.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "tool_run.h"
#include "harness.h"

static void once_shows_who_is_attached(void **state) {
  (void)state;
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  pb_session *session = e2e_open(&daemon);
  e2e_attach(session, "tracking", "Va", 60.0);
  cJSON *json = tool_json("plantbus-monitor", daemon.domain, NULL, "--once --json", 0);
  assert_string_equal(tool_member(json, "plant")->valuestring, "bus-bench");
  assert_string_equal(tool_member(json, "mode")->valuestring, "lockstep");
  assert_true(tool_member(json, "nominal_steps_per_second")->valuedouble == 10000.0);
  assert_int_equal(cJSON_GetArraySize(tool_member(json, "members")), 1);
  const cJSON *member = cJSON_GetArrayItem(tool_member(json, "members"), 0);
  assert_string_equal(tool_member(member, "channel")->valuestring, "tracking");
  assert_true(cJSON_IsTrue(tool_member(member, "waited")));
  assert_true(cJSON_IsTrue(tool_member(member, "barrier")));
  const cJSON *output = cJSON_GetArrayItem(tool_member(json, "outputs"), 1);
  assert_string_equal(tool_member(output, "name")->valuestring, "y");
  assert_string_equal(tool_member(output, "unit")->valuestring, "m");
  cJSON_Delete(json);
  tool_result r = tool_run("plantbus-monitor", daemon.domain, NULL, "--once");
  assert_int_equal(r.code, 0);
  tool_says(r.out, "stands still, waits for test_e2e_monitor[");
  tool_says(r.out, "Vs [V]");
  assert_null(strchr(r.out, '\033'));
  tool_free(&r);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

// The plant's time is that of its clients: watched or not, the same steps are taken.
static bool count(void *context, const pb_sample *sample, double *command) {
  uint64_t *left = context;
  command[0] = (double)(sample->step % 5);
  return --*left > 0;
}

static void a_pipe_gets_a_line_a_status(void **state) {
  (void)state;
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  char domain[16], line[256];
  snprintf(domain, sizeof domain, "%u", daemon.domain);
  const char *const argv[] = {PB_BIN "/plantbus-monitor", "--domain", domain, NULL};
  e2e_child monitor = e2e_spawn(argv);
  e2e_expect_line(&monitor, "bus-bench lockstep epoch 1 step 0 ", line);
  pb_session *session = e2e_open(&daemon);
  e2e_attach(session, "test", "Va", 0.0);
  uint64_t left = 2000;
  pb_run_report report;
  pb_error err;
  const pb_run_options options = {.on_sample = count, .context = &left, .stall = E2E_CAP};
  assert_int_equal(pb_session_run(session, &options, &report, &err), PB_OK);
  assert_int_equal(report.samples, 2000);
  assert_int_equal(report.missed, 0);
  e2e_expect_line(&monitor, "bus-bench lockstep epoch 1 step 1999 ", line);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
  assert_int_equal(e2e_reap(&monitor), 1);  // the daemon has gone
}

static void a_signal_ends_it_with_0(void **state) {
  (void)state;
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  char domain[16], line[256];
  snprintf(domain, sizeof domain, "%u", daemon.domain);
  const char *const argv[] = {PB_BIN "/plantbus-monitor", "--domain", domain, "--json", NULL};
  e2e_child monitor = e2e_spawn(argv);
  e2e_expect_line(&monitor, "{\"plant\":\"bus-bench\"", line);
  assert_int_equal(kill(monitor.pid, SIGINT), 0);
  assert_int_equal(e2e_reap(&monitor), 0);
  e2e_daemon_end(&daemon);
}

// ---- on a terminal ------------------------------------------------------------------------------

typedef struct terminal {
  int master;
  pid_t pid;
  struct termios before;
  char text[1 << 16];
  size_t length;
} terminal;

static void terminal_start(terminal *t, uint32_t domain) {
  int slave;
  struct winsize size = {.ws_row = 12, .ws_col = 60};
  char number[16];
  snprintf(number, sizeof number, "%u", domain);
  assert_int_equal(openpty(&t->master, &slave, NULL, NULL, &size), 0);
  assert_int_equal(tcgetattr(slave, &t->before), 0);
  t->length = 0;
  t->pid = fork();
  assert_true(t->pid >= 0);
  if (t->pid == 0) {
    login_tty(slave);
    execl(PB_BIN "/plantbus-monitor", "plantbus-monitor", "--domain", number, "--rate", "20", NULL);
    _exit(127);
  }
  close(slave);
}

// Reads until the text holds the part, from `from` on; fails at the cap.
static size_t terminal_expect(terminal *t, const char *part, size_t from) {
  for (;;) {
    t->text[t->length] = '\0';
    const char *at = strstr(t->text + from, part);
    if (at) return (size_t)(at - t->text);
    struct pollfd p = {.fd = t->master, .events = POLLIN};
    if (poll(&p, 1, (int)(E2E_CAP * 1e3)) <= 0) fail_msg("no '%s' on the terminal", part);
    const ssize_t n = read(t->master, t->text + t->length, sizeof t->text - 1 - t->length);
    if (n <= 0) fail_msg("the terminal ended before '%s'", part);
    t->length += (size_t)n;
  }
}

// The terminal is as it was: screen, cursor, modes.
static void terminal_check_restored(terminal *t, size_t from) {
  struct termios after;
  int status;
  terminal_expect(t, "\033[?25h\033[?1049l", from);
  while (waitpid(t->pid, &status, WNOHANG) == 0) {
    struct pollfd p = {.fd = t->master, .events = POLLIN};  // hangs up with the process
    if (poll(&p, 1, (int)(E2E_CAP * 1e3)) == 0) fail_msg("the monitor does not end");
    char rest[256];
    if (p.revents & POLLIN && read(t->master, rest, sizeof rest) < 0) continue;
  }
  assert_true(WIFEXITED(status));
  assert_int_equal(WEXITSTATUS(status), 0);
  assert_int_equal(tcgetattr(t->master, &after), 0);
  assert_int_equal(after.c_lflag, t->before.c_lflag);
  assert_int_equal(after.c_cc[VSUSP], t->before.c_cc[VSUSP]);
  close(t->master);
}

static void a_terminal_is_redrawn_and_given_back(void **state) {
  (void)state;
  static terminal t;
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  for (int way = 0; way < 2; way++) {
    terminal_start(&t, daemon.domain);
    terminal_expect(&t, "\033[?1049h", 0);
    size_t at = terminal_expect(&t, "\033[H", 0);
    at = terminal_expect(&t, "lockstep", at);
    at = terminal_expect(&t, "\033[H", at);  // the next picture
    const struct winsize wide = {.ws_row = 40, .ws_col = 120};
    assert_int_equal(ioctl(t.master, TIOCSWINSZ, &wide), 0);
    at = terminal_expect(&t, "y\033[2m [m]", at);  // the last line has room now
    if (way == 0)
      assert_int_equal(write(t.master, "q", 1), 1);
    else
      assert_int_equal(kill(t.pid, SIGINT), 0);
    terminal_check_restored(&t, at);
  }
  e2e_daemon_end(&daemon);
}

// ---- no plant, several --------------------------------------------------------------------------

static void no_plant_is_told(void **state) {
  (void)state;
  tool_result r = tool_run("plantbus-monitor", e2e_domain(), NULL, "--once --timeout 0.3");
  assert_int_equal(r.code, 1);
  tool_says(r.err, "no daemon serves it on domain");
  tool_free(&r);
}

static void several_plants_are_listed(void **state) {
  (void)state;
  e2e_daemon first = e2e_daemon_start(E2E_BENCH, NULL);
  char domain[16], line[256];
  snprintf(domain, sizeof domain, "%u", first.domain);
  const char *const argv[] = {
      PB_BIN "/plantbusd", "--plant", PB_CONFIG "/plants/apa300ml-bench.json",
      "--domain",          domain,    NULL};
  e2e_daemon second = {.child = e2e_spawn(argv), .domain = first.domain};
  e2e_expect_line(&second.child, "plantbusd: ready", line);
  tool_result r = tool_run("plantbus-monitor", first.domain, NULL, "--once");
  assert_int_equal(r.code, 1);
  tool_says(r.err, "  apa300ml-bench  plantbusd[");
  tool_says(r.err, "  bus-bench  plantbusd[");
  tool_says(r.err, "name one by --plant");
  tool_free(&r);
  cJSON *json =
      tool_json("plantbus-monitor", first.domain, NULL, "--once --json --plant apa300ml-bench", 0);
  assert_string_equal(tool_member(json, "plant")->valuestring, "apa300ml-bench");
  cJSON_Delete(json);
  e2e_daemon_end(&second);
  e2e_daemon_end(&first);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(once_shows_who_is_attached),
      cmocka_unit_test(a_pipe_gets_a_line_a_status),
      cmocka_unit_test(a_signal_ends_it_with_0),
      cmocka_unit_test(a_terminal_is_redrawn_and_given_back),
      cmocka_unit_test(no_plant_is_told),
      cmocka_unit_test(several_plants_are_listed),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
