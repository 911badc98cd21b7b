// Assembly: beams against textbook formulas, constraints, massless motions, refusals by name.
#include "support/beam.h"
#include "support/check.h"

#include "assembly/system.h"
#include "base/lapack.h"
#include "model/model.h"

static const beam steel = {
    .length = 0.1, .ea = 2e7, .ei = 50, .gj = 40, .mass = 0.08, .polar_inertia = 2e-6};
static char beam_file[64];

static int setup(void **state) {
  (void)state;
  double k[9 * 36], m[9 * 36], position[9];
  snprintf(beam_file, sizeof beam_file, "/tmp/pb-beam-%ld.mat", (long)getpid());
  beam_chain(&steel, 2, k, m, position);
  return beam_write(beam_file, 3, 18, k, m, position);
}

static int teardown(void **state) {
  (void)state;
  unlink(beam_file);
  return 0;
}

// Parses {"schema", "name", …body} and assembles.
static pb_status assemble(const char *body, pb_plant **plant, pb_system **system,
                          pb_warnings *warnings, pb_error *err) {
  char text[4096];
  int n =
      snprintf(text, sizeof text, "{\"schema\": \"plantbus.plant/1\", \"name\": \"t\", %s}", body);
  assert_true(n > 0 && (size_t)n < sizeof text);
  *system = NULL;
  pb_status st = pb_plant_parse(text, (size_t)n, NULL, warnings, plant, err);
  return st ? st : pb_system_assemble(*plant, warnings, system, err);
}

static void dispose(pb_plant *p, pb_system *s) {
  pb_system_free(s);
  pb_plant_free(p);
}

// Static compliance of output o to input i: Y_0 K⁻¹ F + D.
static double compliance(const pb_system *s, size_t o, size_t i) {
  int n = (int)s->n, one = 1, info;
  double *k = malloc(s->n * s->n * sizeof *k), *x = malloc(s->n * sizeof *x), sum;
  int *pivot = malloc(s->n * sizeof *pivot);
  memcpy(k, s->k, s->n * s->n * sizeof *k);
  memcpy(x, s->f + i * s->n, s->n * sizeof *x);
  dgesv_(&n, &one, k, &n, pivot, x, &n, &info);
  assert_int_equal(info, 0);
  sum = s->d[o + i * s->ny];
  for (size_t j = 0; j < s->n; j++) sum += s->y0[o + j * s->ny] * x[j];
  free(k), free(x), free(pivot);
  return sum;
}

#define SIGNALS(frame, direction)                                                  \
  "\"inputs\": [{\"name\": \"F\", \"type\": \"force\", \"frame\": \"" frame        \
  "\", \"direction\": " direction "}], \"outputs\": [{\"name\": \"x\", \"type\": " \
  "\"displacement\", \"frame\": \"" frame "\", \"direction\": " direction "}]"

// A cantilever in any orientation bends by F L³ / (3 E I) and stretches by F L / (E A).
static void test_cantilever(void **state) {
  (void)state;
  static const char *const cases[][2] = {
      {"\"position\": [1, 2, 3]", "[0, 1, 0]"},
      {"\"position\": [1, 2, 3]", "[0, 0, 1]"},
      {"\"z_axis\": [0.6, 0, 0.8]", "[0.8, 0, -0.6]"},
      {"\"z_axis\": [0.6, 0, 0.8]", "[0.6, 0, 0.8]"},
      {"\"quaternion\": [0.5, 0.5, 0.5, 0.5]", "[1, 0, 0]"},
      {"\"quaternion\": [0.5, 0.5, 0.5, 0.5]", "[0, 1, 0]"},
  };
  static const int axial[] = {0, 1, 0, 1, 1, 0};
  double l = steel.length;
  for (size_t i = 0; i < 6; i++) {
    char body[2048];
    pb_plant *p;
    pb_system *s;
    snprintf(body, sizeof body,
             "\"components\": {\"beam\": {\"type\": \"super_element\", \"file\": \"%s\", %s}}, "
             "\"connections\": {\"wall\": {\"from\": \"ground\", \"to\": \"beam.1\", \"joint\": "
             "{\"type\": \"weld\"}}}, " SIGNALS("beam.3", "%s"),
             beam_file, cases[i][0], cases[i][1], cases[i][1]);
    REQUIRE(assemble(body, &p, &s, NULL, &err));
    assert_int_equal(s->n, 12);
    double expected = axial[i] ? l / steel.ea : l * l * l / (3 * steel.ei);
    ASSERT_RELATIVE(compliance(s, 0, 0), expected, 1e-9);
    dispose(p, s);
  }
}

