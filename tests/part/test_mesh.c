// Meshes of parts: elements against closed forms, shapes against their published volumes, matrices
// against the motions of rigid bodies.
#include <float.h>

#include "base/json.h"
#include "part/part.h"
#include "support/check.h"

static const double pi = 3.14159265358979323846;
static const pb_material steel = {200e9, 0.3, 7800};

static pb_part load(const char *name) {
  char path[512];
  snprintf(path, sizeof path, "%s/parts/%s.json", PB_CONFIG, name);
  cJSON *json = NULL;
  pb_part part;
  REQUIRE(pb_json_read(path, &json, NULL, &err));
  REQUIRE(pb_part_read(json, &part, &err));
  cJSON_Delete(json);
  return part;
}

// A distorted brick: every node moved by a smooth map.
static void brick(double xyz[20][3]) {
  static const double at[20][3] = {{-1, -1, -1}, {1, -1, -1}, {1, 1, -1}, {-1, 1, -1}, {-1, -1, 1},
                                   {1, -1, 1},   {1, 1, 1},   {-1, 1, 1}, {0, -1, -1}, {1, 0, -1},
                                   {0, 1, -1},   {-1, 0, -1}, {0, -1, 1}, {1, 0, 1},   {0, 1, 1},
                                   {-1, 0, 1},   {-1, -1, 0}, {1, -1, 0}, {1, 1, 0},   {-1, 1, 0}};
  for (int i = 0; i < 20; i++) {
    double x = at[i][0], y = at[i][1], z = at[i][2];
    xyz[i][0] = 1e-3 * (2 * x + 0.3 * y * z + 0.1 * y * y);
    xyz[i][1] = 1e-3 * (1.5 * y + 0.2 * x * z);
    xyz[i][2] = 1e-3 * (z + 0.1 * x - 0.1 * x * x);
  }
}

static void test_shape_functions(void **state) {
  (void)state;
  double at[3] = {0.3, -0.7, 0.45}, n[20], dn[20][3], sum = 0, slope[3] = {0};
  pb_hex20_shape(at, n, dn);
  for (int i = 0; i < 20; i++) {
    sum += n[i];
    for (int a = 0; a < 3; a++) slope[a] += dn[i][a];
  }
  ASSERT_NEAR(sum, 1, 1e-15);
  for (int a = 0; a < 3; a++) {
    ASSERT_NEAR(slope[a], 0, 1e-14);
    double up[3] = {at[0], at[1], at[2]}, down[3] = {at[0], at[1], at[2]}, high[20], low[20];
    double unused[20][3];
    up[a] += 1e-6, down[a] -= 1e-6;
    pb_hex20_shape(up, high, unused);
    pb_hex20_shape(down, low, unused);
    for (int i = 0; i < 20; i++) ASSERT_NEAR(dn[i][a], (high[i] - low[i]) / 2e-6, 1e-9);
  }
}

// Forces of a uniform stretch are those of its stress on the faces: their virial is stress ×
// volume.
static void test_element_stretch(void **state) {
  (void)state;
  double xyz[20][3], k[20][20][3][3], m[20][20], energy = 0, mass = 0;
  brick(xyz);
  assert_true(pb_hex20_jacobian(xyz) > 0);
  assert_true(pb_hex20_matrices(xyz, &steel, k, m));
  double volume = pb_hex20_volume(xyz);
  for (int i = 0; i < 20; i++) {
    for (int j = i; j < 20; j++) {
      double twice = i == j ? 1 : 2;
      energy += twice * xyz[i][0] * k[i][j][0][0] * xyz[j][0];  // u = x e_x: strain 1 along x
      mass += twice * m[i][j];
    }
  }
  double modulus = 200e9 * 0.7 / (1.3 * 0.4);  // E (1−ν) / ((1+ν)(1−2ν))
  ASSERT_RELATIVE(energy, modulus * volume, 1e-12);
  ASSERT_RELATIVE(mass, 7800 * volume, 1e-12);
}

