// Plant files: what is accepted, and that each mistake is refused at its place.
#include "support/check.h"

#include "base/json.h"
#include "base/text.h"
#include "plant/plant.h"

static char *bench, *hexapod;

static char *read_file(const char *path) {
  char *text = NULL;
  size_t length;
  pb_error err = {0};
  if (pb_text_read(path, &text, &length, &err)) fail_msg("%s: %s", err.where, err.message);
  return text;
}

static int setup(void **state) {
  (void)state;
  bench = read_file(PB_CONFIG "/plants/apa300ml-bench.json");
  hexapod = read_file(PB_CONFIG "/plants/nano-hexapod.json");
  return 0;
}

static int teardown(void **state) {
  (void)state;
  free(bench);
  free(hexapod);
  return 0;
}

// The plant file `base` with a merge patch applied, parsed.
static pb_status parse_patched(const char *base, const char *patch, pb_plant **plant,
                               pb_error *err) {
  cJSON *target = cJSON_Parse(base), *change = cJSON_Parse(patch);
  if (!change) fail_msg("the test's patch is not JSON: %s", patch);
  cJSON *merged = pb_json_merge(target, change);
  char *text = NULL;
  pb_status st = pb_json_print(merged, &text, err);
  if (!st) st = pb_plant_parse(text, strlen(text), ".", NULL, plant, err);
  free(text);
  cJSON_Delete(target), cJSON_Delete(change), cJSON_Delete(merged);
  return st;
}

typedef struct mistake {
  const char *patch;
  pb_status code;
  const char *where;
  const char *part;  // of the message
} mistake;

static void check_mistakes(const char *base, const mistake *m, size_t count) {
  for (size_t i = 0; i < count; i++) {
    pb_plant *plant = NULL;
    pb_error err = {0};
    pb_status st = parse_patched(base, m[i].patch, &plant, &err);
    if (st != m[i].code || strcmp(err.where, m[i].where) || !strstr(err.message, m[i].part))
      fail_msg("%s\n  gave %s at \"%s\": %s\n  expected %s at \"%s\": …%s…", m[i].patch,
               pb_status_name(st), err.where, err.message, pb_status_name(m[i].code), m[i].where,
               m[i].part);
    assert_null(plant);
  }
}

#define INPUT(fields) "{\"inputs\": [{\"name\": \"i\", " fields "}]}"
#define OUTPUT(fields) "{\"outputs\": [{\"name\": \"o\", " fields "}]}"

static void test_header_mistakes(void **state) {
  (void)state;
  static const mistake list[] = {
      {"{\"schema\": \"plantbus.plant/2\"}", PB_ERR_SCHEMA, "/schema", "expected"},
      {"{\"schema\": null}", PB_ERR_SCHEMA, "/schema", "missing"},
      {"{\"nmae\": \"x\"}", PB_ERR_SCHEMA, "/nmae", "unknown key"},
      {"{\"Name\": \"x\"}", PB_ERR_SCHEMA, "/Name", "unknown key"},
      {"{\"name\": \"\"}", PB_ERR_SCHEMA, "/name", "non-empty"},
      {"{\"sample_rate\": 0}", PB_ERR_SCHEMA, "/sample_rate", "> 0"},
      {"{\"sample_rate\": \"fast\"}", PB_ERR_SCHEMA, "/sample_rate", "number"},
      {"{\"max_frequency\": -1}", PB_ERR_SCHEMA, "/max_frequency", "> 0"},
      {"{\"components\": []}", PB_ERR_SCHEMA, "/components", "object"},
      {"{\"components\": null}", PB_ERR_SCHEMA, "/components", "missing"},
      {"{\"inputs\": {}}", PB_ERR_SCHEMA, "/inputs", "array"},
      {"{\"inputs\": []}", PB_ERR_SCHEMA, "/inputs", "1 to 32"},
      {"{\"models\": {\"x\": {\"type\": \"motor\"}}}", PB_ERR_SCHEMA, "/models/x/type", "no type"},
      {"{\"models\": {\"x\": {\"type\": \"bushing\", \"k_x\": 1}}}", PB_ERR_SCHEMA, "/models/x/k_x",
       "unknown key"},
      {"{\"models\": {\"x\": {\"type\": \"bushing\", \"k_f\": -1}}}", PB_ERR_SCHEMA,
       "/models/x/k_f", "≥ 0"},
  };
  check_mistakes(bench, list, sizeof list / sizeof *list);
}

