// Actuators and joints in figures, against closed forms: the 2-DoF actuator, a beam as a joint,
// bars as an amplified actuator of amplification 1; piezo constants; specifications.
#include "base/json.h"
#include "study/actuator_character.h"
#include "study/actuator_piezo.h"
#include "study/element_limits.h"
#include "study/joint_character.h"
#include "support/beam.h"
#include "support/check.h"

static const double pi = 3.14159265358979323846;
static const pb_stack_nominal nominal = {.stroke = 20e-6, .length = 0.02};

static pb_element_source source_of(const char *path, const char *name, pb_element_wanted *wanted) {
  pb_element_source source = {0};
  char *text = NULL;
  cJSON *file = NULL;
  REQUIRE(pb_json_read(path, &file, &text, &err));
  REQUIRE(pb_element_source_plant(text, path, PB_CONFIG "/plants", name, wanted, &source, &err));
  cJSON_Delete(file);
  free(text);
  return source;
}

// k = k_1 + k_a k_e/(k_a + k_e); y/V_a = g_a k_e/(k_1 k_a + k_1 k_e + k_a k_e); under a force the
// sensor stack stretches by F/k · k_a/(k_a + k_e).
static void the_2dof_actuator(void **state) {
  (void)state;
  pb_element_source source =
      source_of(PB_CONFIG "/plants/apa300ml-bench.json", NULL, pb_element_is_actuator);
  pb_actuator_character c;
  pb_bench_model bench = {0};
  const double k1 = 0.3e6, ka = 2.15e6, ke = 4.3e6, k = k1 + ka * ke / (ka + ke);
  const double y = 2.7 * ke / (k1 * ka + k1 * ke + ka * ke);
  REQUIRE(pb_actuator_characterize(&source, &nominal, NULL, &bench, &c, &err));
  ASSERT_RELATIVE(c.stiffness, k, 1e-9);
  ASSERT_RELATIVE(c.stiffness, 1.733e6, 1e-3);  // Table 2.2
  ASSERT_RELATIVE(c.voltage_gain, y, 1e-9);
  ASSERT_RELATIVE(c.sensor_gain, -0.53e6 * k1 / ke * y, 1e-9);
  ASSERT_RELATIVE(c.sensor_of_force, 0.53e6 / k * ka / (ka + ke), 1e-9);
  ASSERT_RELATIVE(c.resonance, sqrt(k / 0.056) / (2 * pi), 1e-2);  // the inner mass apart
  ASSERT_NEAR(c.height, 0.03, 1e-12);
  ASSERT_NEAR(c.mass, 0.113, 1e-12);
  assert_true(isnan(c.amplification) && isnan(c.stroke) && isnan(c.stack_stiffness));
  pb_bench_model_clear(&bench);
  pb_element_source_clear(&source);
}

// ---- a column of four bars along z: bottom, two actuator stacks in one, sensor stack, top
// --------

enum { PARTS = 4, FRAMES = PARTS + 1, SIZE = 6 * FRAMES };
static const beam column = {
    .length = 0.08, .ea = 4.7e6, .ei = 40, .gj = 30, .mass = 0.1, .polar_inertia = 2e-6};

static void write_column(char *file, size_t size) {
  static double k[SIZE * SIZE], m[SIZE * SIZE], position[3 * FRAMES];
  snprintf(file, size, "/tmp/pb-column-%d.mat", (int)getpid());
  beam_chain(&column, PARTS, k, m, position);
  assert_int_equal(beam_write(file, FRAMES, SIZE, k, m, position), 0);
}

static void an_element_with_stacks(void **state) {
  (void)state;
  char file[64];
  write_column(file, sizeof file);
  pb_element_source source = {0};
  pb_actuator_layout layout = pb_actuator_layout_default();
  const pb_actuator_layout along = {.ends = {1, 5},
                                    .actuator = {2, 3},
                                    .sensor = {3, 4},
                                    .axis = {0, 0, 1},
                                    .polarity = 1,
                                    .g_a = layout.g_a,
                                    .g_s = layout.g_s,
                                    .modal_damping = 0.01};
  REQUIRE(pb_element_source_actuator(file, &along, &source, &err));
  pb_actuator_character c;
  pb_bench_model bench = {0};
  REQUIRE(pb_actuator_characterize(&source, &nominal, NULL, &bench, &c, &err));
  const double part = column.ea / (column.length / PARTS);
  ASSERT_RELATIVE(c.stiffness, part / PARTS, 1e-6);
  ASSERT_RELATIVE(c.stack_stiffness, part, 1e-6);
  // A force in the middle lifts the top by just what the stacks stretch.
  ASSERT_RELATIVE(c.amplification, 1, 1e-6);
  assert_int_equal(c.stacks, 2);
  ASSERT_RELATIVE(c.stroke, 2 * 20e-6, 1e-6);
  ASSERT_RELATIVE(c.blocked_force, 2 * 20e-6 * part / PARTS, 1e-6);
  ASSERT_RELATIVE(c.mass, column.mass, 1e-9);
  ASSERT_NEAR(c.height, column.length, 1e-12);
  ASSERT_RELATIVE(c.voltage_gain, layout.g_a / part, 1e-6);
  // A bar fixed at one end: ¼ √(EA/(μ L²)) Hz, with consistent masses of four parts 0.6 % above.
  ASSERT_RELATIVE(c.resonance, 0.25 * sqrt(column.ea / column.mass / column.length), 1e-2);
  pb_bench_model_clear(&bench);
  pb_element_source_clear(&source);
  unlink(file);
}

