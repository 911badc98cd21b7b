// What each kind of item gives inside the step, and which requests are refused.
#include "host_rig.h"

#include "control/iff.h"
#include "control/lti_ops.h"
#include "signal/excitation.h"
#include "signal/random.h"

static void assert_bits(double a, double b, unsigned step) {
  if (memcmp(&a, &b, sizeof a) != 0) fail_msg("step %u: %.17g, expected %.17g", step, a, b);
}

static void test_table(void **state) {
  (void)state;
  pb_host *once =
      rig_one("excite", "{'channel': 't', 'type': 'table', 'inputs': ['u3', 'u1'], 'values': "
                        "[[1, 2], [3, 4], [5, 6]]}");
  double u[RIG_INPUTS];
  for (unsigned k = 0; k < 3; k++) {
    assert_false(pb_host_done(once, 0));
    rig_run(once, NULL, u);
    assert_bits(u[2], 1 + 2 * k, k);
    assert_bits(u[0], 2 + 2 * k, k);
    assert_bits(u[1], 0, k);
  }
  assert_true(pb_host_done(once, 0));
  for (unsigned k = 3; k < 6; k++) {
    double left[RIG_INPUTS] = {-0.0, 7, -0.0}, y[RIG_OUTPUTS] = {0};
    pb_host_run(once, y, left);
    assert_bits(left[0], -0.0, k);
    assert_bits(left[1], 7, k);
    assert_bits(left[2], -0.0, k);
  }
  assert_int_equal(pb_host_info(once, 0)->period_steps, 3);
  pb_host_reset(once);
  assert_false(pb_host_done(once, 0));
  pb_host_free(once);
  pb_host *again =
      rig_one("excite", "{'channel': 't', 'type': 'table', 'inputs': ['u2'], 'values': [[1], "
                        "[3], [5]], 'repeat': true}");
  for (unsigned k = 0; k < 10; k++) {
    rig_run(again, NULL, u);
    assert_bits(u[1], 1 + 2 * (k % 3), k);
    assert_false(pb_host_done(again, 0));
  }
  pb_host_free(again);
}

// Runs rows + 5 steps against table[rows][2] on inputs u3, u1.
static void check_columns(const char *text, const double *table, unsigned rows, bool repeat) {
  pb_host *host = rig_one("excite", text);
  double u[RIG_INPUTS];
  assert_int_equal(pb_host_info(host, 0)->period_steps, rows);
  for (unsigned k = 0; k < rows + 5; k++) {
    rig_run(host, NULL, u);
    const bool over = !repeat && k >= rows;
    assert_bits(u[2], over ? 0 : table[2 * (k % rows)], k);
    assert_bits(u[0], over ? 0 : table[2 * (k % rows) + 1], k);
    assert_bits(u[1], 0, k);
  }
  assert_int_equal(pb_host_done(host, 0), !repeat);
  pb_host_free(host);
}

static void test_noise(void **state) {
  (void)state;
  double table[2 * 250];
  pb_noise_spec spec = {.sample_rate = 1000, .f1 = 20, .f2 = 200, .rms = 0.7, .seed = 5};
  REQUIRE(pb_excite_noise(&spec, 250, 2, table, &err));
  check_columns("{'channel': 'n', 'type': 'noise', 'inputs': ['u3', 'u1'], 'rms': 0.7, 'f1': 20, "
                "'f2': 200, 'seconds': 0.25, 'seed': 5}",
                table, 250, false);
  spec.periodic = true;
  spec.seed = 1;
  REQUIRE(pb_excite_noise(&spec, 250, 2, table, &err));
  check_columns("{'channel': 'n', 'type': 'noise', 'inputs': ['u3', 'u1'], 'rms': 0.7, 'f1': 20, "
                "'f2': 200, 'seconds': 0.25, 'repeat': true}",
                table, 250, true);
}

static void test_multisine(void **state) {
  (void)state;
  double table[2 * 200];
  const pb_multisine_spec spec = {.sample_rate = 1000, .f1 = 10, .f2 = 300, .rms = 1.5, .seed = 77};
  REQUIRE(pb_excite_multisine(&spec, 200, 2, table, &err));
  check_columns("{'channel': 'm', 'type': 'multisine', 'inputs': ['u3', 'u1'], 'rms': 1.5, 'f1': "
                "10, 'f2': 300, 'seconds': 0.2, 'seed': 77}",
                table, 200, true);
  check_columns("{'channel': 'm', 'type': 'multisine', 'inputs': ['u3', 'u1'], 'rms': 1.5, 'f1': "
                "10, 'f2': 300, 'seconds': 0.2, 'seed': 77, 'repeat': false}",
                table, 200, false);
}