static void test_component_mistakes(void **state) {
  (void)state;
  static const mistake list[] = {
      {"{\"components\": {\"mass\": {\"mass\": -5}}}", PB_ERR_SCHEMA, "/components/mass/mass",
       "≥ 0"},
      {"{\"components\": {\"mass\": {\"inertia\": [1, 2]}}}", PB_ERR_SCHEMA,
       "/components/mass/inertia", "Ixx"},
      {"{\"components\": {\"mass\": {\"inertia\": [1, 2, \"x\"]}}}", PB_ERR_SCHEMA,
       "/components/mass/inertia/2", "number"},
      {"{\"components\": {\"mass\": {\"inertia\": [1, 1, 1, 2, 0, 0]}}}", PB_ERR_SCHEMA,
       "/components/mass/inertia", "negative principal"},
      {"{\"components\": {\"mass\": {\"k_1\": 1}}}", PB_ERR_SCHEMA, "/components/mass/k_1",
       "unknown key"},
      {"{\"components\": {\"mass\": {\"type\": \"blob\"}}}", PB_ERR_SCHEMA, "/components/mass/type",
       "rigid_body"},
      {"{\"components\": {\"apa\": {\"model\": \"nothing\"}}}", PB_ERR_REFERENCE,
       "/components/apa/model", "nothing"},
      {"{\"components\": {\"apa\": {\"k_1\": -3}}}", PB_ERR_SCHEMA, "/components/apa/k_1", "≥ 0"},
      {"{\"components\": {\"apa\": {\"c_1\": 1e31}}}", PB_ERR_SCHEMA, "/components/apa/c_1",
       "1e30"},
      {"{\"components\": {\"mass\": {\"position\": [0, 0, -1e200]}}}", PB_ERR_SCHEMA,
       "/components/mass/position/2", "1e30"},
      {"{\"models\": {\"apa300ml\": {\"k_a\": null}}}", PB_ERR_SCHEMA, "/components/apa/k_a",
       "missing"},
      {"{\"components\": {\"a.b\": {\"type\": \"rigid_body\"}}}", PB_ERR_SCHEMA, "/components/a.b",
       "dot"},
      {"{\"components\": {\"ground\": {\"type\": \"rigid_body\"}}}", PB_ERR_SCHEMA,
       "/components/ground", "ground"},
      {"{\"components\": {\"mass\": {\"quaternion\": [1, 1, 0, 0]}}}", PB_ERR_SCHEMA,
       "/components/mass/quaternion", "unit"},
      {"{\"components\": {\"mass\": {\"z_axis\": [0, 0, 0]}}}", PB_ERR_SCHEMA,
       "/components/mass/z_axis", "zero vector"},
      {"{\"components\": {\"mass\": {\"z_axis\": [1, 0, 0], \"x_axis\": [2, 0, 0]}}}",
       PB_ERR_SCHEMA, "/components/mass/x_axis", "parallel"},
      {"{\"components\": {\"mass\": {\"x_axis\": [1, 0, 0]}}}", PB_ERR_SCHEMA,
       "/components/mass/x_axis", "z_axis"},
      {"{\"components\": {\"mass\": {\"position\": [0, 0]}}}", PB_ERR_SCHEMA,
       "/components/mass/position", "3 numbers"},
      {"{\"components\": {\"mass\": {\"frames\": {\"a\": {}}}}}", PB_ERR_SCHEMA,
       "/components/mass/frames/a/position", "missing"},
      {"{\"components\": {\"mass\": {\"frames\": {\"origin\": {\"position\": [0,0,0]}}}}}",
       PB_ERR_SCHEMA, "/components/mass/frames/origin", "already"},
      {"{\"components\": {\"e\": {\"type\": \"super_element\", \"file\": \"/none.mat\"}}}",
       PB_ERR_IO, "/components/e/file", "/none.mat"},
  };
  check_mistakes(bench, list, sizeof list / sizeof *list);
}

