// plantbus-part build as a user runs it: elements, tables, pictures, full models, messages, and
// CalculiX on the same mesh.
#include <sys/stat.h>

#include "base/json.h"
#include "part/matrix_file.h"
#include "part/part_run.h"
#include "plant/element.h"
#include "support/check.h"

#define JOINT PB_CONFIG "/parts/flexible-joint.json"
#define ACTUATOR PB_CONFIG "/parts/apa300ml.json"

static double member(const cJSON *object, const char *a, const char *b) {
  const cJSON *value = cJSON_GetObjectItemCaseSensitive(object, a);
  if (value && b) value = cJSON_GetObjectItemCaseSensitive(value, b);
  if (!cJSON_IsNumber(value)) fail_msg("there is no number %s %s", a, b ? b : "");
  return value->valuedouble;
}

// Twice the same file, byte for byte; loaded as any element is.
static void test_element(void **state) {
  (void)state;
  cJSON *json = part_json("build " JOINT " --mesh 0.5 --modes 8 --json -o joint.mat");
  assert_true(member(json, "size", NULL) == 20);
  assert_int_equal(part_run("build " JOINT " --mesh 0.5 --modes 8 -o again.mat"), 0);
  assert_int_equal(part_shell("cmp joint.mat again.mat"), 0);
  pb_element *element = NULL;
  pb_warnings warnings = {0};
  REQUIRE(pb_element_load(part_path("joint.mat"), &warnings, &element, &err));
  assert_int_equal(warnings.count, 0);
  assert_int_equal(element->frames, 2);
  assert_int_equal(element->size, 20);
  ASSERT_RELATIVE(element->health.mass, member(json, "characteristics", "mass"), 1e-9);
  pb_element_free(element);
  cJSON_Delete(json);
}

// A thicker neck: bending grows with about the 2.5th power, axial stiffness with less than its
// first.
static void test_sweep(void **state) {
  (void)state;
  cJSON *json =
      part_json("build " JOINT " --mesh 0.5 --json --sweep /dimensions/neck=0.25e-3,0.5e-3");
  const cJSON *rows = cJSON_GetObjectItem(json, "rows");
  assert_int_equal(cJSON_GetArraySize(rows), 2);
  const cJSON *thin = cJSON_GetArrayItem(rows, 0), *thick = cJSON_GetArrayItem(rows, 1);
  ASSERT_RELATIVE(member(thin, "parameter", NULL), 0.25e-3, 1e-15);
  double bending =
      member(thick, "bending_stiffness", NULL) / member(thin, "bending_stiffness", NULL);
  double axial = member(thick, "axial_stiffness", NULL) / member(thin, "axial_stiffness", NULL);
  assert_true(bending > pow(2, 2.3) && bending < pow(2, 2.7));
  assert_true(axial > 1.1 && axial < 2);
  cJSON_Delete(json);
}

static void test_convergence(void **state) {
  (void)state;
  cJSON *json = part_json("build " JOINT " --json --convergence=0.5,0.75");
  const cJSON *rows = cJSON_GetObjectItem(json, "rows");
  assert_int_equal(cJSON_GetArraySize(rows), 2);
  double coarse = member(cJSON_GetArrayItem(rows, 0), "bending_stiffness", NULL);
  double fine = member(cJSON_GetArrayItem(rows, 1), "bending_stiffness", NULL);
  assert_true(fabs(fine / 4.83 - 1) < fabs(coarse / 4.83 - 1));
  assert_true(member(cJSON_GetArrayItem(rows, 1), "full_dof", NULL) >
              2 * member(cJSON_GetArrayItem(rows, 0), "full_dof", NULL));
  cJSON_Delete(json);
}

