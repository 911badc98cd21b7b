// The engine on a plant whose inputs have changed: members and channels keep to what they meant.
#include <stdlib.h>
#include <string.h>

#include "engine_rig.h"

static void values_follow_their_inputs(void **state) {
  (void)state;
  rig *r = rig_new();
  rig_attach(r, 1, "a", 2);
  rig_attach(r, 2, "b", 0);
  rig_command(r, 1, 0, 5.0);
  rig_command(r, 2, 0, 7.0);
  const int from[] = {2, -1, 0};  // 2 comes first, a new one, then 0; 1 and 3 are gone
  pb_engine_relayout(&r->engine, 3, from);
  double u[RIG_INPUTS];
  bool held;
  pb_engine_input(&r->engine, u, &held);
  assert_true(u[0] == 5.0 && u[1] == 0.0 && u[2] == 7.0);
  assert_int_equal(r->engine.nu, 3);
  free(r);
}

static void what_a_channel_left_behind_follows_too(void **state) {
  (void)state;
  rig *r = rig_new();
  pb_member *m = rig_attach(r, 1, "a", 3);
  m->silence = PB_SILENCE_HOLD;
  rig_command(r, 1, 0, 4.0);
  pb_engine_drop(&r->engine, m, PB_EVENT_DETACHED, "has detached");
  const int from[] = {3, 2, 1, 0};
  pb_engine_relayout(&r->engine, 4, from);
  double u[RIG_INPUTS];
  bool held;
  pb_engine_input(&r->engine, u, &held);
  assert_true(u[0] == 4.0 && u[3] == 0.0);
  free(r);
}

static void who_misses_an_input_is_found_and_dropped(void **state) {
  (void)state;
  rig *r = rig_new();
  char text[320];
  uint32_t input;
  rig_attach(r, 1, "a", 0);
  rig_attach(r, 2, "b", 3);
  const int from[] = {0, 1};
  const pb_member *m = pb_engine_misses(&r->engine, 2, from, &input);
  assert_non_null(m);
  assert_int_equal(m->id, 2);
  assert_int_equal(input, 3);
  rig_event(r, PB_EVENT_ATTACHED, NULL);
  pb_engine_relayout(&r->engine, 2, from);
  assert_null(pb_engine_find(&r->engine, 2));
  assert_non_null(pb_engine_find(&r->engine, 1));
  assert_true(rig_event(r, PB_EVENT_LOST, text));
  assert_non_null(strstr(text, "an input that the changed plant lacks"));
  assert_null(pb_engine_misses(&r->engine, 2, from, &input));
  free(r);
}

static void the_age_of_commands_is_kept(void **state) {
  (void)state;
  rig *r = rig_new();
  pb_member *m = rig_attach(r, 1, "a", 0);
  m->barrier = false;
  r->engine.drive = PB_DRIVE_REALTIME;
  for (uint64_t k = 1; k <= 10; k++) pb_engine_advance(&r->engine, k, r->now);
  assert_int_equal(rig_command(r, 1, 10, 1.0), PB_VERDICT_ACCEPTED);
  assert_int_equal(m->age_max, 0);
  for (uint64_t k = 11; k <= 20; k++) pb_engine_advance(&r->engine, k, r->now);
  assert_int_equal(rig_command(r, 1, 13, 1.0), PB_VERDICT_LATE);
  assert_int_equal(m->age_max, 7);
  free(r);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(values_follow_their_inputs),
      cmocka_unit_test(what_a_channel_left_behind_follows_too),
      cmocka_unit_test(who_misses_an_input_is_found_and_dropped),
      cmocka_unit_test(the_age_of_commands_is_kept),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