// A force at an offset frame turns the tip too: with arm a along z, u = F (L³/3 + L² a + L a²)/EI.
static void test_offset_frame(void **state) {
  (void)state;
  char body[2048];
  pb_plant *p;
  pb_system *s;
  snprintf(body, sizeof body,
           "\"components\": {\"beam\": {\"type\": \"super_element\", \"file\": \"%s\", \"frames\": "
           "{\"tip\": {\"node\": 3, \"offset\": [0, 0, 0.02]}}}}, \"connections\": {\"wall\": "
           "{\"from\": \"ground\", \"to\": \"beam.1\", \"joint\": {\"type\": \"weld\"}}}, " SIGNALS(
               "beam.tip", "[1, 0, 0]"),
           beam_file);
  REQUIRE(assemble(body, &p, &s, NULL, &err));
  double l = steel.length, a = 0.02;
  ASSERT_RELATIVE(compliance(s, 0, 0), (l * l * l / 3 + l * l * a + l * a * a) / steel.ei, 1e-9);
  dispose(p, s);
}

#define BODY(name, extra) \
  "\"" name "\": {\"type\": \"rigid_body\", \"mass\": 2, \"inertia\": [0.1, 0.2, 0.3]" extra "}"
#define JOINT(name, from, to, joint) \
  "\"" name "\": {\"from\": \"" from "\", \"to\": \"" to "\", \"joint\": " joint "}"

// Each joint type leaves the degrees of freedom that it names.
static void test_joint_freedoms(void **state) {
  (void)state;
  static const struct {
    const char *type;
    size_t dof;
  } cases[] = {{"universal", 2},       {"spherical", 3}, {"universal_axial", 3},
               {"spherical_axial", 4}, {"bushing", 6},   {"prismatic", 1}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    char body[1024];
    pb_plant *p;
    pb_system *s;
    snprintf(body, sizeof body,
             "\"components\": {" BODY("a", "") "}, \"connections\": {" JOINT(
                 "j", "ground", "a", "{\"type\": \"%s\"}") "}, " SIGNALS("a", "[0, 0, 1]"),
             cases[i].type);
    REQUIRE(assemble(body, &p, &s, NULL, &err));
    assert_int_equal(s->n, cases[i].dof);
    dispose(p, s);
  }
}

// The joint's axes are the connection's: an axial spring along a tilted z pulls along it.
static void test_joint_axes(void **state) {
  (void)state;
  pb_plant *p;
  pb_system *s;
  REQUIRE(assemble(
      "\"components\": {" BODY(
          "a", "") "}, \"connections\": {\"j\": {\"from\": "
                   "\"ground\", \"to\": \"a\", \"z_axis\": [0.6, 0, 0.8], \"joint\": {\"type\": "
                   "\"prismatic\", \"k_a\": 1000}}}, " SIGNALS("a", "[1, 0, 0]"),
      &p, &s, NULL, &err));
  assert_int_equal(s->n, 1);
  ASSERT_RELATIVE(compliance(s, 0, 0), 0.36 / 1000, 1e-12);
  dispose(p, s);
}

// Welding two bodies twice is redundant, not singular; their mass adds up.
static void test_redundant_constraints(void **state) {
  (void)state;
  pb_plant *p;
  pb_system *s;
  pb_warnings w = {0};
  REQUIRE(assemble(
      "\"components\": {" BODY("a", "") ", " BODY("b", "") "}, \"connections\": {" JOINT(
          "one", "a", "b",
          "{\"type\": \"weld\"}") ", " JOINT("two", "b", "a",
                                             "{\"type\": \"weld\"}") ", " JOINT("z", "ground", "a",
                                                                                "{\"type\": "
                                                                                "\"prismatic\","
                                                                                " \"k_a\": "
                                                                                "100}") "},"
                                                                                        " " SIGNALS(
                                                                                            "b",
                                                                                            "[0, "
                                                                                            "0, "
                                                                                            "1]"),
      &p, &s, &w, &err));
  assert_int_equal(s->n, 1);
  assert_int_equal(w.count, 0);
  ASSERT_RELATIVE(s->m[0] / (s->f[0] * s->f[0]), 4, 1e-12);
  dispose(p, s);
  pb_warnings_clear(&w);
}