static void test_chirp(void **state) {
  (void)state;
  double sweep[150], table[2 * 150];
  REQUIRE(pb_excite_chirp(1000, 400, 5, 2, 150, sweep, &err));
  for (int k = 0; k < 150; k++) table[2 * k] = table[2 * k + 1] = sweep[k];
  check_columns("{'channel': 'c', 'type': 'chirp', 'inputs': ['u3', 'u1'], 'amplitude': 2, 'f1': "
                "400, 'f2': 5, 'seconds': 0.15}",
                table, 150, false);
}

static void test_white(void **state) {
  (void)state;
  pb_host *host = rig_one(
      "excite", "{'channel': 'w', 'type': 'white', 'inputs': ['u2', 'u3'], 'rms': 3, 'seed': 8}");
  pb_random random[2];
  double u[RIG_INPUTS];
  pb_random_seed(&random[0], 8, 0);
  pb_random_seed(&random[1], 8, 1);
  for (unsigned k = 0; k < 1001; k++) {
    rig_run(host, NULL, u);
    assert_bits(u[1], 3 * pb_random_gaussian(&random[0]), k);
    assert_bits(u[2], 3 * pb_random_gaussian(&random[1]), k);
  }
  assert_int_equal(pb_host_info(host, 0)->period_steps, 0);
  pb_host_free(host);
}

static void test_step(void **state) {
  (void)state;
  pb_host *host =
      rig_one("excite", "{'channel': 's', 'type': 'step', 'inputs': ['u2', 'u3'], 'amplitude': "
                        "-1.5, 'at': 0.0304}");
  double u[RIG_INPUTS];
  for (unsigned k = 0; k < 100; k++) {
    rig_run(host, NULL, u);
    assert_bits(u[1], k < 30 ? 0 : -1.5, k);
    assert_bits(u[2], k < 30 ? 0 : -1.5, k);
  }
  assert_false(pb_host_done(host, 0));
  pb_host_free(host);
}

// sin(2π f k / fs + φ) with the whole cycles dropped in integers: f = m 2^-s exactly.
static double exact_sine(double f, unsigned rate, uint64_t k, double phase) {
  int exponent;
  const double mantissa = frexp(f, &exponent);
  const int s = 53 - exponent;  // s ≥ 44 for f < 512
  assert_true(s >= 44 && s <= 54);
  const unsigned __int128 m = (unsigned __int128)ldexp(mantissa, 53);
  const unsigned __int128 cycle = (unsigned __int128)rate << s;
  const unsigned __int128 rest = m * k % cycle;
  return (double)sinl(2 * 3.14159265358979323846264338327950288L * (long double)rest /
                          (long double)cycle +
                      (long double)phase);
}

static void test_sine_stays_exact(void **state) {
  (void)state;
  static const double hz[] = {1.0 / 1.7, 50, 123.456, 333.3333333333333, 499.999};
  static const uint64_t start[] = {0, 999999, 123456789012, UINT64_C(1) << 45,
                                   (UINT64_C(1) << 50) + 12345};
  for (size_t f = 0; f < sizeof hz / sizeof *hz; f++) {
    char text[256];
    snprintf(text, sizeof text,
             "{'channel': 's', 'type': 'sine', 'inputs': ['u1', 'u2'], 'amplitude': 2, "
             "'frequency': %.17g, 'phase': 0.75}",
             hz[f]);
    pb_host *host = rig_one("excite", text);
    assert_int_equal(pb_host_bytes(host), sizeof(uint64_t));
    for (size_t s = 0; s < sizeof start / sizeof *start; s++) {
      pb_host_load(host, &start[s]);
      for (uint64_t k = start[s]; k < start[s] + 500; k++) {
        double u[RIG_INPUTS];
        rig_run(host, NULL, u);
        ASSERT_NEAR(u[0], 2 * exact_sine(hz[f], 1000, k, 0.75), 1e-14);
        assert_bits(u[1], u[0], (unsigned)k);
      }
    }
    pb_host_free(host);
  }
}