// The bench is a plant file of its own, in which the names of the stacks' frames stand.
static void names_of_frames_are_quoted(void **state) {
  (void)state;
  char file[64], text[1000];
  write_column(file, sizeof file);
  snprintf(text, sizeof text,
           "{\"models\":{\"a\":{\"type\":\"super_element\",\"file\":\"%s\",\"ends\":[1,5],"
           "\"modal_damping\":0.01,\"g_a\":20,\"frames\":{\"low \\\"\\\\\":{\"node\":2}},"
           "\"stacks\":{\"actuator\":{\"frames\":[\"low \\\"\\\\\",\"3\"],\"axis\":[0,0,1]}}}}}",
           file);
  pb_element_source source;
  pb_actuator_character c;
  pb_bench_model bench = {0};
  REQUIRE(
      pb_element_source_plant(text, "p.json", NULL, "a", pb_element_is_actuator, &source, &err));
  REQUIRE(pb_actuator_characterize(&source, &nominal, NULL, &bench, &c, &err));
  ASSERT_RELATIVE(c.amplification, 1, 1e-6);
  pb_bench_model_clear(&bench);
  pb_element_source_clear(&source);
  unlink(file);
}

// ---- a beam as a joint --------------------------------------------------------------------------

// Cantilever: F L³/3EI, M L/EI, F L/EA, M L/GJ; bending and shear are coupled by √3/2.
static void a_beam_is_a_joint(void **state) {
  (void)state;
  char file[64];
  write_column(file, sizeof file);
  const size_t nodes[2] = {1, 5};
  pb_element_source source = {0};
  pb_joint_character c;
  pb_bench_model bench = {0};
  const double l = column.length;
  REQUIRE(pb_element_source_joint(file, nodes, 0.01, &source, &err));
  REQUIRE(pb_joint_characterize(&source, NULL, &bench, &c, &err));
  for (int i = 0; i < 2; i++) {
    ASSERT_RELATIVE(c.k[i], 3 * column.ei / (l * l * l), 1e-6);
    ASSERT_RELATIVE(c.k[3 + i], column.ei / l, 1e-6);
  }
  ASSERT_RELATIVE(c.k[2], column.ea / l, 1e-6);
  ASSERT_RELATIVE(c.k[5], column.gj / l, 1e-6);
  ASSERT_RELATIVE(c.coupling, sqrt(3) / 2, 1e-6);
  ASSERT_RELATIVE(c.mass, column.mass, 1e-9);
  // (1.8751)² √(EI/(μ L⁴))/2π
  ASSERT_RELATIVE(c.resonance,
                  1.87510407 * 1.87510407 / (2 * pi) * sqrt(column.ei / column.mass / (l * l * l)),
                  2e-3);
  pb_bench_model_clear(&bench);
  pb_element_source_clear(&source);
  unlink(file);
}

static void a_lumped_joint(void **state) {
  (void)state;
  pb_element_source source = {0};
  pb_joint_character c;
  pb_bench_model bench = {0};
  static const char plant[] =
      "{\"models\":{\"a\":{\"type\":\"spherical_axial\",\"k_f\":5,\"k_t\":260,\"k_a\":94e6},"
      "\"b\":{\"type\":\"universal\"}}}";
  pb_error refusal = {0};
  assert_int_equal(
      pb_element_source_plant(plant, "p.json", NULL, NULL, pb_element_is_joint, &source, &refusal),
      PB_ERR_REFERENCE);
  assert_non_null(strstr(refusal.message, "a b"));
  REQUIRE(pb_element_source_plant(plant, "p.json", NULL, "a", pb_element_is_joint, &source, &err));
  REQUIRE(pb_joint_characterize(&source, NULL, &bench, &c, &err));
  assert_true(isinf(c.k[0]) && isinf(c.k[1]));
  ASSERT_RELATIVE(c.k[2], 94e6, 1e-9);
  ASSERT_RELATIVE(c.k[3], 5, 1e-9);
  ASSERT_RELATIVE(c.k[5], 260, 1e-9);
  assert_true(isnan(c.resonance));
  pb_bench_model_clear(&bench);
  pb_element_source_clear(&source);
}

