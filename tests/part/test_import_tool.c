// plantbus-part import, doctor and truncate as a user runs them, and the health that
// plantbus-model check tells.

#include <matio.h>

#include "base/json.h"
#include "part/part_run.h"
#include "plant/element.h"
#include "support/check.h"
#include "support/outside.h"

static outside_element element;

static const outside_form *form_of(const char *name) {
  for (const outside_form *f = outside_forms; f->name; f++)
    if (!strcmp(f->name, name)) return f;
  fail_msg("no form %s", name);
  return NULL;
}

static void write_pair(const char *form) {
  form_of(form)->write(part_path("K.txt"), 'K', element.k);
  form_of(form)->write(part_path("M.txt"), 'M', element.m);
}

static double number(const cJSON *json, const char *key) {
  const cJSON *value = cJSON_GetObjectItemCaseSensitive(json, key);
  if (!cJSON_IsNumber(value)) fail_msg("there is no number %s", key);
  return value->valuedouble;
}

static const char *text(const cJSON *json, const char *key) {
  const char *value = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(json, key));
  if (!value) fail_msg("there is no text %s", key);
  return value;
}

static bool truth(const cJSON *json, const char *key) {
  return cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(json, key));
}

static pb_element *load(const char *name) {
  pb_element *e = NULL;
  REQUIRE(pb_element_load(part_path(name), NULL, &e, &err));
  return e;
}

static void test_import(void **state) {
  (void)state;
  outside_write_both("print", part_path("both.txt"), &element);
  outside_write_listing(part_path("list.txt"), &element, 4, 1, 1);
  cJSON *json = part_json("import both.txt list.txt -o beam.mat --json");
  assert_string_equal(text(json, "format_k"), "Ansys *PRINT");
  assert_string_equal(text(json, "rows_by"), "the list of masters");
  assert_true(number(json, "frames") == 3 && number(json, "modes") == 2);
  assert_true(number(json, "nodes_listed") == 6);
  cJSON_Delete(json);
  pb_element *e = load("beam.mat");
  ASSERT_RELATIVE(e->health.mass, 0.08, 1e-9);
  pb_element_free(e);
  write_pair("dmig-large.pch");
  assert_int_equal(part_run("import K.txt M.txt list.txt -o beam.mtx"), 0);
  assert_int_equal(part_run("import beam.K.mtx beam.M.mtx beam.int_xyz.mtx --modal 2 -o again.mat"),
                   0);
  e = load("again.mat");
  ASSERT_RELATIVE(e->health.mass, 0.08, 1e-8);
  pb_element_free(e);
}

// The command lines that are wrong (2), the files that do not fit (1), each with its message.
static void test_messages(void **state) {
  (void)state;
  write_pair("market-symmetric.mtx");
  outside_write_listing(part_path("list.txt"), &element, 50, 0, 1);
  static const struct {
    const char *line;
    int code;
    const char *message;
  } wrong[] = {
      {"import", 2, "expected a file"},
      {"import K.txt M.txt list.txt more.txt", 2, "more than three"},
      {"import K.txt M.txt list.txt --units mm,kg,N,s", 2, "not consistent"},
      {"import K.txt M.txt list.txt --units furlong,kg,N,s", 2, "is not length,mass,force,time"},
      {"import K.txt M.txt list.txt --modal 3 -o no.mat", 1, "--modal says 3"},
      {"import K.txt -o no.mat", 1, "give K and M"},
      {"import K.txt none.txt list.txt", 1, "none.txt"},
      {"doctor K.txt M.txt list.txt --repair", 2, "belong together"},
      {"doctor K.txt M.txt list.txt --ends 1,1", 2, "two frames"},
      {"truncate K.txt M.txt list.txt", 2, "expected --band"},
      {"truncate K.txt M.txt list.txt --band 100,50", 2, "two frequencies"},
      {"truncate K.txt M.txt list.txt --band 0,100 --actuator 1,2", 2, "belong together"},
      {"truncate K.txt M.txt list.txt --band 0,100 --ends 1,9", 1, "are not two"},
  };
  for (size_t k = 0; k < sizeof wrong / sizeof *wrong; k++) {
    int code = part_run(wrong[k].line);
    if (code != wrong[k].code) fail_msg("'%s' ended with %d", wrong[k].line, code);
    part_complains(wrong[k].message);
  }
  assert_int_equal(access(part_path("no.mat"), F_OK), -1);
}

