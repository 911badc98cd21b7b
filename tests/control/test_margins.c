// Margins of loops whose margins are known on paper, loci and singular values of matrices built
// from them.
#include "support/check.h"

#include "control/margins.h"

enum { N = 4001 };
static double hz[N];

static int make_grid(void **state) {
  (void)state;
  for (int k = 0; k < N; k++) hz[k] = 1e-3 * pow(1e6, k / (double)(N - 1));
  return 0;
}

static double complex s_at(int k) {
  return CMPLX(0, 2 * M_PI * hz[k]);
}

// 4/(s + 1)³: phase −180° at ω = √3, where |L| = 1/2; |L| = 1 at ω² = 4^{2/3} − 1.
static void test_third_order(void **state) {
  (void)state;
  double complex l[N];
  double nearest = INFINITY;
  for (int k = 0; k < N; k++) {
    double complex s1 = 1 + s_at(k);
    l[k] = 4 / (s1 * s1 * s1);
  }
  for (double w = 0.5; w < 5; w += 1e-5)  // far finer than the grid
    nearest = fmin(nearest, cabs(1 + 4 / cpow(1 + I * w, 3)));
  pb_margins m = pb_margins_of(hz, N, l, 1);
  double crossover = sqrt(pow(4, 2.0 / 3) - 1);
  ASSERT_RELATIVE(m.gain_up, 2, 1e-4);
  ASSERT_RELATIVE(m.gain_up_hz, sqrt(3) / (2 * M_PI), 1e-4);
  ASSERT_RELATIVE(m.crossover_hz, crossover / (2 * M_PI), 1e-4);
  ASSERT_NEAR(m.phase_degree, 180 - 3 * atan(crossover) * 180 / M_PI, 1e-2);
  ASSERT_RELATIVE(m.modulus, nearest, 1e-7);
  ASSERT_RELATIVE(m.delay, (M_PI - 3 * atan(crossover)) / crossover, 1e-4);
  assert_true(m.gain_down == 0 && isnan(m.gain_down_hz));
}

// An integrator of 90° of phase margin, and a resonance far above it that just reaches 1: that one
// decides how much delay the loop stands, a part of what the phase margin lets one expect.
static void test_delay_margin(void **state) {
  (void)state;
  double complex l[N];
  for (int k = 0; k < N; k++) {
    double complex s = s_at(k);
    l[k] = 1 / s + 6 * s / (s * s + 4 * s + 400);
  }
  pb_margins m = pb_margins_of(hz, N, l, 1);
  assert_true(m.delay_hz > 10 / (2 * M_PI));
  double w = 2 * M_PI * m.delay_hz;
  double complex s = I * w, there = 1 / s + 6 * s / (s * s + 4 * s + 400);
  ASSERT_NEAR(cabs(there), 1, 1e-4);
  ASSERT_NEAR(cabs(there * cexp(-s * m.delay) + 1), 0, 1e-3);  // turned to −1
  assert_true(m.delay < m.phase_degree * M_PI / 180 / (2 * M_PI * m.phase_hz));
}

// (s + 1)²/s³ is stable and is not with half the gain: L(j) = −2.
static void test_conditional(void **state) {
  (void)state;
  double complex l[N];
  for (int k = 0; k < N; k++) {
    double complex s = s_at(k);
    l[k] = (s + 1) * (s + 1) / (s * s * s);
  }
  pb_margins m = pb_margins_of(hz, N, l, 1);
  ASSERT_RELATIVE(m.gain_down, 0.5, 1e-4);
  ASSERT_RELATIVE(m.gain_down_hz, 1 / (2 * M_PI), 1e-4);
  assert_true(isinf(m.gain_up));
}

// A loop that stays below 1 has no crossover; one that ends real and negative, as sampled loops do,
// reaches the axis there.
static void test_edges(void **state) {
  (void)state;
  double f[3] = {1, 2, 3};
  double complex small[3] = {0.5, CMPLX(0.3, -0.4), CMPLX(-0.1, -0.2)};
  pb_margins m = pb_margins_of(f, 3, small, 1);
  assert_true(isnan(m.crossover_hz) && isinf(m.phase_degree) && isinf(m.gain_up));
  double complex ends[3] = {0.5, CMPLX(0.3, -0.4), -0.2};
  m = pb_margins_of(f, 3, ends, 1);
  ASSERT_RELATIVE(m.gain_up, 5, 1e-12);
  ASSERT_NEAR(m.gain_up_hz, 3, 0);
}

// k/(s (s² + 2ζω s + ω²)) meets the axis at ω, where it turns by a right angle within the width of
// the resonance: a grid as fine as that width finds it all the same. With a constant negative gain
// it begins on the axis.
static void test_resonance(void **state) {
  (void)state;
  const double f0 = 100, w = 2 * M_PI * f0, zeta = 1e-3, k = 0.5 * 2 * zeta * w * w * w;
  double f[21];
  double complex l[21];
  for (int j = 0; j < 21; j++) {
    f[j] = f0 * (1 + 2 * zeta * (j - 10.3));
    double complex s = CMPLX(0, 2 * M_PI * f[j]);
    l[j] = k / (s * (s * s + 2 * zeta * w * s + w * w));
  }
  pb_margins m = pb_margins_of(f, 21, l, 1);
  ASSERT_RELATIVE(m.gain_up, 2, 1e-4);
  ASSERT_RELATIVE(m.gain_up_hz, f0, 1e-6);
  for (int j = 0; j < 21; j++) {
    f[j] = 0.1 * j;
    l[j] = -0.2 / (1 + CMPLX(0, f[j]));
  }
  m = pb_margins_of(f, 21, l, 1);
  ASSERT_RELATIVE(m.gain_up, 5, 1e-12);
  ASSERT_NEAR(m.gain_up_hz, 0, 0);
}