static void refuse(const char *body, pb_status code, const char *where, const char *part) {
  pb_plant *p = NULL;
  pb_system *s = NULL;
  pb_error err = {0};
  pb_status st = assemble(body, &p, &s, NULL, &err);
  if (st != code || strcmp(err.where, where) || !strstr(err.message, part))
    fail_msg("gave %s at \"%s\": %s; expected %s at \"%s\" …%s…", pb_status_name(st), err.where,
             err.message, pb_status_name(code), where, part);
  assert_null(s);
  pb_plant_free(p);
}

static void test_refusals(void **state) {
  (void)state;
  refuse("\"components\": {" BODY("a", "") ", " BODY(
             "b",
             ", \"position\": [0, 0, 2e-6]") "}, "
                                             "\"connections\": {" JOINT(
                                                 "gap", "a", "b",
                                                 "{\"type\": \"weld\"}") "}, " SIGNALS("a",
                                                                                       "[0, 0, 1]"),
         PB_ERR_GEOMETRY, "/connections/gap", "0.002 mm");
  refuse("\"components\": {" BODY("a", "") "}, \"connections\": {" JOINT(
             "fixed", "ground", "a", "{\"type\": \"weld\"}") "}, " SIGNALS("a", "[0, 0, 1]"),
         PB_ERR_SINGULAR, "/connections", "no degree of freedom");
  refuse(
      "\"components\": {" BODY(
          "a", "") ", \"ghost\": {\"type\": \"rigid_body\", \"mass\": 0, "
                   "\"inertia\": [0, 0, 0]}}, \"connections\": {" JOINT(
                       "z", "ground", "a",
                       "{\"type\": \"prismatic\", \"k_a\": 100}") ", " JOINT("g", "a", "ghost",
                                                                             "{\"type\": "
                                                                             "\"prismatic\""
                                                                             "}") "},"
                                                                                  " " SIGNALS(
                                                                                      "a",
                                                                                      "[0, 0, 1]"),
      PB_ERR_SINGULAR, "/components/ghost", "without mass and without stiffness");
}

// Two springs in series with a massless link between them, up to its signals.
// clang-format off
#define LINKED_SPRINGS                                                                             \
  "\"components\": {" BODY("a", "") ", \"link\": {\"type\": \"rigid_body\", \"mass\": 0, "            \
  "\"inertia\": [0, 0, 0]}}, \"connections\": {"                                                   \
  JOINT("lower", "ground", "link", "{\"type\": \"prismatic\", \"k_a\": 300}") ", "                 \
  JOINT("upper", "link", "a", "{\"type\": \"prismatic\", \"k_a\": 600}") "}, "
#define ALONG_Z(name, type, frame)                                                                 \
  "{\"name\": \"" name "\", \"type\": \"" type "\", \"frame\": \"" frame "\", \"direction\": [0, 0, 1]}"
// clang-format on

// Two springs in series with a massless body between them: k/2, and one degree of freedom.
static void test_massless_is_condensed(void **state) {
  (void)state;
  pb_plant *p;
  pb_system *s;
  REQUIRE(assemble(
      LINKED_SPRINGS "\"inputs\": [" ALONG_Z("F", "force", "a") ", " ALONG_Z(
          "L", "force", "link") "], \"outputs\": [" ALONG_Z("x", "displacement",
                                                            "a") ", " ALONG_Z("l", "displacement",
                                                                              "link") "]",
      &p, &s, NULL, &err));
  assert_int_equal(s->n, 1);
  ASSERT_RELATIVE(compliance(s, 0, 0), 1 / 200.0, 1e-12);
  ASSERT_RELATIVE(compliance(s, 0, 1), 1 / 300.0, 1e-12);
  ASSERT_RELATIVE(compliance(s, 1, 0), 1 / 300.0, 1e-12);
  ASSERT_RELATIVE(compliance(s, 1, 1), 1 / 300.0, 1e-12);
  dispose(p, s);
}