// Four digits: found (exit code 1), repaired (0), written, and sound in its rigid motions then.
static void test_doctor(void **state) {
  (void)state;
  write_pair("print.txt");
  outside_write_listing(part_path("list.txt"), &element, 50, 0, 1);
  assert_int_equal(part_run("doctor K.txt M.txt list.txt"), 1);
  char *said = part_text("stdout");
  assert_non_null(strstr(said, "few-digits: K has 4"));
  assert_non_null(strstr(said, "--repair projects K"));
  free(said);
  cJSON *json = part_json("doctor K.txt M.txt list.txt --repair -o cured.mat --json");
  assert_true(truth(json, "repaired") && !truth(json, "sound"));
  const cJSON *states = cJSON_GetObjectItemCaseSensitive(json, "states");
  assert_int_equal(cJSON_GetArraySize(states), 3);  // as it is, projected, weighted
  const cJSON *before = cJSON_GetArrayItem(states, 0), *after = cJSON_GetArrayItem(states, 1);
  const cJSON *rigid = cJSON_GetObjectItemCaseSensitive(after, "rigid_hz");
  assert_true(number(before, "rotation_residual") > 1e-5);
  assert_true(number(after, "rotation_residual") < 1e-12);
  for (int k = 0; k < 6; k++) assert_true(fabs(cJSON_GetArrayItem(rigid, k)->valuedouble) < 0.01);
  cJSON_Delete(json);
  pb_element *e = load("cured.mat");
  assert_true(fabs(e->health.rigid_hz) < 0.01);
  pb_element_free(e);
  write_pair("market-symmetric.mtx");
  json = part_json("doctor K.txt M.txt list.txt --json");
  assert_true(truth(json, "sound"));
  cJSON_Delete(json);
}

static void test_truncate(void **state) {
  (void)state;
  cJSON *json =
      part_json("truncate " PB_CONFIG
                "/elements/apa300ml.mat --band 0,1000 --zero-error 0.1 --json -o few.mat");
  assert_true(truth(json, "within_budget"));
  assert_true(number(json, "zero_error") <= 1e-3);
  assert_true(number(json, "modes") < number(json, "modes_before") / 2);
  assert_true(cJSON_GetArraySize(cJSON_GetObjectItemCaseSensitive(json, "compared")) > 20);
  pb_element *e = load("few.mat"), *whole = NULL;
  assert_int_equal(e->size, 42 + (size_t)number(json, "modes"));
  REQUIRE(pb_element_load(PB_CONFIG "/elements/apa300ml.mat", NULL, &whole, &err));
  ASSERT_RELATIVE(e->health.mass, whole->health.mass, 1e-9);
  pb_element_free(e);
  pb_element_free(whole);
  cJSON_Delete(json);
  // By force, and then the budget is not met.
  assert_int_equal(part_run("truncate " PB_CONFIG "/elements/apa300ml.mat --band 0,5000 --modes 5"),
                   1);
}

static void add_variable(mat_t *mat, const char *name, size_t rows, size_t cols, double *x) {
  size_t size[2] = {rows, cols};
  matvar_t *v = Mat_VarCreate(name, MAT_C_DOUBLE, MAT_T_DOUBLE, 2, size, x, 0);
  assert_non_null(v);
  assert_int_equal(Mat_VarWrite(mat, v, MAT_COMPRESSION_NONE), 0);
  Mat_VarFree(v);
}

// size < OUTSIDE_SIZE: not all rows; half: the upper triangle only.
static void write_own(const char *name, size_t size, bool half) {
  static double k[OUTSIDE_SIZE * OUTSIDE_SIZE], m[OUTSIDE_SIZE * OUTSIDE_SIZE];
  double xyz[3 * OUTSIDE_FRAMES];
  for (size_t j = 0; j < size; j++) {
    for (size_t i = 0; i < size; i++) {
      k[i + j * size] = half && i > j ? 0 : outside_entry(element.k, i, j);
      m[i + j * size] = half && i > j ? 0 : outside_entry(element.m, i, j);
    }
  }
  for (size_t f = 0; f < OUTSIDE_FRAMES; f++)
    for (size_t a = 0; a < 3; a++) xyz[f + a * OUTSIDE_FRAMES] = element.position[a + 3 * f];
  mat_t *mat = Mat_CreateVer(part_path(name), NULL, MAT_FT_MAT5);
  assert_non_null(mat);
  add_variable(mat, "K", size, size, k);
  add_variable(mat, "M", size, size, m);
  add_variable(mat, "int_xyz", OUTSIDE_FRAMES, 3, xyz);
  Mat_Close(mat);
}

// Matrices that are too small for the frames, down to a single number: refused by all commands.
static void test_small_matrices(void **state) {
  (void)state;
  static const char *const command[] = {"doctor", "import", "truncate --band 0,1000"};
  for (size_t size = 1; size <= 13; size += 4) {
    write_own("small.mat", size, false);
    for (size_t k = 0; k < 3; k++) {
      char line[100];
      snprintf(line, sizeof line, "%s small.mat", command[k]);
      assert_int_equal(part_run(line), 1);
      part_complains("do not fit 3 interface frames");
    }
  }
}

