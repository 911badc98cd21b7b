// plantbus-control: designs from files, and HAC-LAC over the bus with a real daemon.
#include <dirent.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "harness.h"
#include "tool_run.h"

#define HEXAPOD PB_CONFIG "/plants/nano-hexapod.json"
#define BENCH PB_CONFIG "/plants/apa300ml-bench.json"
#define TOOL "plantbus-control"

static char directory[] = "/tmp/pb-control-XXXXXX";

static int begin(void **state) {
  (void)state;
  return mkdtemp(directory) ? 0 : -1;
}

static int finish(void **state) {
  (void)state;
  char command[64];
  snprintf(command, sizeof command, "rm -rf %s", directory);
  return system(command);
}

static double number(const cJSON *object, const char *key) {
  const cJSON *item = tool_member(object, key);
  if (!cJSON_IsNumber(item)) fail_msg("'%s' is no number", key);
  return item->valuedouble;
}

static bool exists(const char *name) {
  char path[128];
  snprintf(path, sizeof path, "%s/%s", directory, name);
  FILE *f = fopen(path, "r");
  if (f) fclose(f);
  return f != NULL;
}

static void usage(const char *line, const char *part) {
  tool_result r = tool_run(TOOL, 0, NULL, line);
  if (r.code != 2) fail_msg("%s: exit code %d", line, r.code);
  tool_says(r.err, part);
  tool_free(&r);
}

static void refused_on(uint32_t domain, const char *line, const char *part) {
  tool_result r = tool_run(TOOL, domain, NULL, line);
  if (r.code != 1) fail_msg("%s: exit code %d", line, r.code);
  tool_says(r.err, part);
  assert_string_equal(r.out, "");
  tool_free(&r);
}

static void refused(const char *line, const char *part) {
  refused_on(0, line, part);
}

static void iff_finds_the_gain_and_the_damping(void **state) {
  (void)state;
  char line[256];
  snprintf(line, sizeof line, "iff " HEXAPOD " --json -o %s", directory);
  cJSON *json = tool_json(TOOL, 0, NULL, line, 0);
  const cJSON *mode, *modes = tool_member(json, "modes");
  double smallest = number(tool_member(json, "search"), "smallest_damping"), seen = 1;
  assert_int_equal(cJSON_GetArraySize(modes), 6);
  cJSON_ArrayForEach(mode, modes) {
    double open = number(tool_member(mode, "open_exact"), "damping");
    double closed = number(tool_member(mode, "closed_predicted"), "damping");
    assert_true(open < 0.01 && closed > 20 * open);
    seen = fmin(seen, closed);
  }
  assert_true(fabs(seen - smallest) < 1e-3 * smallest);
  assert_true(tool_member(tool_member(json, "controller"), "best")->type == cJSON_True);
  assert_true(exists("control-iff.json") && exists("iff.mat") && exists("iff-root-locus.csv"));
  assert_true(exists("iff-predicted.csv") && exists("iff-predicted.mat"));
  cJSON_Delete(json);
}

// The best gain is the largest that can be doubled, or none near it does better: here a smaller one
// damps the worst mode less, and twice a little more is unstable.
static void iff_gain_is_the_best(void **state) {
  (void)state;
  double best = 0, smallest[2];
  for (int k = 0; k < 2; k++) {
    char line[256];
    snprintf(line, sizeof line, k ? "iff " HEXAPOD " --json --gain %.6f" : "iff " HEXAPOD " --json",
             0.8 * best);
    cJSON *json = tool_json(TOOL, 0, NULL, line, 0);
    const cJSON *mode;
    if (k == 0) best = number(tool_member(json, "controller"), "gain");
    smallest[k] = 1;
    cJSON_ArrayForEach(mode, tool_member(json, "modes")) {
      double damping = number(tool_member(mode, "closed_predicted"), "damping");
      smallest[k] = fmin(smallest[k], damping);
    }
    cJSON_Delete(json);
  }
  assert_true(smallest[1] < smallest[0]);
  char line[256];
  snprintf(line, sizeof line, "iff " HEXAPOD " --gain %.6f", 2.1 * best);
  refused(line, "the loop is predicted to be unstable");
}

