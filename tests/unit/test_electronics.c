// Signal electronics: what each key does to a signal, in which order, what is refused, and what the
// predictions and a change of model make of it.
#include "support/check.h"

#include "assembly/system.h"
#include "base/json.h"
#include "base/text.h"
#include "control/loop.h"
#include "control/lti_ops.h"
#include "model/model.h"
#include "plant/plant.h"
#include "signal/random.h"

enum { VA, F };  // inputs of the bench
enum { VS, Y };  // outputs

static char *bench_text, *hexapod_text;

static char *read_file(const char *path) {
  char *text = NULL;
  size_t length;
  REQUIRE(pb_text_read(path, &text, &length, &err));
  return text;
}

static int setup(void **state) {
  (void)state;
  bench_text = read_file(PB_CONFIG "/plants/apa300ml-bench.json");
  hexapod_text = read_file(PB_CONFIG "/plants/nano-hexapod.json");
  return 0;
}

static int teardown(void **state) {
  (void)state;
  free(bench_text);
  free(hexapod_text);
  return 0;
}

static pb_status compile_text(const char *text, pb_model **model, pb_error *err) {
  pb_plant *plant = NULL;
  pb_system *system = NULL;
  pb_status st = pb_plant_parse(text, strlen(text), ".", NULL, &plant, err);
  if (!st) st = pb_system_assemble(plant, NULL, &system, err);
  if (!st) st = pb_model_compile(system, NULL, model, err);
  pb_system_free(system);
  pb_plant_free(plant);
  return st;
}

// Sets "electronics" of a signal of a plant file in memory.
static void set_electronics(cJSON *file, const char *list, int index, const char *json) {
  if (!json) return;
  cJSON *signal = cJSON_GetArrayItem(cJSON_GetObjectItem(file, list), index);
  cJSON *value = cJSON_Parse(json);
  if (!value) fail_msg("the test's JSON is none: %s", json);
  cJSON_AddItemToObject(signal, "electronics", value);
}

// The bench with electronics at its voltage and its sensor (NULL: none).
static pb_status bench_try(const char *va, const char *vs, pb_model **model, pb_error *err) {
  cJSON *file = cJSON_Parse(bench_text);
  set_electronics(file, "inputs", VA, va);
  set_electronics(file, "outputs", VS, vs);
  char *text = NULL;
  pb_status st = pb_json_print(file, &text, err);
  if (!st) st = compile_text(text, model, err);
  free(text);
  cJSON_Delete(file);
  return st;
}

static pb_model *bench(const char *va, const char *vs) {
  pb_model *m = NULL;
  REQUIRE(bench_try(va, vs, &m, &err));
  return m;
}

static double applied(const pb_model *m, const pb_state *s) {
  return s->data[m->nx + VA];
}

// Steps the command of the voltage; returns what is applied.
static double step(const pb_model *m, pb_state *s, double command) {
  const double u[2] = {command, 0};
  pb_step_advance(m, s, u);
  return applied(m, s);
}

static double output(const pb_model *m, const pb_state *s, size_t o) {
  double y[2];
  pb_step_output(m, s, y);
  return y[o];
}

// ---- keys ---------------------------------------------------------------------------------------

static void test_none_without_keys(void **state) {
  (void)state;
  pb_model *plain = bench(NULL, NULL), *empty = bench("{}", "{}");
  assert_null(plain->input_electronics);
  assert_null(plain->output_electronics);
  assert_int_equal(pb_state_bytes(plain), sizeof(pb_state) + 6 * sizeof(double));
  assert_non_null(empty->input_electronics);
  pb_state *a = pb_state_new(plain), *b = pb_state_new(empty);
  for (int k = 0; k < 200; k++) {
    double u[2] = {sin(0.3 * k), k % 7};
    pb_step_advance(plain, a, u);
    pb_step_advance(empty, b, u);
    assert_memory_equal(a->data, b->data, 6 * sizeof(double));
    for (size_t o = 0; o < 2; o++) assert_true(output(plain, a, o) == output(empty, b, o));
    assert_true(a->saturated == 0 && b->saturated == 0);
  }
  free(a), free(b);
  pb_model_free(plain), pb_model_free(empty);
}

static void test_gain(void **state) {
  (void)state;
  pb_model *m = bench("{\"gain\": -20}", NULL);
  pb_state *s = pb_state_new(m);
  assert_true(step(m, s, 1.25) == -25);
  assert_true(s->saturated == 0);
  assert_null(m->output_electronics);
  free(s);
  pb_model_free(m);
}

