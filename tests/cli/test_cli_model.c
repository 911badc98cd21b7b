// plantbus-model as a user runs it: results against closed forms, formats, exit codes, messages.
#include <cjson/cJSON.h>
#include <fcntl.h>
#include <matio.h>
#include <spawn.h>
#include <sys/wait.h>

#include "support/check.h"

#include "model/model.h"

extern char **environ;

#define BENCH PB_CONFIG "/plants/apa300ml-bench.json"
#define ELECTRONICS PB_CONFIG "/plants/apa300ml-bench-electronics.json"
#define HEXAPOD PB_CONFIG "/plants/nano-hexapod.json"
#define ONE_DOF PB_CONFIG "/plants/nano-hexapod-1dof.json"  // D is not 0

enum { MOST_ARGUMENTS = 24 };

static char folder[] = "/tmp/pb-cli-XXXXXX";

// The path of a name in the folder, valid until the test ends.
static const char *path_of(const char *name) {
  static char path[32][256];
  static int used;
  for (int k = 0; k < used; k++) {
    if (!strcmp(path[k] + strlen(folder) + 1, name)) return path[k];
  }
  assert_true(used < 32);
  snprintf(path[used], sizeof path[0], "%s/%s", folder, name);
  return path[used++];
}

static int make_folder(void **state) {
  (void)state;
  return mkdtemp(folder) ? 0 : -1;
}

static int remove_folder(void **state) {
  (void)state;
  unlink(path_of("stdout"));
  unlink(path_of("stderr"));
  return rmdir(folder);  // fails when a tool left something behind
}

// ---- running the tool ---------------------------------------------------------------------------

static char *read_text(const char *path) {
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

// Runs the tool with the words of a blank-separated line; its output goes to files in the folder
// (or to `output`). Returns the exit code.
static int run_to(const char *output, const char *line) {
  char copy[2048], *arguments[MOST_ARGUMENTS] = {PB_BIN "/plantbus-model"}, *rest = copy, *word;
  int count = 1;
  snprintf(copy, sizeof copy, "%s", line);
  while ((word = strsep(&rest, " "))) {
    if (*word) arguments[count++] = word;
    assert_true(count < MOST_ARGUMENTS);
  }
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 1, output, O_WRONLY | O_CREAT | O_TRUNC, 0600);
  posix_spawn_file_actions_addopen(&actions, 2, path_of("stderr"), O_WRONLY | O_CREAT | O_TRUNC,
                                   0600);
  pid_t pid;
  assert_int_equal(posix_spawn(&pid, arguments[0], &actions, NULL, arguments, environ), 0);
  posix_spawn_file_actions_destroy(&actions);
  int result = 0;
  assert_int_equal(waitpid(pid, &result, 0), pid);
  return WIFEXITED(result) ? WEXITSTATUS(result) : 128;
}

static int run(const char *format, ...) __attribute__((format(printf, 1, 2)));
static int run(const char *format, ...) {
  char line[2048];
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(line, sizeof line, format, arguments);
  va_end(arguments);
  return run_to(path_of("stdout"), line);
}

static void must_run(const char *line) {
  int code = run("%s", line);
  if (!code) return;
  char *text = read_text(path_of("stderr"));
  fail_msg("'%s' ended with %d: %s", line, code, text);
}

// Runs and parses the JSON on standard output.
static cJSON *run_json(const char *line) {
  must_run(line);
  char *text = read_text(path_of("stdout"));
  cJSON *tree = cJSON_Parse(text);
  if (!tree) fail_msg("'%s' printed no JSON: %s", line, text);
  free(text);
  return tree;
}

static const cJSON *member(const cJSON *tree, const char *key) {
  const cJSON *item = cJSON_GetObjectItemCaseSensitive(tree, key);
  if (!item) fail_msg("no member '%s'", key);
  return item;
}