static void test_iff(void **state) {
  (void)state;
  pb_host *host = rig_one(rig_request[0][0], rig_request[0][1]);
  const pb_iff iff[2] = {{-3.5, 1.5, 0.25}, {20, 1.5, 0.25}};
  pb_lti k1, k2;
  double x[4] = {0}, scratch[2], expected[2], u[RIG_INPUTS], y[RIG_OUTPUTS];
  REQUIRE(pb_iff_discrete(&iff[0], 1, 1000, &k1, &err));
  REQUIRE(pb_iff_discrete(&iff[1], 1, 1000, &k2, &err));
  for (unsigned k = 0; k < 500; k++) {
    rig_outputs(k, y);
    pb_lti_step(&k1, x, scratch, &y[1], &expected[0]);
    pb_lti_step(&k2, x + 2, scratch, &y[0], &expected[1]);
    rig_run(host, y, u);
    assert_bits(u[0], expected[0], k);
    assert_bits(u[2], expected[1], k);
    assert_bits(u[1], 0, k);
  }
  pb_lti_free(&k1);
  pb_lti_free(&k2);
  pb_host_free(host);
}

// One gain for all pairs and the report's corners: the library's controller of three struts.
static void test_iff_defaults(void **state) {
  (void)state;
  pb_host *host =
      rig_one("host_controller", "{'channel': 'i', 'type': 'iff', 'inputs': ['u1', 'u2', 'u3'], "
                                 "'outputs': ['y1', 'y2', 'y3'], 'gain': 12}");
  const pb_iff iff = pb_iff_default(12);
  pb_lti all;
  double x[6] = {0}, scratch[6], expected[3], u[RIG_INPUTS], y[RIG_OUTPUTS];
  REQUIRE(pb_iff_discrete(&iff, 3, 1000, &all, &err));
  for (unsigned k = 0; k < 300; k++) {
    rig_outputs(k, y);
    pb_lti_step(&all, x, scratch, y, expected);
    rig_run(host, y, u);
    for (int i = 0; i < 3; i++) ASSERT_NEAR(u[i], expected[i], 1e-14);
  }
  pb_lti_free(&all);
  pb_host_free(host);
}

// A continuous system, and the same made discrete outside: the same bits. y3, y4 to u2.
static void check_discretised(const char *method_key, pb_c2d_method method) {
  static double a[] = {-30, 1, 4, -2}, b[] = {1, 0, 0.5, 2}, c[] = {3, 7}, d[] = {0.1, 0};
  const pb_lti continuous = {.nx = 2, .nu = 2, .ny = 1, .a = a, .b = b, .c = c, .d = d};
  pb_lti k;
  char given[512], made[1024];
  REQUIRE(pb_lti_c2d(&continuous, 1e-3, method, &k, &err));
  snprintf(given, sizeof given,
           "{'channel': 'k', 'type': 'lti', 'inputs': ['u2'], 'outputs': ['y3', 'y4'], 'a': [[-30, "
           "4], [1, -2]], 'b': [[1, 0.5], [0, 2]], 'c': [[3, 7]], 'd': [[0.1, 0]]%s}",
           method_key);
  snprintf(made, sizeof made,
           "{'channel': 'k', 'type': 'lti', 'inputs': ['u2'], 'outputs': ['y3', 'y4'], 'a': "
           "[[%.17g, %.17g], [%.17g, %.17g]], 'b': [[%.17g, %.17g], [%.17g, %.17g]], 'c': [[%.17g, "
           "%.17g]], 'd': [[%.17g, %.17g]], 'dt': 0.001}",
           k.a[0], k.a[2], k.a[1], k.a[3], k.b[0], k.b[2], k.b[1], k.b[3], k.c[0], k.c[1], k.d[0],
           k.d[1]);
  pb_host *one = rig_one("host_controller", given), *two = rig_one("host_controller", made);
  double x[2] = {0}, scratch[2], expected, u[RIG_INPUTS], v[RIG_INPUTS], y[RIG_OUTPUTS];
  for (unsigned step = 0; step < 300; step++) {
    rig_outputs(step, y);
    pb_lti_step(&k, x, scratch, &y[2], &expected);
    rig_run(one, y, u);
    rig_run(two, y, v);
    assert_bits(u[1], expected, step);
    assert_bits(v[1], expected, step);
    assert_bits(u[0], 0, step);
  }
  pb_lti_free(&k);
  pb_host_free(one);
  pb_host_free(two);
}

