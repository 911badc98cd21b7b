// Channels: the sum, who acts, taking over, and what is left when nobody acts.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "engine_rig.h"

static void input(rig *r, double u[RIG_INPUTS]) {
  bool held;
  pb_engine_input(&r->engine, u, &held);
}

static void channels_add_up(void **state) {
  (void)state;
  rig *r = rig_new();
  rig_attach(r, 1, "a", 2);
  rig_attach(r, 2, "b", 2);
  double u[RIG_INPUTS];
  rig_command(r, 1, 0, 1.25);
  rig_command(r, 2, 0, -0.5);
  input(r, u);
  const double expected[RIG_INPUTS] = {0.0, 0.0, 0.75, 0.0};
  assert_memory_equal(u, expected, sizeof u);
  free(r);
}

// 0.1 + 0.2 + 0.3 depends on the order of the sum; the order of attaching must not matter.
static void the_sum_does_not_depend_on_the_order_of_attaching(void **state) {
  (void)state;
  const char *const name[] = {"c", "a", "b"};
  const double value[] = {0.3, 0.1, 0.2};
  const int order[][3] = {{0, 1, 2}, {1, 2, 0}, {2, 1, 0}, {0, 2, 1}};
  double first = 0.0;
  for (int o = 0; o < 4; o++) {
    rig *r = rig_new();
    for (int i = 0; i < 3; i++) {
      const int c = order[o][i];
      rig_attach(r, (uint64_t)c + 1, name[c], 0);
      rig_command(r, (uint64_t)c + 1, 0, value[c]);
    }
    double u[RIG_INPUTS];
    input(r, u);
    if (o == 0) first = u[0];
    assert_memory_equal(&u[0], &first, sizeof first);
    free(r);
  }
  assert_true(first == (0.1 + 0.2) + 0.3);
}

static void the_highest_priority_acts_from_its_first_command_on(void **state) {
  (void)state;
  rig *r = rig_new();
  double u[RIG_INPUTS];
  rig_attach(r, 1, "a", 0);
  rig_command(r, 1, 0, 1.0);
  assert_true(rig_step(r, NULL));
  pb_member *second = rig_attach(r, 2, "a", 0);
  second->priority = 5;
  rig_command(r, 1, 1, 1.5);
  input(r, u);
  assert_true(u[0] == 1.5);  // the newcomer has said nothing yet
  rig_event(r, PB_EVENT_TAKEOVER, NULL);
  rig_command(r, 2, 1, 9.0);
  input(r, u);
  assert_true(u[0] == 9.0);
  char text[320];
  assert_true(rig_event(r, PB_EVENT_TAKEOVER, text));
  assert_non_null(strstr(text, "'two'"));
  pb_engine_drop(&r->engine, second, PB_EVENT_LOST, "died");
  input(r, u);
  assert_true(u[0] == 1.5);  // the next takes over
  assert_true(rig_event(r, PB_EVENT_TAKEOVER, text));
  assert_non_null(strstr(text, "'one'"));
  free(r);
}

static void equal_priorities_first_come_first_served(void **state) {
  (void)state;
  rig *r = rig_new();
  double u[RIG_INPUTS];
  rig_attach(r, 1, "a", 0);
  rig_attach(r, 2, "a", 0);
  rig_command(r, 2, 0, 2.0);
  rig_command(r, 1, 0, 1.0);
  input(r, u);
  assert_true(u[0] == 1.0);
  free(r);
}

static double left_behind(pb_silence silence, double after[], size_t steps) {
  rig *r = rig_new();
  double u[RIG_INPUTS];
  rig_attach(r, 1, "keeper", 3);
  pb_member *member = rig_attach(r, 2, "a", 0);
  member->silence = silence;
  rig_command(r, 2, 0, 10.0);
  pb_engine_drop(&r->engine, member, PB_EVENT_LOST, "died");
  input(r, u);
  const double first = u[0];
  for (size_t i = 0; i < steps; i++) {
    rig_command(r, 1, i, 0.0);
    assert_true(rig_step(r, u));
    after[i] = u[0];
  }
  free(r);
  return first;
}