static double at(const cJSON *array, int index) {
  const cJSON *item = cJSON_GetArrayItem(array, index);
  if (!cJSON_IsNumber(item)) fail_msg("no number at %d", index);
  return item->valuedouble;
}

static void check_says(const char *expected) {
  char *text = read_text(path_of("stderr"));
  if (!strstr(text, expected)) fail_msg("expected '%s' in: %s", expected, text);
  free(text);
}

// ---- the bench in closed form -------------------------------------------------------------------

// Two masses on one axis, z_i (intermediate) and z_u (upper half with the load); report 2.4.
static const double k_1 = 3e5, c_1 = 18, k_a = 2.15e6, c_a = 0.35, k_e = 4.3e6, c_e = 0.7;
static const double g_a = 2.7, g_s = 530000, m_i = 0.001, m_u = 5.056;

// Determinant of the dynamic stiffness; zero at the poles.
static double complex bench_det(double complex s) {
  double complex e = k_e + c_e * s;
  double complex a11 = m_i * s * s + k_a + c_a * s + e, a22 = m_u * s * s + k_1 + c_1 * s + e;
  return a11 * a22 - e * e;
}

// H at s: h[output][input], outputs Vs, y; inputs Va, F.
static void bench(double complex s, double complex h[2][2]) {
  double complex e = k_e + c_e * s;
  double complex a11 = m_i * s * s + k_a + c_a * s + e, a22 = m_u * s * s + k_1 + c_1 * s + e;
  double complex det = bench_det(s);
  const double force[2][2] = {{g_a, 0}, {0, 1}};  // on z_i, z_u
  for (int i = 0; i < 2; i++) {
    double complex zi = (a22 * force[i][0] + e * force[i][1]) / det;
    double complex zu = (a11 * force[i][1] + e * force[i][0]) / det;
    h[0][i] = g_s * (zu - zi);
    h[1][i] = zu;
  }
}

static void check_complex(double complex value, double complex expected, double tolerance) {
  if (cabs(value - expected) <= tolerance * cabs(expected)) return;
  fail_msg("%.15g %+.15gi, expected %.15g %+.15gi", creal(value), cimag(value), creal(expected),
           cimag(expected));
}

static void test_info(void **state) {
  (void)state;
  cJSON *tree = run_json("info " BENCH " --json");
  assert_string_equal(member(tree, "name")->valuestring, "apa300ml-bench");
  assert_int_equal(member(tree, "dof")->valueint, 2);
  assert_int_equal(member(tree, "states")->valueint, 4);
  assert_true(member(tree, "sample_rate")->valuedouble == 10000);
  assert_string_equal(cJSON_GetArrayItem(member(tree, "inputs"), 1)->valuestring, "F");
  assert_string_equal(cJSON_GetArrayItem(member(tree, "outputs"), 0)->valuestring, "Vs");
  double complex h[2][2];
  bench(0, h);
  for (int o = 0; o < 2; o++) {
    for (int i = 0; i < 2; i++) {
      double gain = at(cJSON_GetArrayItem(member(tree, "dc_gain"), o), i);
      ASSERT_RELATIVE(gain, creal(h[o][i]), 1e-10);
    }
  }
  cJSON_Delete(tree);
}

