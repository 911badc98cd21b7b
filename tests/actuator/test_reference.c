// The APA300ML and a flexible joint as finite elements of another program, where they are at hand:
// the numbers of the report.
#include "study/actuator_character.h"
#include "study/actuator_fit.h"
#include "study/joint_character.h"
#include "support/check.h"

#define APA PB_SHARED "/data/APA300ML.mat"
#define JOINT PB_SHARED "/data/flexor_025.mat"

static void need(const char *file) {
  if (access(file, R_OK) == 0) return;
  print_message("skipped: no %s\n", file);
  skip();
}

static pb_element_source actuator(void) {
  pb_element_source source;
  const pb_actuator_layout layout = pb_actuator_layout_default();
  REQUIRE(pb_element_source_actuator(APA, &layout, &source, &err));
  return source;
}

// Report 2.3.
static void the_apa300ml(void **state) {
  (void)state;
  need(APA);
  const pb_stack_nominal nominal = {.stroke = 20e-6, .length = 0.02};
  pb_element_source source = actuator();
  pb_actuator_character c;
  pb_bench_model bench = {0};
  REQUIRE(pb_actuator_characterize(&source, &nominal, NULL, &bench, &c, &err));
  ASSERT_RELATIVE(c.stiffness, 1.753e6, 1e-3);
  ASSERT_RELATIVE(c.resonance, 709.4, 1e-3);
  ASSERT_RELATIVE(c.amplification, 5.07, 2e-3);
  ASSERT_RELATIVE(c.stack_stiffness, 237e6, 5e-3);
  assert_int_equal(c.stacks, 3);
  ASSERT_RELATIVE(c.stroke, 304e-6, 5e-3);
  ASSERT_RELATIVE(c.mass, 0.115, 5e-3);
  pb_bench_model_clear(&bench);
  pb_element_source_clear(&source);
}

// Table 2.2 within a few per cent, and figure 2.5: a match over decades that ends at some kHz.
static void its_2dof_model(void **state) {
  (void)state;
  need(APA);
  enum { POINTS = 1200 };
  double hz[POINTS];
  for (int i = 0; i < POINTS; i++) hz[i] = pow(10, 4.3 * i / (POINTS - 1));
  pb_element_source source = actuator();
  const pb_actuator_bench options = {.load = 5};
  pb_bench_model bench;
  pb_apa_landmarks l;
  pb_apa_data data;
  pb_apa_2dof apa;
  pb_apa_match match;
  REQUIRE(pb_actuator_bench_build(&source, &options, NULL, &bench, &err));
  REQUIRE(pb_apa_landmarks_of_model(bench.model, &l, &err));
  ASSERT_RELATIVE(l.pole_hz, 93.92, 1e-3);
  ASSERT_RELATIVE(l.zero_hz, 39.06, 1e-3);
  ASSERT_RELATIVE(l.gain_y, 1.048e-6, 1e-3);
  ASSERT_RELATIVE(l.gain_vs, -0.0384, 2e-3);
  REQUIRE(pb_apa_data_of_model(bench.model, hz, POINTS, &data, &err));
  REQUIRE(pb_apa_from_landmarks(&l, 0, 5 + 0.115 / 2, 1e-3, 2, &apa, &err));
  ASSERT_RELATIVE(apa.k_1, 0.30e6, 0.03);
  ASSERT_RELATIVE(apa.k_e, 4.3e6, 0.03);
  ASSERT_RELATIVE(apa.k_a, 2.15e6, 0.03);
  ASSERT_RELATIVE(apa.g_a, 2.7, 0.03);
  ASSERT_RELATIVE(apa.g_s, 0.53e6, 0.03);
  REQUIRE(pb_apa_match_find(&data, &apa, l.pole_hz, 0.2, &match, &err));
  for (int k = 0; k < PB_APA_OUTPUTS; k++) assert_true(match.end[k] > 2000 && match.end[k] < 15000);
  pb_apa_match_clear(&match);
  pb_apa_data_clear(&data);
  pb_bench_model_clear(&bench);
  pb_element_source_clear(&source);
}

// An open sensor stack: k/(1 − k_33²) of one of three stacks lifts the loaded resonance a little.
static void its_open_sensor_stack(void **state) {
  (void)state;
  need(APA);
  pb_element_source source = actuator(), open = {0};
  cJSON *patch = cJSON_Parse("{\"boundary\":{\"sensor\":\"open\",\"coupling\":0.6}}");
  const pb_actuator_bench options = {.load = 5};
  double hz[2], damping;
  REQUIRE(pb_element_source_patch(&source, patch, &open, &err));
  for (int i = 0; i < 2; i++) {
    pb_bench_model bench;
    REQUIRE(pb_actuator_bench_build(i ? &open : &source, &options, NULL, &bench, &err));
    if (i) ASSERT_RELATIVE(pb_bench_part(&bench)->boundary.stiffness, 237e6, 5e-3);
    pb_bench_first_mode(&bench, "Va", "y", 0.2, &hz[i], &damping);
    pb_bench_model_clear(&bench);
  }
  assert_true(hz[1] > 1.01 * hz[0] && hz[1] < 1.1 * hz[0]);
  cJSON_Delete(patch);
  pb_element_source_clear(&source);
  pb_element_source_clear(&open);
}

// Report 3.5, Table 3.1.
static void the_flexible_joint(void **state) {
  (void)state;
  need(JOINT);
  const size_t nodes[2] = {2, 1};
  pb_element_source source;
  pb_joint_character c;
  pb_bench_model bench;
  REQUIRE(pb_element_source_joint(JOINT, nodes, 0.01, &source, &err));
  REQUIRE(pb_joint_characterize(&source, NULL, &bench, &c, &err));
  ASSERT_RELATIVE(c.k[0], 12.7e6, 2e-3);
  ASSERT_RELATIVE(c.k[1], 12.7e6, 2e-3);
  ASSERT_RELATIVE(c.k[2], 94e6, 2e-3);
  ASSERT_RELATIVE(c.k[3], 4.83, 2e-3);
  ASSERT_RELATIVE(c.k[4], 4.83, 2e-3);
  ASSERT_RELATIVE(c.k[5], 260, 2e-3);
  ASSERT_RELATIVE(c.mass, 0.0292, 2e-3);
  pb_bench_model_clear(&bench);
  pb_element_source_clear(&source);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(the_apa300ml),
      cmocka_unit_test(its_2dof_model),
      cmocka_unit_test(its_open_sensor_stack),
      cmocka_unit_test(the_flexible_joint),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
