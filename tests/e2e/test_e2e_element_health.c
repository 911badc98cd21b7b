// The daemon tells the health of each element that it reads: at its start, and after a change that
// brings another one; never again of one that it has.
#include "e2e/harness.h"
#include "support/check.h"

#include <signal.h>

static char copy[64];

static int teardown(void **state) {
  (void)state;
  unlink(copy);
  return 0;
}

static void run(const char *format, ...) {
  char command[512];
  va_list args;
  va_start(args, format);
  vsnprintf(command, sizeof command, format, args);
  va_end(args);
  assert_int_equal(system(command), 0);
}

static double configure(pb_session *session, const char *patch) {
  return e2e_change(session, "configure", patch, "revision");
}

// The line that follows the one of revision `number`.
static void line_after(e2e_child *child, int number, char line[256]) {
  char start[64];
  snprintf(start, sizeof start, "plantbusd: revision %d at step", number);
  e2e_expect_line(child, start, line);
  e2e_expect_line(child, "plantbusd: revision", line);
}

static void test_health(void **state) {
  (void)state;
  e2e_daemon daemon = {.domain = e2e_domain()};
  char command[512], line[256], patch[256];
  snprintf(copy, sizeof copy, "/tmp/pb-health-%ld.mat", (long)getpid());
  run("cp %s/elements/apa300ml.mat %s", PB_CONFIG, copy);
  snprintf(command, sizeof command,
           "exec %s/plantbusd --plant %s/plants/apa300ml-bench-element.json --domain %u 2>&1",
           PB_BIN, PB_CONFIG, daemon.domain);
  daemon.child = e2e_spawn((const char *const[]){"/bin/sh", "-c", command, NULL});
  e2e_expect_line(&daemon.child, "plantbusd: " PB_CONFIG, line);
  assert_non_null(strstr(line, ": element "));
  e2e_expect_line(&daemon.child, "plantbusd: ready", line);
  pb_session *session = e2e_open(&daemon);
  snprintf(patch, sizeof patch, "{\"patch\": {\"models\": {\"apa300ml\": {\"file\": \"%s\"}}}}",
           copy);
  assert_true(configure(session, "{\"patch\": {\"max_frequency\": 2000}}") == 2.0);
  assert_true(configure(session, patch) == 3.0);
  assert_true(configure(session, "{\"patch\": {\"max_frequency\": 3000}}") == 4.0);
  run("cp %s %s.new && mv %s.new %s", copy, copy, copy, copy);
  assert_true(configure(session, "{\"patch\": {\"max_frequency\": 4000}}") == 5.0);
  line_after(&daemon.child, 2, line);  // the element of revision 1 is no news
  assert_non_null(strstr(line, "revision 3 at step"));
  e2e_expect_line(&daemon.child, "plantbusd: revision", line);
  assert_non_null(strstr(line, "revision 3: element"));
  line_after(&daemon.child, 4, line);
  assert_non_null(strstr(line, "revision 5 at step"));
  e2e_expect_line(&daemon.child, "plantbusd: revision", line);
  assert_non_null(strstr(line, "revision 5: element"));  // the file is another one
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_health)};
  return cmocka_run_group_tests(tests, NULL, teardown);
}