// Half steps go away from zero.
static void test_quantisation(void **state) {
  (void)state;
  static const double pair[][2] = {{0.24, 0},     {0.25, 0.5},   {0.26, 0.5}, {0.75, 1},
                                   {-0.25, -0.5}, {-0.74, -0.5}, {7.3, 7.5},  {0, 0}};
  pb_model *m = bench("{\"quantisation\": 0.5}", NULL);
  pb_state *s = pb_state_new(m);
  for (size_t k = 0; k < sizeof pair / sizeof *pair; k++)
    assert_true(step(m, s, pair[k][0]) == pair[k][1]);
  free(s);
  pb_model_free(m);
}

static void test_delay_of_an_input(void **state) {
  (void)state;
  pb_model *m = bench("{\"delay\": 3}", NULL);
  pb_state *s = pb_state_new(m);
  for (int k = 0; k < 20; k++) assert_true(step(m, s, k + 1) == (k < 3 ? 0 : k - 2));
  pb_state_reset(m, s);
  assert_true(step(m, s, 5) == 0 && s->step == 1);
  free(s);
  pb_model_free(m);
}

static void test_saturation(void **state) {
  (void)state;
  pb_model *m = bench("{\"gain\": 20, \"saturation\": [-20, 150]}", NULL);
  pb_state *s = pb_state_new(m);
  assert_true(step(m, s, 7.5) == 150 && s->saturated == 0);  // the border is inside
  assert_true(step(m, s, 7.6) == 150 && s->saturated == 1);
  assert_true(step(m, s, -1) == -20 && s->saturated == 0);
  assert_true(step(m, s, -1.1) == -20 && s->saturated == 1);
  assert_true(step(m, s, 1) == 20 && s->saturated == 0);
  free(s);
  pb_model_free(m);
}

// 10 kHz: 30000 per second is 3 a step.
static void test_slew(void **state) {
  (void)state;
  pb_model *m = bench("{\"slew\": 30000}", NULL);
  pb_state *s = pb_state_new(m);
  const double most = 30000 * (1 / m->sample_rate);
  assert_true(step(m, s, 2) == 2 && s->saturated == 0);
  assert_true(step(m, s, 9) == 2 + most && s->saturated == 1);
  assert_true(step(m, s, 9) == 2 + most + most && s->saturated == 1);
  assert_true(step(m, s, 9) == 9 && s->saturated == 0);
  assert_true(step(m, s, -9) == 9 - most && s->saturated == 1);
  free(s);
  pb_model_free(m);
}

// Slew counts from what was applied, not from what was wanted, and comes before the range.
static void test_slew_before_saturation(void **state) {
  (void)state;
  pb_model *m = bench("{\"slew\": 30000, \"saturation\": [-4, 5]}", NULL);
  pb_state *s = pb_state_new(m);
  const double most = 30000 * (1 / m->sample_rate);
  step(m, s, 100);
  assert_true(step(m, s, 100) == 5);
  assert_true(step(m, s, -100) == 5 - most);
  free(s);
  pb_model_free(m);
}

// Quantised first, then delayed, then multiplied: 1.3 becomes 1.5 becomes 30.
static void test_order_of_an_input(void **state) {
  (void)state;
  pb_model *m =
      bench("{\"quantisation\": 0.5, \"delay\": 1, \"gain\": 20, \"saturation\": [-1, 29]}", NULL);
  pb_state *s = pb_state_new(m);
  assert_true(step(m, s, 1.3) == 0 && s->saturated == 0);
  assert_true(step(m, s, 1.2) == 29 && s->saturated == 1);
  assert_true(step(m, s, 0) == 20 && s->saturated == 0);
  free(s);
  pb_model_free(m);
}

// Several inputs: each has its bit.
static void test_mask(void **state) {
  (void)state;
  cJSON *file = cJSON_Parse(bench_text);
  set_electronics(file, "inputs", F, "{\"saturation\": [-1, 1]}");
  char *text = NULL;
  pb_model *m = NULL;
  REQUIRE(pb_json_print(file, &text, &err));
  REQUIRE(compile_text(text, &m, &err));
  pb_state *s = pb_state_new(m);
  pb_step_advance(m, s, (double[]){1000, 2});
  assert_int_equal(s->saturated, 2);
  assert_true(s->data[m->nx + VA] == 1000 && s->data[m->nx + F] == 1);
  pb_state_reset(m, s);
  assert_int_equal(s->saturated, 0);
  free(s), free(text);
  cJSON_Delete(file);
  pb_model_free(m);
}

