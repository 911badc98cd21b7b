// The reduction against dense Craig–Bampton, and what it refuses.
#include "support/check.h"
#include "truss.h"

static const double two_pi = 6.283185307179586476925286766559;

// Largest difference of two elements, each entry against √(X_ii X_jj). Modes have no sign of their
// own, and none at all where frequencies are equal: M_bp is compared by M_bp M_bpᵀ.
static double compare_boundary(size_t b, size_t size, const double *x, const double *y) {
  double worst = 0;
  for (size_t j = 0; j < b; j++)
    for (size_t i = 0; i < b; i++)
      worst = fmax(worst, fabs(x[i + j * size] - y[i + j * size]) /
                              sqrt(y[i + i * size] * y[j + j * size]));
  return worst;
}

static double compare_drive(size_t b, size_t size, const double *x, const double *y) {
  double worst = 0;
  for (size_t j = 0; j < b; j++) {
    for (size_t i = 0; i < b; i++) {
      double sx = 0, sy = 0;
      for (size_t p = b; p < size; p++) {
        sx += x[i + p * size] * x[j + p * size];
        sy += y[i + p * size] * y[j + p * size];
      }
      worst = fmax(worst, fabs(sx - sy) / sqrt(y[i + i * size] * y[j + j * size]));
    }
  }
  return worst;
}

static void check_against_dense(const pb_fem *fem, size_t p, const char *name) {
  pb_reduce_options options = {.modes = p};
  pb_reduction *r = NULL;
  REQUIRE(pb_reduce(fem, &options, true, &r, &err));
  double *k, *m, *omega2;
  assert_int_equal(dense_reduce(fem, p, &k, &m, &omega2), 0);
  size_t b = 6 * fem->frames, size = b + p;
  assert_int_equal(r->size, size);
  double frequency = 0, shape = 0;
  for (size_t i = 0; i < p; i++)
    frequency = fmax(frequency, fabs(r->k[(b + i) * (size + 1)] / omega2[i] - 1));
  for (size_t j = b; j < size; j++)
    for (size_t i = 0; i < size; i++) {
      ASSERT_NEAR(r->m[i + j * size] - r->m[j + i * size], 0, 0);
      if (i >= b) ASSERT_NEAR(r->m[i + j * size], i == j, 0);
      if (i != j) ASSERT_NEAR(r->k[i + j * size], 0, 0);
    }
  // The shapes really give these matrices.
  size_t n = fem->k.n;
  double *ks = malloc(n * size * sizeof *ks);
  assert_non_null(ks);
  pb_sparse_multiply(&fem->k, size, r->shape, ks);
  for (size_t j = 0; j < size; j++)
    for (size_t i = 0; i < size; i++) {
      double sum = 0;
      for (size_t row = 0; row < n; row++) sum += r->shape[row + i * n] * ks[row + j * n];
      shape = fmax(shape, fabs(sum - r->k[i + j * size]) /
                              sqrt(r->k[i * (size + 1)] * r->k[j * (size + 1)]));
    }
  double stiffness = compare_boundary(b, size, r->k, k), mass = compare_boundary(b, size, r->m, m);
  double drive = compare_drive(b, size, r->m, m);
  print_message("%s: K %.1e  M %.1e  M_bp %.1e  ω² %.1e  shapes %.1e  rigid %.1e\n", name,
                stiffness, mass, drive, frequency, shape, r->rigid_residual);
  assert_true(stiffness < 1e-9 && mass < 1e-9 && drive < 1e-9 && frequency < 1e-9 && shape < 1e-9);
  assert_true(r->rigid_residual < 1e-12);
  ASSERT_RELATIVE(r->mass, r->full_mass, 1e-10);
  free(ks);
  free(k);
  free(m);
  free(omega2);
  pb_reduction_free(r);
}

static void test_averaged(void **state) {
  (void)state;
  for (int scalar = 0; scalar < 2; scalar++) {
    pb_fem fem;
    assert_int_equal(truss_build(70, 0.4, scalar, 7, &fem), 0);
    assert_int_equal(truss_frame(&fem, "left", PB_TIE_AVERAGED, 0, 0, 0.2), 0);
    assert_int_equal(truss_frame(&fem, "middle", PB_TIE_AVERAGED, 0, 0.4, 0.6), 0);
    assert_int_equal(truss_frame(&fem, "right", PB_TIE_AVERAGED, 0, 0.8, 1), 0);
    check_against_dense(&fem, 12, scalar ? "averaged, scalar mass" : "averaged");
    pb_fem_clear(&fem);
  }
}

static void test_rigid(void **state) {
  (void)state;
  pb_fem fem;
  assert_int_equal(truss_build(70, 0.4, false, 3, &fem), 0);
  assert_int_equal(truss_frame(&fem, "left", PB_TIE_RIGID, 0, 0, 0.15), 0);
  assert_int_equal(truss_frame(&fem, "right", PB_TIE_RIGID, 0, 0.85, 1), 0);
  check_against_dense(&fem, 12, "rigid");
  pb_fem_clear(&fem);
}