// The table, and the picture's polygons: one for each visible face of the surface, none outside the
// picture.
static void test_picture(void **state) {
  (void)state;
  assert_int_equal(part_run("build " JOINT " --mesh 0.5 --picture rest.svg"), 0);
  char *table = part_text("stdout");
  assert_non_null(strstr(table, "bending_stiffness"));
  assert_non_null(strstr(table, "published"));
  free(table);
  assert_int_equal(part_run("build " JOINT " --mesh 0.5 --picture mode.svg --picture-mode 1"), 0);
  char *rest = part_text("rest.svg"), *mode = part_text("mode.svg");
  assert_string_equal(strstr(rest, "</svg>"), "</svg>\n");
  int polygons = 0;
  for (const char *at = rest; (at = strstr(at, "points=\"")); polygons++) {
    double x, y;
    assert_int_equal(sscanf(at, "points=\"%lf,%lf", &x, &y), 2);
    assert_true(x >= 0 && x <= 1200 && y >= 0);
    at += 8;
  }
  assert_true(polygons > 150);
  assert_non_null(strstr(mode, "mode 1 at"));
  assert_int_equal(part_run("build " JOINT " --mesh 0.5 --picture n.svg --set '/name=a<b & c'"), 0);
  char *named = part_text("n.svg");
  assert_non_null(strstr(named, ">a&#60;b &#38; c: "));
  free(named);
  assert_string_not_equal(strstr(rest, "<polygon"), strstr(mode, "<polygon"));
  free(rest);
  free(mode);
}

static void test_png(void **state) {
  (void)state;
  if (!part_has("gnuplot")) {
    print_message("skipped: gnuplot is not installed\n");
    skip();
  }
  // The name is no command of gnuplot, whatever it holds.
  assert_int_equal(part_run("build " JOINT " --mesh 0.5 --picture joint.png "
                            "--set \"/name=it's'; system('touch made') #\""),
                   0);
  assert_int_equal(access(part_path("made"), F_OK), -1);
  char *png = part_text("joint.png");
  assert_memory_equal(png, "\x89PNG", 4);
  free(png);
}

static void test_messages(void **state) {
  (void)state;
  assert_int_equal(part_run("build"), 2);
  assert_int_equal(part_run("build " JOINT " --mesh 99"), 2);
  part_complains("--mesh");
  assert_int_equal(part_run("build " JOINT " --tie loose"), 2);
  assert_int_equal(part_run("build " JOINT " --picture a.gif"), 2);
  assert_int_equal(part_run("build " JOINT " --set neck"), 2);
  assert_int_equal(part_run("build " JOINT " --convergence=0.5,0.1"), 2);
  part_complains("--convergence: 0.1 is out of range");
  assert_int_equal(part_run("build " JOINT " --sweep /dimensions/neck=1e-4,x"), 2);
  part_complains("--sweep");
  assert_int_equal(part_run("build " JOINT " --convergence -o x.mat"), 2);
  assert_int_equal(part_run("build " JOINT " --sweep /dimensions/neck=thin,thick"), 2);
  assert_int_equal(part_run("build " JOINT " --set /dimensions/nek=1"), 1);
  part_complains("/dimensions/nek");
  assert_int_equal(part_run("build " JOINT " --set /dimensions/neck=0"), 1);
  part_complains("/dimensions/neck");
  assert_int_equal(part_run("build " JOINT " --set /dimensions/height=1"), 1);
  part_complains("leaves through the side");
  assert_int_equal(part_run("build nothing.json"), 1);
  part_complains("nothing.json");
  // A place that cannot be written is told before the work, even of a part that cannot be meshed.
  static const char *const hopeless[] = {"-o no/such/place.mat", "--picture no/such/place.svg"};
  for (size_t i = 0; i < 2; i++) {
    char line[512];
    snprintf(line, sizeof line, "build " JOINT " --set /dimensions/height=1 %s", hopeless[i]);
    assert_int_equal(part_run(line), 1);
    part_complains("no/such/place");
  }
  assert_int_equal(part_run("build " JOINT " --mesh 0.5 --picture a.svg --picture-mode 900"), 1);
  part_complains("modes");
}

// ---- CalculiX -----------------------------------------------------------------------------------

