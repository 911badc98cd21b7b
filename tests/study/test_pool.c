// The worker pool: every point once, wherever it runs; failures, deaths and interrupts end the run.
#include <signal.h>

#include "pool.h"
#include "support/check.h"

enum { POINTS = 23 };

typedef struct record {
  unsigned seen[POINTS];
  double value[POINTS];
  size_t failing, dying;  // index of a point that fails, or kills its worker; POINTS: none
  bool stop;
} record;

static record *at_work;

// Sizes differ from point to point, and one is larger than a pipe.
static pb_status compute(void *context, size_t index, pb_study_point *out, pb_error *err) {
  const record *r = context;
  if (index == r->failing) return pb_fail(err, PB_ERR_NUMERIC, "somewhere", "point %zu", index);
  if (index == r->dying) raise(SIGKILL);
  *out = (pb_study_point){.size = {.gains = index == 3 ? 100000 : index, .modes = 2},
                          .states = 100 + index};
  pb_status status = pb_study_point_allocate(out, err);
  if (!status) {
    out->mode_hz[1] = sqrt((double)index);
    if (index > 0) out->gain[out->size.gains - 1] = 1.0 / (double)index;
  }
  return status;
}

static pb_status collect(void *context, study_message *m, pb_error *err) {
  record *r = context;
  if (m->status) {
    *err = m->err;
    return m->status;
  }
  r->seen[m->index]++;
  r->value[m->index] = m->point.mode_hz[1];
  assert_int_equal(m->point.states, 100 + m->index);
  if (m->index > 0) ASSERT_NEAR(m->point.gain[m->point.size.gains - 1], 1.0 / (double)m->index, 0);
  pb_study_point_clear(&m->point);
  return PB_OK;
}

static bool stopped(void) {
  return at_work->stop;
}

static pb_status run(record *r, size_t workers, pb_error *err) {
  size_t index[POINTS];
  at_work = r;
  for (size_t k = 0; k < POINTS; k++) index[k] = POINTS - 1 - k;
  const study_pool pool = {compute, collect, stopped, r};
  return study_pool_run(&pool, index, POINTS, workers, err);
}

static void every_point_is_computed_once(void **state) {
  (void)state;
  for (size_t workers = 1; workers <= 4; workers++) {
    record r = {.failing = POINTS, .dying = POINTS};
    REQUIRE(run(&r, workers, &err));
    for (size_t k = 0; k < POINTS; k++) {
      assert_int_equal(r.seen[k], 1);
      ASSERT_NEAR(r.value[k], sqrt((double)k), 0);
    }
  }
}

static void a_failure_is_told_as_it_was(void **state) {
  (void)state;
  for (size_t workers = 1; workers <= 3; workers += 2) {
    record r = {.failing = 7, .dying = POINTS};
    pb_error err = {0};
    assert_int_equal(run(&r, workers, &err), PB_ERR_NUMERIC);
    assert_string_equal(err.where, "somewhere");
    assert_string_equal(err.message, "point 7");
    assert_int_equal(r.seen[7], 0);
  }
}

static void dead_workers_end_the_run(void **state) {
  (void)state;
  record r = {.failing = POINTS, .dying = 5};
  pb_error err = {0};
  assert_int_equal(run(&r, 2, &err), PB_ERR_STATE);
  assert_string_equal(err.where, "worker");
  assert_int_equal(r.seen[5], 0);
}

static void an_interrupt_ends_the_run(void **state) {
  (void)state;
  for (size_t workers = 1; workers <= 2; workers++) {
    record r = {.failing = POINTS, .dying = POINTS, .stop = true};
    pb_error err = {0};
    assert_int_equal(run(&r, workers, &err), PB_ERR_STATE);
    assert_string_equal(err.message, "interrupted");
  }
}

static void cut_messages_are_refused(void **state) {
  (void)state;
  study_message m = {.index = 4}, back;
  record r = {.failing = POINTS, .dying = POINTS};
  void *bytes = NULL;
  size_t size = 0;
  pb_error refusal;
  REQUIRE(compute(&r, 4, &m.point, &err));
  REQUIRE(study_message_pack(&m, &bytes, &size, &err));
  REQUIRE(study_message_unpack(bytes, size, &back, &err));
  assert_int_equal(back.index, 4);
  ASSERT_NEAR(back.point.mode_hz[1], 2, 0);
  pb_study_point_clear(&back.point);
  assert_int_equal(study_message_unpack(bytes, size - 8, &back, &refusal), PB_ERR_SYNTAX);
  assert_int_equal(study_message_unpack(bytes, 12, &back, &refusal), PB_ERR_SYNTAX);
  free(bytes);
  pb_study_point_clear(&m.point);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(every_point_is_computed_once), cmocka_unit_test(a_failure_is_told_as_it_was),
      cmocka_unit_test(dead_workers_end_the_run),     cmocka_unit_test(an_interrupt_ends_the_run),
      cmocka_unit_test(cut_messages_are_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