// More outputs than degrees of freedom before the condensation.
static void test_massless_with_many_outputs(void **state) {
  (void)state;
  enum { outputs = 12 };
  char body[4096];
  int n = snprintf(body, sizeof body,
                   LINKED_SPRINGS "\"inputs\": [" ALONG_Z("F", "force", "a") "], \"outputs\": [");
  for (int i = 0; i < outputs; i++)
    n += snprintf(body + n, sizeof body - (size_t)n,
                  "%s{\"name\": \"y%d\", \"type\": \"displacement\", \"frame\": \"%s\", "
                  "\"direction\": [0, 0, 1]}",
                  i ? ", " : "", i, i % 2 ? "link" : "a");
  snprintf(body + n, sizeof body - (size_t)n, "]");
  pb_plant *p;
  pb_system *s;
  REQUIRE(assemble(body, &p, &s, NULL, &err));
  assert_int_equal(s->n, 1);
  for (size_t i = 0; i < outputs; i++)
    ASSERT_RELATIVE(compliance(s, i, 0), i % 2 ? 1 / 300.0 : 1 / 200.0, 1e-12);
  dispose(p, s);
}

// An element as a joint between frames a beam's length apart; the other way round does not fit.
static void test_element_joint(void **state) {
  (void)state;
  char body[2048];
  static const char *const form = "\"components\": {" BODY(
      "a", ", \"position\": [0, 0, 0.1]") ", \"foot\": {\"type\": "
                                          "\"rigid_body\", \"mass\": 1, \"inertia\": [1, 1, 1]}}, "
                                          "\"connections\": {\"f\": {\"from\": "
                                          "\"ground\", \"to\": \"foot\", \"joint\": {\"type\": "
                                          "\"weld\"}}, \"j\": {\"from\": \"foot\", "
                                          "\"to\": \"a\", \"joint\": {\"type\": \"super_element\", "
                                          "\"file\": \"%s\", \"nodes\": [%s]}}}, " SIGNALS(
                                              "a", "[1, 0, 0]");
  pb_plant *p;
  pb_system *s;
  snprintf(body, sizeof body, form, beam_file, "1, 3");
  REQUIRE(assemble(body, &p, &s, NULL, &err));
  assert_int_equal(s->n, 12);
  double l = steel.length;
  ASSERT_RELATIVE(compliance(s, 0, 0), l * l * l / (3 * steel.ei), 1e-9);
  dispose(p, s);
  snprintf(body, sizeof body, form, beam_file, "3, 1");
  refuse(body, PB_ERR_GEOMETRY, "/connections/j", "200 mm");
}

// The 2-DoF actuator with 5 kg: numbers of physics.md ("Table 2.2" row).
static void test_actuator_numbers(void **state) {
  (void)state;
  pb_model *m;
  REQUIRE(pb_model_load(PB_CONFIG "/plants/apa300ml-bench.json", NULL, &m, &err));
  double gain[4];
  REQUIRE(pb_model_dc(m, gain, &err));
  assert_int_equal(m->nx, 4);
  ASSERT_RELATIVE(gain[0], -0.0384, 1e-3);
  ASSERT_RELATIVE(gain[2], 1.038e-6, 1e-3);
  ASSERT_RELATIVE(1 / gain[3], 1.733e6, 1e-3);
  ASSERT_RELATIVE(m->mode_hz[0], 93.2, 1e-3);
  pb_model_free(m);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_cantilever),
      cmocka_unit_test(test_offset_frame),
      cmocka_unit_test(test_joint_freedoms),
      cmocka_unit_test(test_joint_axes),
      cmocka_unit_test(test_redundant_constraints),
      cmocka_unit_test(test_refusals),
      cmocka_unit_test(test_massless_is_condensed),
      cmocka_unit_test(test_massless_with_many_outputs),
      cmocka_unit_test(test_element_joint),
      cmocka_unit_test(test_actuator_numbers),
  };
  return cmocka_run_group_tests(tests, setup, teardown);
}
