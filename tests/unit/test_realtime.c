// The ring between two threads, and the step thread: the same bits as steps taken by hand, no step
// before its deadline, late inputs counted.
#include <errno.h>
#include <sched.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <cmocka.h>

#include "fpenv.h"
#include "hash.h"
#include "realtime.h"

enum { RING_ITEMS = 50000, RING_CAPACITY = 64 };

typedef struct item {
  uint64_t number, check;
} item;

static void *ring_feed(void *context) {
  pb_ring *ring = context;
  for (uint64_t n = 0; n < RING_ITEMS;) {
    const item next = {n, ~n};
    if (pb_ring_put(ring, &next))
      n++;
    else
      sched_yield();
  }
  return NULL;
}

static void a_ring_loses_and_reorders_nothing(void **state) {
  (void)state;
  static item slots[RING_CAPACITY];
  pb_ring ring;
  pb_ring_init(&ring, slots, sizeof slots[0], RING_CAPACITY);
  pthread_t feeder;
  assert_int_equal(pthread_create(&feeder, NULL, ring_feed, &ring), 0);
  for (uint64_t n = 0; n < RING_ITEMS;) {
    item got;
    if (!pb_ring_take(&ring, &got)) {
      sched_yield();
      continue;
    }
    assert_int_equal(got.number, n);
    assert_int_equal(got.check, ~n);
    n++;
  }
  pthread_join(feeder, NULL);
  item rest;
  assert_false(pb_ring_take(&ring, &rest));
}

static void a_full_ring_refuses(void **state) {
  (void)state;
  static item slots[RING_CAPACITY];
  pb_ring ring;
  pb_ring_init(&ring, slots, sizeof slots[0], RING_CAPACITY);
  const item one = {1, 2};
  for (int i = 0; i < RING_CAPACITY; i++) assert_true(pb_ring_put(&ring, &one));
  assert_false(pb_ring_put(&ring, &one));
  item got;
  assert_true(pb_ring_take(&ring, &got));
  assert_true(pb_ring_put(&ring, &one));
}

typedef struct bench {
  pb_model *model;
  pb_stepper stepper;
  pb_realtime *realtime;
} bench;

static int bench_open(void **state) {
  bench *b = calloc(1, sizeof *b);
  pb_error err = {PB_OK, "", ""};
  assert_non_null(b);
  b->realtime = calloc(1, sizeof *b->realtime);
  assert_non_null(b->realtime);
  if (pb_model_load(PB_TEST_DATA "/bus-bench.json", NULL, &b->model, &err))
    fail_msg("%s", err.message);
  assert_int_equal(pb_stepper_init(&b->stepper, b->model, &err), PB_OK);
  assert_int_equal(pb_realtime_init(b->realtime, &b->stepper, &err), PB_OK);
  *state = b;
  return 0;
}

static int bench_close(void **state) {
  bench *b = *state;
  pb_realtime_free(b->realtime);
  pb_stepper_free(&b->stepper);
  pb_model_free(b->model);
  free(b->realtime);
  free(b);
  return 0;
}

static pb_record record_next(bench *b) {
  struct timespec until;
  clock_gettime(CLOCK_REALTIME, &until);
  until.tv_sec += 5;
  pb_record record;
  while (!pb_ring_take(&b->realtime->records, &record))  // also raised for a change
    while (sem_timedwait(&b->realtime->published, &until) != 0) assert_int_equal(errno, EINTR);
  return record;
}

static void records_equal_steps_by_hand(void **state) {
  enum { STEPS = 400 };
  bench *b = *state;
  pb_error err;
  const pb_realtime_options options = {.speed = 0.5, .cpu = -1};
  const double u[2] = {3.0, -1.5};
  double y[2];
  pb_state *by_hand = pb_state_new(b->model);
  assert_non_null(by_hand);
  struct timespec begin, end;
  clock_gettime(CLOCK_MONOTONIC, &begin);
  assert_int_equal(pb_realtime_start(b->realtime, &options, u, &err), PB_OK);
  const uint64_t saved = pb_flush_denormals();
  for (uint64_t k = 1; k <= STEPS; k++) {
    const pb_record record = record_next(b);
    assert_int_equal(record.step, k);
    assert_memory_equal(record.u, u, sizeof u);
    pb_step_advance(b->model, by_hand, u);
    pb_step_output(b->model, by_hand, y);
    assert_memory_equal(record.y, y, sizeof y);
  }
  pb_restore_denormals(saved);
  clock_gettime(CLOCK_MONOTONIC, &end);
  pb_realtime_stop(b->realtime);
  const double seconds =
      (double)(end.tv_sec - begin.tv_sec) + 1e-9 * (double)(end.tv_nsec - begin.tv_nsec);
  assert_true(seconds >= STEPS / (10000.0 * 0.5));  // no step is early
  free(by_hand);
}