// Electronics are told and are in what is computed; a plant without them has no such member.
static void test_electronics(void **state) {
  (void)state;
  cJSON *tree = run_json("info " ELECTRONICS " --json"), *plain = run_json("info " BENCH " --json");
  const cJSON *lists = member(tree, "electronics");
  const cJSON *va = cJSON_GetArrayItem(member(lists, "inputs"), 0);
  const cJSON *vs = cJSON_GetArrayItem(member(lists, "outputs"), 0);
  assert_string_equal(member(va, "name")->valuestring, "Va");
  assert_true(member(va, "gain")->valuedouble == 20 && at(member(va, "saturation"), 1) == 150);
  assert_int_equal(member(vs, "delay")->valueint, 1);
  assert_null(cJSON_GetObjectItem(plain, "electronics"));
  for (int o = 0; o < 2; o++)
    ASSERT_RELATIVE(at(cJSON_GetArrayItem(member(tree, "dc_gain"), o), 0),
                    20 * at(cJSON_GetArrayItem(member(plain, "dc_gain"), o), 0), 1e-14);
  cJSON_Delete(tree), cJSON_Delete(plain);
  tree = run_json("step " ELECTRONICS " --json --steps 3 --input Va --output Vs");
  const cJSON *rows = member(tree, "output");
  assert_true(fabs(at(cJSON_GetArrayItem(rows, 0), 0)) < 0.002);  // a sample late, but for noise
  assert_true(fabs(at(cJSON_GetArrayItem(rows, 1), 0)) > 0.1);
  cJSON_Delete(tree);
  assert_int_equal(run("export " ELECTRONICS " -o %s", path_of("result.mat")), 0);
  mat_t *mat = Mat_Open(path_of("result.mat"), MAT_ACC_RDONLY);
  assert_non_null(mat);
  matvar_t *gain = Mat_VarRead(mat, "input_gain"), *delay = Mat_VarRead(mat, "output_delay");
  assert_true(gain && delay);
  assert_true(((double *)gain->data)[0] == 20 && ((double *)gain->data)[1] == 1);
  assert_true(((double *)delay->data)[0] == 1 && ((double *)delay->data)[1] == 0);
  Mat_VarFree(gain), Mat_VarFree(delay);
  Mat_Close(mat);
  unlink(path_of("result.mat"));
}

static void test_modes_poles_zeros(void **state) {
  (void)state;
  // Undamped: (k_a + k_e − m_i λ)(k_1 + k_e − m_u λ) = k_e².
  double p = (k_a + k_e) / m_i, q = (k_1 + k_e) / m_u, r = k_e * k_e / (m_i * m_u);
  double root = sqrt((p - q) * (p - q) / 4 + r);
  cJSON *tree = run_json("modes --json " BENCH);
  assert_int_equal(cJSON_GetArraySize(member(tree, "modes_hz")), 2);
  ASSERT_RELATIVE(at(member(tree, "modes_hz"), 1), sqrt((p + q) / 2 + root) / (2 * M_PI), 1e-9);
  double slow = (p * q - r) / ((p + q) / 2 + root);  // without the cancellation of the difference
  ASSERT_RELATIVE(at(member(tree, "modes_hz"), 0), sqrt(slow) / (2 * M_PI), 1e-9);
  assert_int_equal(cJSON_GetArraySize(member(tree, "damping")), 2);
  cJSON_Delete(tree);

  // Whatever z is, a sampled pole oscillates at half the sample rate at most; real parts are of z.
  tree = run_json("poles --sampled --json " BENCH);
  assert_int_equal(cJSON_GetArraySize(member(tree, "oscillation_hz")), 4);
  for (int k = 0; k < 4; k++) {
    const double complex z = at(member(tree, "real"), k) + I * at(member(tree, "imag"), k);
    const double seen = at(member(tree, "oscillation_hz"), k);
    ASSERT_NEAR(seen, fabs(carg(z)) / (2 * M_PI) * 10000, 1e-6);
    assert_true(seen <= 5000);
  }
  cJSON_Delete(tree);

  // Vs = 0 when z_u = z_i: m_u s² + c_1 s + k_1 = 0.
  double re = -c_1 / (2 * m_u), im = sqrt(k_1 / m_u - re * re);
  tree = run_json("zeros " BENCH " --input Va --output Vs --json");
  assert_int_equal(cJSON_GetArraySize(member(tree, "real")), 2);
  assert_int_equal(at(member(tree, "sign_by_sampling"), 0),
                   at(member(tree, "sampled_damping"), 0) < 0);
  ASSERT_RELATIVE(at(member(tree, "real"), 0), re, 1e-9);
  ASSERT_RELATIVE(at(member(tree, "imag"), 0), im, 1e-10);
  ASSERT_RELATIVE(at(member(tree, "imag"), 1), -im, 1e-10);
  ASSERT_RELATIVE(at(member(tree, "zeros_hz"), 0), sqrt(k_1 / m_u) / (2 * M_PI), 1e-10);
  cJSON_Delete(tree);

  // y = 0 for Va: c_e s + k_e = 0.
  tree = run_json("zeros " BENCH " --input Va --output y --json");
  assert_int_equal(cJSON_GetArraySize(member(tree, "real")), 1);
  ASSERT_RELATIVE(at(member(tree, "real"), 0), -k_e / c_e, 1e-6);
  cJSON_Delete(tree);
}