// The noise added after the gain and before the range is that of the signal's own generator.
static void test_noise_of_an_input(void **state) {
  (void)state;
  enum { STEPS = 20000 };
  pb_model *m = bench("{\"gain\": 4, \"noise\": 0.1, \"seed\": 9}", NULL);
  pb_model *other = bench("{\"gain\": 4, \"noise\": 0.1, \"seed\": 10}", NULL);
  pb_state *s = pb_state_new(m), *again = pb_state_new(m), *t = pb_state_new(other);
  double sum = 0, squares = 0;
  for (int k = 0; k < STEPS; k++) {
    double n = step(m, s, 1) - 4;
    assert_true(step(m, again, 1) == applied(m, s));
    assert_true(step(other, t, 1) != applied(m, s));
    sum += n, squares += n * n;
  }
  ASSERT_NEAR(sum / STEPS, 0, 5 * 0.1 / sqrt(STEPS));
  ASSERT_NEAR(sqrt(squares / STEPS), 0.1, 5 * 0.1 / sqrt(2 * STEPS));
  double before = applied(m, again);
  pb_state_reset(m, s);
  pb_state *fresh = pb_state_new(m);
  assert_true(step(m, s, 1) == step(m, fresh, 1));  // a reset seeds anew
  assert_true(applied(m, s) != before);
  free(fresh);
  free(s), free(again), free(t);
  pb_model_free(m), pb_model_free(other);
}

// Output: delayed, then noise, then quantised; asking twice changes nothing.
static void test_output(void **state) {
  (void)state;
  pb_model *plain = bench(NULL, NULL), *late = bench(NULL, "{\"delay\": 2}");
  pb_model *coarse = bench(NULL, "{\"delay\": 2, \"quantisation\": 0.01}");
  pb_model *noisy = bench(NULL, "{\"delay\": 2, \"quantisation\": 0.01, \"noise\": 0.02}");
  const pb_model *m[4] = {plain, late, coarse, noisy};
  pb_state *s[4];
  double y[4][50];
  size_t differ = 0;
  for (int i = 0; i < 4; i++) s[i] = pb_state_new(m[i]);
  for (int k = 0; k < 50; k++) {
    for (int i = 0; i < 4; i++) {
      y[i][k] = output(m[i], s[i], VS);
      assert_true(y[i][k] == output(m[i], s[i], VS));
      assert_true(output(m[i], s[i], Y) == output(plain, s[0], Y));  // the other has none
    }
    double before = k < 2 ? 0 : y[0][k - 2];
    assert_true(y[1][k] == before);
    assert_true(y[2][k] == round(before / 0.01) * 0.01);
    assert_true(y[3][k] == round(y[3][k] / 0.01) * 0.01);
    assert_true(fabs(y[3][k] - before) < 6 * 0.02 + 0.005);
    differ += y[3][k] != y[2][k];
    for (int i = 0; i < 4; i++) step(m[i], s[i], 1 + 0.1 * k);
  }
  assert_true(differ > 30);
  for (int i = 0; i < 4; i++) free(s[i]), pb_model_free((pb_model *)m[i]);
}

// Equal seeds of an input and an output, and of two signals, do not give the same numbers.
static void test_streams_apart(void **state) {
  (void)state;
  pb_model *m = bench("{\"noise\": 1}", "{\"noise\": 1}");
  m->c[VS] = m->c[VS + 2] = m->c[VS + 4] = m->c[VS + 6] = 0;  // the sensor sees its noise only
  m->d[VS] = m->d[VS + 2] = 0;
  pb_state *s = pb_state_new(m);
  pb_random excitation;
  pb_random_seed(&excitation, 0, 0);
  double product = 0, driven = 0;
  for (int k = 0; k < 4000; k++) {
    double vs = output(m, s, VS), va = step(m, s, 0);
    product += vs * va / 4000;
    driven += va * pb_random_gaussian(&excitation) / 4000;
  }
  ASSERT_NEAR(product, 0, 0.1);
  ASSERT_NEAR(driven, 0, 0.1);
  free(s);
  pb_model_free(m);
}

// ---- the file -----------------------------------------------------------------------------------

typedef struct mistake {
  const char *va, *vs, *where, *part;
} mistake;

