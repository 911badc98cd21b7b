// plantbus-actuator and plantbus-joint as a user runs them: results, files, exit codes, messages;
// and on a running bench.
#include <string.h>
#include <sys/stat.h>

#include "base/json.h"
#include "harness.h"
#include "support/check.h"
#include "tool_run.h"

#define BENCH PB_CONFIG "/plants/apa300ml-bench.json"
#define HEXAPOD PB_CONFIG "/plants/nano-hexapod.json"
#define ACTUATOR "plantbus-actuator"
#define JOINT "plantbus-joint"

static char folder[] = "/tmp/pb-actuator-XXXXXX";

static int make_folder(void **state) {
  (void)state;
  return mkdtemp(folder) ? 0 : -1;
}

// Removes a result file, which must be there and not empty.
static void take(const char *name) {
  char path[256];
  struct stat info;
  snprintf(path, sizeof path, "%s/%s", folder, name);
  if (stat(path, &info) != 0 || info.st_size == 0) fail_msg("no %s", path);
  unlink(path);
}

static int remove_folder(void **state) {
  (void)state;
  return rmdir(folder);  // fails when a tool left something behind
}

static double number(const cJSON *object, const char *key) {
  const cJSON *item = tool_member(object, key);
  if (!cJSON_IsNumber(item)) fail_msg("%s is no number", key);
  return item->valuedouble;
}

static void says(const char *tool, const char *line, int code, const char *part) {
  tool_result r = tool_run(tool, TOOL_NO_DOMAIN, NULL, line);
  if (r.code != code) fail_msg("%s %s ended with %d: %s", tool, line, r.code, r.err);
  tool_says(code ? r.err : r.out, part);
  tool_free(&r);
}

static void constants(void **state) {
  (void)state;
  cJSON *j = tool_json(ACTUATOR, TOOL_NO_DOMAIN, NULL, "constants --json", 0);
  ASSERT_RELATIVE(number(j, "g_a"), 26.1, 1e-3);
  ASSERT_RELATIVE(number(j, "g_s"), 5.06e6, 1e-3);
  cJSON_Delete(j);
  j = tool_json(ACTUATOR, TOOL_NO_DOMAIN, NULL, "constants --json --layers 80 --area 2e-4", 0);
  ASSERT_RELATIVE(number(j, "g_a"), 26.112, 1e-9);
  ASSERT_RELATIVE(number(j, "g_s"), 2 * 5.059523809523809e6, 1e-9);
  cJSON_Delete(j);
  says(ACTUATOR, "constants", 0, "26.112  N/V");
  says(ACTUATOR, "constants --layers 0", 2, "--layers");
  char line[300];
  snprintf(line, sizeof line, "constants --plot -o %s", folder);
  says(ACTUATOR, line, 0, "5.0595  V/µm");
  take("constants.csv");
  take("constants.mat");
  take("constants.png");
}

// ---- selection ----------------------------------------------------------------------------------

static const cJSON *by_name(const cJSON *list, const char *name) {
  const cJSON *item;
  cJSON_ArrayForEach(item, list) {
    if (!strcmp(tool_member(item, "name")->valuestring, name)) return item;
  }
  fail_msg("no %s", name);
  return NULL;
}