static void late_inputs_act_and_are_counted(void **state) {
  bench *b = *state;
  pb_error err;
  const pb_realtime_options options = {.speed = 0.1, .cpu = -1};
  const double u[2] = {0.0, 0.0};
  assert_int_equal(pb_realtime_start(b->realtime, &options, u, &err), PB_OK);
  while (record_next(b).step < 5) {
  }
  const pb_held_input input = {.for_step = 2, .revision = 1, .u = {7.0, 0.0}};
  assert_true(pb_realtime_input(b->realtime, &input));
  pb_record record;
  do record = record_next(b);
  while (record.u[0] == 0.0 && record.step < 500);
  pb_realtime_stop(b->realtime);
  assert_true(record.u[0] == 7.0);
  assert_true(record.flags & PB_FLAG_LATE);
  assert_int_equal(atomic_load(&b->realtime->late), 1);
}

static void a_slow_plant_stops_at_once(void **state) {
  bench *b = *state;
  pb_error err;
  const pb_realtime_options options = {.speed = 1e-5, .cpu = -1};  // a step each 10 s
  const double u[2] = {0.0, 0.0};
  struct timespec begin, end;
  assert_int_equal(pb_realtime_start(b->realtime, &options, u, &err), PB_OK);
  clock_gettime(CLOCK_MONOTONIC, &begin);
  pb_realtime_stop(b->realtime);
  clock_gettime(CLOCK_MONOTONIC, &end);
  assert_true(end.tv_sec - begin.tv_sec < 3);
  assert_int_equal(b->stepper.now.step, 0);
}

// What the electronics cut is flagged; the record carries the input as it acts, and the outputs as
// measured.
static void a_saturated_step_is_flagged(void **state) {
  (void)state;
  pb_model *model = NULL;
  pb_stepper stepper;
  pb_error err = {PB_OK, "", ""};
  const double calm[2] = {0.25, 0.0}, wild[2] = {100.0, 0.0};
  double y[2];
  if (pb_model_load(PB_CONFIG "/plants/apa300ml-bench-electronics.json", NULL, &model, &err))
    fail_msg("%s", err.message);
  assert_int_equal(pb_stepper_init(&stepper, model, &err), PB_OK);
  assert_int_equal(stepper.now.flags, 0);
  pb_stepper_step(&stepper, calm, PB_FLAG_HELD);
  assert_int_equal(stepper.now.flags, PB_FLAG_HELD);
  assert_true(stepper.now.u[0] > 4.99 && stepper.now.u[0] < 5.01);
  for (int k = 0; k < 10; k++) pb_stepper_step(&stepper, wild, 0);
  assert_int_equal(stepper.now.flags, PB_FLAG_SATURATED);
  assert_true(stepper.now.u[0] == 150.0);
  pb_step_output(model, stepper.state, y);
  assert_memory_equal(stepper.now.y, y, sizeof y);
  pb_stepper_restart(&stepper, NULL, PB_HASH_START, 2);
  assert_int_equal(stepper.now.flags, 0);
  pb_stepper_free(&stepper);
  pb_model_free(model);
}

// --- overruns: at a thousand times ten thousand steps a second every deadline is missed ---

static void hopeless(bench *b, pb_overrun policy) {
  pb_error err;
  const pb_realtime_options options = {.speed = 1000.0, .cpu = -1, .overrun = policy};
  const double u[2] = {1.0, 0.0};
  assert_int_equal(pb_realtime_start(b->realtime, &options, u, &err), PB_OK);
}

static void catching_up_takes_every_step(void **state) {
  bench *b = *state;
  hopeless(b, PB_OVERRUN_CATCH_UP);
  uint64_t flagged = 0;
  for (uint64_t k = 1; k <= 300; k++) {
    const pb_record record = record_next(b);
    assert_int_equal(record.step, k);
    flagged += (record.flags & PB_FLAG_OVERRUN) != 0;
  }
  pb_realtime_stop(b->realtime);
  assert_true(flagged > 0);
  assert_true(atomic_load(&b->realtime->overruns) >= flagged);
  assert_int_equal(atomic_load(&b->realtime->skipped), 0);
}

static void skipping_leaves_deadlines_out(void **state) {
  bench *b = *state;
  hopeless(b, PB_OVERRUN_SKIP);
  for (uint64_t k = 1; k <= 300; k++) assert_int_equal(record_next(b).step, k);
  pb_realtime_stop(b->realtime);
  assert_true(atomic_load(&b->realtime->skipped) > 0);
  assert_int_equal(atomic_load(&b->realtime->slips), 0);
}

