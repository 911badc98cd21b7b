// A change of a running plant whose transfer is spread over the steps before it: the state that one
// product gives, at the step that was asked for, whatever comes in between.
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <cmocka.h>

#include "fpenv.h"
#include "realtime.h"
#include "support/patched.h"

static const double u[2] = {3.0, -1.5};

typedef struct rig {
  pb_model *model[2];
  pb_motion_map *map[2];
  pb_transfer *transfer;
  pb_stepper stepper;
  pb_realtime *realtime;
  pb_change change;
  pb_carrier carrier;
} rig;

static void plant_make(const char *patch, pb_model **model, pb_motion_map **map) {
  char *text = patched_plant(PB_TEST_DATA "/bus-bench.json", patch);
  pb_error err = {PB_OK, "", ""};
  if (pb_model_parse(text, strlen(text), NULL, NULL, model, map, NULL, &err))
    fail_msg("%s: %s", err.where, err.message);
  free(text);
}

static int rig_open(void **state) {
  rig *r = calloc(1, sizeof *r);
  assert_non_null(r);
  r->realtime = calloc(1, sizeof *r->realtime);
  assert_non_null(r->realtime);
  plant_make("{}", &r->model[0], &r->map[0]);
  plant_make("{\"models\":{\"apa300ml\":{\"k_1\":1e6}}}", &r->model[1], &r->map[1]);
  assert_int_equal(
      pb_transfer_new(r->model[0], r->map[0], r->model[1], r->map[1], NULL, &r->transfer, NULL),
      PB_OK);
  assert_non_null(r->transfer->x);
  assert_int_equal(pb_stepper_init(&r->stepper, r->model[0], NULL), PB_OK);
  assert_int_equal(pb_realtime_init(r->realtime, &r->stepper, NULL), PB_OK);
  r->change = (pb_change){.model = r->model[1],
                          .state = pb_state_new(r->model[1]),
                          .transfer = r->transfer,
                          .revision = 2,
                          .input_from = {0, 1},
                          .carrier = &r->carrier};
  *state = r;
  return 0;
}

static int rig_close(void **state) {
  rig *r = *state;
  pb_realtime_free(r->realtime);
  pb_carrier_end(&r->carrier);
  free(r->change.state);
  pb_stepper_free(&r->stepper);
  pb_transfer_free(r->transfer);
  for (int i = 0; i < 2; i++) {
    pb_model_free(r->model[i]);
    pb_motion_map_free(r->map[i]);
  }
  free(r->realtime);
  free(r);
  return 0;
}

static pb_handover *handover_of(rig *r, size_t steps) {
  pb_handover *h = NULL;
  assert_int_equal(pb_handover_new(r->transfer, steps, NULL, &h, NULL), PB_OK);
  return h;
}

static void assert_near(const double *a, const double *b, size_t count, double tolerance) {
  double size = 0.0, difference = 0.0;
  for (size_t i = 0; i < count; i++) {
    size = fmax(size, fabs(a[i]));
    difference = fmax(difference, fabs(a[i] - b[i]));
  }
  assert_true(size > 0.0);
  if (!(difference <= tolerance * size)) fail_msg("off by %g of %g", difference, size);
}

// Any inputs, and a second time from another state.
static void spread_equals_whole(void **state) {
  rig *r = *state;
  pb_state *old = pb_state_new(r->model[0]), *whole = pb_state_new(r->model[1]);
  pb_state *spread = pb_state_new(r->model[1]);
  assert_true(old && whole && spread);
  pb_handover *h = handover_of(r, 17);
  for (int turn = 0; turn < 2; turn++) {
    for (int k = 0; k < 300; k++) pb_step_advance(r->model[0], old, u);
    pb_handover_begin(h, old);
    for (int k = 0; k < 17; k++) {
      const double varying[2] = {sin(0.3 * k + turn), cos(0.7 * k) - 2.0};
      pb_step_advance(r->model[0], old, varying);
      pb_handover_follow(h, old);
      if (k == 8) pb_handover_carry(h);
    }
    pb_handover_apply(h, old, spread);
    pb_transfer_apply(r->transfer, old, whole);
    assert_near(whole->data, spread->data, r->model[1]->nx, 1e-13);
    assert_memory_equal(whole->data + r->model[1]->nx, spread->data + r->model[1]->nx, sizeof u);
    assert_int_equal(spread->step, old->step);
  }
  pb_handover_free(h);
  free(old);
  free(whole);
  free(spread);
}

// Runs until the change is made and a little longer, and compares with steps taken by hand and one
// product at the same step.
static void run(rig *r, uint64_t at_step, uint64_t expected) {
  enum { MORE = 20 };
  const pb_realtime_options options = {.speed = 0.05, .cpu = -1};
  pb_error err;
  r->change.at_step = at_step;
  r->change.ahead = r->change.carrier->handover->steps;
  pb_realtime_change(r->realtime, &r->change);
  assert_int_equal(pb_realtime_start(r->realtime, &options, u, &err), PB_OK);
  pb_record record = {0};
  struct timespec until;
  clock_gettime(CLOCK_REALTIME, &until);
  until.tv_sec += 20;
  pb_state *old = pb_state_new(r->model[0]), *now = pb_state_new(r->model[1]);
  assert_true(old && now);
  const uint64_t saved = pb_flush_denormals();
  for (uint64_t k = 0; k < expected; k++) pb_step_advance(r->model[0], old, u);
  pb_transfer_apply(r->transfer, old, now);
  double y[2];
  while (record.step < expected + MORE) {
    while (!pb_ring_take(&r->realtime->records, &record))
      while (sem_timedwait(&r->realtime->published, &until) != 0) assert_int_equal(errno, EINTR);
    assert_int_equal(record.revision, record.step <= expected ? 1 : 2);
    if (record.step <= expected) continue;
    pb_step_advance(r->model[1], now, u);
    pb_step_output(r->model[1], now, y);
    assert_near(y, record.y, 2, 1e-9);
  }
  pb_restore_denormals(saved);
  pb_realtime_stop(r->realtime);
  assert_ptr_equal(pb_realtime_changed(r->realtime), &r->change);
  assert_int_equal(r->change.made_step, expected);
  free(old);
  free(now);
}

