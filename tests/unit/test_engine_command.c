// Judging commands: each cause of refusal is counted under its name and never acts.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "engine_rig.h"

static double acting(rig *r) {
  double u[RIG_INPUTS];
  bool held;
  pb_engine_input(&r->engine, u, &held);
  return u[0];
}

static void refusals_are_counted_and_harmless(void **state) {
  (void)state;
  rig *r = rig_new();
  pb_member *member = rig_attach(r, 1, "a", 0);
  assert_int_equal(rig_command(r, 1, 0, 2.0), PB_VERDICT_ACCEPTED);
  const double good[2] = {7.0, 7.0}, bad[2] = {NAN, 0.0};
  const uint64_t writer = RIG_WRITER + 1;
  const struct {
    pb_command command;
    pb_verdict verdict;
  } list[] = {
      {{99, 0, 0, 1, good, writer}, PB_VERDICT_SESSION},
      {{0, 0, 0, 1, good, writer}, PB_VERDICT_SESSION},
      {{1, 0, 5, 1, good, writer}, PB_VERDICT_SESSION},
      {{1, 1, 0, 1, good, writer}, PB_VERDICT_STEP},
      {{1, 0, 0, 2, good, writer}, PB_VERDICT_SIZE},
      {{1, 0, 0, 0, good, writer}, PB_VERDICT_SIZE},
      {{1, 0, 0, UINT32_MAX, good, writer}, PB_VERDICT_SIZE},
      {{1, 0, 0, 1, bad, writer}, PB_VERDICT_NON_FINITE},
      {{1, 0, 0, 1, good, writer}, PB_VERDICT_DUPLICATE},
  };
  for (size_t i = 0; i < sizeof list / sizeof *list; i++) {
    const uint64_t before = r->engine.verdicts[list[i].verdict];
    assert_int_equal(pb_engine_command(&r->engine, &list[i].command), list[i].verdict);
    assert_int_equal(r->engine.verdicts[list[i].verdict], before + 1);
    assert_true(acting(r) == 2.0);
  }
  assert_int_equal(member->commands, 1);
  assert_true(rig_step(r, NULL));
  assert_int_equal(rig_command(r, 1, 0, 7.0), PB_VERDICT_DUPLICATE);  // another for the same step
  assert_int_equal(rig_command(r, 1, 0, 2.0), PB_VERDICT_REPEATED);   // the same once more
  assert_int_equal(rig_command(r, 1, 1, 2.0), PB_VERDICT_ACCEPTED);
  assert_true(rig_step(r, NULL));
  assert_int_equal(rig_command(r, 1, 0, 7.0), PB_VERDICT_STALE);
  assert_true(acting(r) == 2.0);
  free(r);
}

// Named with the client and the cause, at the 1st, 10th, 100th time: a flood is not passed on.
static void refusals_are_told_with_a_name(void **state) {
  (void)state;
  rig *r = rig_new();
  char text[320];
  rig_attach(r, 1, "a", 0);
  rig_event(r, PB_EVENT_ATTACHED, NULL);
  const uint64_t before = r->engine.events_made;
  for (int i = 0; i < 50; i++) assert_int_equal(rig_command(r, 1, 3, 1.0), PB_VERDICT_STEP);
  assert_int_equal(r->engine.events_made, before + 2);
  assert_true(rig_event(r, PB_EVENT_REFUSED, text));
  assert_non_null(strstr(text, "'one'"));
  assert_non_null(strstr(text, "refused: step (10 so far)"));
  const double value = 1.0;
  const pb_command stranger = {99, 0, 0, 1, &value, 5};
  assert_int_equal(pb_engine_command(&r->engine, &stranger), PB_VERDICT_SESSION);
  assert_true(rig_event(r, PB_EVENT_REFUSED, text));
  assert_non_null(strstr(text, "0000000000000063, which is not attached"));
  free(r);
}

static void a_writer_is_checked_before_it_is_believed(void **state) {
  (void)state;
  rig *r = rig_new();
  pb_member *member = rig_attach(r, 1, "a", 0);
  member->writer = 0;
  const double value = 3.0;
  const pb_command command = {1, 0, 0, 1, &value, 77};
  assert_int_equal(pb_engine_command(&r->engine, &command), PB_VERDICT_UNKNOWN_WRITER);
  assert_int_equal(member->commands, 0);
  pb_engine_refuse(&r->engine, &command, PB_VERDICT_FOREIGN);
  assert_int_equal(r->engine.verdicts[PB_VERDICT_FOREIGN], 1);
  member->writer = 77;
  assert_int_equal(pb_engine_command(&r->engine, &command), PB_VERDICT_ACCEPTED);
  assert_true(acting(r) == 3.0);
  free(r);
}

static void in_real_time_late_commands_act_and_are_counted(void **state) {
  (void)state;
  rig *r = rig_new();
  pb_engine_drive(&r->engine, PB_DRIVE_REALTIME, 0);
  pb_member *member = rig_attach(r, 1, "a", 0);
  pb_engine_advance(&r->engine, 10, 0);
  assert_int_equal(rig_command(r, 1, 10, 1.0), PB_VERDICT_ACCEPTED);
  pb_engine_advance(&r->engine, 12, 0);
  assert_int_equal(rig_command(r, 1, 11, 4.0), PB_VERDICT_LATE);
  assert_true(acting(r) == 4.0);
  assert_int_equal(member->late, 1);
  assert_int_equal(rig_command(r, 1, 9, 5.0), PB_VERDICT_STALE);  // back in time
  assert_int_equal(rig_command(r, 1, 13, 5.0), PB_VERDICT_STEP);
  assert_true(acting(r) == 4.0);
  assert_int_equal(rig_command(r, 1, 0, 6.0), PB_VERDICT_ACCEPTED);  // the next one
  assert_true(acting(r) == 6.0);
  free(r);
}

static void in_lockstep_a_free_runner_may_be_late(void **state) {
  (void)state;
  rig *r = rig_new();
  rig_attach(r, 1, "a", 0);
  rig_attach(r, 2, "b", 1)->barrier = false;
  for (uint64_t k = 0; k < 5; k++) {
    assert_int_equal(rig_command(r, 1, k, 0.0), PB_VERDICT_ACCEPTED);
    assert_true(rig_step(r, NULL));
  }
  assert_int_equal(rig_command(r, 2, 3, 1.0), PB_VERDICT_LATE);
  assert_int_equal(rig_command(r, 2, 3, 2.0), PB_VERDICT_DUPLICATE);
  double u[RIG_INPUTS];
  assert_int_equal(rig_command(r, 1, 5, 0.5), PB_VERDICT_ACCEPTED);
  assert_true(rig_step(r, u));
  assert_true(u[0] == 0.5 && u[1] == 1.0);
  free(r);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(refusals_are_counted_and_harmless),
      cmocka_unit_test(refusals_are_told_with_a_name),
      cmocka_unit_test(a_writer_is_checked_before_it_is_believed),
      cmocka_unit_test(in_real_time_late_commands_act_and_are_counted),
      cmocka_unit_test(in_lockstep_a_free_runner_may_be_late),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
