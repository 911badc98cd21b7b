// Specifications: what is read, what is refused where, and what a plant makes of them.
#include "study/file_model.h"
#include "study/gate.h"
#include "study_rig.h"

#define SPEC PB_CONFIG "/specifications/nano-hexapod.json"

static pb_status read_text(const char *text, pb_gate *gate, pb_error *refusal) {
  cJSON *spec = NULL;
  REQUIRE(pb_json_parse(text, strlen(text), &spec, &err));
  pb_status status = pb_gate_read(spec, gate, refusal);
  cJSON_Delete(spec);
  return status;
}

static pb_gate read_limit(const char *limit) {
  char text[512];
  pb_gate gate = {0};
  snprintf(text, sizeof text,
           "{\"schema\": \"plantbus.gate/1\", \"name\": \"t\", \"limits\": [%s]}", limit);
  REQUIRE(read_text(text, &gate, &err));
  return gate;
}

static void judge(pb_gate *gate, const char *plant) {
  cJSON *file = rig_file(plant);
  REQUIRE(pb_gate_judge(gate, file, PB_CONFIG "/plants", &err));
  cJSON_Delete(file);
}

static void the_shipped_hexapod_passes_its_specification(void **state) {
  (void)state;
  cJSON *spec = rig_file(SPEC);
  pb_gate gate = {0};
  REQUIRE(pb_gate_read(spec, &gate, &err));
  assert_string_equal(gate.name, "nano-hexapod");
  assert_int_equal(gate.count, cJSON_GetArraySize(pb_json_member(spec, "limits")));
  judge(&gate, HEXAPOD);
  for (size_t k = 0; k < gate.count; k++)
    if (!gate.limit[k].passed)
      fail_msg("%s: %g misses", gate.limit[k].pointer, gate.limit[k].value);
  assert_true(gate.passed);
  pb_gate_clear(&gate);
  cJSON_Delete(spec);
}

// Soft joints: the damping goes, and with it the gate.
static void soft_joints_miss_it(void **state) {
  (void)state;
  cJSON *spec = rig_file(SPEC), *file = rig_file(HEXAPOD);
  cJSON *soft = rig_vary(file, PB_STUDY_AXIAL, "1e6");
  pb_gate gate = {0};
  size_t missed = 0;
  REQUIRE(pb_gate_read(spec, &gate, &err));
  REQUIRE(pb_gate_judge(&gate, soft, PB_CONFIG "/plants", &err));
  assert_false(gate.passed);
  for (size_t k = 0; k < gate.count; k++) {
    const pb_gate_limit *l = &gate.limit[k];
    missed += !l->passed;
    assert_int_equal(l->passed, l->margin >= 0);
    if (l->quantity == PB_GATE_ATTAINABLE) assert_false(l->passed);
    if (l->quantity == PB_GATE_ORDER) assert_true(l->passed);
  }
  assert_true(missed >= 3 && missed < gate.count);
  pb_gate_clear(&gate);
  cJSON_Delete(soft);
  cJSON_Delete(file);
  cJSON_Delete(spec);
}

// 94 of 100 is a miss by 6 %; between two limits the nearer one counts.
static void margins_are_parts_of_the_limit(void **state) {
  (void)state;
  pb_gate gate =
      read_limit("{\"quantity\": \"order\", \"min\": 60}, {\"quantity\": \"order\", \"max\": 64},"
                 "{\"quantity\": \"order\", \"min\": 40, \"max\": 50}, {\"quantity\": \"order\", "
                 "\"max\": 48}");
  judge(&gate, HEXAPOD);  // 48 states
  const double margin[4] = {48.0 / 60 - 1, 1 - 48.0 / 64, 1 - 48.0 / 50, 0};
  for (size_t k = 0; k < 4; k++) ASSERT_NEAR(gate.limit[k].margin, margin[k], 1e-15);
  assert_false(gate.limit[0].passed);
  assert_true(gate.limit[1].passed && gate.limit[2].passed && gate.limit[3].passed);
  assert_false(gate.passed);
  pb_gate_clear(&gate);
}

// All six actuators alike move the platform straight up: the stroke along z is what they all give.
static void strokes_follow_from_static_gains(void **state) {
  (void)state;
  pb_gate gate = read_limit(
      "{\"quantity\": \"stroke\", \"axis\": \"z\", \"range\": [-20, 150], \"min\": 1e-6},"
      "{\"quantity\": \"stroke\", \"strut\": 3, \"range\": [-20, 150], \"min\": 1e-6},"
      "{\"quantity\": \"stiffness\", \"axis\": \"rz\", \"min\": 1}");
  judge(&gate, HEXAPOD);
  pb_model *m = NULL;
  cJSON *file = rig_file(HEXAPOD);
  REQUIRE(pb_file_model(file, NULL, &m, &err));
  double *dc = malloc(m->nu * m->ny * sizeof *dc), sum = 0;
  REQUIRE(pb_model_dc(m, dc, &err));
  for (int k = 1; k <= 6; k++) {
    char name[8];
    snprintf(name, sizeof name, "Va%d", k);
    sum += dc[(size_t)pb_model_output(m, "Dz") * m->nu + (size_t)pb_model_input(m, name)];
  }
  ASSERT_RELATIVE(gate.limit[0].value, 170 * sum, 1e-9);
  double strut = dc[(size_t)pb_model_output(m, "dL3") * m->nu + (size_t)pb_model_input(m, "Va3")];
  ASSERT_RELATIVE(gate.limit[1].value, 170 * strut, 1e-12);
  double turn = dc[(size_t)pb_model_output(m, "Rz") * m->nu + (size_t)pb_model_input(m, "Mz")];
  ASSERT_RELATIVE(gate.limit[2].value, 1 / turn, 1e-12);
  assert_string_equal(pb_gate_limit_unit(&gate.limit[2]), "Nm/rad");
  free(dc);
  pb_model_free(m);
  cJSON_Delete(file);
  pb_gate_clear(&gate);
}

