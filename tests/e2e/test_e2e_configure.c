// plantbus-configure: what it reads from a real daemon, and what it asks of one that changes its
// plant (the fake one, which answers by the contract of docs/bus.md).
#include <string.h>

#include "fake_daemon.h"

static const char *const paused[] = {"--mode", "paused", NULL};

// One for all tests: domains are few.
static e2e_daemon bench;

static int daemon_begin(void **state) {
  (void)state;
  bench = e2e_daemon_start(E2E_BENCH, paused);
  return 0;
}

static int daemon_finish(void **state) {
  (void)state;
  e2e_daemon_end(&bench);
  return 0;
}

static void get_prints_the_plant_file_or_a_part(void **state) {
  (void)state;
  tool_result r = tool_run("plantbus-configure", bench.domain, NULL, "get /components/mass/mass");
  assert_string_equal(r.out, "5\n");
  tool_free(&r);
  r = tool_run("plantbus-configure", bench.domain, NULL, "get /outputs/1/name");
  assert_string_equal(r.out, "y\n");
  tool_free(&r);
  r = tool_run("plantbus-configure", bench.domain, NULL, "get");
  tool_says(r.out, "{\n  \"schema\": \"plantbus.plant/1\",\n  \"name\": \"bus-bench\",");
  tool_free(&r);
  r = tool_run("plantbus-configure", bench.domain, NULL, "get /components/mass/colour/x");
  assert_int_equal(r.code, 1);
  tool_says(r.err, "/components/mass/colour: is not in the plant file");
  tool_free(&r);
}

static void a_dry_run_checks_and_sends_nothing(void **state) {
  (void)state;
  tool_result r =
      tool_run("plantbus-configure", bench.domain, NULL, "set --dry-run /components/mass/mass 7.5");
  assert_int_equal(r.code, 0);
  tool_says(r.out, "\"mass\": 7.5,");
  tool_free(&r);
  r = tool_run("plantbus-configure", bench.domain, NULL, "set --dry-run /components/mass/mass -1");
  assert_int_equal(r.code, 1);
  tool_says(r.err, "/components/mass/mass: expected a number");
  tool_free(&r);
}

static void a_wrong_command_line_is_refused(void **state) {
  (void)state;
  static const char *const line[] = {"", "set /a", "history 1", "alter", "set /a 1 2 3"};
  for (size_t i = 0; i < sizeof line / sizeof *line; i++) {
    tool_result r = tool_run("plantbus-configure", 0, NULL, line[i]);
    if (r.code != 2) fail_msg("'%s' ended with %d", line[i], r.code);
    tool_free(&r);
  }
}

// ---- changes ------------------------------------------------------------------------------------

static char asked[256], body_of[1024];
static bool at_once;

// The name that the tool gives itself has the number of its process: looked at and taken out.
static void name_take(char *body) {
  static const char start[] = ",\"name\":\"plantbus-configure[";
  char *at = strstr(body, start);
  assert_non_null(at);
  const char *end = strstr(at, "]\"");
  assert_non_null(end);
  memmove(at, end + 2, strlen(end + 2) + 1);
}

static void answer_change(const char *kind, const char *body, fake_answer *out) {
  if (strcmp(kind, "history") == 0) {
    out->result =
        "{\"revisions\":[{\"revision\":3,\"time\":0.5,\"epoch\":1,\"step\":5000,"
        "\"client_name\":\"someone\",\"comment\":\"first\",\"patch\":{\"name\":\"x\"},"
        "\"states\":4,\"output_jump\":0.5,\"energy_before\":1,\"energy_after\":2},"
        "{\"revision\":4,\"time\":1.5,\"epoch\":1,\"step\":15000,\"client_name\":\"tool\","
        "\"comment\":\"\",\"patch\":{},\"states\":4,\"output_jump\":0.25,\"energy_before\":3,"
        "\"energy_after\":3.5}]}";
    return;
  }
  snprintf(asked, sizeof asked, "%s", kind);
  snprintf(body_of, sizeof body_of, "%s", body);
  name_take(body_of);
  if (at_once) {
    out->result =
        "{\"revision\":4,\"states\":4,\"compile_seconds\":0.125,\"swapped\":true,"
        "\"output_jump\":0.75,\"worst_output\":\"Vs\",\"energy_before\":6,\"energy_after\":7}";
    return;
  }
  out->status = "accepted";
  out->result = "{\"revision\":4,\"states\":4,\"compile_seconds\":0.125}";
  out->event = "reconfigured";
  out->event_message = "revision 4 acts";
  out->event_step = 15000;
}

