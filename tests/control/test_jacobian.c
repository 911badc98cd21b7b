// The Jacobian of the hexapod: against the derivative of the struts' lengths, and the static plant.
#include "support/check.h"

#include "base/json.h"
#include "control/jacobian.h"

static const char *const file = PB_CONFIG "/plants/nano-hexapod.json";

static pb_hexapod read_hexapod(cJSON **json) {
  pb_hexapod h;
  REQUIRE(pb_json_read(file, json, NULL, &err));
  REQUIRE(pb_hexapod_read(*json, &h, &err));
  return h;
}

// Length of strut k with the platform moved by x at the point of interest: a small rotation, exact
// enough for a central difference.
static double length_at(const pb_hexapod *h, int k, const double x[6]) {
  const double *top = h->strut[k].top, *bottom = h->strut[k].bottom;
  double r[3] = {top[0], top[1], top[2] - h->point_of_interest_height}, sum = 0;
  const double turned[3] = {x[4] * r[2] - x[5] * r[1], x[5] * r[0] - x[3] * r[2],
                            x[3] * r[1] - x[4] * r[0]};
  for (int i = 0; i < 3; i++) {
    double d = top[i] + x[i] + turned[i] - bottom[i];
    sum += d * d;
  }
  return sqrt(sum);
}

static void test_lengths(void **state) {
  (void)state;
  cJSON *json;
  pb_hexapod h = read_hexapod(&json);
  double j[36], step = 1e-6;
  pb_jacobian_geometry(&h, j);
  for (int k = 0; k < 6; k++) {
    for (int c = 0; c < 6; c++) {
      double up[6] = {0}, down[6] = {0};
      up[c] = step;
      down[c] = -step;
      double slope = (length_at(&h, k, up) - length_at(&h, k, down)) / (2 * step);
      ASSERT_NEAR(j[k + 6 * c], slope, 1e-9);
    }
  }
  cJSON_Delete(json);
}

// Forces at the point of interest move point and struts together.
static void test_static(void **state) {
  (void)state;
  static const char *const motions[] = {"Dx", "Dy", "Dz", "Rx", "Ry", "Rz"};
  static const char *const forces[] = {"Fx", "Fy", "Fz", "Mx", "My", "Mz"};
  cJSON *json;
  pb_hexapod h = read_hexapod(&json);
  pb_warnings warnings = {0};
  pb_model *m;
  size_t metrology[6], motion[6], force[6];
  double geometry[36], gains[36], inverse[36], condition;
  REQUIRE(pb_model_load(file, &warnings, &m, &err));
  for (size_t k = 0; k < 6; k++) {
    char name[8];
    snprintf(name, sizeof name, "dL%zu", k + 1);
    metrology[k] = (size_t)pb_model_output(m, name);
    motion[k] = (size_t)pb_model_output(m, motions[k]);
    force[k] = (size_t)pb_model_input(m, forces[k]);
  }
  pb_jacobian_geometry(&h, geometry);
  REQUIRE(pb_jacobian_static(m, metrology, motion, force, 6, gains, &err));
  for (int k = 0; k < 36; k++) ASSERT_NEAR(gains[k], geometry[k], 1e-10);
  REQUIRE(pb_jacobian_invert(gains, 6, inverse, &condition, &err));
  for (int k = 0; k < 36; k++) {
    double sum = 0;
    for (int i = 0; i < 6; i++) sum += gains[k % 6 + 6 * i] * inverse[i + 6 * (k / 6)];
    ASSERT_NEAR(sum, k % 7 == 0, 1e-12);
  }
  assert_true(condition > 1 && condition < 1000);
  // The same force twice does not move the point in six ways.
  pb_error err = {0};
  force[5] = force[4];
  assert_int_equal(pb_jacobian_static(m, metrology, motion, force, 6, gains, &err),
                   PB_ERR_SINGULAR);
  pb_model_free(m);
  pb_warnings_clear(&warnings);
  cJSON_Delete(json);
}

static void test_condition(void **state) {
  (void)state;
  const double diagonal[4] = {8, 0, 0, 2}, singular[4] = {1, 2, 2, 4};
  double inverse[4], condition;
  REQUIRE(pb_jacobian_invert(diagonal, 2, inverse, &condition, &err));
  ASSERT_RELATIVE(condition, 4, 1e-14);
  ASSERT_RELATIVE(inverse[0], 0.125, 1e-15);
  pb_error err = {0};
  assert_int_equal(pb_jacobian_invert(singular, 2, inverse, NULL, &err), PB_ERR_SINGULAR);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_lengths), cmocka_unit_test(test_static),
                                     cmocka_unit_test(test_condition)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