static void test_mistakes(void **state) {
  (void)state;
#define IN "/inputs/0/electronics"
#define OUT "/outputs/0/electronics"
  static const mistake list[] = {
      {"5", NULL, IN, "object"},
      {"{\"gian\": 1}", NULL, IN "/gian", "unknown key"},
      {"{\"gain\": 0}", NULL, IN "/gain", "gain 0"},
      {"{\"gain\": \"x\"}", NULL, IN "/gain", "number"},
      {"{\"quantisation\": -1}", NULL, IN "/quantisation", "≥ 0"},
      {"{\"noise\": -0.1}", NULL, IN "/noise", "≥ 0"},
      {"{\"delay\": 1.5}", NULL, IN "/delay", "whole number"},
      {"{\"delay\": -1}", NULL, IN "/delay", "whole number"},
      {"{\"delay\": 1001}", NULL, IN "/delay", "1000"},
      {"{\"seed\": 0.5}", NULL, IN "/seed", "whole number"},
      {"{\"seed\": -2}", NULL, IN "/seed", "whole number"},
      {"{\"slew\": 0}", NULL, IN "/slew", "> 0"},
      {"{\"saturation\": 5}", NULL, IN "/saturation", "array of 2"},
      {"{\"saturation\": [1, 2, 3]}", NULL, IN "/saturation", "array of 2"},
      {"{\"saturation\": [1, 5]}", NULL, IN "/saturation", "0 between"},
      {"{\"saturation\": [-5, -1]}", NULL, IN "/saturation", "0 between"},
      {"{\"saturation\": [0, 0]}", NULL, IN "/saturation", "low < high"},
      {"{\"saturation\": [5, -5]}", NULL, IN "/saturation", "low < high"},
      {"{\"saturation\": [-5, \"x\"]}", NULL, IN "/saturation/1", "number"},
      {NULL, "[]", OUT, "object"},
      {NULL, "{\"gain\": 2}", OUT "/gain", "unknown key"},
      {NULL, "{\"slew\": 2}", OUT "/slew", "unknown key"},
      {NULL, "{\"saturation\": [-1, 1]}", OUT "/saturation", "unknown key"},
      {NULL, "{\"delay\": 1001}", OUT "/delay", "1000"},
      {NULL, "{\"noise\": -1}", OUT "/noise", "≥ 0"},
  };
  for (size_t i = 0; i < sizeof list / sizeof *list; i++) {
    pb_model *m = NULL;
    pb_error err = {0};
    pb_status st = bench_try(list[i].va, list[i].vs, &m, &err);
    if (st != PB_ERR_SCHEMA || strcmp(err.where, list[i].where) ||
        !strstr(err.message, list[i].part))
      fail_msg("%s%s gave %s at \"%s\": %s", list[i].va ? list[i].va : "",
               list[i].vs ? list[i].vs : "", pb_status_name(st), err.where, err.message);
    assert_null(m);
  }
}

static pb_status hexapod_try(const char *electronics, pb_model **model, pb_error *err) {
  char patch[512], *text = NULL;
  snprintf(patch, sizeof patch, "{\"template\": {\"electronics\": %s}}", electronics);
  cJSON *file = cJSON_Parse(hexapod_text), *change = cJSON_Parse(patch);
  assert_non_null(change);
  cJSON *merged = pb_json_merge(file, change);
  pb_status st = pb_json_print(merged, &text, err);
  if (!st) st = compile_text(text, model, err);
  free(text);
  cJSON_Delete(file), cJSON_Delete(change), cJSON_Delete(merged);
  return st;
}

static void test_template(void **state) {
  (void)state;
  pb_model *m = NULL;
  REQUIRE(hexapod_try("{\"actuators\": {\"gain\": 20}, \"sensors\": {\"delay\": 1}, \"metrology\": "
                      "{\"delay\": 2, \"noise\": 1e-9}}",
                      &m, &err));
  for (size_t i = 0; i < m->nu; i++)
    assert_true(m->input_electronics[i].gain == (m->input[i].name[0] == 'V' ? 20 : 1));
  for (size_t o = 0; o < m->ny; o++) {
    bool sensor = m->output[o].name[0] == 'V';
    assert_int_equal(m->output_electronics[o].delay, sensor ? 1 : 2);
    assert_true(m->output_electronics[o].noise == (sensor ? 0 : 1e-9));
  }
  pb_model_free(m);
  static const char *const wrong[][2] = {
      {"{\"actors\": {}}", "/template/electronics/actors"},
      {"{\"actuators\": {\"gain\": 0}}", "/template/electronics/actuators/gain"},
      {"{\"sensors\": {\"gain\": 1}}", "/template/electronics/sensors/gain"},
      {"{\"metrology\": {\"delay\": -1}}", "/template/electronics/metrology/delay"},
      {"7", "/template/electronics"},
  };
  for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
    pb_error err = {0};
    assert_int_equal(hexapod_try(wrong[i][0], &m, &err), PB_ERR_SCHEMA);
    assert_string_equal(err.where, wrong[i][1]);
  }
}

static void test_shipped(void **state) {
  (void)state;
  pb_model *m = NULL;
  REQUIRE(pb_model_load(PB_CONFIG "/plants/apa300ml-bench-electronics.json", NULL, &m, &err));
  const pb_electronics *va = &m->input_electronics[VA], *vs = &m->output_electronics[VS];
  assert_true(va->gain == 20 && va->low == -20 && va->high == 150);
  assert_true(va->quantisation == 20.0 / 65536 && vs->delay == 1 && vs->noise > 0);
  pb_model_free(m);
}

// ---- predictions --------------------------------------------------------------------------------

static const char *const chain_va = "{\"gain\": 20, \"delay\": 3}";
static const char *const chain_vs = "{\"delay\": 2}";

