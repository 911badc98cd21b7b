// The relative gain array against its closed forms.
#include "study/rga.h"
#include "support/check.h"

// λ_11 = 1 / (1 − g12 g21 / (g11 g22)); the other entries follow from rows that add up to 1.
static void two_channels_have_the_closed_form(void **state) {
  (void)state;
  const double complex g[4] = {2 + 1 * I, -0.5 * I, 3, 1 - 2 * I};  // column-major
  double complex rga[4];
  REQUIRE(pb_rga(2, g, rga, &err));
  double complex first = 1 / (1 - g[2] * g[1] / (g[0] * g[3]));
  const double complex expected[4] = {first, 1 - first, 1 - first, first};
  for (int k = 0; k < 4; k++) ASSERT_NEAR(cabs(rga[k] - expected[k]), 0, 1e-14);
  double number;
  REQUIRE(pb_rga_number(2, g, &number, &err));
  ASSERT_RELATIVE(number, 4 * cabs(1 - first), 1e-13);
}

static void fill(double complex *g, size_t n) {
  for (size_t k = 0; k < n * n; k++) g[k] = cexp(I * (double)(k * k + 3)) * (1.0 + (double)(k % 7));
}

static void rows_and_columns_add_up_to_one(void **state) {
  (void)state;
  enum { N = 6 };
  double complex g[N * N], rga[N * N];
  fill(g, N);
  REQUIRE(pb_rga(N, g, rga, &err));
  for (size_t r = 0; r < N; r++) {
    double complex row = 0, column = 0;
    for (size_t c = 0; c < N; c++) row += rga[r + c * N], column += rga[c + r * N];
    ASSERT_NEAR(cabs(row - 1), 0, 1e-12);
    ASSERT_NEAR(cabs(column - 1), 0, 1e-12);
  }
}

// Units of inputs and outputs do not matter.
static void scaling_changes_nothing(void **state) {
  (void)state;
  enum { N = 6 };
  double complex g[N * N], scaled[N * N];
  double plain, other;
  fill(g, N);
  for (size_t c = 0; c < N; c++)
    for (size_t r = 0; r < N; r++)
      scaled[r + c * N] = g[r + c * N] * pow(10, (double)r - 3) * pow(7, (double)c);
  REQUIRE(pb_rga_number(N, g, &plain, &err));
  REQUIRE(pb_rga_number(N, scaled, &other, &err));
  ASSERT_RELATIVE(other, plain, 1e-10);
  assert_true(plain > 0.1);
}

// One-way coupling does not count: triangular plants have the number 0, as diagonal ones.
static void triangular_plants_have_none(void **state) {
  (void)state;
  const double complex g[9] = {1 + I, 5, -2 * I, 0, 2, 7, 0, 0, -3};
  double number;
  REQUIRE(pb_rga_number(3, g, &number, &err));
  ASSERT_NEAR(number, 0, 1e-14);
}

static void singular_and_oversized_plants_are_refused(void **state) {
  (void)state;
  const double complex g[4] = {1, 2, 2, 4};
  double number;
  pb_error err = {0};
  assert_int_equal(pb_rga_number(2, g, &number, &err), PB_ERR_SINGULAR);
  assert_int_equal(pb_rga_number(0, g, &number, &err), PB_ERR_ARGUMENT);
  assert_int_equal(pb_rga_number(PB_RGA_LARGEST + 1, g, &number, &err), PB_ERR_ARGUMENT);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(two_channels_have_the_closed_form),
      cmocka_unit_test(rows_and_columns_add_up_to_one),
      cmocka_unit_test(scaling_changes_nothing),
      cmocka_unit_test(triangular_plants_have_none),
      cmocka_unit_test(singular_and_oversized_plants_are_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