// An element's own file by one triangle: mirrored where --half says so, else never used as it is.
static void test_half(void **state) {
  (void)state;
  write_own("half.mat", OUTSIDE_SIZE, true);
  assert_int_equal(part_run("import half.mat -o whole.mat"), 1);
  part_complains("not symmetric");
  assert_int_equal(part_run("truncate half.mat --band 0,1000 --modes 1 -o whole.mat"), 1);
  part_complains("not symmetric");
  assert_int_equal(part_run("import half.mat --half -o whole.mat"), 0);
  pb_element *e = load("whole.mat");
  for (size_t j = 0; j < e->size; j++)
    for (size_t i = 0; i < e->size; i++)
      ASSERT_NEAR(e->k[i + j * e->size], outside_entry(element.k, i, j), 0);
  pb_element_free(e);
  assert_int_equal(part_run("import whole.mat --half"), 1);
  part_complains("both sides of the diagonal");
}

// What cannot be written is neither said to be written nor a success.
static void test_full_disk(void **state) {
  (void)state;
  write_pair("print.txt");
  outside_write_listing(part_path("list.txt"), &element, 50, 0, 1);
  assert_int_equal(part_run("doctor K.txt M.txt list.txt --repair -o none/cured.mat"), 1);
  part_complains("none/cured.mat");
  char *said = part_text("stdout");
  assert_non_null(strstr(said, "few-digits"));
  assert_null(strstr(said, "written"));
  free(said);
  assert_int_equal(part_run("doctor K.txt M.txt list.txt --repair -o none/cured.mat --json"), 1);
  said = part_text("stdout");
  assert_non_null(strstr(said, "\"repaired\": false"));
  free(said);
  assert_int_equal(part_shell(PB_BIN "/plantbus-part import K.txt M.txt list.txt >/dev/full"), 1);
  part_complains("standard output: cannot be written");
}

static void write_plant(const char *file) {
  FILE *f = fopen(part_path("plant.json"), "w");
  assert_non_null(f);
  fprintf(f,
          "{\"schema\": \"plantbus.plant/1\", \"name\": \"t\", \"components\": {\"e\": {\"type\": "
          "\"super_element\", \"file\": \"%s\", \"modal_damping\": 0.01}}, \"connections\": "
          "{\"w\": {\"from\": \"ground\", \"to\": \"e.1\", \"joint\": {\"type\": \"weld\"}}}, "
          "\"inputs\": [{\"name\": \"F\", \"type\": \"force\", \"frame\": \"e.2\", \"direction\": "
          "[0, 0, 1]}], \"outputs\": [{\"name\": \"d\", \"type\": \"displacement\", \"frame\": "
          "\"e.2\", \"direction\": [0, 0, 1]}]}\n",
          file);
  fclose(f);
}

// What plantbus-model check says of a sound element and of one whose frames are swapped.
static void test_model_check(void **state) {
  (void)state;
  write_pair("table.csv");
  outside_element swapped = element;
  memcpy(swapped.position, element.position + 3, 3 * sizeof *element.position);
  memcpy(swapped.position + 3, element.position, 3 * sizeof *element.position);
  outside_write_listing(part_path("list.txt"), &element, 50, 0, 1);
  assert_int_equal(part_run("import K.txt M.txt list.txt -o good.mat"), 0);
  outside_write_listing(part_path("list.txt"), &swapped, 50, 0, 1);
  assert_int_equal(part_run("import K.txt M.txt list.txt -o bad.mat"), 0);
  write_plant("good.mat");
  assert_int_equal(part_shell(PB_BIN "/plantbus-model check plant.json"), 0);
  char *said = part_text("stdout");
  assert_non_null(strstr(said, "good.mat: sound"));
  free(said);
  write_plant("bad.mat");
  assert_int_equal(part_shell(PB_BIN "/plantbus-model check plant.json --json"), 0);
  said = part_text("stdout");
  assert_non_null(strstr(said, "swapped-frames"));
  free(said);
}

static int begin(void **state) {
  outside_make(&element);
  return part_folder_make(state);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_import),      cmocka_unit_test(test_messages),
      cmocka_unit_test(test_doctor),      cmocka_unit_test(test_truncate),
      cmocka_unit_test(test_model_check), cmocka_unit_test(test_small_matrices),
      cmocka_unit_test(test_half),        cmocka_unit_test(test_full_disk),
  };
  return cmocka_run_group_tests(tests, begin, part_folder_remove);
}