static void table_2_1_against_the_specification(void **state) {
  (void)state;
  static const struct {
    const char *name, *verdict;
    int meets;
  } wanted[] = {
      {"APA150M", "near miss", 0},
      {"APA300ML", "misses", 0},
      {"APA400MML", "misses", 0},
      {"FPA-0500E-P", "meets what is known", 1},
      {"FPA-0300E-S", "meets what is known", 1},
  };
  cJSON *j = tool_json(ACTUATOR, TOOL_NO_DOMAIN, NULL, "select --json", 0);
  const cJSON *list = tool_member(j, "actuators");
  for (size_t i = 0; i < 5; i++) {
    const cJSON *a = by_name(list, wanted[i].name);
    assert_string_equal(tool_member(a, "verdict")->valuestring, wanted[i].verdict);
    assert_int_equal(cJSON_IsTrue(tool_member(a, "meets")), wanted[i].meets);
  }
  const cJSON *resolution =
      tool_member(tool_member(by_name(list, "APA300ML"), "limits"), "resolution");
  ASSERT_NEAR(number(resolution, "margin"), -0.5, 1e-9);
  resolution = tool_member(tool_member(by_name(list, "FPA-0500E-P"), "limits"), "resolution");
  assert_true(cJSON_IsNull(tool_member(resolution, "value")));
  assert_string_equal(tool_member(resolution, "verdict")->valuestring, "unknown");
  cJSON_Delete(j);
  says(ACTUATOR, "select", 0, "resolution by 50 %");
}

static void nothing_meets_a_strict_specification(void **state) {
  (void)state;
  cJSON *j = tool_json(ACTUATOR, TOOL_NO_DOMAIN, NULL, "select --json --strict", 1);
  ASSERT_NEAR(number(j, "meeting"), 0, 0);
  cJSON_Delete(j);
  char file[256], line[700];
  snprintf(file, sizeof file, "%s/spec.json", folder);
  FILE *stream = fopen(file, "w");
  assert_non_null(stream);
  fputs("{\"schema\":\"plantbus.specification/"
        "1\",\"name\":\"s\",\"limits\":{\"weight\":{\"above\":1}}}",
        stream);
  fclose(stream);
  snprintf(line, sizeof line, "select --specification %s", file);
  says(ACTUATOR, line, 1, "spec.json: /limits/weight: is no quantity");
  stream = fopen(file, "w");
  fputs("{\"schema\":\"plantbus.specification/"
        "1\",\"name\":\"s\",\"limits\":{\"stroke\":{\"above\":4e-4}}}",
        stream);
  fclose(stream);
  snprintf(line, sizeof line, "select --specification %s --json", file);
  j = tool_json(ACTUATOR, TOOL_NO_DOMAIN, NULL, line, 0);
  ASSERT_NEAR(number(j, "meeting"), 1, 0);
  const cJSON *near = by_name(tool_member(j, "actuators"), "APA400MML");
  assert_string_equal(tool_member(near, "verdict")->valuestring, "near miss");
  cJSON_Delete(j);
  take("spec.json");
  snprintf(line, sizeof line, "select --plot -o %s", folder);
  says(ACTUATOR, line, 0, "FPA-0500E-P");
  take("select.csv");
  take("select.mat");
  take("select.png");
}

// ---- characterize, fit, boundary ----------------------------------------------------------------

static void a_plant_files_actuator(void **state) {
  (void)state;
  char line[700];
  cJSON *j = tool_json(ACTUATOR, TOOL_NO_DOMAIN, NULL,
                       "characterize " BENCH " --json --datasheet APA300ML", 0);
  ASSERT_RELATIVE(number(j, "stiffness"), 1.7333333e6, 1e-6);
  assert_true(cJSON_IsNull(tool_member(j, "amplification")));
  const cJSON *sheet = tool_member(tool_member(j, "data_sheet"), "stiffness");
  ASSERT_NEAR(number(sheet, "difference_percent"), 100 * (1.7333333 / 1.8 - 1), 1e-4);
  cJSON_Delete(j);
  snprintf(line, sizeof line, "characterize " BENCH " --plot -o %s", folder);
  says(ACTUATOR, line, 0, "1.7333  N/µm");
  take("characterize.csv");
  take("characterize.mat");
  take("characterize.png");
  says(ACTUATOR, "characterize", 2, "which actuator?");
  says(ACTUATOR, "characterize " HEXAPOD, 1, "--length: model apa300ml has no length");
  says(ACTUATOR, "characterize " HEXAPOD " --length 0.1", 0, "1.7333  N/µm");
  says(ACTUATOR, "characterize " BENCH " --ends 1,2", 1, "a plant file says itself");
  says(ACTUATOR, "characterize " BENCH " --model spring", 1, "has no model \"spring\"");
  says(ACTUATOR, "characterize " BENCH " --datasheet X", 1, "no data sheet of X");
  says(ACTUATOR, "characterize /nowhere.mat", 1, "/nowhere.mat");
  says(ACTUATOR, "invent", 2, "is not one of its commands");
}