static void test_time_bases(void **state) {
  (void)state;
  pb_model *plain = bench(NULL, NULL), *m = bench(chain_va, chain_vs);
  const double hz = 77, w = 2 * M_PI * hz, T = 1 / m->sample_rate;
  static const pb_time_base base[] = {PB_CONTINUOUS, PB_SAMPLED, PB_APPLIED};
  for (int b = 0; b < 3; b++) {
    double complex h[4], p[4];
    REQUIRE(pb_model_frf(m, base[b], &hz, 1, h, &err));
    REQUIRE(pb_model_frf(plain, base[b], &hz, 1, p, &err));
    for (int o = 0; o < 2; o++)
      for (int i = 0; i < 2; i++) {
        bool applied_base = base[b] == PB_APPLIED;
        double gain = i == VA && !applied_base ? 20 : 1;
        int d = (i == VA && !applied_base ? 3 : 0) + (o == VS ? 2 : 0);
        double complex expected = gain * cexp(-I * w * T * d) * p[2 * o + i];
        ASSERT_NEAR(cabs(h[2 * o + i] - expected), 0, 1e-12 * cabs(expected));
      }
  }
  assert_int_equal(pb_model_delay(m), 5);
  assert_int_equal(pb_model_delay(plain), 0);
  double with[4], without[4];
  REQUIRE(pb_model_dc(m, with, &err));
  REQUIRE(pb_model_dc(plain, without, &err));
  for (int k = 0; k < 4; k++) ASSERT_RELATIVE(with[k], without[k] * (k % 2 == VA ? 20 : 1), 1e-14);
  pb_model_free(plain), pb_model_free(m);
}

static void test_derivatives(void **state) {
  (void)state;
  pb_model *m = bench(chain_va, chain_vs);
  static const pb_time_base base[] = {PB_CONTINUOUS, PB_SAMPLED, PB_APPLIED};
  const double complex at[] = {-3 + I * 400, 0.9 * cexp(I * 0.2), 0.9 * cexp(I * 0.2)};
  for (int b = 0; b < 3; b++) {
    double complex h[4], dh[4], after[4], before[4];
    double e = 1e-6 * cabs(at[b]);
    pb_model_evaluate(m, base[b], at[b], h, dh);
    pb_model_evaluate(m, base[b], at[b] + e, after, NULL);
    pb_model_evaluate(m, base[b], at[b] - e, before, NULL);
    for (int k = 0; k < 4; k++)
      assert_true(cabs((after[k] - before[k]) / (2 * e) - dh[k]) < 1e-7 * cabs(dh[k]) + 1e-20);
  }
  pb_model_free(m);
}

static void check_lti(pb_model *m, pb_time_base base, size_t states) {
  pb_lti lti;
  REQUIRE(pb_lti_from_model(m, base, &lti, &err));
  assert_int_equal(lti.nx, states);
  double x[40] = {0}, scratch[40], u[2], from[2], y[2], expected[2], peak = 0;
  pb_state *s = pb_state_new(m);
  for (int k = 0; k < 300; k++) {
    for (int i = 0; i < 2; i++) u[i] = sin(0.1 * k * (i + 1)) + (k == 5);
    pb_step_output(m, s, expected);
    pb_step_advance(m, s, u);
    for (int i = 0; i < 2; i++) from[i] = base == PB_APPLIED ? s->data[m->nx + (size_t)i] : u[i];
    pb_lti_step(&lti, x, scratch, from, y);
    for (int o = 0; o < 2; o++) {
      peak = fmax(peak, fabs(expected[o]));
      ASSERT_NEAR(y[o], expected[o], 1e-12 * peak);
    }
  }
  free(s);
  pb_lti_free(&lti);
}

// As a dense system the delays are states: 2 for the held inputs of D, 3 and 2 of the lines.
static void test_lti(void **state) {
  (void)state;
  pb_model *m = bench(chain_va, chain_vs), *scaled = bench("{\"gain\": 20}", NULL);
  bool direct = false;
  for (int k = 0; k < 4; k++) direct = direct || m->d[k] != 0;
  size_t states = m->nx + (direct ? 2 : 0);
  check_lti(m, PB_SAMPLED, states + 5);
  check_lti(m, PB_APPLIED, states + 2);
  check_lti(scaled, PB_SAMPLED, states);
  pb_lti lti;
  pb_error refused = {0};
  assert_int_equal(pb_lti_from_model(m, PB_CONTINUOUS, &lti, &refused), PB_ERR_ARGUMENT);
  assert_non_null(strstr(refused.message, "delayed"));
  REQUIRE(pb_lti_from_model(scaled, PB_CONTINUOUS, &lti, &err));
  double complex h[4], g[4];
  const double hz = 50;
  REQUIRE(pb_lti_frf(&lti, &hz, 1, h, &err));
  REQUIRE(pb_model_frf(scaled, PB_CONTINUOUS, &hz, 1, g, &err));
  for (int k = 0; k < 4; k++) ASSERT_NEAR(cabs(h[k] - g[k]), 0, 1e-11 * cabs(g[k]));
  pb_lti_free(&lti);
  const size_t in = VA, out = Y;
  const pb_lti_channels one = {&in, &out, 1, 1};
  REQUIRE(pb_lti_from_channels(m, PB_SAMPLED, &one, &lti, &err));
  assert_int_equal(lti.nx, states + 3);  // the delay of the other output is not in it
  pb_lti_free(&lti);
  pb_model_free(m), pb_model_free(scaled);
}

