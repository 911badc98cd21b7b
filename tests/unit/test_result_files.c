// CSV, MAT and JSON results: what is written reads back bit for bit; failures leave nothing behind.
#include <cjson/cJSON.h>
#include <complex.h>
#include <float.h>
#include <math.h>
#include <matio.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cmocka.h>

#include "csv.h"
#include "jsonout.h"
#include "matfile.h"

static char folder[] = "/tmp/pb-results-XXXXXX";

static const char *path_of(const char *name) {
  static char path[512];
  snprintf(path, sizeof path, "%s/%s", folder, name);
  return path;
}

static int make_folder(void **state) {
  (void)state;
  return mkdtemp(folder) ? 0 : -1;
}

static int remove_folder(void **state) {
  (void)state;
  return rmdir(folder);  // fails when a temporary file was left
}

static char *read_all(const char *path) {
  FILE *file = fopen(path, "rb");
  assert_non_null(file);
  char *text = calloc(1, 65536);
  assert_true(fread(text, 1, 65535, file) > 0);
  fclose(file);
  return text;
}

// Numbers that need all 17 digits, and the ends of the range.
static const double awkward[] = {0.1, 1.0 / 3, -5e-324, DBL_MAX, 93.700000000000003, 1e22, -0.0};
enum { AWKWARD = sizeof awkward / sizeof *awkward };

static void test_csv(void **state) {
  (void)state;
  const char *path = path_of("a.csv");
  pb_csv csv;
  pb_error err = {0};
  assert_int_equal(pb_csv_open(path, &csv, &err), PB_OK);
  pb_csv_column(&csv, "frequency", "Hz");
  pb_csv_column(&csv, "Va \"1\", real", "V/V");
  pb_csv_column(&csv, "who", NULL);
  for (size_t i = 0; i < AWKWARD; i++) {
    pb_csv_number(&csv, awkward[i]);
    pb_csv_number(&csv, NAN);
    pb_csv_text(&csv, "x,y");
  }
  assert_int_equal(access(path, F_OK), -1);  // not there before it is complete
  assert_int_equal(pb_csv_close(&csv, &err), PB_OK);
  char *text = read_all(path), *rest = text, *line = strsep(&rest, "\n");
  assert_string_equal(line, "frequency [Hz],\"Va \"\"1\"\", real [V/V]\",who");
  for (size_t i = 0; i < AWKWARD; i++) {
    char *end;
    line = strsep(&rest, "\n");
    double back = strtod(line, &end);
    assert_memory_equal(&back, &awkward[i], sizeof back);
    assert_string_equal(end, ",nan,\"x,y\"");
  }
  assert_string_equal(rest, "");
  free(text);
  unlink(path);
}

static void test_csv_failures(void **state) {
  (void)state;
  pb_csv csv;
  pb_error err = {0};
  assert_int_equal(pb_csv_open(path_of("no/such/a.csv"), &csv, &err), PB_ERR_IO);
  assert_non_null(strstr(err.message, "No such file"));
  assert_int_equal(pb_csv_open(path_of("b.csv"), &csv, &err), PB_OK);
  pb_csv_column(&csv, "a", NULL);
  pb_csv_column(&csv, "b", NULL);
  pb_csv_number(&csv, 1);
  assert_int_equal(pb_csv_close(&csv, &err), PB_ERR_STATE);
  assert_int_equal(access(path_of("b.csv"), F_OK), -1);
  assert_int_equal(pb_csv_open("/dev/full", &csv, &err), PB_OK);
  pb_csv_column(&csv, "a", NULL);
  for (int i = 0; i < 10000; i++) pb_csv_number(&csv, i);
  assert_int_equal(pb_csv_close(&csv, &err), PB_ERR_IO);
  assert_string_equal(err.where, "/dev/full");
  pb_csv_discard(&csv);  // harmless after the close
}

// ---- MAT ----------------------------------------------------------------------------------------

static void write_example(const char *path) {
  double complex h[2][3][2];  // [nf][ny][nu]
  for (int f = 0; f < 2; f++) {
    for (int o = 0; o < 3; o++) {
      for (int i = 0; i < 2; i++) h[f][o][i] = 100 * f + 10 * o + i + 0.5 * I;
    }
  }
  const double complex pole[2] = {-1 + 2 * I, -1 - 2 * I};
  const char *names[] = {"Vs", "y", ""};
  pb_matfile *mat;
  pb_error err = {0};
  assert_int_equal(pb_matfile_open(path, &mat, &err), PB_OK);
  pb_matfile_scalar(mat, "dt", 1e-4);
  pb_matfile_real(mat, "x", AWKWARD, 1, awkward);
  pb_matfile_real(mat, "none", 0, 0, NULL);
  pb_matfile_complex(mat, "poles", 2, 1, pole);
  pb_matfile_frf(mat, "H", 2, 3, 2, &h[0][0][0]);
  pb_matfile_text(mat, "plant", "bänch");
  pb_matfile_names(mat, "outputs", names, 3);
  if (pb_matfile_close(mat, &err)) fail_msg("%s: %s", err.where, err.message);
}