static void test_face_moments(void **state) {
  (void)state;
  double xyz[8][3] = {{1, 1, 2}, {3, 1, 2},   {3, 2, 2}, {1, 2, 2},
                      {2, 1, 2}, {3, 1.5, 2}, {2, 2, 2}, {1, 1.5, 2}};
  double origin[3] = {1, 0, 0}, weight[8][4], sum[4] = {0}, xx = 0;
  ASSERT_NEAR(pb_face8_moments(xyz, origin, weight), 2, 1e-14);
  for (int i = 0; i < 8; i++) {
    for (int a = 0; a < 4; a++) sum[a] += weight[i][a];
    xx += (xyz[i][0] - origin[0]) * weight[i][1];
  }
  ASSERT_NEAR(sum[0], 2, 1e-14);
  ASSERT_NEAR(sum[1], 2, 1e-14);    // ∫ (x − 1) over [1,3] × [1,2]
  ASSERT_NEAR(sum[2], 3, 1e-14);    // ∫ y
  ASSERT_NEAR(sum[3], 4, 1e-14);    // ∫ z
  ASSERT_NEAR(xx, 8.0 / 3, 1e-14);  // ∫ (x − 1)²
}

// K R relative to K for the six rigid motions; total mass and centre of mass from RᵀMR.
static void check_rigid(const pb_fem *fem, double mass, double center_x) {
  size_t n = fem->k.n;
  double *r = calloc(2 * n, sizeof *r), *y = r + n, largest = 0, worst = 0, center[3] = {0};
  assert_non_null(r);
  for (int64_t i = 0; i < fem->k.start[n]; i++) largest = fmax(largest, fabs(fem->k.value[i]));
  for (int motion = 0; motion < 6; motion++) {
    for (size_t i = 0; i < fem->nodes; i++) {
      const double *p = fem->xyz + 3 * i;
      double *u = r + 3 * i;
      int a = motion % 3;
      u[0] = u[1] = u[2] = 0;
      if (motion < 3) u[a] = 1;
      if (motion >= 3) u[(a + 1) % 3] = -p[(a + 2) % 3], u[(a + 2) % 3] = p[(a + 1) % 3];
    }
    pb_sparse_multiply(&fem->k, 1, r, y);
    for (size_t i = 0; i < n; i++) worst = fmax(worst, fabs(y[i]));
    if (motion >= 3) continue;
    double total = 0;
    pb_sparse_multiply(&fem->m, 1, r, y);
    for (size_t i = 0; i < fem->nodes; i++) {
      total += y[3 * i + (size_t)motion];
      for (int a = 0; a < 3; a++)
        center[a] += y[3 * i + (size_t)motion] * fem->xyz[3 * i + (size_t)a] / mass / 3;
    }
    ASSERT_RELATIVE(total, mass, 1e-10);
  }
  assert_true(worst < 1e-13 * largest);
  for (int a = 0; a < 3; a++) ASSERT_NEAR(center[a], a == 0 ? center_x : 0, 1e-10);
  free(r);
}

static double frame_area(const pb_fem_frame *frame) {
  double area = 0;
  for (size_t i = 0; i < frame->nodes; i++) area += frame->moment[4 * i];
  return area;
}

static void test_actuator(void **state) {
  (void)state;
  pb_part part = load("apa300ml");
  pb_mesh mesh;
  pb_fem fem;
  double volume[3];
  REQUIRE(pb_part_mesh(&part, &mesh, &err));
  pb_mesh_volume(&mesh, 3, volume);
  ASSERT_RELATIVE(volume[0], 7785.7e-9, 1e-4);  // published geometry
  ASSERT_RELATIVE(volume[1], 6000e-9, 1e-12);
  ASSERT_RELATIVE(volume[2], 1000e-9, 1e-12);
  REQUIRE(pb_part_model(&part, &mesh, &fem, &err));
  assert_int_equal(fem.frames, 7);
  assert_string_equal(fem.frame[4].name, "actuator_start");
  ASSERT_RELATIVE(fem.frame[4].origin[0], -7.5e-3, 1e-12);
  for (int i = 2; i < 7; i++) ASSERT_RELATIVE(frame_area(fem.frame + i), 100e-6, 1e-12);
  double depth =
      15.001e-3 - 11.3626e-3;  // of the pad's hole; walls as wide as a square of its area
  ASSERT_RELATIVE(frame_area(fem.frame), 4 * sqrt(pi) / 2 * 4.2e-3 * depth, 1e-4);
  // The spacer is twice as deep as the stack that mirrors it.
  double total = volume[0] + volume[1] + volume[2];
  check_rigid(&fem, 7800 * total, -10e-3 * 500e-9 / total);
  pb_fem_clear(&fem);
  pb_mesh_clear(&mesh);
  pb_part_clear(&part);
}