static void test_poles(void **state) {
  (void)state;
  cJSON *tree = run_json("poles " BENCH " --json");
  cJSON *sampled = run_json("poles " BENCH " --json --sampled");
  double sum = 0, sampled_sum = 0;
  for (int k = 0; k < 4; k++) {
    double complex s = at(member(tree, "real"), k) + I * at(member(tree, "imag"), k);
    double complex e = k_e + c_e * s, det = bench_det(s);
    if (cabs(det) > 1e-9 * cabs(e * e)) fail_msg("determinant %g at pole %d", cabs(det), k);
    sum += creal(cexp(s * 1e-4));
    sampled_sum += at(member(sampled, "real"), k);
  }
  ASSERT_NEAR(sampled_sum, sum, 1e-9);
  cJSON_Delete(tree);
  cJSON_Delete(sampled);
  tree = run_json("poles " BENCH " --json --max-frequency 200");
  assert_int_equal(cJSON_GetArraySize(member(tree, "poles_hz")), 2);
  cJSON_Delete(tree);
}

// ---- frf ----------------------------------------------------------------------------------------

static double complex frf_value(const cJSON *tree, int f, int o, int i) {
  double part[2];
  for (int k = 0; k < 2; k++) {
    const cJSON *row = cJSON_GetArrayItem(member(tree, k ? "imag" : "real"), f);
    part[k] = at(cJSON_GetArrayItem(row, o), i);
  }
  return part[0] + I * part[1];
}

static void test_frf(void **state) {
  (void)state;
  static const double hz[4] = {1, 38.9, 93.2, 4321.5};
  cJSON *tree = run_json("frf " BENCH " --frequencies 1,38.9,93.2,4321.5 --json");
  assert_int_equal(cJSON_GetArraySize(member(tree, "frequency_hz")), 4);
  for (int f = 0; f < 4; f++) {
    double complex h[2][2];
    bench(2 * M_PI * I * hz[f], h);
    assert_true(at(member(tree, "frequency_hz"), f) == hz[f]);
    for (int c = 0; c < 4; c++)
      check_complex(frf_value(tree, f, c / 2, c % 2), h[c / 2][c % 2], 1e-9);
  }
  cJSON_Delete(tree);
  // Chosen signals come in the order asked for.
  tree = run_json("frf " BENCH " --frequencies 10 --output y,Vs --input F --json");
  double complex h[2][2];
  bench(2 * M_PI * I * 10, h);
  assert_string_equal(cJSON_GetArrayItem(member(tree, "outputs"), 0)->valuestring, "y");
  assert_int_equal(cJSON_GetArraySize(member(tree, "inputs")), 1);
  check_complex(frf_value(tree, 0, 0, 0), h[1][1], 1e-9);
  check_complex(frf_value(tree, 0, 1, 0), h[0][1], 1e-9);
  cJSON_Delete(tree);
}

