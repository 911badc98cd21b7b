// The shipped parts built from nothing: against published characteristics, against the shipped
// elements, and against elements from another program where they are at hand.
#include <sys/stat.h>

#include "base/json.h"
#include "model/model.h"
#include "part/characteristics.h"
#include "plant/element.h"
#include "support/check.h"

static const double two_pi = 6.283185307179586476925286766559;

typedef struct built {
  pb_part part;
  pb_mesh mesh;
  pb_fem fem;
  pb_reduction *element;
  size_t count;
  pb_characteristic value[PB_CHARACTERISTICS];
} built;

static void build(const char *name, built *b) {
  char path[512];
  cJSON *json = NULL;
  snprintf(path, sizeof path, "%s/parts/%s.json", PB_CONFIG, name);
  REQUIRE(pb_json_read(path, &json, NULL, &err));
  REQUIRE(pb_part_read(json, &b->part, &err));
  cJSON_Delete(json);
  REQUIRE(pb_part_mesh(&b->part, &b->mesh, &err));
  REQUIRE(pb_part_model(&b->part, &b->mesh, &b->fem, &err));
  pb_reduce_options options = {.modes = b->part.modes};
  REQUIRE(pb_reduce(&b->fem, &options, false, &b->element, &err));
  REQUIRE(pb_part_characteristics(&b->part, b->element, b->value, &b->count, &err));
}

static void clear(built *b) {
  pb_reduction_free(b->element);
  pb_fem_clear(&b->fem);
  pb_mesh_clear(&b->mesh);
  pb_part_clear(&b->part);
}

static double value_of(const pb_characteristic *value, size_t count, const char *name) {
  for (size_t i = 0; i < count; i++)
    if (!strcmp(value[i].name, name)) return value[i].value;
  fail_msg("there is no characteristic %s", name);
  return NAN;
}

static void check_published(const built *b, size_t least) {
  assert_true(b->part.published >= least);
  for (size_t i = 0; i < b->part.published; i++) {
    const pb_part_published *p = b->part.publication + i;
    double value = value_of(b->value, b->count, p->name);
    if (!(fabs(value / p->value - 1) <= 0.015))
      fail_msg("%s of %s is %g, published %g", p->name, b->part.name, value, p->value);
  }
}

// ---- two elements are the same part: dynamic stiffness at the frames ----------------------------

// D = K_bb − ω² M_bb − (ω² M_bi)(K_ii − ω² M_ii)⁻¹(ω² M_ib): whatever the modes' order, signs and
// choice within multiple ones. The modes are decoupled in K and M (fixed-interface modes).
static void dynamic_stiffness(size_t frames, size_t size, const double *k, const double *m,
                              double hz, double *d) {
  size_t nb = 6 * frames;
  double w2 = two_pi * hz * two_pi * hz;
  for (size_t j = 0; j < nb; j++) {
    for (size_t i = 0; i < nb; i++) {
      double sum = k[i + j * size] - w2 * m[i + j * size];
      for (size_t q = nb; q < size; q++)
        sum -=
            w2 * w2 * m[i + q * size] * m[j + q * size] / (k[q + q * size] - w2 * m[q + q * size]);
      d[i + j * nb] = sum;
    }
  }
}

static void check_shipped(const built *b) {
  char path[512];
  pb_element *shipped = NULL;
  const pb_reduction *r = b->element;
  snprintf(path, sizeof path, "%s/elements/%s.mat", PB_CONFIG, b->part.name);
  REQUIRE(pb_element_load(path, NULL, &shipped, &err));
  assert_int_equal(shipped->frames, r->frames);
  assert_int_equal(shipped->size, r->size);
  assert_memory_equal(shipped->position, r->position, 3 * r->frames * sizeof(double));
  size_t nb = 6 * r->frames;
  double *a = malloc(2 * nb * nb * sizeof *a), *c = a + nb * nb;
  assert_non_null(a);
  double low = r->fixed_hz[0];
  double hz[] = {0, 0.3 * low, 0.9 * low, 1.07 * low, 3.13 * low};
  for (size_t f = 0; f < sizeof hz / sizeof *hz; f++) {
    dynamic_stiffness(r->frames, r->size, r->k, r->m, hz[f], a);
    dynamic_stiffness(r->frames, shipped->size, shipped->k, shipped->m, hz[f], c);
    for (size_t j = 0; j < nb; j++)
      for (size_t i = 0; i < nb; i++)
        ASSERT_NEAR(c[i + j * nb], a[i + j * nb],
                    1e-6 * sqrt(fabs(r->k[i + i * r->size] * r->k[j + j * r->size])));
  }
  free(a);
  pb_element_free(shipped);
}

