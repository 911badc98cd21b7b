// When a step may be taken: the barrier as a set, guards on the wall clock, leases in plant time.
#include <stdlib.h>
#include <string.h>

#include "engine_rig.h"

static const int64_t second = 1000000000;

static void a_step_waits_for_every_member(void **state) {
  (void)state;
  rig *r = rig_new();
  assert_false(rig_step(r, NULL));  // nobody drives
  rig_attach(r, 1, "a", 0);
  rig_attach(r, 2, "b", 1);
  assert_false(rig_step(r, NULL));
  rig_command(r, 1, 0, 1.0);
  rig_command(r, 1, 0, 1.0);  // twice from one is not once from two
  assert_false(rig_step(r, NULL));
  assert_true(pb_engine_waiting(&r->engine));
  rig_command(r, 2, 0, 2.0);
  assert_true(rig_step(r, NULL));
  assert_false(rig_step(r, NULL));
  assert_int_equal(r->engine.step, 1);
  free(r);
}

static void a_refused_command_does_not_open_the_barrier(void **state) {
  (void)state;
  rig *r = rig_new();
  rig_attach(r, 1, "a", 0);
  assert_int_equal(rig_command(r, 1, 1, 1.0), PB_VERDICT_STEP);
  assert_int_equal(rig_command(r, 1, 0, 1.0 / 0.0), PB_VERDICT_NON_FINITE);
  assert_false(rig_step(r, NULL));
  free(r);
}

static void a_late_member_is_evicted_by_name(void **state) {
  (void)state;
  rig *r = rig_new();
  rig_attach(r, 1, "a", 0);
  rig_attach(r, 2, "b", 1);
  rig_command(r, 1, 0, 1.0);
  assert_false(pb_engine_guard(&r->engine, second));
  assert_true(pb_engine_guard(&r->engine, second + 1));
  char text[320];
  assert_true(rig_event(r, PB_EVENT_EVICTED, text));
  assert_non_null(strstr(text, "'two'"));
  assert_non_null(strstr(text, "'b'"));
  assert_non_null(strstr(text, "late at step 0"));
  assert_null(pb_engine_find(&r->engine, 2));
  assert_non_null(pb_engine_find(&r->engine, 1));
  assert_true(rig_step(r, NULL));
  assert_int_equal(rig_command(r, 2, 1, 1.0), PB_VERDICT_SESSION);
  free(r);
}

// A member's time begins with the step it owes an answer to, or with its attaching.
static void guards_count_from_the_step_or_the_attaching(void **state) {
  (void)state;
  rig *r = rig_new();
  rig_attach(r, 1, "a", 0);
  r->now = 10 * second;
  rig_command(r, 1, 0, 1.0);
  assert_true(rig_step(r, NULL));  // now + 1 ms
  assert_false(pb_engine_guard(&r->engine, r->now + second));
  r->now += second / 2;
  rig_attach(r, 2, "b", 1);
  assert_true(pb_engine_guard(&r->engine, r->now + second / 2 + 1));
  assert_null(pb_engine_find(&r->engine, 1));
  assert_non_null(pb_engine_find(&r->engine, 2));
  free(r);
}

static void nobody_is_late_while_the_plant_is_paused(void **state) {
  (void)state;
  rig *r = rig_new();
  rig_attach(r, 1, "a", 0);
  pb_engine_drive(&r->engine, PB_DRIVE_PAUSED, 0);
  assert_false(pb_engine_guard(&r->engine, 100 * second));
  assert_false(rig_step(r, NULL));
  r->engine.budget = 2;
  rig_command(r, 1, 0, 1.0);
  assert_true(rig_step(r, NULL));
  assert_false(rig_step(r, NULL));  // a budget does not pass the barrier
  rig_command(r, 1, 1, 1.0);
  assert_true(rig_step(r, NULL));
  rig_command(r, 1, 2, 1.0);
  assert_false(rig_step(r, NULL));  // spent
  assert_true(rig_event(r, PB_EVENT_STEPPED, NULL));
  pb_engine_drive(&r->engine, PB_DRIVE_LOCKSTEP, 100 * second);
  assert_true(rig_step(r, NULL));
  free(r);
}

// Steps asked for after a long pause: the members have their whole guard to answer.
static void allowed_steps_wait_anew(void **state) {
  (void)state;
  rig *r = rig_new();
  rig_attach(r, 1, "a", 0);
  pb_engine_drive(&r->engine, PB_DRIVE_PAUSED, 0);
  pb_engine_allow(&r->engine, 1, 100 * second);
  assert_true(pb_engine_waiting(&r->engine));
  assert_false(pb_engine_guard(&r->engine, 101 * second));
  assert_true(pb_engine_guard(&r->engine, 101 * second + 1));
  free(r);
}