// What loci and poles say of the border agrees; no loop exceeds 1 beyond the bandwidth.
static void hac_is_judged_in_both_frames(void **state) {
  (void)state;
  static const char *const frame[] = {"strut", "cartesian"};
  for (int k = 0; k < 2; k++) {
    char line[300];
    snprintf(line, sizeof line, "hac " HEXAPOD " --json --bandwidth 200 --iff-gain 400 --frame %s",
             frame[k]);
    cJSON *json = tool_json(TOOL, 0, NULL, line, 0);
    const cJSON *loop, *locus;
    double up = INFINITY;
    assert_true(tool_member(json, "stable")->type == cJSON_True);
    assert_true(number(tool_member(json, "worst_pole"), "modulus") < 1);
    cJSON_ArrayForEach(locus, tool_member(json, "loci")) {
      const cJSON *item = tool_member(locus, "gain_up");
      if (cJSON_IsNumber(item)) up = fmin(up, item->valuedouble);
    }
    assert_true(fabs(number(json, "gain_up") / up - 1) < 0.01);
    cJSON_ArrayForEach(loop, tool_member(json, "loops")) {
      assert_true(number(loop, "phase_margin_degree") > 30);
      assert_true(number(loop, "modulus") > 0.5);
    }
    assert_true(number(tool_member(json, "sensitivity"), "peak") > 1);
    const cJSON *jacobian = cJSON_GetObjectItem(tool_member(json, "hac"), "jacobian");
    assert_true((jacobian != NULL) == (k == 1));
    if (jacobian) assert_true(number(jacobian, "difference") < 1e-9);
    // HAC holds the point still where the plant alone does not.
    const cJSON *row = cJSON_GetArrayItem(tool_member(json, "transmission"), 0);
    assert_true(number(tool_member(row, "hac"), "low") <
                0.2 * number(tool_member(row, "undamped"), "low"));
    cJSON_Delete(json);
  }
}

static void an_unstable_design_is_not_exported(void **state) {
  (void)state;
  char line[300];
  snprintf(line, sizeof line,
           "hac " BENCH " --metrology y --bandwidth 300 --lead 1 --integrator 200 --no-iff -o %s",
           directory);
  tool_result r = tool_run(TOOL, 0, NULL, line);
  assert_int_equal(r.code, 1);
  tool_says(r.out, "UNSTABLE");
  tool_says(r.err, "bandwidth: with 300 Hz the closed loop is unstable");
  assert_true(exists("hac.mat") && !exists("control-hac.json"));
  tool_free(&r);
}

static void mistakes_are_named(void **state) {
  (void)state;
  usage("hac " HEXAPOD, "--bandwidth is missing");
  usage("hac --bandwidth 100", "a plant file is wanted, or --live");
  usage("hac " HEXAPOD " --bandwidth 100 --frame polar", "--frame: 'polar'");
  usage("hac " HEXAPOD " --bandwidth 100 --lead 0.5", "--lead");
  usage("hac " HEXAPOD " --bandwidth 100 --no-iff --iff-gain 4", "exclude each other");
  usage("run " HEXAPOD " --bandwidth 100", "run works on the plant of the bus");
  usage("tune", "is not one of its commands");
  refused("hac " HEXAPOD " --bandwidth 6000", "bandwidth: 6000 Hz");
  refused("hac " HEXAPOD " --bandwidth 100 --metrology dL1,dL2", "2 outputs for 6 actuators");
  refused("hac " HEXAPOD " --bandwidth 100 --iff-gain 400 --disturbance Va1",
          "Va1: is an actuator");
  refused("hac " BENCH " --bandwidth 100", "Va: the plant has no output dL");
  refused("hac " BENCH " --bandwidth 100 --metrology z", "z: the plant has no output 'z'; its outputs: Vs, y");
  refused("hac " BENCH " --bandwidth 100 --metrology y --frame cartesian --jacobian geometry",
          "no template");
  refused("hac /nowhere.json --bandwidth 100", "/nowhere.json");
}

// ---- over the bus -------------------------------------------------------------------------------

// A stage's responses are the predicted ones to 1 %, nearly everywhere, and so are the motions.
static void check_stage(const cJSON *json, const char *name) {
  const cJSON *stage = tool_member(tool_member(json, "stages"), name), *rms;
  double magnitude = number(stage, "magnitude_error_percent");
  print_message("%s: within %.2e %% and %.2e degrees, %g of %g lines\n", name, magnitude,
                number(stage, "phase_error_degree"), number(stage, "used"), number(stage, "lines"));
  assert_true(magnitude < 1 && number(stage, "phase_error_degree") < 1);
  assert_true(number(stage, "used") > 0.6 * number(stage, "lines"));
  assert_true(number(stage, "missed") == 0 && number(stage, "flagged") == 0);
  cJSON_ArrayForEach(rms, tool_member(stage, "rms")) {
    double measured = number(rms, "measured"), predicted = number(rms, "predicted");
    if (predicted > 1e-12) assert_true(fabs(measured / predicted - 1) < 0.01);
  }
}

static double rms_of(const cJSON *json, const char *stage, int motion) {
  const cJSON *all = tool_member(tool_member(tool_member(json, "stages"), stage), "rms");
  return number(cJSON_GetArrayItem(all, motion), "measured");
}