// A quadratic edge strays from the circle by a known amount; nodes do not.
static void test_joint(void **state) {
  (void)state;
  pb_part part = load("flexible-joint");
  pb_mesh mesh;
  pb_fem fem;
  double volume[1];
  REQUIRE(pb_part_mesh(&part, &mesh, &err));
  pb_mesh_volume(&mesh, 1, volume);
  ASSERT_RELATIVE(volume[0], 3771e-9, 5e-4);
  REQUIRE(pb_part_model(&part, &mesh, &fem, &err));
  assert_int_equal(fem.frames, 2);
  for (int i = 0; i < 2; i++) ASSERT_RELATIVE(frame_area(fem.frame + i), 220.9e-6, 3e-4);
  check_rigid(&fem, 7750 * volume[0], 0);
  double neck = INFINITY, radius = 0;
  for (size_t i = 0; i < mesh.nodes; i++) {
    const double *p = mesh.xyz + 3 * i;
    radius = fmax(radius, hypot(p[0], p[1]));
    if (p[2] == 0 && p[0] > 1e-3 && fabs(p[1]) > 0 && fabs(p[1]) < neck) neck = fabs(p[1]);
  }
  ASSERT_RELATIVE(radius, 10e-3, 1e-12);
  ASSERT_RELATIVE(neck, 0.0625e-3, 1e-9);  // mid-side node of one of two elements across the neck
  pb_fem_clear(&fem);
  pb_mesh_clear(&mesh);
  part.density = 2;  // edges come nearer to their arcs
  REQUIRE(pb_part_mesh(&part, &mesh, &err));
  pb_mesh_volume(&mesh, 1, volume);
  ASSERT_RELATIVE(volume[0], 3771e-9, 1e-4);
  pb_mesh_clear(&mesh);
  pb_part_clear(&part);
}

// Every surface node of the joint lies on the cylinder, on an end face or on a wall of a slot.
static void test_joint_surface(void **state) {
  (void)state;
  pb_part part = load("flexible-joint");
  const pb_joint_shape *d = &part.joint;
  pb_mesh mesh;
  pb_mesh_face *faces;
  size_t count, on_arc = 0;
  REQUIRE(pb_part_mesh(&part, &mesh, &err));
  REQUIRE(pb_mesh_faces(&mesh, &faces, &count, &err));
  double center = 0.5 * d->neck + d->neck_radius;
  for (size_t f = 0; f < count; f++) {
    double xyz[8][3];
    if (!faces[f].surface) continue;
    pb_mesh_face_places(&mesh, faces + f, xyz);
    for (int i = 0; i < 8; i++) {
      double *p = xyz[i], off = INFINITY;
      off = fmin(off, fabs(hypot(p[0], p[1]) - 0.5 * d->diameter));
      off = fmin(off, fabs(fabs(p[2]) - 0.5 * d->height));
      for (int cut = 0; cut < 2; cut++) {
        double r = fabs(p[cut]), z = cut ? p[2] : -p[2], wall[2];
        double arc = hypot(r - center, z);
        if (r < center && z > -1.6e-3 && z < 1.86e-3) on_arc += fabs(arc - d->neck_radius) < 1e-12;
        pb_joint_walls(d, z, wall);
        off = fmin(off, fmin(fabs(r - wall[0]), fabs(r - wall[1])));
        double end = (center - (d->neck_radius - 0.5 * d->slot_width) * cos(54.2 * pi / 180)),
               up = (d->neck_radius - 0.5 * d->slot_width) * sin(54.2 * pi / 180);
        off = fmin(off, fabs(hypot(r - end, z - up) - 0.5 * d->slot_width));
      }
      if (!(off < 1e-10)) fail_msg("(%g, %g, %g) is off the surface by %g", p[0], p[1], p[2], off);
    }
  }
  assert_true(on_arc > 100);
  free(faces);
  pb_mesh_clear(&mesh);
  pb_part_clear(&part);
}

