// Unit tests of control/assign.h, pole_track.h and rootlocus.h: assignments against all
// permutations, branches on coarse gains against the same on fine ones and against the eigenvalues.
#include "support/check.h"

#include "control/assign.h"
#include "control/iff.h"
#include "control/lti_ops.h"
#include "control/rootlocus.h"
#include "modal_model.h"

enum { RATE = 10000, LOOPS = 2, COARSE = 21, FINE = 8, MOST_MODES = 100 };

static uint64_t seed;

static double uniform(void) {
  seed = seed * 6364136223846793005u + 1442695040888963407u;
  return (double)(seed >> 11) * 0x1p-53;
}

// The least sum over all ways to give rows r.. a column that is not in `used`.
static double least_sum(const pb_assignment *a, size_t r, unsigned used) {
  double least = r == a->rows ? 0 : INFINITY;
  for (size_t c = 0; r < a->rows && c < a->columns; c++)
    if (!(used >> c & 1))
      least = fmin(least, a->cost[r * a->columns + c] + least_sum(a, r + 1, used | 1u << c));
  return least;
}

static void test_assignment(void **state) {
  (void)state;
  seed = 3;
  for (size_t trial = 0; trial < 300; trial++) {
    pb_assignment a;
    size_t columns = 1 + trial % 7, rows = columns - (trial / 7) % 2;
    REQUIRE(pb_assignment_new(rows, columns, &a, &err));
    // Few values, so that many costs are equal.
    for (size_t k = 0; k < rows * columns; k++) a.cost[k] = floor(uniform() * 6);
    pb_assignment_solve(&a);
    double sum = 0;
    unsigned used = 0;
    for (size_t r = 0; r < rows; r++) {
      assert_true(a.column[r] < columns && !(used >> a.column[r] & 1));
      used |= 1u << a.column[r];
      sum += a.cost[r * columns + a.column[r]];
    }
    ASSERT_NEAR(sum, least_sum(&a, 0, 0), 1e-12);
    pb_assignment_clear(&a);
  }
  pb_assignment none;
  pb_error err;
  assert_int_equal(pb_assignment_new(3, 2, &none, &err), PB_ERR_ARGUMENT);
}

// Collocated modes of random size, two of them at one frequency.
static pb_model *random_plant(size_t modes) {
  test_mode mode[MOST_MODES];
  static double shape[MOST_MODES][2 * LOOPS];
  for (size_t k = 0; k < modes; k++) {
    double hz = 20 * pow(800.0 / 20, (double)(k < 2 ? 0 : k) / (double)(modes < 20 ? modes : 75));
    for (size_t j = 0; j < LOOPS; j++) {
      shape[k][j] = (2 * uniform() - 1) * pow(hz / 20, 0.3);
      shape[k][LOOPS + j] = 2 * M_PI * hz * shape[k][j];
    }
    mode[k] = (test_mode){hz, 0.001 + 0.01 * uniform(), shape[k], shape[k] + LOOPS};
  }
  return test_model(mode, modes, LOOPS, LOOPS, RATE, NULL);
}

// Every pole at gain k is an eigenvalue, and of two branches not the same one.
static void check_eigenvalues(const pb_loop *loop, const pb_rootlocus *l, size_t k) {
  pb_lti closed;
  REQUIRE(pb_loop_closed(loop, l->gain[k], &closed, &err));
  double complex *z = malloc(closed.nx * sizeof *z);
  REQUIRE(pb_lti_poles(&closed, z, &err));
  for (size_t b = 0; b < l->branches; b++) {
    size_t nearest = 0;
    double complex at = l->pole[b * l->gains + k].z;
    for (size_t j = 1; j < closed.nx; j++)
      if (cabs(z[j] - at) < cabs(z[nearest] - at)) nearest = j;
    ASSERT_NEAR(cabs(z[nearest] - at), 0, 1e-7);
    if (cimag(at) != 0) z[nearest] = INFINITY;  // taken
  }
  free(z);
  pb_lti_free(&closed);
}

static void check_branches(size_t modes, unsigned delay, double f2) {
  pb_model *m = random_plant(modes);
  const pb_iff iff = pb_iff_default(1);
  const size_t channel[LOOPS] = {0, 1};
  pb_lti controller;
  pb_loop_solver *s;
  pb_rootlocus coarse, fine;
  double unit, gain[COARSE] = {0}, more[1 + (COARSE - 1) * FINE] = {0};
  size_t count = 1;
  REQUIRE(pb_iff_discrete(&iff, LOOPS, RATE, &controller, &err));
  const pb_loop loop = {m, &controller, channel, channel, 1, delay};
  REQUIRE(pb_loop_solver_new(&loop, &s, &err));
  REQUIRE(pb_loop_unit_gain(&loop, 15, f2, &unit, &err));
  for (size_t k = 1; k < COARSE; k++) {
    gain[k] = unit * pow(10, 4.0 * (double)(k - 1) / (COARSE - 2) - 2);
    double ratio = pow(10, 4.0 / (COARSE - 2));
    for (size_t i = 1; i <= FINE; i++)
      more[count++] = i == FINE ? gain[k] : gain[k] / pow(ratio, 1 - (double)i / FINE);
  }
  REQUIRE(pb_rootlocus_compute(s, gain, COARSE, 10, f2, &coarse, &err));
  REQUIRE(pb_rootlocus_compute(s, more, count, 10, f2, &fine, &err));
  assert_int_equal(coarse.branches, fine.branches);
  for (size_t b = 0; b < coarse.branches; b++)
    for (size_t k = 0; k < COARSE; k++) {
      pb_pole p = coarse.pole[b * COARSE + k], q = fine.pole[b * count + k * FINE];
      if (isnan(p.hz)) fail_msg("%zu modes, delay %u: branch %zu is lost", modes, delay, b);
      ASSERT_NEAR(cabs(p.z - q.z), 0, 1e-5 * cabs(q.z - 1));
    }
  for (size_t k = 5; k < COARSE; k += 5) check_eigenvalues(&loop, &coarse, k);
  pb_rootlocus_clear(&coarse);
  pb_rootlocus_clear(&fine);
  pb_loop_solver_free(s);
  pb_lti_free(&controller);
  pb_model_free(m);
}

static void test_branches_of_small_plants(void **state) {
  (void)state;
  seed = 5;
  for (size_t trial = 0; trial < 6; trial++) check_branches(4 + trial, trial % 3, 800);
}

// Also where the modes lie that are left out of the estimates.
static void test_branches_of_a_large_plant(void **state) {
  (void)state;
  seed = 7;
  check_branches(MOST_MODES, 0, 800);
  check_branches(MOST_MODES, 2, 800);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_assignment),
      cmocka_unit_test(test_branches_of_small_plants),
      cmocka_unit_test(test_branches_of_a_large_plant),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