static void check_text(const matvar_t *variable, const char *expected, size_t characters) {
  assert_non_null(variable);
  assert_int_equal(variable->class_type, MAT_C_CHAR);
  assert_int_equal(variable->data_type, MAT_T_UTF8);
  assert_int_equal(variable->dims[1], characters);
  assert_int_equal(variable->nbytes, strlen(expected));
  assert_memory_equal(variable->data, expected, strlen(expected));
}

static matvar_t *read_variable(mat_t *mat, const char *name) {
  matvar_t *variable = Mat_VarRead(mat, name);
  if (!variable) fail_msg("no variable %s", name);
  return variable;
}

static void check_frf(mat_t *mat) {
  matvar_t *v = read_variable(mat, "H");
  assert_int_equal(v->rank, 3);
  assert_int_equal(v->dims[0], 3);
  assert_int_equal(v->dims[1], 2);
  assert_int_equal(v->dims[2], 2);
  assert_true(v->isComplex);
  const mat_complex_split_t *split = v->data;
  for (int f = 0; f < 2; f++) {
    for (int i = 0; i < 2; i++) {
      for (int o = 0; o < 3; o++) {
        int k = (f * 2 + i) * 3 + o;
        assert_true(((double *)split->Re)[k] == 100 * f + 10 * o + i);
        assert_true(((double *)split->Im)[k] == 0.5);
      }
    }
  }
  Mat_VarFree(v);
}

static void test_mat(void **state) {
  (void)state;
  const char *path = path_of("a.mat");
  write_example(path);
  mat_t *mat = Mat_Open(path, MAT_ACC_RDONLY);
  assert_non_null(mat);
  assert_int_equal(Mat_GetVersion(mat), MAT_FT_MAT5);
  matvar_t *v = read_variable(mat, "x");
  assert_memory_equal(v->data, awkward, sizeof awkward);
  Mat_VarFree(v);
  v = read_variable(mat, "dt");
  assert_true(*(double *)v->data == 1e-4);
  Mat_VarFree(v);
  v = read_variable(mat, "poles");
  const mat_complex_split_t *split = v->data;
  assert_true(((double *)split->Im)[1] == -2);
  Mat_VarFree(v);
  check_frf(mat);
  v = read_variable(mat, "plant");
  check_text(v, "bänch", 5);
  Mat_VarFree(v);
  v = read_variable(mat, "outputs");
  assert_int_equal(v->dims[0], 3);
  check_text(Mat_VarGetCell(v, 0), "Vs", 2);
  check_text(Mat_VarGetCell(v, 1), "y", 1);
  Mat_VarFree(v);
  Mat_Close(mat);
  unlink(path);
}

// The same data gives the same bytes, with the permissions of an ordinary new file.
static void test_mat_reproducible(void **state) {
  (void)state;
  char first[512];
  snprintf(first, sizeof first, "%s", path_of("1.mat"));
  const char *second = path_of("2.mat");
  mode_t mask = umask(027);
  write_example(first);
  umask(mask);
  write_example(second);
  struct stat a, b;
  assert_int_equal(stat(first, &a), 0);
  assert_int_equal(stat(second, &b), 0);
  assert_int_equal(a.st_mode & 0777, 0640);
  assert_int_equal(a.st_size, b.st_size);
  char *one = read_all(first), *two = read_all(second);
  assert_memory_equal(one, two, (size_t)a.st_size);
  free(one);
  free(two);
  unlink(first);
  unlink(second);
}

static void test_mat_failures(void **state) {
  (void)state;
  pb_matfile *mat;
  pb_error err = {0};
  assert_int_equal(pb_matfile_open(path_of("no/such/a.mat"), &mat, &err), PB_ERR_IO);
  assert_null(mat);
  assert_int_equal(pb_matfile_open(path_of("b.mat"), &mat, &err), PB_OK);
  pb_matfile_scalar(mat, "2nd", 1);
  pb_matfile_scalar(mat, "good", 1);
  assert_int_equal(pb_matfile_close(mat, &err), PB_ERR_ARGUMENT);
  assert_non_null(strstr(err.message, "'2nd'"));
  assert_int_equal(access(path_of("b.mat"), F_OK), -1);
}

