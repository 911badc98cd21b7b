// What every tool does with a wrong command line, a file that is not there, and a place that takes
// no result: exit code 2 or 1, and a message that names the flag or the file.
#include "cli_run.h"
#include "support/check.h"

#define BIN PB_BIN "/plantbus-"
#define BENCH PB_CONFIG "/plants/apa300ml-bench.json"
#define HEXAPOD PB_CONFIG "/plants/nano-hexapod.json"
#define GATE PB_CONFIG "/specifications/nano-hexapod.json"

static const char *const tools[] = {
    "model frf",
    "identify",
    "iff",
    "control iff",
    "control hac",
    "control run",
    "part build",
    "part reduce",
    "part import",
    "part doctor",
    "part truncate",
    "actuator characterize",
    "actuator constants",
    "actuator select",
    "actuator fit",
    "actuator boundary",
    "joint characterize",
    "study mass",
    "gate",
    "record",
    "replay info",
    "configure get",
    "request",
    "monitor",
    "doctor",
};

static void unknown_flags_and_help(void **state) {
  (void)state;
  char line[300];
  for (size_t k = 0; k < sizeof tools / sizeof *tools; k++) {
    snprintf(line, sizeof line, BIN "%s --nonsense", tools[k]);
    cli_expect(line, 2, "nonsense");
    snprintf(line, sizeof line, BIN "%s --help", tools[k]);
    cli_expect(line, 0, "Usage");
  }
  cli_expect(BIN "example --help", 0, "usage");
  cli_expect(BIN "example Va Vs much 1", 2, "usage");
}

static void missing_files(void **state) {
  (void)state;
  static const char *const lines[] = {
      "model frf /no/file.json",
      "control iff /no/file.json",
      "control hac /no/file.json --bandwidth 100",
      "part build /no/file.json",
      "part doctor /no/file.mat",
      "part truncate /no/file.mat --band 1,100",
      "actuator characterize /no/file.mat",
      "actuator characterize " BENCH " --datasheet /no/file.json:X",
      "actuator fit /no/file.json",
      "actuator fit --frf /no/file.csv",
      "actuator fit --frf /no/file.mat",
      "actuator boundary /no/file.mat",
      "actuator select --actuators /no/file.json",
      "actuator select --specification /no/file.json",
      "joint characterize /no/file.mat",
      "study mass /no/file.json",
      "study joint-model " HEXAPOD " --model x=@/no/file.json",
      "gate /no/file.json " HEXAPOD,
      "gate " GATE " /no/file.json",
      "replay info /no/file.mcap",
  };
  char line[500];
  for (size_t k = 0; k < sizeof lines / sizeof *lines; k++) {
    snprintf(line, sizeof line, BIN "%s", lines[k]);
    cli_expect(line, 1, "/no/file");
  }
}

static void values_of_flags(void **state) {
  (void)state;
  static const char *const value[] = {"1x", "nan", "inf", "-5", "", "0x10", "1e999"};
  static const struct {
    const char *line, *flag;
  } tool[] = {
      {"actuator boundary " BENCH, "--load"},
      {"actuator boundary " BENCH, "--resistance"},
      {"actuator constants", "--d33"},
      {"actuator select", "--near"},
      {"control hac " HEXAPOD, "--bandwidth"},
      {"identify", "--averages"},
      {"identify", "--coherence-target"},
      {"identify", "--band"},
      {"identify", "--blocks"},
      {"iff", "--strut"},
      {"iff", "--gain"},
      {"iff", "--corners"},
      {"joint characterize " BENCH, "--stroke"},
      {"study mass " HEXAPOD, "--points"},
      {"study mass " HEXAPOD, "--values"},
  };
  char line[500];
  for (size_t k = 0; k < sizeof tool / sizeof *tool; k++) {
    for (size_t v = 0; v < sizeof value / sizeof *value; v++) {
      snprintf(line, sizeof line, BIN "%s %s=%s", tool[k].line, tool[k].flag, value[v]);
      cli_expect(line, 2, tool[k].flag);
    }
  }
}

static void what_does_not_go_together(void **state) {
  (void)state;
  cli_expect(BIN "actuator boundary " BENCH " --live", 2, "Give one of");
  cli_expect(BIN "actuator boundary --live --load 5", 2, "--load");
  cli_expect(BIN "actuator characterize --live --plot", 2, "--plot");
  cli_expect(BIN "actuator fit --live --excitation noise", 2, "--excitation");
  cli_expect(BIN "actuator fit --live --axis 1,0,0", 2, "--live");
  cli_expect(BIN "control run --bandwidth 100 --live", 2, "--live");
  cli_expect(BIN "study joint-model " HEXAPOD " --model x={bad", 1, "--model: x");
}

// A directory that takes no files is told before there is a plant on the bus, or any other work.
static void places_that_take_nothing(void **state) {
  (void)state;
  static const char *const lines[] = {
      "identify",
      "iff",
      "control run --bandwidth 100",
      "control hac " HEXAPOD " --bandwidth 100",
      "actuator characterize --live",
      "study mass " HEXAPOD,
  };
  char line[500];
  for (size_t k = 0; k < sizeof lines / sizeof *lines; k++) {
    snprintf(line, sizeof line, BIN "%s --output-dir /no/directory", lines[k]);
    cli_expect(line, 1, "/no/directory");
  }
}

// Runs the line with a full standard output: exit code 1, told once.
static void expect_full(const char *line) {
  char shell[600], text[4000];
  snprintf(shell, sizeof shell, "%s 2>&1 > /dev/full", line);
  FILE *run = popen(shell, "r");
  assert_non_null(run);
  text[fread(text, 1, sizeof text - 1, run)] = 0;
  const int status = pclose(run);
  const char *told = strstr(text, "standard output: cannot be written");
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 1 || !told || strstr(told + 1, "standard output"))
    fail_msg("%s ended with %d: %s", line, status, text);
}

static void a_full_standard_output(void **state) {
  (void)state;
  static const char *const full[] = {
      "actuator constants",
      "actuator constants --json",
      "actuator select --json",
      "gate " GATE " " HEXAPOD,
      "model info " HEXAPOD,
      "model frf --json --output Vs --input Va --points 100000 " BENCH,
      "part --help",
      "part doctor " PB_CONFIG "/elements/flexible-joint.mat",
      "example --help",
  };
  char line[500];
  for (size_t k = 0; k < sizeof full / sizeof *full; k++) {
    snprintf(line, sizeof line, BIN "%s", full[k]);
    expect_full(line);
  }
  for (size_t k = 0; k < sizeof tools / sizeof *tools; k++) {
    snprintf(line, sizeof line, BIN "%s --help", tools[k]);
    expect_full(line);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(unknown_flags_and_help),   cmocka_unit_test(missing_files),
      cmocka_unit_test(values_of_flags),          cmocka_unit_test(what_does_not_go_together),
      cmocka_unit_test(places_that_take_nothing), cmocka_unit_test(a_full_standard_output),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