static void a_fit_writes_a_model_that_loads(void **state) {
  (void)state;
  char line[700], model[256];
  snprintf(model, sizeof model, "%s/model.json", folder);
  snprintf(line, sizeof line,
           "fit " BENCH " --json --plot -o %s --write %s --name apa300ml --refine 5,300", folder,
           model);
  cJSON *j = tool_json(ACTUATOR, TOOL_NO_DOMAIN, NULL, line, 0);
  const cJSON *p = tool_member(j, "parameters");
  ASSERT_RELATIVE(number(p, "k_1"), 0.3e6, 1e-6);
  ASSERT_RELATIVE(number(p, "k_e"), 4.3e6, 1e-3);
  ASSERT_RELATIVE(number(p, "g_s"), 0.53e6, 1e-3);
  ASSERT_NEAR(number(j, "moving_mass"), 5.056, 1e-9);
  assert_true(number(tool_member(j, "refined"), "after") < 1e-3);
  cJSON_Delete(j);
  // The model in place of the bench's own: the same stiffness.
  cJSON *file = NULL, *patch = NULL;
  char *text = NULL, path[256];
  REQUIRE(pb_json_read(BENCH, &file, NULL, &err));
  REQUIRE(pb_json_read(model, &patch, NULL, &err));
  cJSON *merged = pb_json_merge(file, patch);
  REQUIRE(pb_json_print(merged, &text, &err));
  snprintf(path, sizeof path, "%s/plant.json", folder);
  FILE *stream = fopen(path, "w");
  fputs(text, stream);
  fclose(stream);
  snprintf(line, sizeof line, "characterize %s --json", path);
  j = tool_json(ACTUATOR, TOOL_NO_DOMAIN, NULL, line, 0);
  ASSERT_RELATIVE(number(j, "stiffness"), 1.7333333e6, 1e-3);
  cJSON_Delete(j);
  cJSON_Delete(file);
  cJSON_Delete(patch);
  cJSON_Delete(merged);
  free(text);
  take("plant.json");
  take("model.json");
  take("fit.csv");
  take("fit.mat");
  take("fit-y.png");
  take("fit-Vs.png");
  says(ACTUATOR, "fit " BENCH " --free-ratio", 2, "--free-ratio goes with --refine");
  says(ACTUATOR, "fit", 2, "tune to one of");
}

static void boundaries_of_a_plant_files_actuator(void **state) {
  (void)state;
  char line[700];
  snprintf(line, sizeof line,
           "boundary " BENCH " --json --coupling 0.6 --resistance 900,300 --plot -o %s", folder);
  cJSON *j = tool_json(ACTUATOR, TOOL_NO_DOMAIN, NULL, line, 0);
  const cJSON *rows = tool_member(j, "boundaries");
  assert_int_equal(cJSON_GetArraySize(rows), 4);
  const cJSON *closed = rows->child, *open = closed->next, *first = open->next;
  ASSERT_NEAR(number(closed, "resonance_hz"), 93.183, 1e-3);
  ASSERT_RELATIVE(number(open, "stack_stiffness"), 4.3e6 / 0.64, 1e-9);
  // M ω² = k_1 + k_a k_e/(k_a + k_e)
  const double ke = 4.3e6 / 0.64, k = 0.3e6 + 2.15e6 * ke / (2.15e6 + ke);
  ASSERT_RELATIVE(number(open, "resonance_hz"), sqrt(k / 5.056) / 6.283185307179586, 1e-4);
  ASSERT_NEAR(number(first, "resistance"), 300, 0);
  assert_true(number(first, "damping") > 5 * number(closed, "damping"));
  assert_true(number(first, "resonance_hz") > number(closed, "resonance_hz") &&
              number(first, "resonance_hz") < number(open, "resonance_hz"));
  cJSON_Delete(j);
  take("boundary.csv");
  take("boundary.mat");
  take("boundary.png");
  take("boundary-resistance.png");
  says(ACTUATOR, "boundary " BENCH " --coupling 1", 2, "--coupling");
}