static void test_frf_grid(void **state) {
  (void)state;
  cJSON *tree = run_json("frf " BENCH " --from 10 --to 1000 --points 5 --json");
  const cJSON *hz = member(tree, "frequency_hz");
  assert_int_equal(cJSON_GetArraySize(hz), 5);
  ASSERT_RELATIVE(at(hz, 1), 10 * sqrt(10), 1e-12);
  assert_true(at(hz, 0) == 10 && at(hz, 4) == 1000);
  cJSON_Delete(tree);
  tree = run_json("frf " BENCH " --from 10 --to 1000 --points 4 --linear --json");
  ASSERT_RELATIVE(at(member(tree, "frequency_hz"), 1), 340.0, 1e-12);
  cJSON_Delete(tree);
}

// ---- step ---------------------------------------------------------------------------------------

static void test_step(void **state) {
  (void)state;
  cJSON *tree = run_json("step " BENCH " --json --at 1,2,3,300000");
  cJSON *first = run_json("step " BENCH " --json --steps 3 --amplitude 2 --input Va");
  assert_string_equal(member(tree, "input")->valuestring, "Va");
  assert_int_equal(cJSON_GetArraySize(member(first, "step")), 3);
  for (int k = 0; k < 3; k++) {
    double one = at(cJSON_GetArrayItem(member(tree, "output"), k), 0);
    double two = at(cJSON_GetArrayItem(member(first, "output"), k), 0);
    assert_true(at(member(first, "step"), k) == k + 1);
    ASSERT_RELATIVE(two, 2 * one, 1e-12);
  }
  // Thirty seconds later the suspension has come to rest at the static gains.
  double complex h[2][2];
  bench(0, h);
  for (int o = 0; o < 2; o++) {
    ASSERT_RELATIVE(at(cJSON_GetArrayItem(member(tree, "output"), 3), o), creal(h[o][0]), 1e-8);
  }
  cJSON_Delete(tree);
  cJSON_Delete(first);
}

// ---- files --------------------------------------------------------------------------------------

static void test_csv(void **state) {
  (void)state;
  const char *path = path_of("frf.csv");
  assert_int_equal(run("frf " BENCH " --frequencies 10,20 --output y -o %s", path), 0);
  char *text = read_text(path), *rest = text;
  assert_string_equal(
      strsep(&rest, "\n"),
      "frequency [Hz],Va→y real [m/V],Va→y imag [m/V],F→y real [m/N],F→y imag [m/N]");
  double complex h[2][2];
  bench(2 * M_PI * I * 10, h);
  double value[5];
  assert_int_equal(
      sscanf(rest, "%lf,%lf,%lf,%lf,%lf", value, value + 1, value + 2, value + 3, value + 4), 5);
  assert_true(value[0] == 10);
  check_complex(value[3] + I * value[4], h[1][1], 1e-9);
  free(text);
  char *out = read_text(path_of("stdout"));
  assert_string_equal(out, "");
  free(out);
  unlink(path);
}

static double *real_variable(mat_t *mat, const char *name, size_t rows, size_t cols,
                             matvar_t **variable) {
  *variable = Mat_VarRead(mat, name);
  if (!*variable) fail_msg("no variable %s", name);
  assert_int_equal((*variable)->dims[0], rows);
  assert_int_equal((*variable)->dims[1], cols);
  return (*variable)->data;
}