// ---- against elements from Ansys ----------------------------------------------------------------

// The same characteristics of an element read from a file.
static void check_outside(const built *b, const char *file) {
  char path[512];
  struct stat there;
  snprintf(path, sizeof path, "%s/data/%s", PB_SHARED, file);
  if (stat(path, &there)) {
    print_message("skipped: %s is not here\n", file);
    skip();
  }
  pb_element *other = NULL;
  pb_warnings warnings = {0};
  pb_characteristic value[PB_CHARACTERISTICS];
  size_t count;
  REQUIRE(pb_element_load(path, &warnings, &other, &err));
  assert_int_equal(other->frames, b->element->frames);
  pb_reduction view = {.frames = other->frames,
                       .size = other->size,
                       .position = other->position,
                       .k = other->k,
                       .m = other->m,
                       .mass = other->health.mass};
  REQUIRE(pb_part_characteristics(&b->part, &view, value, &count, &err));
  for (size_t i = 0; i < count; i++)
    if (!(fabs(b->value[i].value / value[i].value - 1) <= 0.015))
      fail_msg("%s is %g, from Ansys %g", value[i].name, b->value[i].value, value[i].value);
  for (size_t i = 0; i < 3 * other->frames; i++)
    ASSERT_NEAR(b->element->position[i], other->position[i], 2e-9);
  pb_warnings_clear(&warnings);
  pb_element_free(other);
}

static built apa300ml, apa95ml, joint;

static void test_apa300ml(void **state) {
  (void)state;
  check_published(&apa300ml, 6);
  check_shipped(&apa300ml);
}

static void test_apa95ml(void **state) {
  (void)state;
  check_published(&apa95ml, 3);
  check_shipped(&apa95ml);
}

static void test_joint(void **state) {
  (void)state;
  check_published(&joint, 5);
  check_shipped(&joint);
}

static void test_apa300ml_outside(void **state) {
  (void)state;
  check_outside(&apa300ml, "APA300ML.mat");
}

static void test_joint_outside(void **state) {
  (void)state;
  check_outside(&joint, "flexor_025.mat");
}

// Frame 1 of the joint is the end of positive z, and the one whose neck yields along x: the middle
// follows it along y.
static void test_joint_ends(void **state) {
  (void)state;
  const pb_reduction *r = joint.element;
  double along_x = r->m[0], along_y = r->m[1 + r->size], tilt = r->m[0 + 4 * r->size];
  assert_true(along_y > 2 * along_x);
  assert_true(tilt > 0);  // m z of its mass: u_x = z r_y
}

// An element's rigid motions cost nothing.
static void test_rigid_motions(void **state) {
  (void)state;
  const built *all[] = {&apa300ml, &apa95ml, &joint};
  for (int i = 0; i < 3; i++) {
    const pb_reduction *r = all[i]->element;
    pb_element *element = NULL;
    REQUIRE(pb_element_new("element", r->frames, r->size, r->position, r->k, r->m, NULL, &element,
                           &err));
    ASSERT_NEAR(element->health.rigid_hz, 0, 0.1);
    assert_true(element->health.flexible_hz > 900);
    ASSERT_RELATIVE(element->health.mass, r->full_mass, 1e-9);
    pb_element_free(element);
  }
}

