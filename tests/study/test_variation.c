// What a variation changes in a plant file, what it leaves alone, and what it refuses.
#include "study_rig.h"

static const cJSON *part(const cJSON *file, const char *key) {
  return pb_json_member(pb_json_member(file, "template"), key);
}

static double number(const cJSON *object, const char *key) {
  const cJSON *item = pb_json_member(object, key);
  if (!cJSON_IsNumber(item)) fail_msg("no number %s", key);
  return item->valuedouble;
}

static const char *type_of(const cJSON *object) {
  return pb_json_member(object, "type")->valuestring;
}

// Everything outside the named keys of the template is as it was.
static void check_rest(const cJSON *before, const cJSON *after, const char *const *changed) {
  for (const cJSON *m = before->child; m; m = m->next)
    if (strcmp(m->string, "template"))
      assert_true(cJSON_Compare(m, pb_json_member(after, m->string), 1));
  for (const cJSON *m = pb_json_member(before, "template")->child; m; m = m->next) {
    bool may = false;
    for (const char *const *key = changed; *key; key++) may = may || !strcmp(*key, m->string);
    if (!may) assert_true(cJSON_Compare(m, part(after, m->string), 1));
  }
}

static const char *const joints[] = {"bottom_joint", "top_joint", NULL};

static void bending_sets_one_key_of_both_joints(void **state) {
  (void)state;
  cJSON *file = rig_file(HEXAPOD), *out = rig_vary(file, PB_STUDY_BENDING, "77.5");
  assert_string_equal(type_of(part(out, "bottom_joint")), "universal_axial");
  assert_string_equal(type_of(part(out, "top_joint")), "spherical_axial");
  ASSERT_NEAR(number(part(out, "bottom_joint"), "k_f"), 77.5, 0);
  ASSERT_NEAR(number(part(out, "top_joint"), "k_f"), 77.5, 0);
  ASSERT_NEAR(number(part(out, "top_joint"), "k_t"), 260, 0);
  ASSERT_NEAR(number(part(out, "top_joint"), "k_a"), 94e6, 0);
  check_rest(file, out, joints);
  cJSON_Delete(out);
  cJSON_Delete(file);
}

static void torsion_sets_the_joint_that_turns(void **state) {
  (void)state;
  cJSON *file = rig_file(HEXAPOD), *out = rig_vary(file, PB_STUDY_TORSION, "9");
  assert_true(cJSON_IsString(part(out, "bottom_joint")));  // a universal joint has no torsion
  ASSERT_NEAR(number(part(out, "top_joint"), "k_t"), 9, 0);
  check_rest(file, out, joints);
  cJSON_Delete(out);
  cJSON_Delete(file);
}

static void axial_frees_and_locks_the_direction(void **state) {
  (void)state;
  cJSON *file = rig_file(HEXAPOD_1DOF), *soft = rig_vary(file, PB_STUDY_AXIAL, "2e7");
  assert_string_equal(type_of(part(soft, "bottom_joint")), "universal_axial");
  assert_string_equal(type_of(part(soft, "top_joint")), "spherical_axial");
  ASSERT_NEAR(number(part(soft, "top_joint"), "k_a"), 2e7, 0);
  cJSON *locked = rig_vary(soft, PB_STUDY_AXIAL, "inf");
  assert_string_equal(type_of(part(locked, "bottom_joint")), "universal");
  assert_string_equal(type_of(part(locked, "top_joint")), "spherical");
  assert_null(pb_json_member(part(locked, "top_joint"), "k_a"));
  cJSON_Delete(locked);
  cJSON_Delete(soft);
  cJSON_Delete(file);
}

static void mass_is_the_payloads_and_none_is_null(void **state) {
  (void)state;
  static const char *const payload[] = {"payload", NULL};
  cJSON *file = rig_file(HEXAPOD), *out = rig_vary(file, PB_STUDY_MASS, "33");
  ASSERT_NEAR(number(part(out, "payload"), "mass"), 33, 0);
  ASSERT_NEAR(number(part(out, "payload"), "radius"), 0.1, 0);
  check_rest(file, out, payload);
  cJSON *none = rig_vary(file, PB_STUDY_MASS, "0");
  assert_true(cJSON_IsNull(part(none, "payload")));
  cJSON_Delete(none);
  cJSON_Delete(out);
  cJSON_Delete(file);
}

// k = k_1 + k_a k_e/(k_a + k_e), as the shell and the stacks in series are at rest.
static void one_dof_struts_have_the_static_stiffness(void **state) {
  (void)state;
  cJSON *file = rig_file(HEXAPOD), *out = rig_vary(file, PB_STUDY_ACTUATOR_MODEL, "1dof");
  const cJSON *strut = part(out, "actuator");
  assert_string_equal(type_of(strut), "strut_1dof");
  ASSERT_RELATIVE(number(strut, "k"), 0.3e6 + 2.15e6 * 4.3e6 / 6.45e6, 1e-14);
  ASSERT_RELATIVE(number(strut, "c"), 18 + 0.35 * 4 / 9 + 0.7 / 9, 1e-14);
  ASSERT_RELATIVE(number(strut, "mass"), 0.113, 1e-14);
  cJSON *again = rig_vary(out, PB_STUDY_ACTUATOR_MODEL, "2dof");  // the file's only such model
  assert_string_equal(type_of(part(again, "actuator")), "apa_2dof");
  cJSON_Delete(again);
  cJSON_Delete(out);
  cJSON_Delete(file);
}