// The gain of an amplifier is none of the actuator's range.
static void strokes_are_by_applied_voltage(void **state) {
  (void)state;
  const char *limit =
      "{\"quantity\": \"stroke\", \"axis\": \"x\", \"range\": [0, 150], \"min\": 1e-6}";
  pb_gate plain = read_limit(limit), amplified = read_limit(limit);
  judge(&plain, HEXAPOD);
  cJSON *file = rig_file(HEXAPOD), *electronics = cJSON_CreateObject();
  cJSON *actuators = cJSON_AddObjectToObject(electronics, "actuators");
  cJSON_AddNumberToObject(actuators, "gain", 20);
  cJSON_AddItemToObject(cJSON_GetObjectItem(file, "template"), "electronics", electronics);
  REQUIRE(pb_gate_judge(&amplified, file, NULL, &err));
  ASSERT_RELATIVE(amplified.limit[0].value, plain.limit[0].value, 1e-12);
  cJSON_Delete(file);
  pb_gate_clear(&plain);
  pb_gate_clear(&amplified);
}

static void check_refused(const char *text, const char *pointer, const char *words) {
  pb_gate gate = {0};
  pb_error refusal = {0};
  pb_status status = read_text(text, &gate, &refusal);
  if (status != PB_ERR_SCHEMA || strcmp(refusal.where, pointer) || !strstr(refusal.message, words))
    fail_msg("%s: %s at '%s': %s", text, pb_status_name(status), refusal.where, refusal.message);
  assert_null(gate.limit);
  assert_null(gate.name);
}

static void wrong_specifications_are_refused_where_they_are_wrong(void **state) {
  (void)state;
#define HEAD "{\"schema\": \"plantbus.gate/1\", \"name\": \"t\", \"limits\": ["
  check_refused("{}", "/schema", "missing");
  check_refused("{\"schema\": \"plantbus.gate/2\", \"name\": \"t\"}", "/schema", "plantbus.gate/1");
  check_refused("{\"schema\": \"plantbus.gate/1\", \"name\": \"t\"}", "/limits", "missing");
  check_refused(HEAD "]}", "/limits", "array of limits");
  check_refused(HEAD "], \"more\": 1}", "/more", "");
  check_refused(HEAD "{\"quantity\": \"colour\", \"min\": 1}]}", "/limits/0/quantity",
                "is no quantity");
  check_refused(HEAD "{\"quantity\": \"order\"}]}", "/limits/0", "neither min nor max");
  check_refused(HEAD "{\"quantity\": \"order\", \"min\": 0}]}", "/limits/0/min", "");
  check_refused(HEAD "{\"quantity\": \"order\", \"min\": 3, \"max\": 2}]}", "/limits/0",
                "min is above max");
  check_refused(HEAD "{\"quantity\": \"order\", \"max\": 9}, {\"quantity\": \"order\", \"max\": 9, "
                     "\"axis\": \"x\"}]}",
                "/limits/1/axis", "");
  check_refused(HEAD "{\"quantity\": \"stiffness\", \"axis\": \"w\", \"min\": 1}]}",
                "/limits/0/axis", "expected x, y, z");
  check_refused(HEAD "{\"quantity\": \"mode\", \"min\": 1}]}", "/limits/0/number", "missing");
  check_refused(HEAD "{\"quantity\": \"mode\", \"number\": 0, \"min\": 1}]}", "/limits/0/number",
                "");
  check_refused(HEAD "{\"quantity\": \"stroke\", \"range\": [0, 1], \"min\": 1}]}", "/limits/0",
                "either axis or strut");
  check_refused(HEAD "{\"quantity\": \"stroke\", \"axis\": \"x\", \"min\": 1}]}", "/limits/0/range",
                "missing");
  check_refused(HEAD "{\"quantity\": \"coupling\", \"band\": [10, 1], \"damped\": true, \"max\": "
                     "1}]}",
                "/limits/0/band", "ascending");
  check_refused(HEAD "{\"quantity\": \"coupling\", \"band\": [1, 10], \"max\": 1}]}",
                "/limits/0/damped", "missing");
#undef HEAD
}

// A plant that cannot answer fails at the limit that asks.
static void questions_to_the_wrong_plant_are_named(void **state) {
  (void)state;
  cJSON *bench = rig_file(PB_CONFIG "/plants/apa300ml-bench.json");
  pb_gate gate = read_limit("{\"quantity\": \"mode\", \"number\": 1, \"min\": 90, \"max\": 95},"
                            "{\"quantity\": \"attainable_damping\", \"min\": 0.1}");
  pb_error err = {0};
  assert_int_equal(pb_gate_judge(&gate, bench, NULL, &err), PB_ERR_STATE);
  assert_string_equal(err.where, "/limits/1");
  assert_true(gate.limit[0].passed);
  assert_false(gate.passed);
  pb_gate_clear(&gate);
  cJSON_Delete(bench);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(the_shipped_hexapod_passes_its_specification),
      cmocka_unit_test(soft_joints_miss_it),
      cmocka_unit_test(margins_are_parts_of_the_limit),
      cmocka_unit_test(strokes_follow_from_static_gains),
      cmocka_unit_test(strokes_are_by_applied_voltage),
      cmocka_unit_test(wrong_specifications_are_refused_where_they_are_wrong),
      cmocka_unit_test(questions_to_the_wrong_plant_are_named),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