// Rigid ties are stiffer than averaged ones.
static void test_rigid_tie(void **state) {
  (void)state;
  for (size_t i = 0; i < joint.fem.frames; i++) joint.fem.frame[i].tie = PB_TIE_RIGID;
  pb_reduction *rigid = NULL;
  pb_reduce_options options = {.modes = 6};
  pb_characteristic value[PB_CHARACTERISTICS];
  size_t count;
  REQUIRE(pb_reduce(&joint.fem, &options, false, &rigid, &err));
  REQUIRE(pb_part_characteristics(&joint.part, rigid, value, &count, &err));
  double torsion = value_of(value, count, "torsion_stiffness");
  assert_true(torsion > 1.1 * value_of(joint.value, joint.count, "torsion_stiffness"));
  pb_reduction_free(rigid);
}

// ---- shipped plants of these elements
// ------------------------------------------------------------

static pb_model *load_plant(const char *name, size_t states) {
  char path[512];
  pb_warnings warnings = {0};
  pb_model *model = NULL;
  snprintf(path, sizeof path, "%s/plants/%s.json", PB_CONFIG, name);
  REQUIRE(pb_model_load(path, &warnings, &model, &err));
  assert_int_equal(warnings.count, 0);
  assert_int_equal(model->nx, states);
  return model;
}

// The lowest frequency among a plant's poles, Hz.
static double first_hz(const pb_model *model) {
  double complex *pole = malloc(model->nx * sizeof *pole);
  double lowest = INFINITY;
  assert_non_null(pole);
  REQUIRE(pb_model_poles(model, PB_CONTINUOUS, pole, &err));
  for (size_t i = 0; i < model->nx; i++) {
    assert_true(creal(pole[i]) < 0);
    lowest = fmin(lowest, cabs(pole[i]) / two_pi);
  }
  free(pole);
  return lowest;
}

// Against what the element from Ansys gives with the same load (published: pole 93.92 Hz, y/V_a
// 1.048 µm/V), and the APA95ML's load on its own stiffness.
static void test_benches(void **state) {
  (void)state;
  pb_model *model = load_plant("apa300ml-bench-element", 122);
  double gain[4];
  assert_true(model->nu == 2 && model->ny == 2);
  ASSERT_RELATIVE(first_hz(model), 93.92, 0.015);
  REQUIRE(pb_model_dc(model, gain, &err));
  ASSERT_RELATIVE(gain[2], 1.048e-6, 0.015);  // row of y, column of Va
  pb_model_free(model);
  model = load_plant("apa95ml-bench", 122);
  double stiffness = value_of(apa95ml.value, apa95ml.count, "axial_stiffness");
  // Guided: a little stiffer than with its top free to tilt; half of its mass moves along.
  ASSERT_RELATIVE(first_hz(model), sqrt(stiffness / (5.7 + 0.5 * 0.156)) / two_pi, 0.03);
  pb_model_free(model);
}

static void test_hexapod(void **state) {
  (void)state;
  pb_model *model = load_plant("nano-hexapod-element-joints", 252);
  double soft = first_hz(model);
  pb_model_free(model);
  char path[512];
  pb_model *simple = NULL;  // joints of the same stiffnesses
  snprintf(path, sizeof path, "%s/plants/nano-hexapod.json", PB_CONFIG);
  REQUIRE(pb_model_load(path, NULL, &simple, &err));
  ASSERT_RELATIVE(soft, first_hz(simple), 0.05);
  pb_model_free(simple);
}

static int set_up(void **state) {
  (void)state;
  build("apa300ml", &apa300ml);
  build("apa95ml", &apa95ml);
  build("flexible-joint", &joint);
  return 0;
}

static int tear_down(void **state) {
  (void)state;
  clear(&apa300ml);
  clear(&apa95ml);
  clear(&joint);
  return 0;
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_apa300ml),      cmocka_unit_test(test_apa95ml),
      cmocka_unit_test(test_joint),         cmocka_unit_test(test_apa300ml_outside),
      cmocka_unit_test(test_joint_outside), cmocka_unit_test(test_joint_ends),
      cmocka_unit_test(test_rigid_motions), cmocka_unit_test(test_rigid_tie),
      cmocka_unit_test(test_benches),       cmocka_unit_test(test_hexapod),
  };
  return cmocka_run_group_tests(tests, set_up, tear_down);
}