static void test_lti(void **state) {
  (void)state;
  check_discretised("", PB_C2D_TUSTIN);
  check_discretised(", 'method': 'tustin', 'dt': 0", PB_C2D_TUSTIN);
  check_discretised(", 'method': 'zoh'", PB_C2D_ZOH);
}

// u(k) = +D y(k) at once, without states; and a lag against its closed form.
static void test_lti_sign_and_time(void **state) {
  (void)state;
  pb_host *gain = rig_one("host_controller",
                          "{'channel': 'g', 'type': 'lti', 'inputs': ['u3', 'u1'], 'outputs': "
                          "['y4'], 'a': [], 'd': [[2], [-1]]}");
  double u[RIG_INPUTS], y[RIG_OUTPUTS] = {9, 9, 9, 3};
  assert_int_equal(pb_host_bytes(gain), 0);
  rig_run(gain, y, u);
  assert_bits(u[2], 6, 0);
  assert_bits(u[0], -3, 0);
  pb_host_free(gain);
  pb_host *lag = rig_one("host_controller",
                         "{'channel': 'l', 'type': 'lti', 'inputs': ['u1'], 'outputs': ['y1'], "
                         "'a': [[-50]], 'b': [[50]], 'c': [[1]], 'method': 'zoh'}");
  y[0] = 1;
  for (unsigned k = 0; k < 200; k++) {
    rig_run(lag, y, u);
    ASSERT_NEAR(u[0], 1 - exp(-50e-3 * k), 1e-13);
  }
  pb_host_free(lag);
}

typedef struct refusal {
  const char *request, *body, *where;
  pb_status status;
} refusal;

#define C "host_controller"
#define E "excite"
#define IFF "'channel': 'c', 'type': 'iff', 'inputs': ['u1', 'u2'], 'outputs': ['y1', 'y2']"
#define LTI "'channel': 'c', 'type': 'lti', 'inputs': ['u1', 'u2'], 'outputs': ['y1']"
#define ON(type) "'channel': 'c', 'type': '" type "', 'inputs': ['u1', 'u2']"
#define BAND(type) ON(type) ", 'rms': 1, 'f1': 10, 'f2': 100"
#define A2 "'a': [[1, 2], [3, 4]]"