// A limit on the size of files stands in for a full disk.
static void test_mat_disk_full(void **state) {
  (void)state;
  static const double zeros[20000];
  struct rlimit limit, small;
  signal(SIGXFSZ, SIG_IGN);
  assert_int_equal(getrlimit(RLIMIT_FSIZE, &limit), 0);
  small = (struct rlimit){65536, limit.rlim_max};
  pb_matfile *mat;
  pb_error err = {0};
  assert_int_equal(pb_matfile_open(path_of("full.mat"), &mat, &err), PB_OK);
  assert_int_equal(setrlimit(RLIMIT_FSIZE, &small), 0);
  pb_matfile_real(mat, "x", 20000, 1, zeros);
  pb_status status = pb_matfile_close(mat, &err);
  setrlimit(RLIMIT_FSIZE, &limit);
  assert_int_equal(status, PB_ERR_IO);
  assert_int_equal(access(path_of("full.mat"), F_OK), -1);
}

// What cannot be gone back in is a copy: it fails as a file does, and a pipe gets the same bytes.
static void test_mat_special(void **state) {
  (void)state;
  pb_matfile *mat;
  pb_error err = {0};
  assert_int_equal(pb_matfile_open("/dev/full", &mat, &err), PB_OK);
  pb_matfile_scalar(mat, "x", 1);
  assert_int_equal(pb_matfile_close(mat, &err), PB_ERR_IO);
  assert_string_equal(err.where, "/dev/full");
  assert_non_null(strstr(err.message, "No space left"));

  char plain[512], command[1200];
  snprintf(plain, sizeof plain, "%s", path_of("plain.mat"));
  const char *pipe_path = path_of("pipe.mat");
  write_example(plain);
  snprintf(command, sizeof command, "cmp -s '%s' '%s'", pipe_path, plain);
  assert_int_equal(mkfifo(pipe_path, 0600), 0);
  FILE *reader = popen(command, "w");
  assert_non_null(reader);
  write_example(pipe_path);
  assert_int_equal(pclose(reader), 0);
  unlink(pipe_path);
  unlink(plain);
}

// ---- JSON ---------------------------------------------------------------------------------------

static void test_json(void **state) {
  (void)state;
  char *text = NULL;
  size_t size = 0;
  FILE *stream = open_memstream(&text, &size);
  pb_jsonout json;
  pb_jsonout_begin(&json, stream);
  pb_jsonout_object(&json, NULL);
  pb_jsonout_text(&json, "name", "a \"b\" \\ \n\t\x01 é");
  pb_jsonout_integer(&json, "step", UINT64_MAX);
  pb_jsonout_boolean(&json, "good", true);
  pb_jsonout_numbers(&json, "x", awkward, AWKWARD);
  pb_jsonout_array(&json, "rows");
  pb_jsonout_row(&json, NULL);
  pb_jsonout_number(&json, NULL, NAN);
  pb_jsonout_number(&json, NULL, -INFINITY);
  pb_jsonout_array_end(&json);
  pb_jsonout_array_end(&json);
  pb_jsonout_array(&json, "none");
  pb_jsonout_array_end(&json);
  pb_jsonout_object_end(&json);
  pb_jsonout_end(&json);
  fclose(stream);
  assert_non_null(strstr(text, "  \"rows\": [\n    [null, null]\n  ],\n  \"none\": []\n}\n"));
  assert_non_null(strstr(text, "18446744073709551615"));
  assert_non_null(strstr(text, "[0.1, 0.333333"));
  cJSON *tree = cJSON_Parse(text);
  assert_non_null(tree);
  assert_string_equal(cJSON_GetObjectItem(tree, "name")->valuestring, "a \"b\" \\ \n\t\x01 é");
  for (int i = 0; i < AWKWARD; i++) {
    double back = cJSON_GetArrayItem(cJSON_GetObjectItem(tree, "x"), i)->valuedouble;
    assert_true(back == awkward[i]);
  }
  cJSON_Delete(tree);
  free(text);
}

static void test_json_format(void **state) {
  (void)state;
  char text[32];
  pb_jsonout_format(0.1, text);
  assert_string_equal(text, "0.1");
  pb_jsonout_format(93.700000000000003, text);
  assert_string_equal(text, "93.7");
  pb_jsonout_format(0.1 + 0.2, text);
  assert_string_equal(text, "0.30000000000000004");
  pb_jsonout_format(-DBL_MAX, text);
  assert_true(strtod(text, NULL) == -DBL_MAX);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_csv),          cmocka_unit_test(test_csv_failures),
      cmocka_unit_test(test_mat),          cmocka_unit_test(test_mat_reproducible),
      cmocka_unit_test(test_mat_failures), cmocka_unit_test(test_mat_disk_full),
      cmocka_unit_test(test_mat_special),  cmocka_unit_test(test_json),
      cmocka_unit_test(test_json_format),
  };
  return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
