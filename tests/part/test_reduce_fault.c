// Every allocation of a reduction fails once, CHOLMOD's too: each time the call reports it, hands
// nothing out and leaks nothing (the sanitizers' build sees to the latter).
#include <SuiteSparse_config.h>

#include "support/check.h"
#include "support/faults.h"
#include "truss.h"

// CHOLMOD allocates through these pointers.
static void route_cholmod(void) {
  SuiteSparse_config.malloc_func = __wrap_malloc;
  SuiteSparse_config.calloc_func = __wrap_calloc;
  SuiteSparse_config.realloc_func = __wrap_realloc;
}

static void fail_each(const pb_fem *fem, const pb_reduce_options *options, const char *name) {
  long reached = 0;
  for (failing = 1;; failing++) {
    pb_reduction *r = NULL;
    pb_error err = {0};
    allocations = 0;
    pb_status st = pb_reduce(fem, options, true, &r, &err);
    reached = allocations;
    long failed = failing;
    if (!st && reached < failed) {
      pb_reduction_free(r);
      break;
    }
    failing = 0;
    if (st && r) fail_msg("%s: an element was handed out in spite of %s", name, err.message);
    // Giving memory back may fail without harm: then the result must be there.
    if (!st && !r) fail_msg("%s: allocation %ld failed: neither element nor error", name, failed);
    if (st && reached < failed) fail_msg("%s: failed by itself: %s", name, err.message);
    if (st && st != PB_ERR_MEMORY)
      fail_msg("%s: allocation %ld: %s: %s", name, failed, pb_status_name(st), err.message);
    pb_reduction_free(r);
    failing = failed;
  }
  failing = 0;
  print_message("%s: %ld allocations failed in turn\n", name, reached);
  assert_true(reached > 100);
}

static void test_averaged(void **state) {
  (void)state;
  pb_fem fem;
  assert_int_equal(truss_build(30, 0.6, true, 5, &fem), 0);
  assert_int_equal(truss_frame(&fem, "left", PB_TIE_AVERAGED, 0, 0, 0.4), 0);
  pb_reduce_options options = {.max_hz = 300, .modes = 4, .check_points = 1, .check_to_hz = 50};
  fail_each(&fem, &options, "averaged");
  pb_fem_clear(&fem);
}

static void test_mixed(void **state) {
  (void)state;
  pb_fem fem;
  assert_int_equal(truss_build(30, 0.6, false, 6, &fem), 0);
  assert_int_equal(truss_frame(&fem, "left", PB_TIE_RIGID, 0, 0, 0.3), 0);
  assert_int_equal(truss_frame(&fem, "right", PB_TIE_AVERAGED, 0, 0.6, 1), 0);
  pb_reduce_options options = {.modes = 4};
  fail_each(&fem, &options, "mixed");
  pb_fem_clear(&fem);
}

int main(void) {
  route_cholmod();
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_averaged), cmocka_unit_test(test_mixed)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