// Entries of a stored matrix with rows renumbered by labels to 3 (node − 1) + direction − 1.
static void read_labelled(const char *file, const pb_dof_file *dof, pb_matrix_file *out) {
  REQUIRE(pb_matrix_file_read(part_path(file), NULL, out, &err));
  assert_int_equal(out->rows, dof->count);
  for (size_t i = 0; i < out->count; i++) {
    const pb_row_label *r = dof->label + out->row[i], *c = dof->label + out->col[i];
    out->row[i] = 3 * (r->node - 1) + r->direction - 1;
    out->col[i] = 3 * (c->node - 1) + c->direction - 1;
  }
}

// Largest |a − b| / √(a_ii a_jj) over all places.
static double difference(const pb_matrix_file *a, const pb_matrix_file *b) {
  size_t n = a->rows, count = a->count + b->count;
  int64_t *row = malloc(count * sizeof *row), *col = malloc(count * sizeof *col);
  double *value = malloc(count * sizeof *value), *diagonal = calloc(n, sizeof *diagonal), worst = 0;
  assert_true(row && col && value && diagonal);
  for (size_t i = 0; i < count; i++) {
    const pb_matrix_file *from = i < a->count ? a : b;
    size_t at = i < a->count ? i : i - a->count;
    row[i] = from->row[at], col[i] = from->col[at];
    value[i] = from == a ? from->value[at] : -from->value[at];
    if (from == a && row[i] == col[i]) diagonal[row[i]] = value[i];
  }
  pb_sparse sum;
  REQUIRE(pb_sparse_from_entries(n, count, row, col, value, &sum, &err));
  for (size_t j = 0; j < n; j++)
    for (int64_t at = sum.start[j]; at < sum.start[j + 1]; at++)
      worst = fmax(worst, fabs(sum.value[at]) / sqrt(diagonal[j] * diagonal[sum.row[at]]));
  pb_sparse_clear(&sum);
  free(row), free(col), free(value), free(diagonal);
  return worst;
}

static void compare_matrices(const char *directory) {
  static const char *const name[2][2] = {{"K.mtx", "part.sti"}, {"M.mtx", "part.mas"}};
  char path[64], stored[64];
  pb_dof_file dof;
  snprintf(path, sizeof path, "%s/part.dof", directory);
  REQUIRE(pb_dof_file_read(part_path(path), &dof, &err));
  for (int i = 0; i < 2; i++) {
    pb_matrix_file ours, theirs;
    snprintf(path, sizeof path, "%s/%s", directory, name[i][0]);
    snprintf(stored, sizeof stored, "%s/%s", directory, name[i][1]);
    REQUIRE(pb_matrix_file_read(part_path(path), NULL, &ours, &err));
    read_labelled(stored, &dof, &theirs);
    assert_int_equal(ours.rows, theirs.rows);
    double worst = difference(&ours, &theirs);
    print_message("%s: differs by %.1e\n", stored, worst);
    assert_true(worst < 1e-9);
    pb_matrix_file_clear(&ours);
    pb_matrix_file_clear(&theirs);
  }
  pb_dof_file_clear(&dof);
}

// The free element with many modes has the free part's frequencies, as CalculiX computes them from
// the same mesh. It prints a mode's frequency in the fourth column.
static void compare_frequencies(void) {
  pb_element *element = NULL;
  REQUIRE(pb_element_load(part_path("many.mat"), NULL, &element, &err));
  char *text = part_text("full/modes.dat"), *at = strstr(text, "MODE NO");
  assert_non_null(at);
  int compared = 0;
  for (at = strchr(at, '\n'); at && compared < 6; at = strchr(at + 1, '\n')) {
    int mode;
    double eigenvalue, rad, hz;
    if (sscanf(at + 1, "%d %lf %lf %lf", &mode, &eigenvalue, &rad, &hz) != 4 || mode <= 6) continue;
    double ours = sqrt(element->omega2[mode - 1]) / 6.283185307179586;
    ASSERT_RELATIVE(ours, hz, 1e-3);
    compared++;
  }
  assert_int_equal(compared, 6);
  free(text);
  pb_element_free(element);
}