// The exported state space by Horner-like powers: x(k+1) = A_d x + B_d u must give the step
// response.
static void test_export(void **state) {
  (void)state;
  const char *path = path_of("model.mat");
  assert_int_equal(run("export " BENCH " -o %s", path), 0);
  mat_t *mat = Mat_Open(path, MAT_ACC_RDONLY);
  assert_non_null(mat);
  matvar_t *v[4];
  const double *ad = real_variable(mat, "A_d", 4, 4, &v[0]),
               *bd = real_variable(mat, "B_d", 4, 2, &v[1]);
  const double *c = real_variable(mat, "C", 2, 4, &v[2]), *d = real_variable(mat, "D", 2, 2, &v[3]);
  double x[4] = {0}, y[2];
  for (int k = 0; k < 3; k++) {
    double next[4];
    for (int i = 0; i < 4; i++) {
      next[i] = bd[i];
      for (int j = 0; j < 4; j++) next[i] += ad[j * 4 + i] * x[j];
    }
    memcpy(x, next, sizeof x);
  }
  for (int o = 0; o < 2; o++) {
    y[o] = d[o];
    for (int j = 0; j < 4; j++) y[o] += c[j * 2 + o] * x[j];
  }
  for (int k = 0; k < 4; k++) Mat_VarFree(v[k]);
  Mat_Close(mat);
  unlink(path);
  cJSON *tree = run_json("step " BENCH " --at 3 --json");
  const cJSON *row = cJSON_GetArrayItem(member(tree, "output"), 0);
  for (int o = 0; o < 2; o++) ASSERT_NEAR(y[o], at(row, o), 1e-9 * fabs(at(row, o)));
  cJSON_Delete(tree);
}

// ss(A, B, C, D, Ts) as other programs take it.
typedef struct standard {
  size_t n, nu, ny;
  const double *a, *b, *c, *d;
} standard;

// out = M x + N u
static void add_up(const double *m, const double *x, size_t n, const double *k, const double *u,
                   size_t nu, double *out, size_t rows) {
  for (size_t r = 0; r < rows; r++) {
    out[r] = 0;
    for (size_t j = 0; j < n; j++) out[r] += m[r + j * rows] * x[j];
    for (size_t i = 0; i < nu; i++) out[r] += k[r + i * rows] * u[i];
  }
}

// Both stepped with inputs that jump: largest difference and largest value of each output.
static void step_both(const pb_model *m, const standard *s, double *error, double *largest) {
  pb_state *plant = pb_state_new(m);
  double *x = calloc(2 * s->n, sizeof *x), *next = x + s->n, *u = calloc(s->nu, sizeof *u);
  double *y = calloc(2 * s->ny, sizeof *y), *other = y + s->ny;
  for (size_t k = 0; k < 400; k++) {
    for (size_t i = 0; i < s->nu; i++)
      u[i] = sin(0.01 * (double)(k * (i + 1))) > 0 ? 1.0 + (double)i : -0.5;
    pb_step_output(m, plant, y);
    add_up(s->c, x, s->n, s->d, u, s->nu, other, s->ny);
    for (size_t o = 0; o < s->ny; o++) {
      largest[o] = fmax(largest[o], fabs(y[o]));
      error[o] = fmax(error[o], fabs(other[o] - y[o]));
    }
    add_up(s->a, x, s->n, s->b, u, s->nu, next, s->n);
    memcpy(x, next, s->n * sizeof *x);
    pb_step_advance(m, plant, u);
  }
  free(plant), free(x), free(u), free(y);
}

// The standard form of an export, y = C ξ + D u, is the stepped plant, also where D is not 0.
static void test_export_standard(void **state) {
  (void)state;
  pb_model *m;
  REQUIRE(pb_model_load(ONE_DOF, NULL, &m, &err));
  const char *path = path_of("standard.mat");
  assert_int_equal(run("export " ONE_DOF " -o %s", path), 0);
  mat_t *mat = Mat_Open(path, MAT_ACC_RDONLY);
  assert_non_null(mat);
  matvar_t *held = Mat_VarRead(mat, "held"), *text = Mat_VarRead(mat, "convention"), *v[4];
  assert_true(held && text && held->dims[0] > 0);
  standard s = {.n = m->nx + held->dims[0], .nu = m->nu, .ny = m->ny};
  s.a = real_variable(mat, "A_ss", s.n, s.n, &v[0]);
  s.b = real_variable(mat, "B_ss", s.n, s.nu, &v[1]);
  s.c = real_variable(mat, "C_ss", s.ny, s.n, &v[2]);
  s.d = real_variable(mat, "D_ss", s.ny, s.nu, &v[3]);
  double *error = calloc(2 * s.ny, sizeof *error), *largest = error + s.ny;
  step_both(m, &s, error, largest);
  for (size_t o = 0; o < s.ny; o++) {
    assert_true(largest[o] > 0);
    ASSERT_NEAR(error[o], 0, 1e-9 * largest[o]);
  }
  for (int k = 0; k < 4; k++) Mat_VarFree(v[k]);
  Mat_VarFree(held), Mat_VarFree(text);
  Mat_Close(mat);
  unlink(path);
  free(error);
  pb_model_free(m);
}