static void test_connection_and_signal_mistakes(void **state) {
  (void)state;
  static const mistake list[] = {
      {"{\"connections\": {\"load\": {\"to\": \"moss\"}}}", PB_ERR_REFERENCE,
       "/connections/load/to", "moss"},
      {"{\"connections\": {\"load\": {\"from\": \"apa.side\"}}}", PB_ERR_REFERENCE,
       "/connections/load/from", "bottom top"},
      {"{\"connections\": {\"load\": {\"from\": \"apa\"}}}", PB_ERR_REFERENCE,
       "/connections/load/from", "origin"},
      {"{\"connections\": {\"load\": {\"from\": \"mass\"}}}", PB_ERR_REFERENCE, "/connections/load",
       "itself"},
      {"{\"connections\": {\"load\": {\"joint\": \"hinge\"}}}", PB_ERR_REFERENCE,
       "/connections/load/joint", "hinge"},
      {"{\"connections\": {\"load\": {\"joint\": {\"type\": \"hinge\"}}}}", PB_ERR_SCHEMA,
       "/connections/load/joint/type", "universal"},
      {"{\"connections\": {\"load\": {\"joint\": {\"k_f\": 1}}}}", PB_ERR_SCHEMA,
       "/connections/load/joint/k_f", "unknown key"},
      {"{\"connections\": {\"load\": {\"joint\": null}}}", PB_ERR_SCHEMA, "/connections/load/joint",
       "missing"},
      {INPUT("\"type\": \"displacement\", \"frame\": \"mass\""), PB_ERR_SCHEMA, "/inputs/0/type",
       "actuator_voltage"},
      {INPUT("\"type\": \"force\", \"frame\": \"mass\""), PB_ERR_SCHEMA, "/inputs/0/direction",
       "missing"},
      {INPUT("\"type\": \"force\", \"component\": \"mass\""), PB_ERR_SCHEMA, "/inputs/0/component",
       "unknown key"},
      {INPUT("\"type\": \"actuator_voltage\", \"component\": \"mass\""), PB_ERR_REFERENCE,
       "/inputs/0/component", "no actuator"},
      {OUTPUT("\"type\": \"sensor_voltage\", \"component\": \"none\""), PB_ERR_REFERENCE,
       "/outputs/0/component", "none"},
      {OUTPUT("\"type\": \"displacement\", \"frame\": \"mass\", \"direction\": [0, 0, 0]"),
       PB_ERR_SCHEMA, "/outputs/0/direction", "zero"},
      {"{\"outputs\": [{\"name\": \"y\", \"type\": \"sensor_voltage\", \"component\": \"apa\"}, "
       "{\"name\": \"y\", \"type\": \"sensor_voltage\", \"component\": \"apa\"}]}",
       PB_ERR_SCHEMA, "/outputs/1", "taken"},
  };
  check_mistakes(bench, list, sizeof list / sizeof *list);
}

static void test_template_mistakes(void **state) {
  (void)state;
  static const mistake list[] = {
      {"{\"template\": {\"type\": \"delta\"}}", PB_ERR_SCHEMA, "/template/type", "nano_hexapod"},
      {"{\"template\": {\"geometry\": {\"top_radius\": 0}}}", PB_ERR_SCHEMA,
       "/template/geometry/top_radius", "> 0"},
      {"{\"template\": {\"geometry\": {\"tilt\": 0}}}", PB_ERR_SCHEMA, "/template/geometry/tilt",
       "unknown"},
      {"{\"template\": {\"platform\": {\"mass\": null}}}", PB_ERR_SCHEMA, "/template/platform/mass",
       "missing"},
      {"{\"template\": {\"actuator\": \"none\"}}", PB_ERR_REFERENCE, "/template/actuator", "none"},
      {"{\"template\": {\"actuator\": \"top\"}}", PB_ERR_SCHEMA, "/models/top/type", "no actuator"},
      {"{\"template\": {\"top_joint\": 5}}", PB_ERR_SCHEMA, "/template/top_joint", "model"},
      {"{\"components\": {\"strut3\": {\"k_1\": -1}}}", PB_ERR_SCHEMA, "/components/strut3/k_1",
       "≥ 0"},
  };
  check_mistakes(hexapod, list, sizeof list / sizeof *list);
}

