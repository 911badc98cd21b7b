// Attainable damping against the closed form of one mode, and on plants that are cut down for it.
#include "control/iff.h"
#include "study/damping.h"
#include "study/file_model.h"
#include "study_rig.h"

// The bench: one mode ω_p, one zero ω_z, sampled so fast and with corners so low that the loop is
// as good as continuous with a pure integrator.
static pb_model *fast_bench(void) {
  cJSON *file = rig_file(PB_CONFIG "/plants/apa300ml-bench.json");
  cJSON *apa = cJSON_GetObjectItem(cJSON_GetObjectItem(file, "models"), "apa300ml");
  static const char *const damper[] = {"c_1", "c_a", "c_e"};
  for (int i = 0; i < 3; i++) cJSON_SetNumberValue(cJSON_GetObjectItem(apa, damper[i]), 1e-3);
  cJSON_SetNumberValue(cJSON_GetObjectItem(file, "sample_rate"), 200000);
  pb_model *model = NULL;
  REQUIRE(pb_file_model(file, PB_CONFIG "/plants", &model, &err));
  cJSON_Delete(file);
  return model;
}

// Of s (s² + ω_p²) + g (s² + ω_z²) the largest damping is (ω_p − ω_z) / (2 ω_z).
// A. Preumont, "Vibration Control of Active Structures", 7.5.1.
static void one_mode_has_the_closed_form(void **state) {
  (void)state;
  pb_model *m = fast_bench();
  const size_t input = (size_t)pb_model_input(m, "Va"), output = (size_t)pb_model_output(m, "Vs");
  const pb_iff law = {1, 1e-3, 1e-3};
  pb_lti k = {0};
  pb_loop_solver *s = NULL;
  pb_attainable a = {0};
  REQUIRE(pb_iff_discrete(&law, 1, m->sample_rate, &k, &err));
  const pb_loop loop = {m, &k, &output, &input, 1, 0};
  REQUIRE(pb_loop_solver_new(&loop, &s, &err));
  REQUIRE(pb_attainable_find(s, s, 30, 300, &a, &err));
  double ratio = 93.18340 / 38.76831;  // of pole and zero of this plant
  assert_int_equal(a.modes, 1);
  ASSERT_RELATIVE(a.mode[0].open.hz, 93.18340, 1e-5);
  ASSERT_RELATIVE(a.mode[0].damping, (ratio - 1) / 2, 2e-3);
  assert_true(a.mode[0].gain > 0 && a.best.gain > 0);
  ASSERT_RELATIVE(a.best.smallest, a.mode[0].damping, 1e-3);
  ASSERT_NEAR(a.locus.gain[a.chosen], a.best.gain, 0);
  pb_attainable_clear(&a);
  pb_loop_solver_free(s);
  pb_lti_free(&k);
  pb_model_free(m);
}

static void a_band_without_modes_is_refused(void **state) {
  (void)state;
  pb_model *m = fast_bench();
  const size_t input = (size_t)pb_model_input(m, "Va"), output = (size_t)pb_model_output(m, "Vs");
  const pb_iff law = pb_iff_default(1);
  pb_lti k = {0};
  pb_loop_solver *s = NULL;
  pb_attainable a = {0};
  pb_error refusal = {0};
  REQUIRE(pb_iff_discrete(&law, 1, m->sample_rate, &k, &err));
  const pb_loop loop = {m, &k, &output, &input, 1, 0};
  REQUIRE(pb_loop_solver_new(&loop, &s, &err));
  assert_int_equal(pb_attainable_find(s, s, 200, 300, &a, &refusal), PB_ERR_STATE);
  assert_null(a.mode);
  pb_loop_solver_free(s);
  pb_lti_free(&k);
  pb_model_free(m);
}

// All of a locus' dampings are reached below the gain that makes the loop unstable, or not: what is
// called stable is.
static void the_stable_gain_is_stable_and_the_next_is_not(void **state) {
  (void)state;
  cJSON *file = rig_file(HEXAPOD);
  pb_study_point p = rig_point(file, PB_STUDY_AXIAL, "1e7");
  assert_true(p.stable_to > 0 && p.stable_to < p.gain[p.size.gains - 1]);
  assert_true(p.stable.gain <= p.stable_to && p.best.gain > p.stable_to);
  assert_true(p.stable.smallest < p.best.smallest);
  pb_model *m = NULL;
  cJSON *varied = rig_vary(file, PB_STUDY_AXIAL, "1e7");
  REQUIRE(pb_file_model(varied, PB_CONFIG "/plants", &m, &err));
  pb_hexapod_channels c;
  REQUIRE(pb_hexapod_channels_find(m, &c, &err));
  const pb_iff law = pb_iff_default(1);
  pb_lti k = {0};
  pb_loop_solver *s = NULL;
  REQUIRE(pb_iff_discrete(&law, 6, m->sample_rate, &k, &err));
  const pb_loop loop = {m, &k, c.sensor, c.input, 1, 0};
  REQUIRE(pb_loop_solver_new(&loop, &s, &err));
  size_t at = 0;
  while (p.gain[at] < p.stable_to) at++;
  bool below = false, above = true;
  REQUIRE(pb_loop_solver_stable(s, p.gain[at], &below, NULL, &err));
  REQUIRE(pb_loop_solver_stable(s, p.gain[at + 1], &above, NULL, &err));
  assert_true(below);
  assert_false(above);
  pb_loop_solver_free(s);
  pb_lti_free(&k);
  pb_model_free(m);
  pb_study_point_clear(&p);
  cJSON_Delete(varied);
  cJSON_Delete(file);
}

static void small_models_are_not_cut_down(void **state) {
  (void)state;
  pb_model *m = fast_bench(), *low = m;
  REQUIRE(pb_model_lowest(m, &low, &err));
  assert_null(low);
  pb_model_free(m);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(one_mode_has_the_closed_form),
      cmocka_unit_test(a_band_without_modes_is_refused),
      cmocka_unit_test(the_stable_gain_is_stable_and_the_next_is_not),
      cmocka_unit_test(small_models_are_not_cut_down),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