// Every command writes each of its formats, and the same bytes each time.
static void test_formats(void **state) {
  (void)state;
  static const char *const line[] = {
      "info json", "check json",  "modes json", "modes csv", "modes mat", "poles csv",
      "poles mat", "poles png",   "zeros json", "zeros csv", "zeros mat", "zeros png",
      "frf json",  "frf mat",     "frf png",    "step json", "step csv",  "step mat",
      "step png",  "export json", "export csv",
  };
  for (size_t k = 0; k < sizeof line / sizeof *line; k++) {
    char command[16], extension[16], name[32];
    assert_int_equal(sscanf(line[k], "%15s %15s", command, extension), 2);
    snprintf(name, sizeof name, "result.%s", extension);
    const char *path = path_of(name);
    char *text[2];
    for (int turn = 0; turn < 2; turn++) {
      if (run("%s " BENCH " -o %s", command, path)) fail_msg("%s failed", line[k]);
      text[turn] = read_text(path);
      assert_int_equal(unlink(path), 0);
    }
    if (strlen(text[0]) < 3 || strcmp(text[0], text[1]))
      fail_msg("%s: not the same twice", line[k]);
    free(text[0]);
    free(text[1]);
  }
}

static void test_tables(void **state) {
  (void)state;
  static const struct {
    const char *line, *expected;
  } table[] = {
      {"info " BENCH, "2 degrees of freedom, 4 states"},
      {"check " BENCH, "usable"},
      {"modes " BENCH, "frequency [Hz]"},
      {"zeros " BENCH, "38.76834"},
      {"poles " BENCH, "1 pair is above 5000 Hz"},
      {"poles --sampled " BENCH, "1 pair is an alias"},
      {"frf " BENCH " --frequencies 10 --input Va --output y", "magnitude [m/V]"},
      {"step " BENCH " --steps 2", "Va = 1 V from step 0"},
      {"info " HEXAPOD, "nano-hexapod"},
      {"info " ELECTRONICS, "-20 … 150"},
  };
  for (size_t k = 0; k < sizeof table / sizeof *table; k++) {
    must_run(table[k].line);
    char *text = read_text(path_of("stdout"));
    if (!strstr(text, table[k].expected)) fail_msg("'%s': %s", table[k].line, text);
    free(text);
  }
}

// ---- the hexapod: six inputs and outputs --------------------------------------------------------

static void test_hexapod(void **state) {
  (void)state;
  cJSON *tree = run_json("zeros " HEXAPOD " --json --max-frequency 500 "
                         "--input Va1,Va2,Va3 --input Va4,Va5,Va6 "
                         "--output Vs1,Vs2,Vs3,Vs4,Vs5,Vs6");
  cJSON *modes = run_json("modes " HEXAPOD " --json --max-frequency 500");
  int count = cJSON_GetArraySize(member(tree, "zeros_hz"));
  // Six suspension modes, six pairs of zeros below them: collocated force sensors.
  assert_int_equal(count, 12);
  for (int k = 0; k < 6; k++) {
    double zero = at(member(tree, "zeros_hz"), 2 * k), mode = at(member(modes, "modes_hz"), k);
    if (!(zero > 0 && zero < mode)) fail_msg("zero %d at %g Hz, mode at %g Hz", k, zero, mode);
  }
  cJSON_Delete(tree);
  cJSON_Delete(modes);
}