// What acted in real time is no answer to the sample that lockstep begins with.
static void lockstep_begins_with_an_answer_of_its_own(void **state) {
  (void)state;
  rig *r = rig_new();
  rig_attach(r, 1, "a", 0);
  pb_engine_drive(&r->engine, PB_DRIVE_REALTIME, 0);
  pb_engine_advance(&r->engine, 7, 0);
  assert_int_equal(rig_command(r, 1, 5, 1.0), PB_VERDICT_LATE);
  pb_engine_drive(&r->engine, PB_DRIVE_LOCKSTEP, 0);
  assert_false(rig_step(r, NULL));
  assert_int_equal(rig_command(r, 1, 7, 2.0), PB_VERDICT_ACCEPTED);
  double u[RIG_INPUTS];
  assert_true(rig_step(r, u));
  assert_true(u[0] == 2.0);
  free(r);
}

static void a_budget_steps_without_members(void **state) {
  (void)state;
  rig *r = rig_new();
  r->engine.budget = 3;
  int steps = 0;
  while (rig_step(r, NULL)) steps++;
  assert_int_equal(steps, 3);
  free(r);
}

static void a_lease_ends_in_plant_time(void **state) {
  (void)state;
  rig *r = rig_new();
  rig_attach(r, 1, "a", 0);
  pb_member *free_runner = rig_attach(r, 2, "b", 1);
  free_runner->barrier = false;
  free_runner->lease_steps = 10;
  double u[RIG_INPUTS] = {0.0};
  rig_command(r, 2, 0, 5.0);
  for (uint64_t k = 0; k < 10; k++) {
    assert_true(pb_engine_find(&r->engine, 2) != NULL);
    rig_command(r, 1, k, 0.0);
    assert_true(rig_step(r, u));
    assert_true(u[1] == 5.0);
  }
  assert_false(rig_event(r, PB_EVENT_LEASE_OVER, NULL));
  rig_command(r, 1, 10, 0.0);
  assert_true(rig_step(r, NULL));
  char text[320];
  assert_true(rig_event(r, PB_EVENT_LEASE_OVER, text));
  assert_non_null(strstr(text, "'two'"));
  rig_command(r, 1, 11, 0.0);
  assert_true(rig_step(r, u));
  assert_true(u[1] == 0.0);
  free(r);
}

static void decimation_asks_at_every_nth_step_only(void **state) {
  (void)state;
  rig *r = rig_new();
  r->engine.decimation = 4;
  rig_attach(r, 1, "a", 0)->lease_steps = 2;  // shorter than it can answer: no reason to go
  for (uint64_t k = 0; k < 12; k += 4) {
    assert_false(rig_step(r, NULL));
    assert_int_equal(rig_command(r, 1, k, (double)k), PB_VERDICT_ACCEPTED);
    double u[RIG_INPUTS];
    for (int i = 0; i < 4; i++) {
      assert_true(rig_step(r, u));
      assert_true(u[0] == (double)k);
    }
  }
  free(r);
}

static void the_oldest_events_give_way(void **state) {
  (void)state;
  rig *r = rig_new();
  for (int i = 0; i < PB_ENGINE_EVENTS + 10; i++)
    pb_engine_note(&r->engine, PB_EVENT_MODE, "%d", i);
  pb_event event;
  assert_true(pb_engine_event_take(&r->engine, &event));
  assert_int_equal(event.number, 10);
  assert_string_equal(event.message, "10");
  int rest = 0;
  while (pb_engine_event_take(&r->engine, &event)) rest++;
  assert_int_equal(rest, PB_ENGINE_EVENTS - 1);
  assert_string_equal(event.message, "137");
  free(r);
}

static void dropping_a_client_drops_all_its_sessions(void **state) {
  (void)state;
  rig *r = rig_new();
  rig_attach(r, 1, "a", 0);
  rig_attach(r, 2, "b", 1);
  memcpy(rig_attach(r, 3, "c", 2)->client, pb_engine_find(&r->engine, 1)->client, 16);
  const uint8_t one[16] = {1}, nobody[16] = {200};
  assert_false(pb_engine_drop_client(&r->engine, nobody, PB_EVENT_LOST, "left"));
  assert_true(pb_engine_drop_client(&r->engine, one, PB_EVENT_LOST, "left"));
  assert_int_equal(pb_engine_member_count(&r->engine), 1);
  assert_non_null(pb_engine_find(&r->engine, 2));
  free(r);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_step_waits_for_every_member),
      cmocka_unit_test(a_refused_command_does_not_open_the_barrier),
      cmocka_unit_test(a_late_member_is_evicted_by_name),
      cmocka_unit_test(guards_count_from_the_step_or_the_attaching),
      cmocka_unit_test(nobody_is_late_while_the_plant_is_paused),
      cmocka_unit_test(allowed_steps_wait_anew),
      cmocka_unit_test(lockstep_begins_with_an_answer_of_its_own),
      cmocka_unit_test(a_budget_steps_without_members),
      cmocka_unit_test(a_lease_ends_in_plant_time),
      cmocka_unit_test(decimation_asks_at_every_nth_step_only),
      cmocka_unit_test(the_oldest_events_give_way),
      cmocka_unit_test(dropping_a_client_drops_all_its_sessions),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