static const refusal refused[] = {
    {C, "[]", "", PB_ERR_SCHEMA},
    {C, "{}", "/type", PB_ERR_SCHEMA},
    {C, "{'type': 'sine'}", "/type", PB_ERR_SCHEMA},
    {E, "{'type': 'iff'}", "/type", PB_ERR_SCHEMA},
    {E, "{'type': 7}", "/type", PB_ERR_SCHEMA},
    {"attach", "{'type': 'iff'}", "host", PB_ERR_ARGUMENT},
    {E, "{'type': 'step', 'amplitude': 1, 'inputs': ['u1']}", "/channel", PB_ERR_SCHEMA},
    {E, "{'channel': '', 'type': 'step', 'amplitude': 1, 'inputs': ['u1']}", "/channel",
     PB_ERR_SCHEMA},
    {E,
     "{'channel': '1234567890123456789012345678901234567890123456789012345678901234', 'type': "
     "'step', 'amplitude': 1, 'inputs': ['u1']}",
     "/channel", PB_ERR_SCHEMA},
    {E, "{'channel': 'c', 'type': 'step', 'amplitude': 1}", "/inputs", PB_ERR_SCHEMA},
    {E, "{'channel': 'c', 'type': 'step', 'amplitude': 1, 'inputs': []}", "/inputs", PB_ERR_SCHEMA},
    {E, "{'channel': 'c', 'type': 'step', 'amplitude': 1, 'inputs': ['u1', 3]}", "/inputs/1",
     PB_ERR_SCHEMA},
    {E, "{'channel': 'c', 'type': 'step', 'amplitude': 1, 'inputs': ['u1', 'y1']}", "/inputs/1",
     PB_ERR_REFERENCE},
    {E, "{'channel': 'c', 'type': 'step', 'amplitude': 1, 'inputs': ['u1', 'u2', 'u1']}",
     "/inputs/2", PB_ERR_SCHEMA},
    {C, "{'channel': 'c', 'type': 'iff', 'inputs': ['u1'], 'gain': 1}", "/outputs", PB_ERR_SCHEMA},
    {C, "{'channel': 'c', 'type': 'iff', 'inputs': ['u1'], 'outputs': ['u1'], 'gain': 1}",
     "/outputs/0", PB_ERR_REFERENCE},
    {C, "{'channel': 'c', 'type': 'iff', 'inputs': ['u1'], 'outputs': ['y1', 'y2'], 'gain': 1}",
     "/outputs", PB_ERR_SCHEMA},
    {C, "{" IFF "}", "/gain", PB_ERR_SCHEMA},
    {C, "{" IFF ", 'gain': '1'}", "/gain", PB_ERR_SCHEMA},
    {C, "{" IFF ", 'gain': [1]}", "/gain", PB_ERR_SCHEMA},
    {C, "{" IFF ", 'gain': [1, 2, 3]}", "/gain", PB_ERR_SCHEMA},
    {C, "{" IFF ", 'gain': [1, null]}", "/gain/1", PB_ERR_SCHEMA},
    {C, "{" IFF ", 'gain': 1, 'integrator_hz': 0}", "/integrator_hz", PB_ERR_SCHEMA},
    {C, "{" IFF ", 'gain': 1, 'highpass_hz': -1}", "/highpass_hz", PB_ERR_SCHEMA},
    {C, "{" IFF ", 'gain': 1, 'highpass_hz': '1'}", "/highpass_hz", PB_ERR_SCHEMA},
    {C, "{" IFF ", 'gain': 1, 'a': []}", "/a", PB_ERR_SCHEMA},
    {C, "{" IFF ", 'gain': 1, 'Gain': 1}", "/Gain", PB_ERR_SCHEMA},
    {C, "{" LTI "}", "/d", PB_ERR_SCHEMA},
    {C, "{" LTI ", 'a': [[1, 2]], 'b': [[1]], 'c': [[1], [1]]}", "/a/0", PB_ERR_SCHEMA},
    {C, "{" LTI ", 'a': [[1, 2], [3, true]], 'b': [[1]], 'c': [[1], [1]]}", "/a/1/1",
     PB_ERR_SCHEMA},
    {C, "{" LTI ", 'a': [1]}", "/a/0", PB_ERR_SCHEMA},
    {C, "{" LTI ", " A2 "}", "/b", PB_ERR_SCHEMA},
    {C, "{" LTI ", " A2 ", 'b': [[1], [1, 1]], 'c': [[1, 1], [1, 1]]}", "/b/1", PB_ERR_SCHEMA},
    {C, "{" LTI ", " A2 ", 'b': [[1]], 'c': [[1, 1], [1, 1]]}", "/b", PB_ERR_SCHEMA},
    {C, "{" LTI ", " A2 ", 'b': [[1], [1]], 'c': [[1, 1]]}", "/c", PB_ERR_SCHEMA},
    {C, "{" LTI ", " A2 ", 'b': [[1], [1]], 'c': [[1, 1], [1]]}", "/c/1", PB_ERR_SCHEMA},
    {C, "{" LTI ", " A2 ", 'b': [[1], [1]], 'c': [[1, 1], [1, 1]], 'd': [[1]]}", "/d",
     PB_ERR_SCHEMA},
    {C, "{" LTI ", 'a': [], 'd': [[1], ['1']]}", "/d/1/0", PB_ERR_SCHEMA},
    {C, "{" LTI ", 'a': [], 'b': 1, 'd': [[1], [1]]}", "/b", PB_ERR_SCHEMA},
    {C, "{" LTI ", 'a': [], 'd': [[1], [1]], 'dt': 0.002}", "/dt", PB_ERR_SCHEMA},
    {C, "{" LTI ", 'a': [], 'd': [[1], [1]], 'dt': 0.00100000001}", "/dt", PB_ERR_SCHEMA},
    {C, "{" LTI ", 'a': [], 'd': [[1], [1]], 'dt': -1}", "/dt", PB_ERR_SCHEMA},
    {C, "{" LTI ", 'a': [], 'd': [[1], [1]], 'method': 'foh'}", "/method", PB_ERR_SCHEMA},
    {C, "{" LTI ", 'a': [], 'd': [[1], [1]], 'method': 'zoh', 'dt': 0.001}", "/method",
     PB_ERR_SCHEMA},
    {C, "{" LTI ", 'a': [[2000]], 'b': [[1]], 'c': [[1], [1]]}", "/a", PB_ERR_SCHEMA},
    {C, "{" LTI ", 'a': [[1e7]], 'b': [[1]], 'c': [[1], [1]], 'method': 'zoh'}", "/a",
     PB_ERR_SCHEMA},
    {E, "{" ON("white") "}", "/rms", PB_ERR_SCHEMA},
    {E, "{" ON("white") ", 'rms': 0}", "/rms", PB_ERR_SCHEMA},
    {E, "{" ON("white") ", 'rms': 1, 'seed': 1.5}", "/seed", PB_ERR_SCHEMA},
    {E, "{" ON("white") ", 'rms': 1, 'seed': -1}", "/seed", PB_ERR_SCHEMA},
    {E, "{" ON("white") ", 'rms': 1, 'seconds': 1}", "/seconds", PB_ERR_SCHEMA},
    {E, "{" ON("white") ", 'rms': 1, 'outputs': ['y1']}", "/outputs", PB_ERR_SCHEMA},
    {E, "{" ON("noise") ", 'rms': 1}", "/f1", PB_ERR_SCHEMA},
    {E, "{" ON("noise") ", 'rms': 1, 'f1': 1}", "/f2", PB_ERR_SCHEMA},
    {E, "{" ON("noise") ", 'rms': 1, 'f1': -1, 'f2': 10}", "/f1", PB_ERR_SCHEMA},
    {E, "{" ON("noise") ", 'rms': 1, 'f1': 500, 'f2': 501}", "/f1", PB_ERR_SCHEMA},
    {E, "{" ON("noise") ", 'rms': 1, 'f1': 10, 'f2': 10}", "/f2", PB_ERR_SCHEMA},
    {E, "{" ON("noise") ", 'rms': 1, 'f1': 10, 'f2': 501}", "/f2", PB_ERR_SCHEMA},
    {E, "{" BAND("noise") "}", "/seconds", PB_ERR_SCHEMA},
    {E, "{" BAND("noise") ", 'seconds': 0}", "/seconds", PB_ERR_SCHEMA},
    {E, "{" BAND("noise") ", 'seconds': 1e-4}", "/seconds", PB_ERR_SCHEMA},
    {E, "{" BAND("noise") ", 'seconds': 2000.001}", "/seconds", PB_ERR_SCHEMA},
    {E, "{" BAND("noise") ", 'seconds': 0.002, 'repeat': true}", "/seconds", PB_ERR_SCHEMA},
    {E, "{" BAND("noise") ", 'seconds': 1, 'repeat': 1}", "/repeat", PB_ERR_SCHEMA},
    {E, "{" BAND("noise") ", 'seconds': 1, 'amplitude': 1}", "/amplitude", PB_ERR_SCHEMA},
    {E, "{" BAND("multisine") ", 'seconds': 0.005}", "/seconds", PB_ERR_SCHEMA},
    {E, "{" BAND("multisine") ", 'seconds': 1e300}", "/seconds", PB_ERR_SCHEMA},
    {E, "{" ON("chirp") ", 'f1': 1, 'f2': 10, 'seconds': 1}", "/amplitude", PB_ERR_SCHEMA},
    {E, "{" ON("chirp") ", 'amplitude': 1, 'f1': 0, 'f2': 10, 'seconds': 1}", "/f1", PB_ERR_SCHEMA},
    {E, "{" ON("chirp") ", 'amplitude': 1, 'f1': 501, 'f2': 10, 'seconds': 1}", "/f1",
     PB_ERR_SCHEMA},
    {E, "{" ON("chirp") ", 'amplitude': 1, 'f1': 10, 'f2': 10, 'seconds': 1}", "/f2",
     PB_ERR_SCHEMA},
    {E, "{" ON("chirp") ", 'amplitude': 1, 'f1': 10, 'f2': 501, 'seconds': 1}", "/f2",
     PB_ERR_SCHEMA},
    {E, "{" ON("chirp") ", 'amplitude': 1, 'f1': 1, 'f2': 10, 'seconds': 4000.001}", "/seconds",
     PB_ERR_SCHEMA},
    {E, "{" ON("chirp") ", 'amplitude': 1, 'f1': 1, 'f2': 10, 'seconds': 1, 'seed': 1}", "/seed",
     PB_ERR_SCHEMA},
    {E, "{" ON("sine") ", 'frequency': 1}", "/amplitude", PB_ERR_SCHEMA},
    {E, "{" ON("sine") ", 'amplitude': 1}", "/frequency", PB_ERR_SCHEMA},
    {E, "{" ON("sine") ", 'amplitude': 1, 'frequency': 0}", "/frequency", PB_ERR_SCHEMA},
    {E, "{" ON("sine") ", 'amplitude': 1, 'frequency': 500.1}", "/frequency", PB_ERR_SCHEMA},
    {E, "{" ON("sine") ", 'amplitude': 1, 'frequency': 5, 'phase': '0'}", "/phase", PB_ERR_SCHEMA},
    {E, "{" ON("step") "}", "/amplitude", PB_ERR_SCHEMA},
    {E, "{" ON("step") ", 'amplitude': 1, 'at': -1e-9}", "/at", PB_ERR_SCHEMA},
    {E, "{" ON("step") ", 'amplitude': 1, 'at': 1e16}", "/at", PB_ERR_SCHEMA},
    {E, "{" ON("table") "}", "/values", PB_ERR_SCHEMA},
    {E, "{" ON("table") ", 'values': []}", "/values", PB_ERR_SCHEMA},
    {E, "{" ON("table") ", 'values': [1, 2]}", "/values/0", PB_ERR_SCHEMA},
    {E, "{" ON("table") ", 'values': [[1, 2], [1]]}", "/values/1", PB_ERR_SCHEMA},
    {E, "{" ON("table") ", 'values': [[1, 2], [1, '']]}", "/values/1/1", PB_ERR_SCHEMA},
    {E, "{" ON("table") ", 'values': [[1, 2]], 'repeat': null}", "/repeat", PB_ERR_SCHEMA},
};

