// The experiments as a user runs them: plantbusd serves a plant in lockstep, plantbus-identify and
// plantbus-iff work on it over the bus, and what they report in JSON is held against the limits.
// Arguments: identify | repeat | iff, plant file, inputs to excite.
#include "support/check.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>

#include "base/json.h"
#include "base/text.h"
#include "harness.h"

extern char **environ;

static const char *plant, *inputs;
static char domain[16], directory[] = "/tmp/pb-accept-XXXXXX";
static e2e_daemon served;

static int start(void **state) {
  (void)state;
  if (!mkdtemp(directory)) return -1;
  served = e2e_daemon_start(plant, NULL);
  snprintf(domain, sizeof domain, "%u", served.domain);
  return 0;
}

static int end(void **state) {
  (void)state;
  e2e_daemon_end(&served);
  char command[64];
  snprintf(command, sizeof command, "rm -rf %s", directory);
  return system(command);
}

// Runs a tool with these arguments (--domain and --json are added), its standard output into a
// file; returns what it printed as JSON.
static cJSON *run(const char *tool, const char *const *arguments) {
  const char *argv[24] = {tool, "--domain", domain, "--json"};
  char output[64];
  size_t n = 4;
  pid_t pid;
  int status;
  for (; *arguments; arguments++) argv[n++] = *arguments;
  assert_true(n < 24);
  snprintf(output, sizeof output, "%s/stdout", directory);
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, 1, output, O_CREAT | O_TRUNC | O_WRONLY, 0600);
  assert_int_equal(posix_spawn(&pid, tool, &files, NULL, (char **)argv, environ), 0);
  posix_spawn_file_actions_destroy(&files);
  assert_int_equal(waitpid(pid, &status, 0), pid);
  assert_true(WIFEXITED(status));
  assert_int_equal(WEXITSTATUS(status), 0);
  cJSON *report = NULL;
  REQUIRE(pb_json_read(output, &report, NULL, &err));
  return report;
}

static double number(const cJSON *object, const char *key) {
  const cJSON *value = pb_json_member(object, key);
  if (!cJSON_IsNumber(value)) fail_msg("the report has no number \"%s\"", key);
  return value->valuedouble;
}

// Within 1 % and 1° of the exact sampled response wherever the coherence is above 0.99 and the
// response above its noise, which on this noiseless plant is nearly everywhere.
static void test_identify(void **state) {
  (void)state;
  const char *const arguments[] = {"--input",      inputs, "--band", "10,300",
                                   "--resolution", "1",    NULL};
  cJSON *report = run(PB_BIN "/plantbus-identify", arguments);
  const cJSON *agreement = pb_json_member(report, "agreement");
  double magnitude = number(agreement, "magnitude_error_percent");
  double phase = number(agreement, "phase_error_degree");
  double used = number(agreement, "used"), lines = number(agreement, "lines");
  print_message("%s: within %.2e %% and %.2e° on %g of %g lines\n", plant, magnitude, phase, used,
                lines);
  assert_true(magnitude < 1 && phase < 1);
  assert_true(lines > 100 && used > 0.95 * lines);
  cJSON_Delete(report);
}

// The same seed gives the same bytes, another one does not.
static void test_repeat(void **state) {
  (void)state;
  char *samples[3];
  size_t length[3];
  for (int i = 0; i < 3; i++) {
    char file[64];
    snprintf(file, sizeof file, "%s/samples", directory);
    const char *const arguments[] = {
        "--input", inputs,   "--band",          "50,150",         "--resolution", "10", "--settle",
        "0.05",    "--seed", i < 2 ? "7" : "8", "--save-samples", file,           NULL};
    cJSON_Delete(run(PB_BIN "/plantbus-identify", arguments));
    REQUIRE(pb_text_read(file, &samples[i], &length[i], &err));
  }
  assert_true(length[0] > 1000);
  assert_int_equal(length[0], length[1]);
  assert_memory_equal(samples[0], samples[1], length[0]);
  assert_true(length[2] != length[0] || memcmp(samples[0], samples[2], length[0]));
  for (int i = 0; i < 3; i++) free(samples[i]);
}

// Two modes of the same frequency, by symmetry, show one pole in a measurement.
static bool has_measured_twin(const cJSON *modes, const cJSON *mode) {
  const double hz = number(pb_json_member(mode, "closed_predicted"), "hz");
  const cJSON *other;
  cJSON_ArrayForEach(other, modes) {
    const cJSON *damping = pb_json_member(pb_json_member(other, "closed_measured"), "damping");
    const double near = number(pb_json_member(other, "closed_predicted"), "hz") / hz - 1;
    if (other != mode && cJSON_IsNumber(damping) && fabs(near) < 1e-3) return true;
  }
  return false;
}

// The damping that the closed loop shows is the predicted one, to 5 % of it, mode by mode.
static void test_iff(void **state) {
  (void)state;
  static const char *const arguments[] = {"--gain",       "400", "--band",         "5,250",
                                          "--resolution", "1",   "--no-open-loop", NULL};
  cJSON *report = run(PB_BIN "/plantbus-iff", arguments);
  const cJSON *mode;
  size_t compared = 0, twins = 0;
  cJSON_ArrayForEach(mode, pb_json_member(report, "modes")) {
    const cJSON *predicted = pb_json_member(mode, "closed_predicted");
    const cJSON *measured = pb_json_member(mode, "closed_measured");
    if (cJSON_IsNull(pb_json_member(measured, "damping"))) {
      assert_true(has_measured_twin(pb_json_member(report, "modes"), mode));
      twins++;
      continue;
    }
    double a = number(measured, "damping"), b = number(predicted, "damping");
    double before = number(pb_json_member(mode, "open_exact"), "damping");
    print_message("%.4g Hz: damping %.5f before, predicted %.5f, measured %.5f\n",
                  number(predicted, "hz"), before, b, a);
    assert_true(fabs(a - b) < 0.05 * b);
    assert_true(b > 5 * before);
    compared++;
  }
  // The bench's mode, or the six of a suspension, with at most a pair along x and y, and one about.
  assert_true(compared == 1 || compared + twins == 6);
  assert_true(twins <= 2);
  cJSON_Delete(report);
}

int main(int argc, char **argv) {
  const char *kind = argc > 3 ? argv[1] : "";
  plant = argc > 3 ? argv[2] : "";
  inputs = argc > 3 ? argv[3] : "";
  if (access(plant, R_OK)) {
    printf("skipped: %s is not here\n", plant);
    return 77;
  }
  const struct CMUnitTest identify[] = {cmocka_unit_test(test_identify)};
  const struct CMUnitTest repeat[] = {cmocka_unit_test(test_repeat)};
  const struct CMUnitTest iff[] = {cmocka_unit_test(test_iff)};
  if (!strcmp(kind, "identify")) return cmocka_run_group_tests(identify, start, end);
  if (!strcmp(kind, "repeat")) return cmocka_run_group_tests(repeat, start, end);
  if (!strcmp(kind, "iff")) return cmocka_run_group_tests(iff, start, end);
  fprintf(stderr, "usage: experiments identify|repeat|iff PLANT INPUTS\n");
  return 2;
}