// ---- joints -------------------------------------------------------------------------------------

static void a_joint_against_table_3_1(void **state) {
  (void)state;
  char path[256], line[700];
  snprintf(path, sizeof path, "%s/joints.json", folder);
  FILE *stream = fopen(path, "w");
  assert_non_null(stream);
  fputs("{\"models\":{\"soft\":{\"type\":\"bushing\",\"k_a\":94e6,\"k_s\":12.7e6,\"k_f\":4.83,"
        "\"k_t\":260},\"stiff\":{\"type\":\"bushing\",\"k_a\":150e6,\"k_s\":12.7e6,\"k_f\":4.83,"
        "\"k_t\":260}}}",
        stream);
  fclose(stream);
  snprintf(line, sizeof line, "characterize %s --model soft --json --check", path);
  cJSON *j = tool_json(JOINT, TOOL_NO_DOMAIN, NULL, line, 1);
  const cJSON *axial = tool_member(tool_member(j, "limits"), "axial_stiffness");
  ASSERT_NEAR(number(axial, "margin"), -0.06, 1e-9);
  assert_string_equal(tool_member(axial, "verdict")->valuestring, "miss");
  const cJSON *stroke = tool_member(tool_member(j, "limits"), "bending_stroke");
  assert_string_equal(tool_member(stroke, "verdict")->valuestring, "unknown");
  cJSON_Delete(j);
  snprintf(line, sizeof line, "characterize %s --model soft", path);
  says(JOINT, line, 0, "miss by 6 %");
  snprintf(line, sizeof line, "characterize %s --model stiff --check --stroke 0.02 --plot -o %s",
           path, folder);
  says(JOINT, line, 0, "pass");
  take("joint.csv");
  take("joint.mat");
  take("joint.png");
  snprintf(line, sizeof line, "characterize %s", path);
  says(JOINT, line, 1, "several of its models would do: soft stiff");
  says(JOINT, "characterize", 2, "which joint?");
  take("joints.json");
}

// ---- on a running bench -------------------------------------------------------------------------

static void the_running_bench(void **state) {
  (void)state;
  e2e_daemon bench = e2e_daemon_start(BENCH, NULL);
  char line[700];
  snprintf(line, sizeof line, "characterize --live --json --resolution 4 --band 4,400 --domain %u",
           bench.domain);
  cJSON *j = tool_json(ACTUATOR, TOOL_NO_DOMAIN, NULL, line, 0);
  ASSERT_RELATIVE(number(j, "stiffness"), 1.7333333e6, 1e-4);
  ASSERT_NEAR(number(j, "loaded_resonance"), 93.183, 2e-3);
  cJSON_Delete(j);
  snprintf(line, sizeof line, "fit --live --json --resolution 4 --band 4,400 --domain %u",
           bench.domain);
  j = tool_json(ACTUATOR, TOOL_NO_DOMAIN, NULL, line, 0);
  const cJSON *p = tool_member(j, "parameters");
  ASSERT_RELATIVE(number(p, "k_1"), 0.3e6, 1e-3);
  ASSERT_RELATIVE(number(p, "c_1"), 18, 1e-2);
  ASSERT_RELATIVE(number(p, "k_e"), 4.3e6, 1e-3);
  ASSERT_RELATIVE(number(p, "g_a"), 2.7, 1e-3);
  cJSON_Delete(j);
  // The boundary switched on the running plant, and put back.
  snprintf(line, sizeof line,
           "boundary --live --coupling 0.6 --resistance 300 --json --resolution 4 --band 4,400 "
           "--domain %u",
           bench.domain);
  j = tool_json(ACTUATOR, TOOL_NO_DOMAIN, NULL, line, 0);
  const cJSON *closed = tool_member(j, "boundaries")->child, *open = closed->next;
  const double ke = 4.3e6 / 0.64, k = 0.3e6 + 2.15e6 * ke / (2.15e6 + ke);
  ASSERT_RELATIVE(number(closed, "resonance_hz"), 93.183, 1e-4);
  ASSERT_RELATIVE(number(open, "resonance_hz"), sqrt(k / 5.056) / 6.283185307179586, 1e-4);
  assert_true(number(open->next, "damping") > 5 * number(closed, "damping"));
  cJSON_Delete(j);
  tool_result r = tool_run("plantbus-configure", bench.domain, NULL, "get /models/apa300ml");
  assert_null(strstr(r.out, "boundary"));
  tool_free(&r);
  e2e_daemon_end(&bench);
}

