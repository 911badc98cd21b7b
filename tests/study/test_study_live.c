// plantbus-study --live on a real daemon: changes its plant, identifies it, gives it back.
#include <cjson/cJSON.h>

#include "cli_run.h"
#include "harness.h"
#include "support/check.h"

static void the_daemon_is_studied_and_gets_its_plant_back(void **state) {
  (void)state;
  e2e_daemon daemon = e2e_daemon_start(PB_CONFIG "/plants/nano-hexapod.json", NULL);
  char line[512];
  snprintf(line, sizeof line,
           PB_BIN "/plantbus-study bending --live --domain %u --values 0,500 --from 5 --to 300 "
                  "--json",
           daemon.domain);
  cli_result r = cli_run(line);
  if (r.code != 0) fail_msg("ended with %d: %s", r.code, r.err);
  cJSON *json = cJSON_Parse(r.out);
  assert_non_null(json);
  const cJSON *values = cJSON_GetObjectItem(json, "values");
  assert_int_equal(cJSON_GetArraySize(values), 2);
  double zero[2];
  for (int k = 0; k < 2; k++) {
    const cJSON *v = cJSON_GetArrayItem(values, k);
    zero[k] = cJSON_GetObjectItem(cJSON_GetObjectItem(v, "zero_measured"), "hz")->valuedouble;
    double exact = cJSON_GetObjectItem(cJSON_GetObjectItem(v, "zero_exact"), "hz")->valuedouble;
    ASSERT_RELATIVE(zero[k], exact, 1e-4);
    ASSERT_NEAR(cJSON_GetObjectItem(v, "states")->valuedouble, 48, 0);
    assert_true(cJSON_GetObjectItem(v, "magnitude_error_percent")->valuedouble < 0.1);
    assert_true(cJSON_GetObjectItem(v, "lines_used")->valuedouble > 100);
  }
  assert_true(zero[1] > 1.2 * zero[0]);
  cJSON_Delete(json);
  cli_free(&r);
  pb_session *session = e2e_open(&daemon);
  const pb_description *d = pb_session_description(session);
  assert_int_equal(d->revision, 4);  // two changes, and back
  assert_non_null(strstr(d->plant_text, "\"bottom_joint\": \"bottom\""));
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(the_daemon_is_studied_and_gets_its_plant_back),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