// ---- loops --------------------------------------------------------------------------------------

// Whether a run of the loop with proportional gain from Vs to Va dies down.
static bool run_dies_down(const pb_model *m, double gain) {
  pb_state *s = pb_state_new(m);
  double first = 0, last = 0;
  for (int n = 0; n < 60000 && last < 1e50; n++) {
    double vs = output(m, s, VS);
    step(m, s, gain * vs + (n == 0));
    if (n < 3000) first = fmax(first, fabs(vs));
    if (n >= 57000 || fabs(vs) > 1e50) last = fmax(last, fabs(vs));
  }
  free(s);
  return last < first;
}

// Poles of the loop are roots of 1 − L, with electronics in it, and the verdict on stability is
// that of a run. Delays of hundreds of samples are judged by the argument principle.
static void check_loop(const char *va, const char *vs, const double *gain, size_t gains) {
  pb_model *m = bench(va, vs);
  pb_lti k;
  REQUIRE(pb_lti_new(0, 1, 1, 1 / m->sample_rate, &k, &err));
  k.d[0] = 1;
  const size_t in = VA, out = VS;
  pb_loop loop = {m, &k, &out, &in, 1, 0};
  pb_loop_solver *solver;
  REQUIRE(pb_loop_solver_new(&loop, &solver, &err));
  bool seen[2] = {false};
  for (size_t g = 0; g < gains; g++) {
    pb_pole_list list;
    bool stable;
    REQUIRE(pb_loop_solver_poles(solver, gain[g], 20, 1000, &list, &err));
    assert_true(list.count >= 1);
    for (size_t p = 0; p < list.count; p++) {
      double complex h[4], dh[4], z = list.item[p].z;
      pb_model_evaluate(m, PB_SAMPLED, z, h, dh);
      double complex error = (gain[g] * h[VS * 2 + VA] - 1) / (gain[g] * dh[VS * 2 + VA]);
      if (!(cabs(error) < 1e-9)) fail_msg("gain %g: pole off by %g", gain[g], cabs(error));
    }
    REQUIRE(pb_loop_solver_stable(solver, gain[g], &stable, NULL, &err));
    seen[stable] = true;
    if (stable != run_dies_down(m, gain[g])) fail_msg("gain %g: stable %d?", gain[g], stable);
    pb_pole_list_clear(&list);
  }
  assert_true(seen[0] && seen[1]);
  pb_loop_solver_free(solver);
  pb_lti_free(&k);
  pb_model_free(m);
}

static void test_loop(void **state) {
  (void)state;
  static const double gain[] = {0.001, 0.01, -0.001, 0.1, -0.1, 0.0003};
  check_loop("{\"gain\": 20, \"delay\": 1}", "{\"delay\": 1}", gain, 6);
}

static void test_loop_of_long_delay(void **state) {
  (void)state;
  static const double gain[] = {3e-3, 2e-2, -2e-2};
  check_loop("{\"gain\": 20, \"delay\": 300}", "{\"delay\": 150}", gain, 3);
}

// The closed loop as state space and as response agree with a run's steady state.
static void test_closed_loop_response(void **state) {
  (void)state;
  pb_model *m = bench("{\"gain\": 20, \"delay\": 1}", "{\"delay\": 2}");
  pb_lti k, closed;
  REQUIRE(pb_lti_new(0, 1, 1, 1 / m->sample_rate, &k, &err));
  k.d[0] = 1e-3;
  const size_t in = VA, out = VS;
  pb_loop loop = {m, &k, &out, &in, -1, 1};
  const double hz[2] = {30, 210};
  double complex a[8], b[8], l[2], p[8];
  REQUIRE(pb_loop_closed(&loop, 1, &closed, &err));
  REQUIRE(pb_lti_frf(&closed, hz, 2, a, &err));
  REQUIRE(pb_loop_frf(&loop, 1, hz, 2, b, &err));
  REQUIRE(pb_loop_gain(&loop, 1, hz, 2, l, &err));
  REQUIRE(pb_model_frf(m, PB_SAMPLED, hz, 2, p, &err));
  for (int f = 0; f < 2; f++) {
    double complex open = -1e-3 * cexp(-I * 2 * M_PI * hz[f] / m->sample_rate) * p[4 * f + VS * 2];
    ASSERT_NEAR(cabs(l[f] - open), 0, 1e-12 * cabs(open));
    ASSERT_NEAR(cabs(b[4 * f] - p[4 * f] / (1 - open)), 0, 1e-11 * cabs(b[4 * f]));
    for (int c = 0; c < 4; c++)
      ASSERT_NEAR(cabs(a[4 * f + c] - b[4 * f + c]), 0, 1e-9 * cabs(b[4 * f + c]));
  }
  pb_lti_free(&closed), pb_lti_free(&k);
  pb_model_free(m);
}