// A neck of another thickness, another height, another density: still sound meshes.
static void test_other_dimensions(void **state) {
  (void)state;
  pb_part part = load("flexible-joint");
  pb_mesh mesh;
  static const double neck[] = {0.1e-3, 0.5e-3, 1e-3}, density[] = {0.5, 0.75, 1.5};
  for (int i = 0; i < 3; i++) {
    part.joint.neck = neck[i];
    part.density = density[i];
    REQUIRE(pb_part_mesh(&part, &mesh, &err));
    assert_true(mesh.elements > 100);
    pb_mesh_clear(&mesh);
  }
  part.joint.height = 12e-3;
  part.joint.diameter = 24e-3;
  REQUIRE(pb_part_mesh(&part, &mesh, &err));
  pb_mesh_clear(&mesh);
  pb_part_clear(&part);
  part = load("apa300ml");
  part.actuator.arm_angle = 14;
  part.actuator.half_height = 17e-3;
  part.actuator.frame_height = 17e-3;
  part.density = 0.5;
  REQUIRE(pb_part_mesh(&part, &mesh, &err));
  pb_mesh_clear(&mesh);
  pb_part_clear(&part);
}

static void expect_geometry(pb_part *part, const char *says) {
  pb_mesh mesh;
  pb_error err = {0};
  assert_int_equal(pb_part_mesh(part, &mesh, &err), PB_ERR_GEOMETRY);
  assert_non_null(strstr(err.message, says));
  assert_null(mesh.xyz);
}

static void test_impossible_dimensions(void **state) {
  (void)state;
  pb_part part = load("flexible-joint");
  part.joint.height = 40e-3;
  expect_geometry(&part, "leaves through the side");
  part.joint.height = 5e-3;
  expect_geometry(&part, "height");
  pb_part_clear(&part);
  part = load("apa300ml");
  part.actuator.pad_hole_diameter = 10e-3;
  expect_geometry(&part, "too wide");
  part.actuator.pad_hole_diameter = 4.2e-3;
  part.actuator.half_height = 12e-3;
  expect_geometry(&part, "half_height");
  pb_part_clear(&part);
}

// Part files that are wrong are refused by the place.
static void refuse(const char *find, const char *replace, const char *where) {
  char path[512], *text = NULL, *out;
  cJSON *json = NULL;
  pb_part part;
  pb_error error = {0};
  snprintf(path, sizeof path, "%s/parts/flexible-joint.json", PB_CONFIG);
  REQUIRE(pb_json_read(path, &json, &text, &err));
  cJSON_Delete(json);
  char *at = strstr(text, find);
  assert_non_null(at);
  out = malloc(strlen(text) + strlen(replace) + 1);
  sprintf(out, "%.*s%s%s", (int)(at - text), text, replace, at + strlen(find));
  REQUIRE(pb_json_parse(out, strlen(out), &json, &err));
  assert_int_not_equal(pb_part_read(json, &part, &error), PB_OK);
  if (strcmp(error.where, where))
    fail_msg("%s: %s, expected %s", error.where, error.message, where);
  assert_null(part.name);
  cJSON_Delete(json);
  free(text);
  free(out);
}

static void test_wrong_files(void **state) {
  (void)state;
  refuse("\"neck\"", "\"nec\"", "/dimensions/nec");
  refuse("0.00025", "-1", "/dimensions/neck");
  refuse("0.31", "0.5", "/materials/body/poisson_ratio");
  refuse("\"body\"", "\"shell\"", "/materials/shell");
  refuse("averaged", "mean", "/frames/tie");
  refuse("\"density\": 1}", "\"density\": 99}", "/mesh/density");
  refuse("\"modes\": 6", "\"modes\": 0", "/modes");
  refuse("shear_stiffness", "amplification", "/published/amplification");
  refuse("plantbus.part/1", "plantbus.plant/1", "/schema");
  refuse("\"flexible_joint\"", "\"joint\"", "/type");
  refuse("94e6", "\"94\"", "/published/axial_stiffness");
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_shape_functions),
      cmocka_unit_test(test_element_stretch),
      cmocka_unit_test(test_face_moments),
      cmocka_unit_test(test_actuator),
      cmocka_unit_test(test_joint),
      cmocka_unit_test(test_joint_surface),
      cmocka_unit_test(test_other_dimensions),
      cmocka_unit_test(test_impossible_dimensions),
      cmocka_unit_test(test_wrong_files),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