// A joint's model may not name joints' keys that its type lacks, wherever the value stands.
static void test_overrides(void **state) {
  (void)state;
  pb_plant *p = NULL;
  REQUIRE(parse_patched(bench, "{\"components\": {\"apa\": {\"k_1\": 5, \"g_a\": 9}}}", &p, &err));
  assert_true(p->component[0].strut.k_1 == 5);
  assert_true(p->component[0].strut.g_a == 9);
  assert_true(p->component[0].strut.k_a == 2.15e6);
  assert_true(p->sample_rate == 10000 && p->max_frequency == 0);
  pb_plant_free(p);
}

static void test_template_expands(void **state) {
  (void)state;
  pb_plant *p = NULL;
  REQUIRE(parse_patched(hexapod,
                        "{\"components\": {\"strut3\": {\"k_1\": 7}}, \"connections\": "
                        "{\"top_joint2\": {\"joint\": {\"type\": \"weld\"}}}}",
                        &p, &err));
  assert_int_equal(p->component_count, 8);
  assert_int_equal(p->connection_count, 13);
  assert_int_equal(p->input_count, 12);
  assert_int_equal(p->output_count, 18);
  assert_string_equal(p->input[0].name, "Va1");
  assert_string_equal(p->output[17].name, "Rz");
  for (size_t i = 0; i < p->component_count; i++) {
    const pb_component *c = &p->component[i];
    if (c->type != PB_APA_2DOF) continue;
    assert_true(c->strut.k_1 == (strcmp(c->name, "strut3") ? 0.3e6 : 7));
    const double *z = c->pose.rotation + 6, *y = c->pose.rotation + 3;
    ASSERT_NEAR(y[2], 0, 1e-15);  // y = ẑ × z is horizontal
    assert_true(z[2] > 0);
  }
  for (size_t i = 0; i < p->connection_count; i++)
    if (!strcmp(p->connection[i].name, "top_joint2"))
      assert_int_equal(p->connection[i].joint.type, PB_WELD);
  pb_plant_free(p);
  // A signal of the template's name takes its place, others follow.
  REQUIRE(parse_patched(hexapod,
                        "{\"inputs\": [{\"name\": \"extra\", \"type\": \"force\", \"frame\": "
                        "\"payload\", \"direction\": [0, 0, 1]}, {\"name\": \"Va2\", \"type\": "
                        "\"actuator_force\", \"component\": \"strut2\"}]}",
                        &p, &err));
  assert_int_equal(p->input_count, 13);
  assert_string_equal(p->input[1].name, "Va2");
  assert_int_equal(p->input[1].type, PB_ACTUATOR_FORCE);
  assert_string_equal(p->input[12].name, "extra");
  pb_plant_free(p);
  REQUIRE(parse_patched(hexapod, "{\"template\": {\"payload\": null}}", &p, &err));
  assert_int_equal(p->component_count, 7);
  pb_plant_free(p);
}

// The canonical text is a plant file again, and its own canonical text.
static void test_text_round_trip(void **state) {
  (void)state;
  for (int i = 0; i < 2; i++) {
    pb_plant *p = NULL, *q = NULL;
    REQUIRE(parse_patched(i ? hexapod : bench, "{}", &p, &err));
    REQUIRE(pb_plant_parse(p->text, strlen(p->text), NULL, NULL, &q, &err));
    assert_string_equal(p->text, q->text);
    pb_plant_free(p);
    pb_plant_free(q);
  }
}

static void test_orientation(void **state) {
  (void)state;
  pb_plant *p = NULL;
  // 90° about x turns z to −y and y to z.
  REQUIRE(parse_patched(bench,
                        "{\"components\": {\"mass\": {\"quaternion\": [0.70710678118654757, "
                        "0.70710678118654757, 0, 0]}}, \"connections\": {\"load\": null}}",
                        &p, &err));
  const double expected[9] = {1, 0, 0, 0, 0, 1, 0, -1, 0};
  for (int i = 0; i < 9; i++) ASSERT_NEAR(p->component[1].pose.rotation[i], expected[i], 1e-15);
  pb_plant_free(p);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_header_mistakes),
      cmocka_unit_test(test_component_mistakes),
      cmocka_unit_test(test_connection_and_signal_mistakes),
      cmocka_unit_test(test_template_mistakes),
      cmocka_unit_test(test_overrides),
      cmocka_unit_test(test_template_expands),
      cmocka_unit_test(test_text_round_trip),
      cmocka_unit_test(test_orientation),
  };
  return cmocka_run_group_tests(tests, setup, teardown);
}