// ---- on the bus ---------------------------------------------------------------------------------

static pb_status unpack(const double *data, size_t count, pb_model **out, pb_error *err) {
  static const char *const in[] = {"Va", "F"}, *const in_unit[] = {"V", "N"};
  static const char *const o[] = {"Vs", "y"}, *const o_unit[] = {"V", "m"};
  return pb_model_unpack(data, count, "copy", in, in_unit, o, o_unit, out, err);
}

static void test_pack(void **state) {
  (void)state;
  pb_model *m = NULL, *copy = NULL;
  double *data, *again;
  size_t count, count_again;
  REQUIRE(pb_model_load(PB_CONFIG "/plants/apa300ml-bench-electronics.json", NULL, &m, &err));
  REQUIRE(pb_model_pack(m, &data, &count, &err));
  REQUIRE(unpack(data, count, &copy, &err));
  REQUIRE(pb_model_pack(copy, &again, &count_again, &err));
  assert_int_equal(count, count_again);
  assert_memory_equal(data, again, count * sizeof *data);
  pb_state *a = pb_state_new(m), *b = pb_state_new(copy);
  for (int k = 0; k < 100; k++) {
    assert_true(output(m, a, VS) == output(copy, b, VS));
    assert_true(step(m, a, 9 * sin(k)) == step(copy, b, 9 * sin(k)));
  }
  pb_model_free(copy);
  // The last 4 × 8 numbers are the electronics of Va, F, Vs, y: gain, quantisation, noise, low,
  // high, slew, delay, seed.
  static const struct {
    int at;
    double value;
  } wrong[] = {{0, 0},   {1, -1},   {2, -1}, {3, 1},   {4, -1},   {5, -1},       {6, 0.5},
               {6, -1},  {6, 1001}, {7, -1}, {7, 0.5}, {7, 1e17}, {0, NAN},      {16, 2},
               {19, -1}, {20, 1},   {21, 1}, {22, -1}, {23, 0.5}, {18, INFINITY}};
  for (size_t k = 0; k < sizeof wrong / sizeof *wrong; k++) {
    double *entry = &data[count - 32 + (size_t)wrong[k].at], kept = *entry;
    *entry = wrong[k].value;
    pb_error err = {0};
    if (unpack(data, count, &copy, &err) != PB_ERR_SYNTAX)
      fail_msg("entry %d = %g is taken", wrong[k].at, wrong[k].value);
    assert_null(copy);
    *entry = kept;
  }
  free(a), free(b), free(data), free(again);
  pb_model_free(m);
}

static void test_truncation_keeps_electronics(void **state) {
  (void)state;
  pb_model *m = bench(chain_va, chain_vs), *cut = NULL;
  REQUIRE(pb_model_truncate(m, 1000, &cut, &err));
  assert_int_equal(cut->nx, 2);
  assert_true(cut->input_electronics[VA].gain == 20 && cut->input_electronics[VA].delay == 3);
  assert_int_equal(cut->output_electronics[VS].delay, 2);
  pb_model_free(m), pb_model_free(cut);
}

// ---- a change of model --------------------------------------------------------------------------

static void carry(const pb_model *from, const pb_state *a, const pb_model *to, pb_state *b) {
  static const int both[2] = {0, 1};
  pb_electronics_carry(from, a, both, both, to, b);
  memcpy(b->data, a->data, from->nx * sizeof(double));
  b->step = a->step;
  pb_state_measure(to, b);
}

#define NOISY_VA "{\"gain\": 2, \"delay\": 3, \"noise\": 0.1, \"slew\": 9000, \"seed\": 4}"
#define NOISY_VS "{\"delay\": 2, \"noise\": 0.1, \"quantisation\": 0.01}"

// Carried to the same model, a state goes on bit for bit.
static void test_carry_to_the_same(void **state) {
  (void)state;
  pb_model *m = bench(NOISY_VA, NOISY_VS);
  pb_state *a = pb_state_new(m), *b = pb_state_new(m);
  for (int k = 0; k < 57; k++) step(m, a, sin(k));
  carry(m, a, m, b);
  assert_int_equal(b->saturated, a->saturated);
  for (int k = 0; k < 100; k++) {
    for (size_t o = 0; o < 2; o++) assert_true(output(m, a, o) == output(m, b, o));
    assert_true(step(m, a, cos(k)) == step(m, b, cos(k)));
  }
  free(a), free(b);
  pb_model_free(m);
}