static void test_mixed(void **state) {
  (void)state;
  pb_fem fem;
  assert_int_equal(truss_build(70, 0.4, true, 5, &fem), 0);
  assert_int_equal(truss_frame(&fem, "left", PB_TIE_AVERAGED, 0, 0, 0.2), 0);
  assert_int_equal(truss_frame(&fem, "right", PB_TIE_RIGID, 0, 0.85, 1), 0);
  assert_int_equal(truss_frame(&fem, "front", PB_TIE_AVERAGED, 1, 0, 0.1), 0);  // shares with both
  check_against_dense(&fem, 12, "mixed");
  pb_fem_clear(&fem);
}

static void test_no_modes(void **state) {
  (void)state;
  pb_fem fem;
  assert_int_equal(truss_build(40, 0.5, true, 5, &fem), 0);
  assert_int_equal(truss_frame(&fem, "left", PB_TIE_AVERAGED, 0, 0, 0.4), 0);
  assert_int_equal(truss_frame(&fem, "right", PB_TIE_AVERAGED, 0, 0.6, 1), 0);
  check_against_dense(&fem, 0, "static");
  pb_fem_clear(&fem);
}

// Every mode there is: the element is then the full model in other coordinates.
static void test_all_modes(void **state) {
  (void)state;
  pb_fem fem;
  double *omega2;
  size_t count;
  assert_int_equal(truss_build(25, 0.6, false, 11, &fem), 0);
  assert_int_equal(truss_frame(&fem, "left", PB_TIE_AVERAGED, 0, 0, 0.5), 0);
  assert_int_equal(truss_frame(&fem, "right", PB_TIE_AVERAGED, 0, 0.5, 1), 0);
  assert_int_equal(dense_fixed(&fem, &omega2, &count), 0);
  check_against_dense(&fem, count, "all modes");
  pb_reduce_options options = {.modes = count, .check_points = 3};
  pb_reduction *r = NULL;
  REQUIRE(pb_reduce(&fem, &options, false, &r, &err));
  for (size_t i = 0; i < r->checks; i++) {
    print_message("check at %.4g Hz: %.1e\n", r->check[i].hz, r->check[i].error);
    assert_true(r->check[i].error < 1e-8);
  }
  pb_reduction_free(r);
  options.modes = count + 1;
  pb_error err = {0};
  assert_int_equal(pb_reduce(&fem, &options, false, &r, &err), PB_ERR_ARGUMENT);
  assert_null(r);
  assert_non_null(strstr(err.message, "modes"));
  free(omega2);
  pb_fem_clear(&fem);
}

// All modes up to a frequency, and no more; the check's counts are those of the dense model.
static void check_band(pb_fem *fem, const char *name) {
  double *omega2;
  size_t count, expected = 0;
  assert_int_equal(dense_fixed(fem, &omega2, &count), 0);
  double limit = sqrt(sqrt(omega2[17] * omega2[18])) / two_pi;
  if (omega2[18] / omega2[17] < 1.0001) limit = 1.001 * sqrt(omega2[18]) / two_pi;
  while (sqrt(omega2[expected]) < two_pi * limit) expected++;
  pb_reduce_options options = {.max_hz = limit, .check_points = 4, .check_to_hz = 1.3 * limit};
  pb_reduction *r = NULL;
  REQUIRE(pb_reduce(fem, &options, false, &r, &err));
  print_message("%s: %zu modes up to %.5g Hz, counted at %.5g Hz\n", name, r->modes, limit,
                r->proven_hz);
  assert_int_equal(r->modes, expected);
  assert_true(r->proven_hz > r->fixed_hz[r->modes - 1]);
  ASSERT_RELATIVE(r->fixed_hz[expected - 1], sqrt(omega2[expected - 1]) / two_pi, 1e-9);
  for (size_t i = 0; i < r->checks; i++) {
    size_t below = 0;
    while (below < count && sqrt(omega2[below]) < two_pi * r->check[i].hz) below++;
    assert_int_equal(r->check[i].fixed_below, below);
    assert_true(r->check[i].free_below >= below + 6);
  }
  pb_reduction_free(r);
  free(omega2);
}

static void test_band(void **state) {
  (void)state;
  static const pb_frame_tie ties[3][2] = {{PB_TIE_AVERAGED, PB_TIE_AVERAGED},
                                          {PB_TIE_RIGID, PB_TIE_AVERAGED},
                                          {PB_TIE_RIGID, PB_TIE_RIGID}};
  static const char *const name[3] = {"averaged", "mixed", "rigid"};
  for (size_t i = 0; i < 3; i++) {
    pb_fem fem;
    assert_int_equal(truss_build(60, 0.4, i != 1, 21, &fem), 0);
    assert_int_equal(truss_frame(&fem, "left", ties[i][0], 0, 0, 0.2), 0);
    assert_int_equal(truss_frame(&fem, "right", ties[i][1], 0, 0.8, 1), 0);
    check_band(&fem, name[i]);
    pb_fem_clear(&fem);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_averaged),  cmocka_unit_test(test_rigid),
      cmocka_unit_test(test_mixed),     cmocka_unit_test(test_no_modes),
      cmocka_unit_test(test_all_modes), cmocka_unit_test(test_band),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