// ---- refusals -----------------------------------------------------------------------------------

static void test_usage_errors(void **state) {
  (void)state;
  static const struct {
    const char *line, *expected;
  } wrong[] = {
      {"", "expected a command and a plant file"},
      {"info", "expected a command and a plant file"},
      {"nothing " BENCH, "unknown command 'nothing'"},
      {"info " BENCH " " BENCH, "one plant file at a time"},
      {"info " BENCH " --sampled", "info has no option --sampled"},
      {"modes " BENCH " --input Va", "modes has no option --input"},
      {"frf " BENCH " --frequencies 1,x", "--frequencies: '1,x' is not a list of numbers"},
      {"frf " BENCH " --frequencies -1", "negative"},
      {"frf " BENCH " --frequencies 1 --from 2", "--frequencies excludes"},
      {"frf " BENCH " --from 20 --to 10", "--from is not below --to"},
      {"frf " BENCH " --points 0", "--points"},
      {"frf " BENCH " --input Vb", "--input: the plant has no input 'Vb'; its inputs: Va, F"},
      {"step " BENCH " --input Va,F", "step takes one --input"},
      {"step " BENCH " --at 3,2", "ascending"},
      {"step " BENCH " --at 1.5", "ascending whole numbers"},
      {"frf " BENCH " -o out.txt", "does not end in .json, .csv, .mat or .png"},
      {"frf " BENCH " -o out", "does not end in"},
      {"info " BENCH " -o info.png", "info cannot be written as '.png'"},
      {"export " BENCH, "export needs -o or --json"},
  };
  for (size_t k = 0; k < sizeof wrong / sizeof *wrong; k++) {
    int code = run("%s", wrong[k].line);
    if (code != 2) fail_msg("'%s' ended with %d", wrong[k].line, code);
    check_says(wrong[k].expected);
  }
}

static void test_failures(void **state) {
  (void)state;
  assert_int_equal(run("info /no/such/plant.json"), 1);
  check_says("/no/such/plant.json");
  assert_int_equal(run("info " PB_TEST_DATA "/cli-bad-key.json"), 1);
  check_says("plantbus-model: /components/mass/colour");
  assert_int_equal(run("check " PB_TEST_DATA "/cli-bad-key.json --json"), 1);
  check_says("/components/mass/colour");
  char *text = read_text(path_of("stdout"));
  cJSON *tree = cJSON_Parse(text);
  assert_true(cJSON_IsFalse(member(tree, "good")));
  assert_string_equal(member(member(tree, "error"), "where")->valuestring,
                      "/components/mass/colour");
  cJSON_Delete(tree);
  free(text);
  assert_int_equal(run("zeros " BENCH " --input Va,F --output Vs"), 1);
  check_says("as many inputs as outputs");
  assert_int_equal(run("frf " BENCH " -o %s/none/a.csv", folder), 1);
  check_says("none/a.csv");
  assert_int_equal(run("frf " BENCH " -o %s/none/a.png", folder), 1);
  assert_int_equal(run_to("/dev/full", "frf " BENCH " --json"), 1);
  check_says("standard output");
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_info),
      cmocka_unit_test(test_electronics),
      cmocka_unit_test(test_modes_poles_zeros),
      cmocka_unit_test(test_poles),
      cmocka_unit_test(test_frf),
      cmocka_unit_test(test_frf_grid),
      cmocka_unit_test(test_step),
      cmocka_unit_test(test_csv),
      cmocka_unit_test(test_export),
      cmocka_unit_test(test_export_standard),
      cmocka_unit_test(test_formats),
      cmocka_unit_test(test_tables),
      cmocka_unit_test(test_hexapod),
      cmocka_unit_test(test_usage_errors),
      cmocka_unit_test(test_failures),
  };
  return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