static void set_sends_a_patch_of_one_value(void **state) {
  (void)state;
  at_once = true;
  fake_daemon fake = fake_daemon_start(answer_change);
  tool_result r =
      fake_daemon_run(&fake, "plantbus-configure",
                      "set /components/mass/mass 7.5 --at-step 900 --comment 'more mass'");
  if (r.code) fail_msg("%s", r.err);
  assert_string_equal(asked, "configure");
  assert_string_equal(body_of,
                      "{\"patch\":{\"components\":{\"mass\":{\"mass\":7.5}}},\"at_step\":900,"
                      "\"comment\":\"more mass\"}");
  tool_says(r.out, "revision         4\n");
  tool_says(r.out, "compiled in      0.125 s\n");
  tool_says(r.out, "output jump      0.75 (Vs)\n");
  tool_says(r.out, "energy after     7 J\n");
  tool_free(&r);
  fake_daemon_end(&fake);
}

static void a_change_that_comes_later_is_waited_for(void **state) {
  (void)state;
  at_once = false;
  fake_daemon fake = fake_daemon_start(answer_change);
  tool_result r = fake_daemon_run(&fake, "plantbus-configure", "revert 2 --json");
  if (r.code) fail_msg("%s", r.err);
  assert_string_equal(asked, "revert");
  assert_string_equal(body_of, "{\"revision\":2}");
  cJSON *json = cJSON_Parse(r.out);
  assert_string_equal(tool_member(json, "message")->valuestring, "revision 4 acts");
  assert_true(tool_member(json, "step")->valuedouble == 15000.0);
  assert_true(tool_member(json, "output_jump")->valuedouble == 0.25);
  assert_true(tool_member(json, "energy_after")->valuedouble == 3.5);
  assert_true(tool_member(json, "compile_seconds")->valuedouble == 0.125);
  cJSON_Delete(json);
  tool_free(&r);
  fake_daemon_end(&fake);
}

static void answer_failing(const char *kind, const char *body, fake_answer *out) {
  (void)body;
  if (strcmp(kind, "revert") == 0) {
    out->status = "refused";
    out->pointer = "/revision";
    out->message = "there is no revision 9";
    return;
  }
  out->status = "accepted";
  out->event = "configure_failed";
  out->event_message = "the stiffness is not positive";
}

static void refusals_and_failures_end_with_1(void **state) {
  (void)state;
  fake_daemon fake = fake_daemon_start(answer_failing);
  tool_result r = fake_daemon_run(&fake, "plantbus-configure", "set /name other");
  assert_int_equal(r.code, 1);
  tool_says(r.err, "configure_failed: the stiffness is not positive");
  tool_free(&r);
  r = fake_daemon_run(&fake, "plantbus-configure", "revert 9");
  assert_int_equal(r.code, 1);
  tool_says(r.err, "/revision: revert refused: there is no revision 9");
  tool_free(&r);
  fake_daemon_end(&fake);
}

static void history_is_a_table(void **state) {
  (void)state;
  fake_daemon fake = fake_daemon_start(answer_change);
  tool_result r = fake_daemon_run(&fake, "plantbus-configure", "history");
  if (r.code) fail_msg("%s", r.err);
  tool_says(r.out, "energy before [J]");
  tool_says(r.out, "someone");
  tool_says(r.out, "{\"name\":\"x\"}");
  tool_free(&r);
  r = fake_daemon_run(&fake, "plantbus-configure", "history --json");
  cJSON *json = cJSON_Parse(r.out);
  assert_int_equal(cJSON_GetArraySize(json), 2);
  cJSON_Delete(json);
  tool_free(&r);
  fake_daemon_end(&fake);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(get_prints_the_plant_file_or_a_part),
      cmocka_unit_test(a_dry_run_checks_and_sends_nothing),
      cmocka_unit_test(a_wrong_command_line_is_refused),
      cmocka_unit_test(set_sends_a_patch_of_one_value),
      cmocka_unit_test(a_change_that_comes_later_is_waited_for),
      cmocka_unit_test(refusals_and_failures_end_with_1),
      cmocka_unit_test(history_is_a_table),
  };
  return cmocka_run_group_tests(tests, daemon_begin, daemon_finish);
}