// Two loci of which one steps past the other: each goes on where that is nearest for both together.
static void test_swaps(void **state) {
  (void)state;
  const double f[3] = {1, 2, 3};
  const double complex l[12] = {0, 0, 0, 1, -5, 0, 0, 1.1, -10, 0, 0, 1.2};
  pb_mimo m;
  REQUIRE(pb_mimo_analyse(f, 3, 2, l, &m, &err));
  size_t fast = cabs(m.locus[0]) < 0.5 ? 0 : 1;
  for (size_t k = 0; k < 3; k++) {
    ASSERT_NEAR(creal(m.locus[2 * k + fast]), -5.0 * (double)k, 1e-12);
    ASSERT_NEAR(creal(m.locus[2 * k + 1 - fast]), 1 + 0.1 * (double)k, 1e-12);
  }
  pb_mimo_clear(&m);
}

// L = V diag(l₁, l₂) V⁻¹: the loci are l₁ and l₂ although the loops are coupled, and the worst
// direction is worse than either.
static void test_loci(void **state) {
  (void)state;
  static double complex l[N * 4];
  const double v[4] = {1, 0.8, 0.2, 1}, det = 1 - 0.16;  // rows
  double worst = 0;
  for (int k = 0; k < N; k++) {
    double complex s1 = 1 + s_at(k), a = 4 / (s1 * s1 * s1), b = 1 / s_at(k);
    double complex va[4] = {v[0] * a, v[1] * b, v[2] * a, v[3] * b};
    l[4 * k + 0] = (va[0] * v[3] - va[1] * v[2]) / det;
    l[4 * k + 1] = (-va[0] * v[1] + va[1] * v[0]) / det;
    l[4 * k + 2] = (va[2] * v[3] - va[3] * v[2]) / det;
    l[4 * k + 3] = (-va[2] * v[1] + va[3] * v[0]) / det;
    worst = fmax(worst, 1 / cabs(1 + a));
  }
  pb_mimo m;
  REQUIRE(pb_mimo_analyse(hz, N, 2, l, &m, &err));
  int third = isfinite(m.margins[0].gain_up) ? 0 : 1;
  ASSERT_RELATIVE(m.margins[third].gain_up, 2, 1e-4);
  ASSERT_RELATIVE(m.margins[1 - third].crossover_hz, 1 / (2 * M_PI), 1e-4);
  ASSERT_NEAR(m.margins[1 - third].phase_degree, 90, 1e-2);
  assert_true(m.s_peak > 1.05 * worst);
  for (int k = 0; k < N; k += 500) {
    double complex sensitivity[4], work[8];
    double largest;
    assert_true(pb_sensitivity_of(2, l + 4 * k, sensitivity, work));
    // S (I + L) = I
    double complex product = sensitivity[0] * (1 + l[4 * k]) + sensitivity[1] * l[4 * k + 2];
    ASSERT_NEAR(cabs(product - 1), 0, 1e-12);
    // σ² of 2 × 2 from trace and determinant of SᴴS.
    double trace = 0;
    for (int i = 0; i < 4; i++) trace += creal(sensitivity[i] * conj(sensitivity[i]));
    double d = cabs(sensitivity[0] * sensitivity[3] - sensitivity[1] * sensitivity[2]);
    REQUIRE(pb_largest_gain(2, sensitivity, &largest, &err));
    ASSERT_RELATIVE(largest, sqrt(0.5 * (trace + sqrt(trace * trace - 4 * d * d))), 1e-10);
    ASSERT_RELATIVE(m.s[k], largest, 1e-12);
  }
  pb_mimo_clear(&m);
}

static void test_grid(void **state) {
  (void)state;
  pb_pole pole[2] = {{0, 50, 1e-3}, {0, 2000, 1e-3}};
  pb_pole_list list = {.count = 2, .item = pole};
  double *grid;
  size_t count;
  REQUIRE(pb_margins_grid(1, 1000, 100, &list, &grid, &count, &err));
  ASSERT_NEAR(grid[0], 1, 1e-12);
  ASSERT_NEAR(grid[count - 1], 1000, 0);
  size_t near = 0;
  for (size_t k = 0; k < count; k++) {
    assert_true(k == 0 || grid[k] > grid[k - 1]);
    near += fabs(grid[k] - 50) < 0.5;
  }
  assert_true(near > 10);  // those of the pole at 50 Hz; none of the one beyond
  assert_true(count < 100 + 14);
  free(grid);
  pb_error err = {0};
  assert_int_equal(pb_margins_grid(1, 1, 100, &list, &grid, &count, &err), PB_ERR_ARGUMENT);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_third_order), cmocka_unit_test(test_delay_margin),
      cmocka_unit_test(test_conditional), cmocka_unit_test(test_edges),
      cmocka_unit_test(test_resonance),   cmocka_unit_test(test_swaps),
      cmocka_unit_test(test_loci),        cmocka_unit_test(test_grid)};
  return cmocka_run_group_tests(tests, make_grid, NULL);
}