static void joint_models_take_the_plants_stiffnesses(void **state) {
  (void)state;
  cJSON *file = rig_file(HEXAPOD), *out = NULL;
  const pb_variation v = {PB_STUDY_JOINT_MODEL, "bushing", {NAN, 100, NAN, 12.7e6}, NULL};
  REQUIRE(pb_variation_apply(file, &v, &out, &err));
  for (int side = 0; side < 2; side++) {
    const cJSON *joint = part(out, joints[side]);
    assert_string_equal(type_of(joint), "bushing");
    ASSERT_NEAR(number(joint, "k_f"), 4.83, 0);  // each joint's own
    ASSERT_NEAR(number(joint, "k_t"), 100, 0);   // as told
    ASSERT_NEAR(number(joint, "k_a"), 94e6, 0);
    ASSERT_NEAR(number(joint, "k_s"), 12.7e6, 0);
  }
  cJSON_Delete(out);
  out = rig_vary(file, PB_STUDY_JOINT_MODEL, "ideal");
  ASSERT_NEAR(number(part(out, "top_joint"), "k_f"), 0, 0);
  ASSERT_NEAR(number(part(out, "top_joint"), "k_t"), 0, 0);
  cJSON_Delete(out);
  out = rig_vary(file, PB_STUDY_JOINT_MODEL, "top");  // a model of the file, by its name
  assert_string_equal(part(out, "bottom_joint")->valuestring, "top");
  cJSON_Delete(out);
  out = rig_vary(file, PB_STUDY_JOINT_MODEL, "plant");
  assert_true(cJSON_Compare(file, out, 1));
  cJSON_Delete(out);
  cJSON_Delete(file);
}

static void check_refused(const char *path, pb_study_kind kind, const char *value, pb_status code,
                          const char *words) {
  cJSON *file = rig_file(path), *out = file;
  const pb_variation v = {kind, value, {NAN, NAN, NAN, NAN}, PB_CONFIG "/plants"};
  pb_error err = {0};
  pb_status status = pb_variation_apply(file, &v, &out, &err);
  if (status != code || !strstr(err.message, words))
    fail_msg("%s: %s: %s, not '%s'", value, pb_status_name(status), err.message, words);
  assert_null(out);
  cJSON_Delete(file);
}

static void what_cannot_be_varied_is_refused(void **state) {
  (void)state;
  check_refused(HEXAPOD, PB_STUDY_BENDING, "12x", PB_ERR_ARGUMENT, "'12x' is not a number");
  check_refused(HEXAPOD, PB_STUDY_BENDING, "-1", PB_ERR_ARGUMENT, "at least 0");
  check_refused(HEXAPOD, PB_STUDY_BENDING, "nan", PB_ERR_ARGUMENT, "is not a number");
  check_refused(HEXAPOD, PB_STUDY_BENDING, "inf", PB_ERR_ARGUMENT, "is not a number");
  check_refused(HEXAPOD, PB_STUDY_AXIAL, "0", PB_ERR_ARGUMENT, "above 0");
  check_refused(HEXAPOD, PB_STUDY_JOINT_MODEL, "bushing", PB_ERR_ARGUMENT, "needs k_s");
  check_refused(HEXAPOD, PB_STUDY_JOINT_MODEL, "nothing", PB_ERR_REFERENCE, "\"nothing\"");
  check_refused(HEXAPOD_1DOF, PB_STUDY_ACTUATOR_MODEL, "2dof", PB_ERR_STATE, "type apa_2dof");
  check_refused(PB_CONFIG "/plants/apa300ml-bench.json", PB_STUDY_MASS, "1", PB_ERR_STATE,
                "no template");
}

// An element keeps its stiffness; a bushing's axis cannot be locked.
static void elements_are_not_set(void **state) {
  (void)state;
  cJSON *file = rig_file(HEXAPOD), *element = cJSON_CreateObject(), *out = NULL;
  cJSON_AddStringToObject(element, "type", "super_element");
  cJSON *template = cJSON_GetObjectItem(file, "template");
  cJSON_ReplaceItemInObject(template, "top_joint", element);
  const pb_variation v = {PB_STUDY_AXIAL, "1e8", {NAN, NAN, NAN, NAN}, PB_CONFIG "/plants"};
  pb_error err = {0};
  assert_int_equal(pb_variation_apply(file, &v, &out, &err), PB_ERR_STATE);
  assert_string_equal(err.where, "/template/top_joint");
  cJSON_ReplaceItemInObject(element, "type", cJSON_CreateString("bushing"));
  const pb_variation locked = {PB_STUDY_AXIAL, "inf", {NAN, NAN, NAN, NAN}, PB_CONFIG "/plants"};
  assert_int_equal(pb_variation_apply(file, &locked, &out, &err), PB_ERR_STATE);
  assert_non_null(strstr(err.message, "cannot be locked"));
  cJSON_Delete(file);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(bending_sets_one_key_of_both_joints),
      cmocka_unit_test(torsion_sets_the_joint_that_turns),
      cmocka_unit_test(axial_frees_and_locks_the_direction),
      cmocka_unit_test(mass_is_the_payloads_and_none_is_null),
      cmocka_unit_test(one_dof_struts_have_the_static_stiffness),
      cmocka_unit_test(joint_models_take_the_plants_stiffnesses),
      cmocka_unit_test(what_cannot_be_varied_is_refused),
      cmocka_unit_test(elements_are_not_set),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
