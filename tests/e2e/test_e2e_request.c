// plantbus-request, and the session's way to tell "accepted" from "ok".
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

static void restart(void) {
  tool_result r = tool_run("plantbus-request", bench.domain, NULL, "reset");
  assert_int_equal(r.code, 0);
  tool_free(&r);
}

static void results_are_printed_as_json(void **state) {
  (void)state;
  restart();
  cJSON *json = tool_json("plantbus-request", bench.domain, NULL, "step '{\"n\": 7}'", 0);
  assert_true(tool_member(json, "step")->valuedouble == 7.0);
  cJSON_Delete(json);
  json = tool_json("plantbus-request", bench.domain, NULL, "ping", 0);
  assert_true(tool_member(json, "step")->valuedouble == 7.0);
  assert_string_equal(tool_member(json, "mode")->valuestring, "paused");
  cJSON_Delete(json);
}

static void a_refusal_names_place_and_reason(void **state) {
  (void)state;
  tool_result r = tool_run("plantbus-request", bench.domain, NULL, "step '{\"m\": 1}'");
  assert_int_equal(r.code, 1);
  assert_string_equal(r.out, "");
  tool_says(r.err, "/m: step refused: is not a key of this request");
  tool_free(&r);
  r = tool_run("plantbus-request", bench.domain, NULL, "step '{\"n\": '");
  assert_int_equal(r.code, 1);
  tool_says(r.err, "argument: line 1, column");
  tool_free(&r);
  r = tool_run("plantbus-request", bench.domain, NULL, "step [1]");
  assert_int_equal(r.code, 1);
  tool_says(r.err, "expected a JSON object");
  tool_free(&r);
  r = tool_run("plantbus-request", bench.domain, NULL, "");
  assert_int_equal(r.code, 2);
  tool_says(r.err, "KIND is missing");
  tool_free(&r);
}

// The daemon says "accepted" to so many steps; without --wait the tool does not wait for them.
static void wait_prints_the_ending_event(void **state) {
  (void)state;
  restart();
  tool_result r = tool_run("plantbus-request", bench.domain, NULL, "decimate '{\"n\": 1000}'");
  assert_int_equal(r.code, 0);
  tool_free(&r);
  r = tool_run("plantbus-request", bench.domain, NULL, "step '{\"n\": 100000}' --wait");
  assert_int_equal(r.code, 0);
  tool_says(r.out, "{\"event\":\"stepped\"");
  tool_says(r.out, "\"step\":100000,");
  tool_free(&r);
}

static void no_daemon_is_told(void **state) {
  (void)state;
  const uint32_t nobody = e2e_domain();
  tool_result r = tool_run("plantbus-request", nobody, NULL, "ping --timeout 0.3");
  assert_int_equal(r.code, 1);
  tool_says(r.err, "no daemon serves it");
  tool_free(&r);
}

// ---- what a real daemon says only at certain times ----------------------------------------------

static void answer_failing(const char *kind, const char *body, fake_answer *out) {
  (void)kind;
  (void)body;
  out->status = "accepted";
  out->event = "configure_failed";
  out->event_message = "the stiffness is not positive";
}

static void a_bad_ending_is_a_failure(void **state) {
  (void)state;
  fake_daemon fake = fake_daemon_start(answer_failing);
  tool_result r = fake_daemon_run(&fake, "plantbus-request", "configure {} --wait=5");
  assert_int_equal(r.code, 1);
  tool_says(r.out, "{}\n{\"event\":\"configure_failed\"");
  tool_says(r.err, "configure_failed: the stiffness is not positive");
  tool_free(&r);
  r = fake_daemon_run(&fake, "plantbus-request", "configure {}");
  assert_int_equal(r.code, 0);
  assert_string_equal(r.out, "{}\n");
  tool_free(&r);
  fake_daemon_end(&fake);
}

// Accepted, with an event of another kind: the wait ends by its time.
static void answer_never(const char *kind, const char *body, fake_answer *out) {
  (void)kind;
  (void)body;
  out->status = "accepted";
  out->event = "fault";
  out->event_message = "";
}

static void an_ending_that_never_comes_is_told(void **state) {
  (void)state;
  fake_daemon fake = fake_daemon_start(answer_never);
  tool_result r = fake_daemon_run(&fake, "plantbus-request", "step {} --wait=0.3");
  assert_int_equal(r.code, 1);
  tool_says(r.err, "no event 'stepped reset restored shutdown' came within 0.3 s");
  tool_free(&r);
  fake_daemon_end(&fake);
}

static void ask_tells_accepted_from_done(void **state) {
  (void)state;
  pb_session *session = e2e_open(&bench);
  pb_answer answer;
  pb_session_event event;
  pb_error err = {0};
  e2e_request(session, "reset", NULL);
  e2e_request(session, "decimate", "{\"n\":1000}");
  assert_int_equal(pb_session_ask(session, "step", "{\"n\":1}", 0.0, &answer, &err), PB_OK);
  assert_false(answer.accepted);
  pb_answer_clear(&answer);
  for (int i = 0; i < 2; i++) {  // the second must not take the first one's event for its own
    assert_int_equal(pb_session_ask(session, "step", "{\"n\":50000}", 0.0, &answer, &err), PB_OK);
    assert_true(answer.accepted);
    assert_int_equal(
        pb_session_wait_event(session, "stepped", answer.event, E2E_CAP, NULL, &event, &err),
        PB_OK);
    assert_string_equal(event.kind, "stepped");
    assert_int_equal(event.step, 1 + 50000 * (i + 1));
    assert_true(event.number >= answer.event);
    pb_answer_clear(&answer);
  }
  assert_int_equal(pb_session_wait_event(session, "stepp step", 0, 0.1, NULL, &event, &err),
                   PB_ERR_STATE);
  pb_session_close(session);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(results_are_printed_as_json),
      cmocka_unit_test(a_refusal_names_place_and_reason),
      cmocka_unit_test(wait_prints_the_ending_event),
      cmocka_unit_test(no_daemon_is_told),
      cmocka_unit_test(a_bad_ending_is_a_failure),
      cmocka_unit_test(an_ending_that_never_comes_is_told),
      cmocka_unit_test(ask_tells_accepted_from_done),
  };
  return cmocka_run_group_tests(tests, daemon_begin, daemon_finish);
}