// ---- constants and specifications ---------------------------------------------------------------

static void piezo_constants(void **state) {
  (void)state;
  pb_piezo p = pb_piezo_default();
  ASSERT_RELATIVE(pb_piezo_force_constant(&p), 26.1, 1e-3);
  ASSERT_RELATIVE(pb_piezo_sensor_constant(&p), 5.06e6, 1e-3);
  ASSERT_RELATIVE(pb_piezo_stiffness(&p), 240e6, 1e-12);
  p.layers *= 2;
  ASSERT_RELATIVE(pb_piezo_force_constant(&p), 52.2, 1e-3);
  ASSERT_RELATIVE(pb_piezo_sensor_constant(&p), 2.53e6, 1e-3);
}

static const char *const known[] = {"stroke", "stiffness", "height", NULL};

static pb_status read_limits(const char *text, pb_limits *out, pb_error *err) {
  cJSON *file = cJSON_Parse(text);
  assert_non_null(file);
  pb_status st = pb_limits_read(file, known, out, err);
  cJSON_Delete(file);
  return st;
}

#define SPEC(limits) \
  "{\"schema\":\"plantbus.specification/1\",\"name\":\"s\",\"limits\":" limits "}"

static void limits_judge(void **state) {
  (void)state;
  pb_limits l;
  double margin;
  REQUIRE(
      read_limits(SPEC("{\"stroke\":{\"above\":1e-4},\"stiffness\":{\"about\":1e6,\"factor\":2},"
                       "\"height\":{\"above\":0.01,\"below\":0.05}}"),
                  &l, &err));
  assert_int_equal(l.count, 3);
  const struct {
    int limit;
    double value;
    pb_verdict verdict;
    double margin;
  } cases[] = {
      {0, 1.5e-4, PB_MET, 0.5},
      {0, 1e-4, PB_MISSED, 0},
      {0, 9.4e-5, PB_MISSED, -0.06},
      {0, NAN, PB_UNKNOWN, NAN},
      {1, 2e6, PB_MET, 0},
      {1, 0.5e6, PB_MET, 0},
      {1, 2.2e6, PB_MISSED, -0.1},
      {2, 0.04, PB_MET, 0.2},
      {2, 0.06, PB_MISSED, -0.2},
      {2, 0.009, PB_MISSED, -0.1},
      {0, INFINITY, PB_MET, INFINITY},
  };
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    assert_int_equal(pb_limit_judge(&l.limit[cases[i].limit], cases[i].value, &margin),
                     cases[i].verdict);
    if (isinf(cases[i].margin))
      assert_true(margin == INFINITY);
    else if (isnan(cases[i].margin))
      assert_true(isnan(margin));
    else
      ASSERT_NEAR(margin, cases[i].margin, 1e-9);
  }
  pb_limits_clear(&l);
}

static void wrong_specifications_are_refused(void **state) {
  (void)state;
  static const struct {
    const char *text, *where;
  } cases[] = {
      {SPEC("{}"), "/limits"},
      {SPEC("{\"colour\":{\"above\":1}}"), "/limits/colour"},
      {SPEC("{\"stroke\":{}}"), "/limits/stroke"},
      {SPEC("{\"stroke\":{\"about\":1}}"), "/limits/stroke"},
      {SPEC("{\"stroke\":{\"about\":1,\"factor\":0.5}}"), "/limits/stroke"},
      {SPEC("{\"stroke\":{\"above\":1,\"factor\":2}}"), "/limits/stroke"},
      {SPEC("{\"stroke\":{\"above\":2,\"below\":1}}"), "/limits/stroke"},
      {SPEC("{\"stroke\":{\"over\":2}}"), "/limits/stroke/over"},
      {"{\"schema\":\"x\",\"name\":\"s\",\"limits\":{\"stroke\":{\"above\":1}}}", "/schema"},
  };
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    pb_limits l;
    pb_error refusal = {0};
    if (read_limits(cases[i].text, &l, &refusal) != PB_ERR_SCHEMA)
      fail_msg("accepted: %s", cases[i].text);
    assert_string_equal(refusal.where, cases[i].where);
    assert_null(l.limit);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(the_2dof_actuator),
      cmocka_unit_test(an_element_with_stacks),
      cmocka_unit_test(names_of_frames_are_quoted),
      cmocka_unit_test(a_beam_is_a_joint),
      cmocka_unit_test(a_lumped_joint),
      cmocka_unit_test(piezo_constants),
      cmocka_unit_test(limits_judge),
      cmocka_unit_test(wrong_specifications_are_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
