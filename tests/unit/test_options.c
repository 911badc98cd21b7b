// Strict values of flags, exit codes of wrong command lines, the form of messages.
#include "results.h"
#include "session.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

static void test_double(void **state) {
  (void)state;
  double value = 0;
  assert_true(pb_parse_double("-1.5e-3", &value));
  assert_true(value == -1.5e-3);
  assert_true(pb_parse_double("0.1", &value));
  assert_true(value == 0.1);
  static const char *const wrong[] = {"",      " 1", "1 ", "1,5",   "0x10", "nan", "inf",
                                      "1e999", "1e", "-",  "1.2.3", "--1",  "1m"};
  for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
    value = 7;
    if (pb_parse_double(wrong[i], &value) || value != 7) fail_msg("'%s' was taken", wrong[i]);
  }
}

static void test_uint64(void **state) {
  (void)state;
  uint64_t value = 0;
  assert_true(pb_parse_uint64("18446744073709551615", &value));
  assert_true(value == UINT64_MAX);
  assert_false(pb_parse_uint64("18446744073709551616", &value));
  assert_false(pb_parse_uint64("-1", &value));
  assert_false(pb_parse_uint64("", &value));
  assert_false(pb_parse_uint64("1.0", &value));
}

static void test_lists(void **state) {
  (void)state;
  double *value;
  size_t count;
  assert_true(pb_parse_double_list("1,2.5,-3e2", &value, &count));
  assert_int_equal(count, 3);
  assert_true(value[0] == 1 && value[1] == 2.5 && value[2] == -300);
  free(value);
  assert_false(pb_parse_double_list("1,,2", &value, &count));
  assert_null(value);
  assert_int_equal(count, 0);
  assert_false(pb_parse_double_list("1,2,", &value, &count));
  assert_false(pb_parse_double_list("", &value, &count));
  pb_name_list names = {0};
  assert_true(pb_parse_names("Va1,Va2", &names));
  assert_true(pb_parse_names("Fz", &names));
  assert_int_equal(names.count, 3);
  assert_string_equal(names.name[1], "Va2");
  assert_string_equal(names.name[2], "Fz");
  assert_false(pb_parse_names("a,,b", &names));
  pb_name_list_free(&names);
  assert_true(pb_parse_names("\"x, y\",z,\"5\"\" disk\",a\"b", &names));
  assert_int_equal(names.count, 4);
  assert_string_equal(names.name[0], "x, y");
  assert_string_equal(names.name[1], "z");
  assert_string_equal(names.name[2], "5\" disk");
  assert_string_equal(names.name[3], "a\"b");
  static const char *const bad[] = {"", ",", "a,", "\"", "\"a", "\"a\"b", "\"\"", "a,\"b"};
  for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
    assert_false(pb_parse_names(bad[i], &names));
  pb_name_list_free(&names);
  assert_int_equal(names.count, 0);
}

// ---- a small tool, run in a child process ------------------------------------------------------

typedef struct tool {
  pb_common_options common;
  pb_result_options result;
  double gain, f1, f2, axis[3];
  size_t frames[2];
} tool;

static error_t parse_tool(int key, char *arg, struct argp_state *state) {
  tool *t = state->input;
  switch (key) {
  case ARGP_KEY_INIT:
    state->child_inputs[0] = &t->common;
    state->child_inputs[1] = &t->result;
    return 0;
  case 'b':
    pb_option_band(state, "--band", arg, &t->f1, &t->f2);
    return 0;
  case 'f':
    pb_option_frames(state, "--frames", arg, t->frames);
    return 0;
  case 'a':
    pb_option_direction(state, "--axis", arg, t->axis);
    return 0;
  case 'g':
    t->gain = pb_option_double(state, "--gain", arg, 0, 100);
    return 0;
  default:
    return ARGP_ERR_UNKNOWN;
  }
}

