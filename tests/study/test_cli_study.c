// plantbus-study and plantbus-gate as a user runs them: the same results whoever computes them,
// files, messages, exit codes.
#include <dirent.h>

#include <cjson/cJSON.h>

#include "cli_run.h"
#include "support/check.h"

#define STUDY PB_BIN "/plantbus-study "
#define GATE PB_BIN "/plantbus-gate "
#define HEXAPOD PB_CONFIG "/plants/nano-hexapod.json "
#define HEXAPOD_1DOF PB_CONFIG "/plants/nano-hexapod-1dof.json "
#define SPEC PB_CONFIG "/specifications/nano-hexapod.json "

static char folder[] = "/tmp/pb-study-XXXXXX";

static int make_folder(void **state) {
  (void)state;
  return mkdtemp(folder) ? 0 : -1;
}

static void empty(const char *path) {
  DIR *dir = opendir(path);
  for (struct dirent *e; dir && (e = readdir(dir));) {
    char name[600];
    snprintf(name, sizeof name, "%s/%s", path, e->d_name);
    if (e->d_name[0] != '.') unlink(name);
  }
  if (dir) closedir(dir);
  rmdir(path);
}

static int remove_folder(void **state) {
  (void)state;
  static const char *const inner[] = {"one", "two", "rest"};
  for (size_t k = 0; k < 3; k++) {
    char path[64];
    snprintf(path, sizeof path, "%s/%s", folder, inner[k]);
    empty(path);
  }
  return rmdir(folder);  // fails when a tool left something behind
}

static char *read_file(const char *directory, const char *name) {
  char path[256];
  snprintf(path, sizeof path, "%s/%s/%s", folder, directory, name);
  FILE *file = fopen(path, "rb");
  if (!file) fail_msg("no file %s", path);
  fseek(file, 0, SEEK_END);
  long size = ftell(file);
  rewind(file);
  char *text = calloc(1, (size_t)size + 1);
  assert_int_equal(fread(text, 1, (size_t)size, file), size);
  fclose(file);
  return text;
}

// The JSON of a command line, which must end with 0.
static char *output_of(const char *line) {
  cli_result r = cli_run(line);
  if (r.code != 0) fail_msg("%s ended with %d: %s", line, r.code, r.err);
  free(r.err);
  return r.out;
}

#define AXIAL "axial " HEXAPOD "--values 1e7,1e8,inf --points 40 --json "

static void any_number_of_workers_gives_the_same_bits(void **state) {
  (void)state;
  char line[1024];
  snprintf(line, sizeof line, STUDY AXIAL "--workers 1 -o %s/one", folder);
  char *serial = output_of(line);
  snprintf(line, sizeof line, STUDY AXIAL "--workers 3 -o %s/two", folder);
  char *parallel = output_of(line);
  assert_string_equal(serial, parallel);
  static const char *const name[] = {"study-axial.csv", "study-axial-frf.csv",
                                     "study-axial-locus.csv"};
  for (size_t k = 0; k < 3; k++) {
    char *a = read_file("one", name[k]), *b = read_file("two", name[k]);
    assert_string_equal(a, b);
    free(a);
    free(b);
  }
  free(serial);
  free(parallel);
}

// Two processes of mpirun on this host.
static void mpirun_gives_the_same_bits(void **state) {
  (void)state;
#ifdef PB_MPIRUN
  char *alone = output_of(STUDY AXIAL "--workers 1");
  char *together = output_of(PB_MPIRUN " -n 2 --oversubscribe --allow-run-as-root " STUDY AXIAL);
  assert_string_equal(alone, together);
  free(alone);
  free(together);
  cli_expect(PB_MPIRUN " -n 2 --oversubscribe --allow-run-as-root " STUDY "bending " HEXAPOD
                       "--band 200,300 --values 1,2",
             1, "at 1: ");
#else
  print_message("built without MPI, or mpirun is not installed\n");
  skip();
#endif
}

static void results_come_in_the_order_of_the_values(void **state) {
  (void)state;
  char *text = output_of(STUDY "bending " HEXAPOD_1DOF "--values 500,0,50 --points 20 --json");
  cJSON *json = cJSON_Parse(text);
  assert_non_null(json);
  const cJSON *values = cJSON_GetObjectItem(json, "values");
  const double expected[3] = {500, 0, 50};
  assert_int_equal(cJSON_GetArraySize(values), 3);
  for (int k = 0; k < 3; k++) {
    const cJSON *v = cJSON_GetArrayItem(values, k);
    ASSERT_NEAR(cJSON_GetObjectItem(v, "value")->valuedouble, expected[k], 0);
    ASSERT_NEAR(cJSON_GetObjectItem(v, "states")->valuedouble, 12, 0);
    const cJSON *k_r = cJSON_GetObjectItem(cJSON_GetObjectItem(v, "struts"), "k_r");
    ASSERT_NEAR(k_r->valuedouble, expected[k], 1e-9);
    assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(v, "attainable_damping")), 6);
  }
  assert_true(cJSON_IsNull(
      cJSON_GetObjectItem(cJSON_GetArrayItem(values, 1), "iff_zero_hz")));  // ideal joints: none
  cJSON_Delete(json);
  free(text);
}