// The full model in full/ and its element many.mat, made once for the tests that look at them.
static void make_full(void) {
  static bool made;
  if (!made)
    assert_int_equal(part_run("build " JOINT " --mesh 0.5 --modes 40 --full full -o many.mat"), 0);
  made = true;
}

static void test_calculix(void **state) {
  (void)state;
  if (!part_has("ccx")) {
    print_message("skipped: CalculiX (ccx) is not installed\n");
    skip();
  }
  make_full();
  assert_int_equal(part_shell("cd full && ccx part && ccx modes"), 0);
  compare_matrices("full");
  compare_frequencies();
}

// Materials by region, mirrored sections and left-out hole: the actuator's matrices, too.
static void test_calculix_actuator(void **state) {
  (void)state;
  if (!part_has("ccx")) {
    print_message("skipped: CalculiX (ccx) is not installed\n");
    skip();
  }
  assert_int_equal(part_run("build " ACTUATOR " --mesh 0.5 --modes 1 --full actuator"), 0);
  assert_int_equal(part_shell("cd actuator && ccx part"), 0);
  compare_matrices("actuator");
}

// The full model that build writes goes through reduce to the same element.
static void test_full_and_back(void **state) {
  (void)state;
  make_full();
  assert_int_equal(part_run("reduce full/K.mtx full/M.mtx --nodes full/nodes.csv "
                            "--frames full/frames.json --modes 40 -o again.mat"),
                   0);
  pb_element *a = NULL, *b = NULL;
  REQUIRE(pb_element_load(part_path("many.mat"), NULL, &a, &err));
  REQUIRE(pb_element_load(part_path("again.mat"), NULL, &b, &err));
  assert_int_equal(a->size, b->size);
  for (size_t j = 0; j < 12; j++)
    for (size_t i = 0; i < 12; i++)
      ASSERT_NEAR(b->k[i + j * b->size], a->k[i + j * a->size],
                  1e-8 * sqrt(a->k[i + i * a->size] * a->k[j + j * a->size]));
  for (size_t i = 6; i < a->size; i++) ASSERT_RELATIVE(b->omega2[i], a->omega2[i], 1e-7);
  pb_element_free(a);
  pb_element_free(b);
}

// The documented way of any solid: gmsh, CalculiX, plantbus-part reduce.
static void test_bracket(void **state) {
  (void)state;
  if (!part_has("gmsh") || !part_has("ccx")) {
    print_message("skipped: gmsh and CalculiX (ccx) are not both installed\n");
    skip();
  }
  int code = part_shell("PLANTBUS_BIN='" PB_BIN "' '" PB_CONFIG "/parts/bracket/make.sh' bracket");
  char *complaint = part_text("stderr");
  if (code) fail_msg("make.sh: %s", complaint);
  free(complaint);
  pb_element *element = NULL;
  pb_warnings warnings = {0};
  REQUIRE(pb_element_load(part_path("bracket/bracket.mat"), &warnings, &element, &err));
  assert_int_equal(warnings.count, 0);
  assert_int_equal(element->frames, 2);
  assert_int_equal(element->size, 24);
  ASSERT_RELATIVE(element->position[0], 28e-3, 1e-12);
  double volume = 40e-3 * 20e-3 * 6e-3 + 34e-3 * 20e-3 * 6e-3 - 2 * 3.14159265 * 9e-6 * 6e-3;
  ASSERT_RELATIVE(element->health.mass, 7800 * volume, 1e-3);
  assert_true(fabs(element->health.rigid_hz) < 1);
  pb_warnings_clear(&warnings);
  pb_element_free(element);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_element),       cmocka_unit_test(test_sweep),
      cmocka_unit_test(test_convergence),   cmocka_unit_test(test_picture),
      cmocka_unit_test(test_png),           cmocka_unit_test(test_messages),
      cmocka_unit_test(test_calculix),      cmocka_unit_test(test_calculix_actuator),
      cmocka_unit_test(test_full_and_back), cmocka_unit_test(test_bracket),
  };
  return cmocka_run_group_tests(tests, part_folder_make, part_folder_remove);
}