static void silence_is_held_dropped_or_ramped(void **state) {
  (void)state;
  double after[60];
  assert_true(left_behind(PB_SILENCE_HOLD, after, 60) == 10.0);
  assert_true(after[59] == 10.0);
  assert_true(left_behind(PB_SILENCE_ZERO, after, 60) == 0.0);
  assert_true(left_behind(PB_SILENCE_RAMP, after, 60) == 10.0);
  // 0.05 s at 1 kHz: 50 steps down in equal parts.
  for (int i = 1; i < 50; i++) assert_true(fabs(after[i - 1] - after[i] - 0.2) < 1e-12);
  assert_true(after[50] == 0.0 && after[59] == 0.0);
}

static void a_reset_forgets_what_was_left(void **state) {
  (void)state;
  rig *r = rig_new();
  double u[RIG_INPUTS];
  pb_member *member = rig_attach(r, 1, "a", 0);
  member->silence = PB_SILENCE_HOLD;
  rig_command(r, 1, 0, 10.0);
  pb_engine_drop(&r->engine, member, PB_EVENT_DETACHED, "has detached");
  rig_attach(r, 2, "b", 0);
  rig_command(r, 2, 0, 1.0);
  input(r, u);
  assert_true(u[0] == 11.0);
  pb_engine_restart(&r->engine, 0, 0);
  input(r, u);
  assert_true(u[0] == 0.0);
  assert_int_equal(r->engine.epoch, 2);
  assert_int_equal(rig_command(r, 2, 0, 1.0), PB_VERDICT_ACCEPTED);
  free(r);
}

static pb_status attach_status(rig *r, const char *channel, pb_error *err) {
  const uint32_t index = 0;
  const pb_attach attach = {.client_name = "x",
                            .channel = channel,
                            .input = &index,
                            .count = 1,
                            .lease = 1.0,
                            .guard = 1.0,
                            .id = 500};
  const pb_member *out;
  const pb_status status = pb_engine_attach(&r->engine, &attach, 0, &out, err);
  assert_true((out != NULL) == (status == PB_OK));
  return status;
}

// Each member can have a channel of its own, round after round under new names.
static void places_are_bounded_and_come_back(void **state) {
  (void)state;
  rig *r = rig_new();
  char name[8] = "c00";
  for (int round = 0; round < 3; round++) {
    for (int i = 0; i < PB_ENGINE_MEMBERS; i++) {
      name[1] = (char)('0' + round), name[2] = (char)('0' + i);
      rig_attach(r, (uint64_t)i + 1, name, 0);
    }
    assert_int_equal(attach_status(r, "full", NULL), PB_ERR_STATE);
    for (int i = 0; i < PB_ENGINE_MEMBERS; i++)
      pb_engine_drop(&r->engine, pb_engine_find(&r->engine, (uint64_t)i + 1), PB_EVENT_DETACHED,
                     "has detached");
    assert_int_equal(pb_engine_member_count(&r->engine), 0);
  }
  free(r);
}

// A channel that holds what a member left behind is in use; under its name it can be taken again.
static void channels_that_hold_are_in_use(void **state) {
  (void)state;
  rig *r = rig_new();
  char name[8] = "c0";
  for (int i = 0; i < PB_ENGINE_CHANNELS; i++) {
    name[1] = (char)('0' + i);
    pb_member *member = rig_attach(r, 1, name, 0);
    member->silence = PB_SILENCE_HOLD;
    assert_int_equal(rig_command(r, 1, 0, 1.0), PB_VERDICT_ACCEPTED);
    pb_engine_drop(&r->engine, member, PB_EVENT_DETACHED, "has detached");
  }
  pb_error err;
  assert_int_equal(attach_status(r, "full", &err), PB_ERR_STATE);
  assert_string_equal(err.where, "/channel");
  assert_int_equal(attach_status(r, name, &err), PB_OK);
  free(r);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(channels_add_up),
      cmocka_unit_test(the_sum_does_not_depend_on_the_order_of_attaching),
      cmocka_unit_test(the_highest_priority_acts_from_its_first_command_on),
      cmocka_unit_test(equal_priorities_first_come_first_served),
      cmocka_unit_test(silence_is_held_dropped_or_ramped),
      cmocka_unit_test(a_reset_forgets_what_was_left),
      cmocka_unit_test(places_are_bounded_and_come_back),
      cmocka_unit_test(channels_that_hold_are_in_use),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
