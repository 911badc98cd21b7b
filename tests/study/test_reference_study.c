// Studies of a plant whose joints are elements, where their data are at hand: cut down for the root
// locus, and judged beside the same plant with springs for joints.
#include "study/file_model.h"
#include "study_rig.h"

#define WHERE PB_SHARED "/reference"

static pb_study_point analyse(const char *name) {
  char path[512];
  const pb_study_options options = {.from = 1, .to = 500, .points = 60};
  pb_study_point p = {0};
  snprintf(path, sizeof path, WHERE "/%s.json", name);
  cJSON *file = rig_file(path);
  REQUIRE(pb_study_point_find(file, WHERE, &options, &p, &err));
  cJSON_Delete(file);
  return p;
}

static bool missing(void) {
  if (access(WHERE "/nano-hexapod-2dof-fem-joints.json", R_OK) == 0 &&
      access(PB_SHARED "/data/flexor_025.mat", R_OK) == 0)
    return false;
  print_message("the reference plants are not at hand\n");
  return true;
}

// Section 3.5: 252 states with elements, 48 with springs, and nearly the same damping.
static void element_joints_damp_as_springs_do(void **state) {
  (void)state;
  if (missing()) skip();
  pb_study_point element = analyse("nano-hexapod-2dof-fem-joints"),
                 spring = analyse("nano-hexapod-2dof-reduced");
  assert_int_equal(element.states, 252);
  assert_int_equal(spring.states, 48);
  for (size_t m = 0; m < 6; m++) {
    ASSERT_RELATIVE(element.mode_hz[m], spring.mode_hz[m], 0.03);
    ASSERT_RELATIVE(element.attainable[m], spring.attainable[m], 0.06);
  }
  // k_f of the element, from its own matrices.
  ASSERT_RELATIVE(element.struts.bending, 4.83, 0.01);
  pb_study_point_clear(&element);
  pb_study_point_clear(&spring);
}

// The model of the locus has the whole one's modes in the band.
static void the_cut_keeps_the_modes_and_static_gains(void **state) {
  (void)state;
  if (missing()) skip();
  cJSON *file = rig_file(WHERE "/nano-hexapod-2dof-fem-joints.json");
  pb_model *whole = NULL, *low = NULL;
  REQUIRE(pb_file_model(file, WHERE, &whole, &err));
  REQUIRE(pb_model_lowest(whole, &low, &err));
  assert_non_null(low);
  assert_true(low->nx <= PB_DAMPING_STATES && low->nx > PB_DAMPING_STATES / 2);
  double *a = malloc(whole->nu * whole->ny * sizeof *a),
         *b = malloc(whole->nu * whole->ny * sizeof *b);
  double most = 0;
  REQUIRE(pb_model_dc(whole, a, &err));
  REQUIRE(pb_model_dc(low, b, &err));
  for (size_t k = 0; k < whole->nu * whole->ny; k++)
    most = fmax(most, fabs(a[k] - b[k]) / (fabs(a[k]) + 1e-9));
  assert_true(most < 1e-6);
  free(a);
  free(b);
  pb_model_free(low);
  pb_model_free(whole);
  cJSON_Delete(file);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(element_joints_damp_as_springs_do),
      cmocka_unit_test(the_cut_keeps_the_modes_and_static_gains),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