static const struct argp_option tool_option[] = {{"gain", 'g', "G", 0, "gain", 0},
                                                 {"band", 'b', "F1,F2", 0, "band", 0},
                                                 {"frames", 'f', "A,B", 0, "frames", 0},
                                                 {"axis", 'a', "X,Y,Z", 0, "axis", 0},
                                                 {0}};
static const struct argp_child tool_child[] = {
    {&pb_common_argp, 0, NULL, 0}, {&pb_result_argp, 0, NULL, 0}, {0}};
static const struct argp tool_argp = {
    .options = tool_option, .parser = parse_tool, .children = tool_child};

static bool same_text(const char *a, const char *b) {
  return !strcmp(a ? a : "", b ? b : "");
}

// Parses in a child; returns its exit code (10 when parsing came to an end) and what it wrote.
static int run_tool(char **argv, tool *expected, char *text, size_t size) {
  int pipes[2];
  assert_int_equal(pipe(pipes), 0);
  int argc = 0;
  while (argv[argc]) argc++;
  pid_t pid = fork();
  if (pid == 0) {
    dup2(pipes[1], STDERR_FILENO);
    tool t = {.gain = 1};
    error_t failure = pb_options_parse(&tool_argp, argc, argv, &t);
    const pb_session_options where = pb_common_session(&t.common);
    bool same = t.gain == expected->gain && where.domain == expected->common.domain &&
                same_text(where.plant, expected->common.plant) &&
                same_text(where.interface, expected->common.interface) &&
                same_text(where.config, expected->common.config);
    _exit(failure || !same ? 11 : 10);
  }
  close(pipes[1]);
  size_t used = 0;
  ssize_t got;
  while ((got = read(pipes[0], text + used, size - 1 - used)) > 0) used += (size_t)got;
  text[used] = 0;
  close(pipes[0]);
  int result = 0;
  waitpid(pid, &result, 0);
  return WIFEXITED(result) ? WEXITSTATUS(result) : -1;
}

static void test_command_line(void **state) {
  (void)state;
  char text[1024];
  tool expected = {.gain = 2.5, .common = {.domain = 7, .plant = "bench"}};
  char *good[] = {"tool", "--gain", "2.5", "--domain", "7", "--plant=bench", NULL};
  assert_int_equal(run_tool(good, &expected, text, sizeof text), 10);
  assert_string_equal(text, "");
  expected = (tool){.gain = 1, .common = {.interface = "eth1", .plant = "b"}};
  char *network[] = {"tool", "--interface", "eth1", "-p", "b", NULL};
  assert_int_equal(run_tool(network, &expected, text, sizeof text), 10);
  expected = (tool){.gain = 1, .common = {.config = "dds.xml"}};
  char *file[] = {"tool", "--config=dds.xml", NULL};
  assert_int_equal(run_tool(file, &expected, text, sizeof text), 10);
  char *both[] = {"tool", "--config=dds.xml", "--interface=lo", NULL};
  assert_int_equal(run_tool(both, &expected, text, sizeof text), PB_EXIT_USAGE);
  assert_non_null(strstr(text, "--interface has no meaning with --config"));
  char *word[] = {"tool", "--gain", "much", NULL};
  assert_int_equal(run_tool(word, &expected, text, sizeof text), PB_EXIT_USAGE);
  assert_non_null(strstr(text, "--gain: 'much' is not a number"));
  char *range[] = {"tool", "--gain", "101", NULL};
  assert_int_equal(run_tool(range, &expected, text, sizeof text), PB_EXIT_USAGE);
  assert_non_null(strstr(text, "--gain: 101 is out of range, expected 0 to 100"));
  char *domain[] = {"tool", "--domain", "-1", NULL};
  assert_int_equal(run_tool(domain, &expected, text, sizeof text), PB_EXIT_USAGE);
  assert_non_null(strstr(text, "--domain"));
  char *unknown[] = {"tool", "--nothing", NULL};
  assert_int_equal(run_tool(unknown, &expected, text, sizeof text), PB_EXIT_USAGE);
}

