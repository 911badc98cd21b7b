// plantbus-study --live on a real daemon: changes its plant, identifies it, gives it back.
#include <cjson/cJSON.h>
#include <signal.h>
#include <string.h>

#include "cli_run.h"
#include "harness.h"
#include "support/check.h"
#include "tool_run.h"

// The study beside a session of the test's own.
typedef struct waiting {
  pb_session *session;
  tool_process *study;
  int code;
} waiting;

static bool plant_is_changed(void *context) {
  return e2e_number(((waiting *)context)->session, "ping", NULL, "revision") > 1;
}

static bool study_has_ended(void *context) {
  waiting *w = context;
  return tool_ended(w->study, &w->code);
}

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

// Broken off wherever it is, also between the values: the daemon has its plant again.
static void an_interrupted_study_gives_the_plant_back(void **state) {
  (void)state;
  e2e_daemon daemon = e2e_daemon_start(PB_CONFIG "/plants/nano-hexapod.json", NULL);
  pb_session *session = e2e_open(&daemon);
  char *before = strdup(pb_session_description(session)->plant_text);
  tool_process study = tool_start("plantbus-study", daemon.domain, NULL,
                                  "bending --live --values 1,2,3,4,5,6,7,8,9,10 --from 5 --to 300");
  waiting w = {session, &study, -1};
  e2e_until(plant_is_changed, &w, "the first change");
  kill(study.pid, SIGINT);
  e2e_until(study_has_ended, &w, "the end of the study");
  tool_result r = tool_collect(&study, w.code);
  assert_int_equal(r.code, 1);
  tool_says(r.err, "interrupted");
  tool_free(&r);
  pb_session_close(session);
  session = e2e_open(&daemon);
  assert_true(pb_session_description(session)->revision > 2);
  assert_string_equal(pb_session_description(session)->plant_text, before);
  free(before);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(the_daemon_is_studied_and_gets_its_plant_back),
      cmocka_unit_test(an_interrupted_study_gives_the_plant_back),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