static void test_refusals(void **state) {
  (void)state;
  for (size_t i = 0; i < sizeof refused / sizeof *refused; i++) {
    const refusal *r = &refused[i];
    pb_host *host = NULL;
    pb_error err = {0};
    const pb_status status = rig_try(NULL, r->request, r->body, &host, &err);
    if (status != r->status || strcmp(err.where, r->where) != 0 || !err.message[0] || host)
      fail_msg("%s: %s at '%s' (%s), expected %s at '%s'", r->body, pb_status_name(status),
               err.where, err.message, pb_status_name(r->status), r->where);
  }
}

// Numbers that no JSON text can carry, and more states than a step has time for.
static void test_refusals_of_made_bodies(void **state) {
  (void)state;
  static const char *const key[] = {"amplitude", "frequency", "phase"};
  static const char *const where[] = {"/amplitude", "/frequency", "/phase"};
  for (int i = 0; i < 3; i++) {
    cJSON *body = rig_parse("{" ON("sine") ", 'amplitude': 1, 'frequency': 5, 'phase': 1}");
    cJSON_ReplaceItemInObject(body, key[i], cJSON_CreateNumber(i == 1 ? INFINITY : NAN));
    pb_host *host;
    pb_error err = {0};
    assert_int_equal(pb_host_add(NULL, body, E, rig_model(), NULL, &host, NULL, &err),
                     PB_ERR_SCHEMA);
    assert_string_equal(err.where, where[i]);
    cJSON_Delete(body);
  }
  cJSON *body = rig_parse("{" LTI ", 'a': [], 'd': [[1], [1]]}");
  for (int i = 0; i <= PB_HOST_STATES; i++)
    cJSON_AddItemToArray(cJSON_GetObjectItem(body, "a"), cJSON_CreateArray());
  pb_host *host;
  pb_error err = {0};
  assert_int_equal(pb_host_add(NULL, body, C, rig_model(), NULL, &host, NULL, &err), PB_ERR_SCHEMA);
  assert_string_equal(err.where, "/a");
  assert_non_null(strstr(err.message, "501 states"));
  cJSON_Delete(body);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_table),
      cmocka_unit_test(test_noise),
      cmocka_unit_test(test_multisine),
      cmocka_unit_test(test_chirp),
      cmocka_unit_test(test_white),
      cmocka_unit_test(test_step),
      cmocka_unit_test(test_sine_stays_exact),
      cmocka_unit_test(test_iff),
      cmocka_unit_test(test_iff_defaults),
      cmocka_unit_test(test_lti),
      cmocka_unit_test(test_lti_sign_and_time),
      cmocka_unit_test(test_refusals),
      cmocka_unit_test(test_refusals_of_made_bodies),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