static void test_carry_between(void **state) {
  (void)state;
  pb_model *plain = bench(NULL, NULL), *two = bench("{\"delay\": 2}", "{\"delay\": 2}");
  pb_model *four = bench("{\"delay\": 4}", "{\"delay\": 4}");
  pb_state *a = pb_state_new(two), *b = pb_state_new(four), *c = pb_state_new(plain);
  double vs[9];
  for (int k = 1; k <= 8; k++) {
    step(two, a, k), step(plain, c, applied(two, a));  // c sees the same inputs
    vs[k] = output(plain, c, VS);
  }
  assert_true(output(two, a, VS) == vs[6]);
  // To a longer delay: 8 and 7 are known, 6 was the oldest.
  carry(two, a, four, b);
  assert_true(applied(four, b) == 6);
  assert_true(output(four, b, VS) == vs[6]);
  assert_true(step(four, b, 9) == 6);
  assert_true(step(four, b, 9) == 6);
  assert_true(step(four, b, 9) == 7);
  assert_true(step(four, b, 9) == 8);
  assert_true(step(four, b, 9) == 9);
  // To none, and back: the held input is all there is.
  carry(two, a, plain, c);
  assert_true(applied(plain, c) == 6);
  ASSERT_NEAR(output(plain, c, VS), vs[8], 1e-15 * fabs(vs[8]));
  carry(plain, c, two, a);
  ASSERT_NEAR(output(two, a, VS), vs[8], 1e-12 * fabs(vs[8]));
  assert_true(step(two, a, 1) == 6 && step(two, a, 1) == 6 && step(two, a, 1) == 1);
  free(a), free(b), free(c);
  pb_model_free(plain), pb_model_free(two), pb_model_free(four);
}

static void test_carry_from_nothing(void **state) {
  (void)state;
  pb_model *m = bench(NOISY_VA, NOISY_VS);
  pb_state *a = pb_state_new(m), *b = pb_state_new(m), *fresh = pb_state_new(m);
  for (int k = 0; k < 57; k++) step(m, a, 100), step(m, b, 7);
  static const int none[2] = {-1, -1};
  pb_electronics_carry(m, a, none, none, m, b);
  memset(b->data, 0, m->nx * sizeof(double));
  b->step = 0;
  pb_state_measure(m, b);
  assert_memory_equal(b->data, fresh->data, m->nx * sizeof(double));
  for (int k = 0; k < 40; k++) {
    assert_true(output(m, fresh, VS) == output(m, b, VS));
    assert_true(step(m, fresh, 2) == step(m, b, 2));
  }
  free(a), free(b), free(fresh);
  pb_model_free(m);
}

// Measuring again is idempotent, and sees a state that was changed.
static void test_measure_again(void **state) {
  (void)state;
  pb_model *m = bench(NULL, "{\"noise\": 0.1}");
  pb_state *s = pb_state_new(m);
  size_t bytes = pb_state_bytes(m);
  pb_state *copy = malloc(bytes);
  for (int k = 0; k < 30; k++) step(m, s, 1);
  memcpy(copy, s, bytes);
  pb_state_measure(m, s);
  pb_state_measure(m, s);
  assert_memory_equal(copy, s, bytes);
  double before = output(m, s, VS);
  s->data[0] += 1e-6;
  pb_state_measure(m, s);
  ASSERT_NEAR(output(m, s, VS) - before, 1e-6 * m->c[VS], 1e-12);
  free(s), free(copy);
  pb_model_free(m);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_none_without_keys),
      cmocka_unit_test(test_gain),
      cmocka_unit_test(test_quantisation),
      cmocka_unit_test(test_delay_of_an_input),
      cmocka_unit_test(test_saturation),
      cmocka_unit_test(test_slew),
      cmocka_unit_test(test_slew_before_saturation),
      cmocka_unit_test(test_order_of_an_input),
      cmocka_unit_test(test_mask),
      cmocka_unit_test(test_noise_of_an_input),
      cmocka_unit_test(test_output),
      cmocka_unit_test(test_streams_apart),
      cmocka_unit_test(test_mistakes),
      cmocka_unit_test(test_template),
      cmocka_unit_test(test_shipped),
      cmocka_unit_test(test_time_bases),
      cmocka_unit_test(test_derivatives),
      cmocka_unit_test(test_lti),
      cmocka_unit_test(test_loop),
      cmocka_unit_test(test_loop_of_long_delay),
      cmocka_unit_test(test_closed_loop_response),
      cmocka_unit_test(test_pack),
      cmocka_unit_test(test_truncation_keeps_electronics),
      cmocka_unit_test(test_carry_to_the_same),
      cmocka_unit_test(test_carry_between),
      cmocka_unit_test(test_carry_from_nothing),
      cmocka_unit_test(test_measure_again),
  };
  return cmocka_run_group_tests(tests, setup, teardown);
}