// Lists of a known length name their flag and what is wanted.
static void test_known_lists(void **state) {
  (void)state;
  static char *const bad[][3] = {
      {"--band", "5", "--band: '5' is not two frequencies 0 < F1 < F2"},
      {"--band", "0,5", "--band: '0,5' is not two"},
      {"--band", "5,5", "--band: '5,5' is not two"},
      {"--band", "1,nan", "--band: '1,nan' is not two"},
      {"--band", "1,2,3", "--band: '1,2,3' is not two"},
      {"--frames", "1,1", "--frames: '1,1' is not two frames that differ, counted from 1"},
      {"--frames", "0,2", "--frames: '0,2' is not"},
      {"--frames", "1.5,2", "--frames: '1.5,2' is not"},
      {"--frames", "1,1e9", "--frames: '1,1e9' is not"},
      {"--axis", "0,0,0", "--axis: '0,0,0' is not a direction X,Y,Z"},
      {"--axis", "1,0", "--axis: '1,0' is not a direction"},
      {"--output-dir", "", "--output-dir: the name is empty"},
  };
  char text[1024];
  tool expected = {.gain = 1};
  for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
    char *line[] = {"tool", bad[k][0], bad[k][1], NULL};
    assert_int_equal(run_tool(line, &expected, text, sizeof text), PB_EXIT_USAGE);
    if (!strstr(text, bad[k][2])) fail_msg("%s: %s", bad[k][2], text);
  }
  char *good[] = {"tool", "--band", "1,2", "--frames=2,1", "--axis=-1,0,0", "-o", "x", NULL};
  assert_int_equal(run_tool(good, &expected, text, sizeof text), 10);
}

// A directory that takes no files is told, and one that is not there yet is not left behind.
static void test_result_check(void **state) {
  (void)state;
  char dir[] = "/tmp/pb-options-XXXXXX", path[64];
  pb_error err = {0};
  assert_non_null(mkdtemp(dir));
  snprintf(path, sizeof path, "%s/new", dir);
  const pb_result_options good = {.dir = path}, none = {0};
  assert_int_equal(pb_result_check(&good, &err), PB_OK);
  assert_int_equal(pb_result_check(&none, &err), PB_OK);
  assert_int_equal(rmdir(dir), 0);
  assert_int_equal(pb_result_check(&good, &err), PB_ERR_IO);
  assert_string_equal(err.where, path);
  const pb_result_options file = {.dir = "/dev/null"};
  assert_int_equal(pb_result_check(&file, &err), PB_ERR_IO);
}

static void test_messages(void **state) {
  (void)state;
  char *text = NULL;
  size_t size = 0;
  FILE *stream = open_memstream(&text, &size);
  pb_error err = {PB_ERR_SCHEMA, "/components/apa/k_1", "expected a positive number"};
  pb_print_error(stream, &err);
  pb_error bare = {PB_ERR_IO, "", ""};
  pb_print_error(stream, &bare);
  pb_warnings warnings = {0};
  assert_int_equal(pb_warn(&warnings, NULL, "a.mat", "%d digits", 4), PB_OK);
  pb_print_warnings(stream, &warnings);
  pb_warnings_clear(&warnings);
  fclose(stream);
  char expected[512];
  const char *me = program_invocation_short_name;
  snprintf(expected, sizeof expected,
           "%s: /components/apa/k_1: expected a positive number\n"
           "%s: a file cannot be read or written\n%s: warning: a.mat: 4 digits\n",
           me, me, me);
  assert_string_equal(text, expected);
  free(text);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_double),      cmocka_unit_test(test_uint64),
      cmocka_unit_test(test_lists),       cmocka_unit_test(test_command_line),
      cmocka_unit_test(test_known_lists), cmocka_unit_test(test_result_check),
      cmocka_unit_test(test_messages),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