static void tables_files_and_plots_are_written(void **state) {
  (void)state;
  char line[1024];
  snprintf(line, sizeof line, STUDY "actuator-model " HEXAPOD "--points 60 --plot -o %s/rest",
           folder);
  char *text = output_of(line);
  assert_non_null(strstr(text, "Attainable damping"));
  assert_non_null(strstr(text, "1dof"));
  free(text);
  static const char *const name[] = {
      "study-actuator-model.csv",      "study-actuator-model-frf.csv",
      "study-actuator-model.mat",      "study-actuator-model-hac.png",
      "study-actuator-model-iff.png",  "study-actuator-model-rga.png",
      "study-actuator-model-locus.png"};
  for (size_t k = 0; k < sizeof name / sizeof *name; k++) free(read_file("rest", name[k]));
  // Zeros there may be none of: an empty variable.
  snprintf(line, sizeof line, STUDY "bending " HEXAPOD_1DOF "--values 0,50 --points 20 -o %s/rest",
           folder);
  free(output_of(line));
  free(read_file("rest", "study-bending.mat"));
}

static void a_model_of_ones_own_can_be_studied(void **state) {
  (void)state;
  char *text =
      output_of(STUDY "joint-model " HEXAPOD "--values plant,soft --points 20 --json --model "
                      "soft={\"type\":\"spherical_axial\",\"k_f\":50,\"k_t\":10,\"k_a\":1e7}");
  assert_non_null(strstr(text, "\"value\": \"soft\""));
  free(text);
}

static void what_a_default_cannot_be_is_left_out_and_told(void **state) {
  (void)state;
  cli_expect(STUDY "actuator-model " HEXAPOD_1DOF "--points 20", 0, "without 2dof");
}

static void wrong_lines_and_plants_are_told(void **state) {
  (void)state;
  cli_expect(STUDY, 2, "Commands:");
  cli_expect(STUDY "colour", 2, "'colour' is not one of its commands");
  cli_expect(STUDY "bending", 2, "the plant file is missing");
  cli_expect(STUDY "bending " HEXAPOD "--live", 2, "no file");
  cli_expect(STUDY "bending " HEXAPOD "--workers 0", 2, "--workers");
  cli_expect(STUDY "bending " HEXAPOD "--band 9,3", 2, "--band");
  cli_expect(STUDY "bending " HEXAPOD "--from 10 --to 5", 2, "--from");
  cli_expect(STUDY "bending /nowhere.json", 1, "/nowhere.json");
  cli_expect(STUDY "bending " HEXAPOD "--values 1,x", 2, "'x' is not a number");
  cli_expect(STUDY "mass " PB_CONFIG "/plants/apa300ml-bench.json", 1, "no template");
  cli_expect(STUDY "bending " HEXAPOD "--band 200,300 --values 1", 1, "at 1: ");
  cli_expect(STUDY "joint-model " HEXAPOD "--model x", 1, "NAME=JSON");
  cli_expect(STUDY "bending --help", 0, "--values");
}

static void the_gate_says_pass_fail_and_usage(void **state) {
  (void)state;
  cli_expect(GATE SPEC HEXAPOD, 0, "pass: all 16 limits");
  cli_expect(GATE SPEC HEXAPOD "--json", 0, "\"passed\": true");
  char line[1024];
  snprintf(line, sizeof line, "%s/spec.json", folder);
  FILE *file = fopen(line, "w");
  assert_non_null(file);
  fputs("{\"schema\": \"plantbus.gate/1\", \"name\": \"t\", \"limits\": [{\"quantity\": \"order\", "
        "\"max\": 47}]}",
        file);
  fclose(file);
  snprintf(line, sizeof line, GATE "%s/spec.json " HEXAPOD, folder);
  cli_expect(line, 1, "FAIL: 1 of 1 limits missed");
  cli_expect(GATE SPEC PB_CONFIG "/plants/apa300ml-bench.json", 1, "/limits/2");
  cli_expect(GATE SPEC "/nowhere.json", 1, "/nowhere.json");
  cli_expect(GATE HEXAPOD SPEC, 2,
             "nano-hexapod.json: /sample_rate: unknown key");  // the wrong way round
  cli_expect(GATE "/nowhere.json " HEXAPOD, 1, "/nowhere.json");
  cli_expect(GATE SPEC, 2, "are needed");
  snprintf(line, sizeof line, "%s/spec.json", folder);
  unlink(line);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(any_number_of_workers_gives_the_same_bits),
      cmocka_unit_test(mpirun_gives_the_same_bits),
      cmocka_unit_test(results_come_in_the_order_of_the_values),
      cmocka_unit_test(tables_files_and_plots_are_written),
      cmocka_unit_test(a_model_of_ones_own_can_be_studied),
      cmocka_unit_test(what_a_default_cannot_be_is_left_out_and_told),
      cmocka_unit_test(wrong_lines_and_plants_are_told),
      cmocka_unit_test(the_gate_says_pass_fail_and_usage),
  };
  return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