static void stopping_ends_at_the_first_overrun(void **state) {
  bench *b = *state;
  hopeless(b, PB_OVERRUN_STOP);
  struct timespec until;
  clock_gettime(CLOCK_REALTIME, &until);
  until.tv_sec += 5;
  while (!atomic_load(&b->realtime->gave_up))
    assert_int_equal(sem_timedwait(&b->realtime->published, &until), 0);
  pb_realtime_stop(b->realtime);
  assert_int_equal(atomic_load(&b->realtime->overruns), 1);
  assert_true(b->stepper.now.flags & PB_FLAG_OVERRUN);
}

static void policies_have_names(void **state) {
  (void)state;
  assert_int_equal(pb_overrun_parse("catch-up"), PB_OVERRUN_CATCH_UP);
  assert_int_equal(pb_overrun_parse("skip"), PB_OVERRUN_SKIP);
  assert_int_equal(pb_overrun_parse("stop"), PB_OVERRUN_STOP);
  assert_int_equal(pb_overrun_parse("Stop"), -1);
}

// --- histograms ---

static void bins_are_half_octaves(void **state) {
  (void)state;
  assert_int_equal(pb_histogram_bin(-5), 0);
  assert_int_equal(pb_histogram_bin(16), 0);
  assert_int_equal(pb_histogram_bin(22), 0);
  assert_int_equal(pb_histogram_bin(23), 1);
  assert_int_equal(pb_histogram_bin(32), 2);
  assert_int_equal(pb_histogram_bin(1 << 20), 32);
  assert_int_equal(pb_histogram_bin(INT64_MAX), PB_HISTOGRAM_BINS - 1);
  for (int64_t ns = 17; ns < INT64_C(1) << 40; ns += ns / 3)
    assert_true(pb_histogram_bin(ns) >= pb_histogram_bin(ns - 1));
}

static uint64_t histogram_sum(const pb_histogram *h) {
  uint64_t sum = 0;
  for (int i = 0; i < PB_HISTOGRAM_BINS; i++) sum += atomic_load(&h->bin[i]);
  return sum;
}

static void every_step_is_in_the_histograms(void **state) {
  bench *b = *state;
  pb_error err;
  const pb_realtime_options options = {.speed = 1.0, .cpu = -1};
  const double u[2] = {1.0, 0.0};
  assert_int_equal(pb_realtime_start(b->realtime, &options, u, &err), PB_OK);
  while (record_next(b).step < 200) {
  }
  pb_realtime_stop(b->realtime);
  const uint64_t steps = b->stepper.now.step;
  assert_int_equal(histogram_sum(&b->realtime->step_time), steps);
  assert_int_equal(histogram_sum(&b->realtime->jitter), steps);
  assert_int_equal(atomic_load(&b->realtime->step_time.count), steps);
  assert_true(atomic_load(&b->realtime->step_time.largest_ns) > 0);
  assert_true(atomic_load(&b->realtime->flush));
}

// --- changes between two steps ---

// The model comes again with its inputs the other way round: what is held and what is still on its
// way goes to the inputs that it was meant for.
static void a_change_puts_inputs_where_they_belong(void **state) {
  bench *b = *state;
  pb_error err;
  const pb_realtime_options options = {.speed = 0.2, .cpu = -1};
  const double u[2] = {3.0, -1.5};
  pb_change change = {.at_step = 20,
                      .model = b->model,
                      .state = pb_state_new(b->model),
                      .revision = 2,
                      .input_from = {1, 0}};
  assert_non_null(change.state);
  change.state->step = change.at_step;
  assert_int_equal(pb_realtime_start(b->realtime, &options, u, &err), PB_OK);
  pb_realtime_change(b->realtime, &change);
  pb_record record;
  do {
    record = record_next(b);
    assert_int_equal(record.revision, record.step <= 20 ? 1 : 2);
    assert_true(record.u[0] == (record.step <= 20 ? 3.0 : -1.5));
  } while (record.step < 40 && record.revision == 1);
  assert_ptr_equal(pb_realtime_changed(b->realtime), &change);
  assert_null(pb_realtime_changed(b->realtime));
  const pb_held_input old = {.for_step = UINT64_MAX, .revision = 1, .u = {7.0, 8.0}};
  assert_true(pb_realtime_input(b->realtime, &old));
  do record = record_next(b);
  while (record.u[0] == -1.5 && record.step < 500);
  pb_realtime_stop(b->realtime);
  assert_true(record.u[0] == 8.0 && record.u[1] == 7.0);
  assert_int_equal(change.made_step, 20);
  free(change.state);
}