static void as_soon_as_possible_is_after_its_steps(void **state) {
  rig *r = *state;
  assert_true(pb_carrier_start(&r->carrier, handover_of(r, 100)));  // 0.2 s
  run(r, 0, 100);
  assert_non_null(r->change.handover);
}

static void a_step_that_is_asked_for_is_met(void **state) {
  rig *r = *state;
  assert_true(pb_carrier_start(&r->carrier, handover_of(r, 100)));
  run(r, 130, 130);
  assert_non_null(r->change.handover);
}

static void a_step_that_is_near_is_met_by_one_product(void **state) {
  rig *r = *state;
  assert_true(pb_carrier_start(&r->carrier, handover_of(r, 100)));
  run(r, 40, 40);
  assert_null(r->change.handover);
}

static void a_carrier_that_is_late_is_not_waited_for(void **state) {
  rig *r = *state;
  pb_carrier nobody = {.handover = handover_of(r, 10)};
  sem_init(&nobody.begun, 0, 0);
  r->change.carrier = &nobody;
  run(r, 0, 10);
  assert_null(r->change.handover);
  sem_destroy(&nobody.begun);
  pb_handover_free(nobody.handover);
}

// What has begun cannot be taken back, and is not lost with the step thread either.
static void a_stop_on_the_way_makes_the_change(void **state) {
  rig *r = *state;
  const pb_realtime_options options = {.speed = 0.01, .cpu = -1};
  pb_error err;
  assert_true(pb_carrier_start(&r->carrier, handover_of(r, 100000)));
  r->change.ahead = 100000;
  pb_realtime_change(r->realtime, &r->change);
  assert_int_equal(pb_realtime_start(r->realtime, &options, u, &err), PB_OK);
  const struct timespec pause = {0, 1000000};
  while (atomic_load(&r->realtime->change)) nanosleep(&pause, NULL);
  assert_false(pb_realtime_revoke(r->realtime));
  assert_null(pb_realtime_changed(r->realtime));
  pb_realtime_stop(r->realtime);
  assert_ptr_equal(pb_realtime_changed(r->realtime), &r->change);
  assert_null(r->change.handover);
  assert_int_equal(r->stepper.revision, 2);
  assert_int_equal(r->change.made_step, r->stepper.state->step);
}

static void one_that_waits_for_its_step_can_be_taken_back(void **state) {
  rig *r = *state;
  const pb_realtime_options options = {.speed = 0.05, .cpu = -1};
  pb_error err;
  assert_true(pb_carrier_start(&r->carrier, handover_of(r, 10)));
  r->change.ahead = 10;
  r->change.at_step = 1000000000;
  pb_realtime_change(r->realtime, &r->change);
  assert_int_equal(pb_realtime_start(r->realtime, &options, u, &err), PB_OK);
  assert_true(pb_realtime_revoke(r->realtime));
  pb_realtime_stop(r->realtime);
  assert_null(pb_realtime_changed(r->realtime));
  assert_int_equal(r->stepper.revision, 1);
}

static void what_fits_into_a_step_is_not_spread(void **state) {
  (void)state;
  double x;
  pb_model large = {.nx = 2100}, small = {.nx = 252};
  const pb_transfer big = {.from = &large, .to = &large, .x = &x};
  const pb_transfer little = {.from = &small, .to = &small, .x = &x};
  const pb_transfer copied = {.from = &large, .to = &large};
  assert_int_equal(pb_carrier_steps(&big, 0.0), 0);  // lockstep
  assert_int_equal(pb_carrier_steps(&big, 10.0), 0);
  assert_int_equal(pb_carrier_steps(&little, 1000.0), 0);
  assert_int_equal(pb_carrier_steps(&copied, 10000.0), 0);
  assert_in_range(pb_carrier_steps(&big, 1000.0), 3, 20);
  assert_in_range(pb_carrier_steps(&big, 10000.0), 30, 200);
  assert_int_equal(pb_carrier_steps(&big, 1e9), 256);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test_setup_teardown(spread_equals_whole, rig_open, rig_close),
      cmocka_unit_test_setup_teardown(as_soon_as_possible_is_after_its_steps, rig_open, rig_close),
      cmocka_unit_test_setup_teardown(a_step_that_is_asked_for_is_met, rig_open, rig_close),
      cmocka_unit_test_setup_teardown(a_step_that_is_near_is_met_by_one_product, rig_open,
                                      rig_close),
      cmocka_unit_test_setup_teardown(a_carrier_that_is_late_is_not_waited_for, rig_open,
                                      rig_close),
      cmocka_unit_test_setup_teardown(a_stop_on_the_way_makes_the_change, rig_open, rig_close),
      cmocka_unit_test_setup_teardown(one_that_waits_for_its_step_can_be_taken_back, rig_open,
                                      rig_close),
      cmocka_unit_test(what_fits_into_a_step_is_not_spread),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