// What plantbus-identify wrote, as CSV and as MAT.
static void a_measured_response(void **state) {
  (void)state;
  e2e_daemon bench = e2e_daemon_start(BENCH, NULL);
  char line[700];
  snprintf(line, sizeof line, "--input Va --output Vs,y --band 4,400 --resolution 4 -o %s", folder);
  tool_result r = tool_run("plantbus-identify", bench.domain, NULL, line);
  assert_int_equal(r.code, 0);
  tool_free(&r);
  e2e_daemon_end(&bench);
  static const char *const files[] = {"identify.csv", "identify.mat"};
  for (int i = 0; i < 2; i++) {
    snprintf(line, sizeof line, "fit --frf %s/%s --json", folder, files[i]);
    cJSON *j = tool_json(ACTUATOR, TOOL_NO_DOMAIN, NULL, line, 0);
    const cJSON *p = tool_member(j, "parameters");
    ASSERT_RELATIVE(number(p, "k_1"), 0.3e6, 1e-3);
    ASSERT_RELATIVE(number(p, "k_a"), 2.15e6, 1e-3);
    ASSERT_RELATIVE(number(p, "g_s"), 0.53e6, 1e-3);
    cJSON_Delete(j);
    snprintf(line, sizeof line, "fit --frf %s/%s --sensor-output Vx", folder, files[i]);
    says(ACTUATOR, line, 1, "Vx");
    take(files[i]);
  }
}

static void damaged_files_are_named(void **state) {
  (void)state;
  static const char head[] = "frequency [Hz],real y from Va [m/V],imag y from Va [m/V],"
                             "real Vs from Va [V/V],imag Vs from Va [V/V]\n";
  static const struct {
    const char *rows, *message;
  } cases[] = {
      {"", "header only"},
      {"1,2,3,4,x\n", ":2: column 5: 'x' is not a number"},
      {"1,2,3,4\n", ":2: expected 5 columns"},
      {"2,1,1,1,1\n1,1,1,1,1\n", "line 3: frequencies are > 0 and ascend"},
  };
  char path[256], line[700];
  snprintf(path, sizeof path, "%s/frf.csv", folder);
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    FILE *stream = fopen(path, "w");
    assert_non_null(stream);
    fprintf(stream, "%s%s", head, cases[i].rows);
    fclose(stream);
    snprintf(line, sizeof line, "fit --frf %s", path);
    says(ACTUATOR, line, 1, cases[i].message);
  }
  take("frf.csv");
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(constants),
      cmocka_unit_test(table_2_1_against_the_specification),
      cmocka_unit_test(nothing_meets_a_strict_specification),
      cmocka_unit_test(a_plant_files_actuator),
      cmocka_unit_test(a_fit_writes_a_model_that_loads),
      cmocka_unit_test(boundaries_of_a_plant_files_actuator),
      cmocka_unit_test(a_joint_against_table_3_1),
      cmocka_unit_test(the_running_bench),
      cmocka_unit_test(a_measured_response),
      cmocka_unit_test(damaged_files_are_named),
  };
  return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
