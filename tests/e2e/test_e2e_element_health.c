// The daemon tells the health of each element that it loads: at its start, and after a change.
#include "e2e/harness.h"
#include "support/check.h"

#include <signal.h>

static void test_health(void **state) {
  (void)state;
  e2e_daemon daemon = {.domain = e2e_domain()};
  char command[512], line[256];
  snprintf(command, sizeof command,
           "exec %s/plantbusd --plant %s/plants/apa300ml-bench-element.json --domain %u 2>&1",
           PB_BIN, PB_CONFIG, daemon.domain);
  daemon.child = e2e_spawn((const char *const[]){"/bin/sh", "-c", command, NULL});
  e2e_expect_line(&daemon.child, "plantbusd: " PB_CONFIG, line);
  assert_non_null(strstr(line, ": element "));
  e2e_expect_line(&daemon.child, "plantbusd: ready", line);
  pb_session *session = e2e_open(&daemon);
  assert_true(e2e_number(session, "configure", "{\"patch\": {\"max_frequency\": 2000}}",
                         "revision") == 2.0);
  e2e_expect_line(&daemon.child, "plantbusd: revision 2: element", line);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_health)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