// Hosted, in six stages: responses, motions and the sensitivity at the metrology.
static void hac_lac_hosted_is_as_predicted(void **state) {
  (void)state;
  e2e_daemon daemon = e2e_daemon_start(HEXAPOD, NULL);
  char line[400];
  snprintf(line, sizeof line,
           "run --json --hosted --bandwidth 200 --iff-gain 400 --frame cartesian --jacobian static "
           "--resolution 10 "
           "--band 10,300 --settle 1 --no-undamped -o %s",
           directory);
  cJSON *json = tool_json(TOOL, daemon.domain, NULL, line, 0);
  check_stage(json, "iff");
  check_stage(json, "hac");
  for (int k = 0; k < 6; k++) assert_true(rms_of(json, "hac", k) < 0.9 * rms_of(json, "iff", k));
  const cJSON *s = tool_member(json, "sensitivity");
  assert_true(number(s, "error_percent") < 1);
  assert_true(number(s, "used") == number(s, "lines") && number(s, "lines") == 30);
  assert_true(exists("run.mat") && exists("run-spectra.csv") && exists("run-hac.csv"));
  cJSON_Delete(json);
  // What was exported is what the daemon takes; nothing of the run is left in its way.
  snprintf(line, sizeof line, "host_controller @%s/control-hac.json", directory);
  tool_result r = tool_run("plantbus-request", daemon.domain, NULL, line);
  if (r.code != 0) fail_msg("host_controller: %s", r.err);
  tool_free(&r);
  refused_on(
      daemon.domain,
      "run --hosted --bandwidth 200 --iff-gain 400 --settle 0.1 --disturbance Fx --no-undamped",
      "'hac' is in use");
  e2e_daemon_end(&daemon);
}

// HAC answers from a client of its own beside the one that disturbs.
static void hac_lac_over_the_bus_is_as_predicted(void **state) {
  (void)state;
  e2e_daemon daemon = e2e_daemon_start(HEXAPOD, NULL);
  cJSON *json = tool_json(TOOL, daemon.domain, NULL,
                          "run --json --bandwidth 200 --iff-gain 400 --resolution 20 --band 20,300 "
                          "--settle 0.5 --no-undamped --disturbance Fx",
                          0);
  check_stage(json, "iff");
  check_stage(json, "hac");
  assert_true(rms_of(json, "hac", 0) < 0.9 * rms_of(json, "iff", 0));
  assert_string_equal(tool_member(json, "hac_runs")->valuestring, "client");
  cJSON_Delete(json);
  e2e_daemon_end(&daemon);
}

// One strut: undamped too, twice in a row, by a client and hosted, then IFF measured.
static void one_strut_is_controlled(void **state) {
  (void)state;
  e2e_daemon daemon = e2e_daemon_start(BENCH, NULL);
  for (int k = 0; k < 2; k++) {
    char line[200];
    snprintf(
        line, sizeof line,
        "run --json --bandwidth 150 --iff-gain 400 --metrology y --resolution 10 --band 10,400%s",
        k ? " --hosted --no-undamped" : "");
    cJSON *json = tool_json(TOOL, daemon.domain, NULL, line, 0);
    if (k == 0) {
      check_stage(json, "undamped");
      assert_true(rms_of(json, "hac", 0) < 0.5 * rms_of(json, "undamped", 0));
    }
    check_stage(json, "iff");
    check_stage(json, "hac");
    assert_true(number(tool_member(json, "sensitivity"), "error_percent") < 1);
    cJSON_Delete(json);
  }
  cJSON *json = tool_json(TOOL, daemon.domain, NULL,
                          "iff --live --json --gain 400 --band 20,300 --resolution 5", 0);
  const cJSON *mode = cJSON_GetArrayItem(tool_member(json, "modes"), 0);
  double error = number(mode, "damping_error_percent");
  assert_true(fabs(error) < 1);
  assert_true(number(tool_member(json, "damped"), "magnitude_error_percent") < 1);
  cJSON_Delete(json);
  json = tool_json(TOOL, daemon.domain, NULL, "hac --live --json --bandwidth 150 --metrology y", 0);
  assert_true(tool_member(json, "stable")->type == cJSON_True);
  cJSON_Delete(json);
  e2e_daemon_end(&daemon);
}

// An argument names the tests to run (* and ?).
int main(int argc, char **argv) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(iff_finds_the_gain_and_the_damping),
      cmocka_unit_test(iff_gain_is_the_best),
      cmocka_unit_test(hac_is_judged_in_both_frames),
      cmocka_unit_test(an_unstable_design_is_not_exported),
      cmocka_unit_test(mistakes_are_named),
      cmocka_unit_test(hac_lac_hosted_is_as_predicted),
      cmocka_unit_test(hac_lac_over_the_bus_is_as_predicted),
      cmocka_unit_test(one_strut_is_controlled),
  };
  if (argc > 1) cmocka_set_test_filter(argv[1]);
  return cmocka_run_group_tests(tests, begin, finish);
}