// --- the step thread allocates nothing and takes no lock ---

static bench *watched;
static atomic_int trespasses;

static void watch(void) {
  if (watched && watched->realtime->running &&
      pthread_equal(pthread_self(), watched->realtime->thread))
    atomic_fetch_add(&trespasses, 1);
}

void *__real_malloc(size_t size);
void *__real_calloc(size_t count, size_t size);
void *__real_realloc(void *p, size_t size);
void __real_free(void *p);
int __real_pthread_mutex_lock(pthread_mutex_t *mutex);
void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t count, size_t size);
void *__wrap_realloc(void *p, size_t size);
void __wrap_free(void *p);
int __wrap_pthread_mutex_lock(pthread_mutex_t *mutex);

void *__wrap_malloc(size_t size) {
  watch();
  return __real_malloc(size);
}
void *__wrap_calloc(size_t count, size_t size) {
  watch();
  return __real_calloc(count, size);
}
void *__wrap_realloc(void *p, size_t size) {
  watch();
  return __real_realloc(p, size);
}
void __wrap_free(void *p) {
  watch();
  __real_free(p);
}
int __wrap_pthread_mutex_lock(pthread_mutex_t *mutex) {
  watch();
  return __real_pthread_mutex_lock(mutex);
}

static pb_host *host_of(const char *text, const char *kind, const pb_host *before,
                        const pb_model *model) {
  cJSON *body = cJSON_Parse(text);
  pb_host *host = NULL;
  uint64_t period;
  pb_error err = {PB_OK, "", ""};
  if (pb_host_add(before, body, kind, model, "test", &host, &period, &err))
    fail_msg("%s: %s", err.where, err.message);
  cJSON_Delete(body);
  return host;
}

static void the_step_thread_neither_allocates_nor_locks(void **state) {
  bench *b = *state;
  pb_error err;
  pb_host *iff = host_of("{\"channel\":\"iff\",\"type\":\"iff\",\"inputs\":[\"Va\"],"
                         "\"outputs\":[\"Vs\"],\"gain\":100}",
                         "host_controller", NULL, b->model);
  pb_host *both = host_of("{\"channel\":\"w\",\"type\":\"white\",\"inputs\":[\"F\"],"
                          "\"rms\":1,\"seed\":1}",
                          "excite", iff, b->model);
  pb_host_free(iff);
  pb_change change = {.at_step = 50,
                      .model = b->model,
                      .state = pb_state_new(b->model),
                      .revision = 2,
                      .input_from = {0, 1},
                      .swaps_host = true,
                      .host = both};
  const pb_realtime_options options = {.speed = 1.0, .cpu = -1};
  const double u[2] = {3.0, -1.5};
  assert_non_null(change.state);
  change.state->step = change.at_step;
  watched = b;
  assert_int_equal(pb_realtime_start(b->realtime, &options, u, &err), PB_OK);
  pb_realtime_change(b->realtime, &change);
  pb_record record;
  do record = record_next(b);
  while (record.step < 300);
  assert_int_equal(record.revision, 2);
  assert_int_equal(atomic_load(&trespasses), 0);
  watched = NULL;
  pb_realtime_stop(b->realtime);
  free(change.state);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_ring_loses_and_reorders_nothing),
      cmocka_unit_test(a_full_ring_refuses),
      cmocka_unit_test(a_saturated_step_is_flagged),
      cmocka_unit_test_setup_teardown(records_equal_steps_by_hand, bench_open, bench_close),
      cmocka_unit_test_setup_teardown(late_inputs_act_and_are_counted, bench_open, bench_close),
      cmocka_unit_test_setup_teardown(a_slow_plant_stops_at_once, bench_open, bench_close),
      cmocka_unit_test_setup_teardown(catching_up_takes_every_step, bench_open, bench_close),
      cmocka_unit_test_setup_teardown(skipping_leaves_deadlines_out, bench_open, bench_close),
      cmocka_unit_test_setup_teardown(stopping_ends_at_the_first_overrun, bench_open, bench_close),
      cmocka_unit_test(policies_have_names),
      cmocka_unit_test(bins_are_half_octaves),
      cmocka_unit_test_setup_teardown(every_step_is_in_the_histograms, bench_open, bench_close),
      cmocka_unit_test_setup_teardown(a_change_puts_inputs_where_they_belong, bench_open,
                                      bench_close),
      cmocka_unit_test_setup_teardown(the_step_thread_neither_allocates_nor_locks, bench_open,
                                      bench_close),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
