// The compiled model: block diagonalisation and its fall-back, discretisation, truncation, packing.
#include "support/check.h"

#include "model/block.h"
#include "model/model.h"
#include "plant/plant.h"
#include "assembly/system.h"

static pb_model *load(const char *name) {
  char path[512];
  pb_model *m = NULL;
  snprintf(path, sizeof path, PB_CONFIG "/plants/%s.json", name);
  REQUIRE(pb_model_load(path, NULL, &m, &err));
  return m;
}

static pb_status try_compile(const char *body, pb_model **model, pb_error *error) {
  char text[4096];
  pb_plant *p = NULL;
  pb_system *s = NULL;
  int n =
      snprintf(text, sizeof text, "{\"schema\": \"plantbus.plant/1\", \"name\": \"t\", %s}", body);
  REQUIRE(pb_plant_parse(text, (size_t)n, NULL, NULL, &p, &err));
  REQUIRE(pb_system_assemble(p, NULL, &s, &err));
  pb_status st = pb_model_compile(s, NULL, model, error);
  pb_system_free(s);
  pb_plant_free(p);
  return st;
}

static pb_model *compile(const char *body) {
  pb_model *m = NULL;
  REQUIRE(try_compile(body, &m, &err));
  return m;
}

// A mass on a vertical guide with a spring and a damper.
#define GUIDED(mass, k, c)                                                                      \
  "\"components\": {\"a\": {\"type\": \"rigid_body\", \"mass\": " mass ", \"inertia\": [1, 1, " \
  "1]}}, \"connections\": {\"j\": {\"from\": \"ground\", \"to\": \"a\", \"joint\": {\"type\": " \
  "\"prismatic\", \"k_a\": " k ", \"c_a\": " c "}}}, \"inputs\": [{\"name\": \"F\", \"type\": " \
  "\"force\", \"frame\": \"a\", \"direction\": [0, 0, 1]}], \"outputs\": [{\"name\": \"y\", "   \
  "\"type\": \"displacement\", \"frame\": \"a\", \"direction\": [0, 0, 1]}]"

// Largest |A V − V blocks| over the largest |A|.
static double residual(size_t n, const double *a, const double *blocks, const double *v) {
  double worst = 0, largest = 0;
  for (size_t j = 0; j < n; j++)
    for (size_t i = 0; i < n; i++) {
      double sum = 0;
      for (size_t k = 0; k < n; k++)
        sum += a[i + k * n] * v[k + j * n] - v[i + k * n] * blocks[k + j * n];
      worst = fmax(worst, fabs(sum));
      largest = fmax(largest, fabs(a[i + j * n]));
    }
  return worst / largest;
}

static void test_blocks_of_distinct_eigenvalues(void **state) {
  (void)state;
  const double a[16] = {0, -4, 0, 1, 1, -0.1, 0, 0, 0, 0.5, -3, 0, 0, 0, 2, -7};
  double d[16], v[16];
  size_t blocks, size[4];
  memcpy(d, a, sizeof a);
  REQUIRE(pb_block_diagonalize(4, d, v, &blocks, size, "t", &err));
  assert_int_equal(blocks, 3);
  assert_true(residual(4, a, d, v) < 1e-13);
}

// Two equal Jordan blocks and a distinct eigenvalue: no eigenvector basis, so a larger block, but
// the distinct one is still told apart.
static void test_blocks_of_a_defective_matrix(void **state) {
  (void)state;
  double a[25] = {0}, d[25], v[25], t[25];
  for (int i = 0; i < 4; i++) a[6 * i] = -2;
  a[5] = a[17] = 1;  // (0,1) and (2,3)
  a[24] = -9;
  for (int i = 0; i < 5; i++)  // a similarity, so that it is not triangular already
    for (int j = 0; j < 5; j++) t[i + 5 * j] = (i == j) + 0.1 * (i + 1) / (j + 2);
  double ta[25];
  for (int i = 0; i < 5; i++)
    for (int j = 0; j < 5; j++) {
      ta[i + 5 * j] = 0;
      for (int k = 0; k < 5; k++) ta[i + 5 * j] += t[i + 5 * k] * a[k + 5 * j];
    }
  // a' = T A T⁻¹ by solving for each row: done with Gaussian elimination on Tᵀ.
  double m[25], b[25], full[25];
  for (int i = 0; i < 5; i++)
    for (int j = 0; j < 5; j++) m[i + 5 * j] = t[j + 5 * i], b[i + 5 * j] = ta[j + 5 * i];
  for (int k = 0; k < 5; k++)
    for (int i = k + 1; i < 5; i++) {
      double f = m[i + 5 * k] / m[k + 5 * k];
      for (int j = 0; j < 5; j++)
        m[i + 5 * j] -= f * m[k + 5 * j], b[i + 5 * j] -= f * b[k + 5 * j];
    }
  for (int j = 0; j < 5; j++)
    for (int i = 4; i >= 0; i--) {
      double s = b[i + 5 * j];
      for (int k = i + 1; k < 5; k++) s -= m[i + 5 * k] * b[k + 5 * j];
      b[i + 5 * j] = s / m[i + 5 * i];
    }
  for (int i = 0; i < 5; i++)
    for (int j = 0; j < 5; j++) full[i + 5 * j] = b[j + 5 * i];
  size_t blocks, size[5], largest = 0, total = 0;
  memcpy(d, full, sizeof d);
  REQUIRE(pb_block_diagonalize(5, d, v, &blocks, size, "t", &err));
  for (size_t k = 0; k < blocks; k++) {
    total += size[k];
    if (size[k] > largest) largest = size[k];
  }
  assert_int_equal(total, 5);
  assert_true(blocks >= 2 && largest >= 2 && largest <= 4);
  assert_true(residual(5, full, d, v) < 1e-12);
}

// Entries that are not finite are refused before and after the eigenvalues.
static void test_blocks_of_overflow(void **state) {
  (void)state;
  static const double bad[] = {NAN, INFINITY, -INFINITY};
  for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
    double a[9] = {0, -4, 0, 1, bad[i], 0, 0, 0, -3}, v[9];
    size_t blocks, size[3];
    pb_error err = {0};
    assert_int_equal(pb_block_diagonalize(3, a, v, &blocks, size, "t", &err), PB_ERR_NUMERIC);
    assert_string_equal(err.where, "t");
  }
}

// e^{A h} and its integral against the closed forms, also for a defective block and fast modes.
static void test_discretisation(void **state) {
  (void)state;
  double ad[4], gd[4];
  const double jordan[4] = {0, 0, 1, 0};  // a rigid-body mode
  REQUIRE(pb_block_discretize(2, jordan, 0.25, ad, gd, &err));
  const double ad_j[4] = {1, 0, 0.25, 1}, gd_j[4] = {0.25, 0, 0.03125, 0.25};
  for (int i = 0; i < 4; i++) {
    ASSERT_NEAR(ad[i], ad_j[i], 1e-15);
    ASSERT_NEAR(gd[i], gd_j[i], 1e-15);
  }
  const double fast[4] = {-0.01 * 1.8e6, -1.8e6, 1.8e6, -0.01 * 1.8e6};
  REQUIRE(pb_block_discretize(2, fast, 1e-4, ad, gd, &err));
  double complex z = cexp((-0.01 * 1.8e6 + I * 1.8e6) * 1e-4);
  ASSERT_NEAR(ad[0], creal(z), 1e-13);
  ASSERT_NEAR(ad[2], cimag(z), 1e-13);
  const double critical[4] = {0, -100, 1, -20};  // (s + 10)²
  REQUIRE(pb_block_discretize(2, critical, 0.05, ad, gd, &err));
  ASSERT_NEAR(ad[0], exp(-0.5) * 1.5, 1e-14);
  ASSERT_NEAR(ad[2], exp(-0.5) * 0.05, 1e-15);
  const double one[1] = {-3};
  REQUIRE(pb_block_discretize(1, one, 0.5, ad, gd, &err));
  ASSERT_NEAR(ad[0], exp(-1.5), 1e-15);
  ASSERT_NEAR(gd[0], (1 - exp(-1.5)) / 3, 1e-15);
}

// A free body: a double integrator, x = F t² / 2m exactly, infinite static gain.
static void test_floating_body(void **state) {
  (void)state;
  pb_model *m = compile(
      "\"sample_rate\": 100, \"components\": {\"a\": {\"type\": \"rigid_body\", \"mass\": 4, "
      "\"inertia\": [1, 2, 3]}}, \"inputs\": [{\"name\": \"F\", \"type\": \"force\", \"frame\": "
      "\"a\", \"direction\": [0, 1, 0]}], \"outputs\": [{\"name\": \"x\", \"type\": "
      "\"displacement\", \"frame\": \"a\", \"direction\": [0, 1, 0]}, {\"name\": \"acc\", "
      "\"type\": "
      "\"acceleration\", \"frame\": \"a\", \"direction\": [0, 1, 0]}, {\"name\": \"v\", \"type\": "
      "\"velocity\", \"frame\": \"a\", \"direction\": [0, 1, 0]}]");
  double u = 8, y[3], gain[3];
  assert_int_equal(m->nx, 12);
  for (size_t j = 0; j < 6; j++) assert_true(m->mode_hz[j] == 0);
  REQUIRE(pb_model_dc(m, gain, &err));
  assert_true(isinf(gain[0]));
  pb_state *s = pb_state_new(m);
  for (int k = 0; k < 50; k++) pb_step_advance(m, s, &u);
  pb_step_output(m, s, y);
  ASSERT_RELATIVE(y[0], 0.5 * 2 * 0.25, 1e-13);
  ASSERT_RELATIVE(y[1], 2, 1e-13);
  ASSERT_RELATIVE(y[2], 1, 1e-13);
  free(s);
  pb_model_free(m);
}

// Critically damped and coupled: two equal masses on dampers that make all poles coincide in pairs.
static void test_critical_damping(void **state) {
  (void)state;
  pb_model *m = compile(
      "\"sample_rate\": 1000, \"components\": {\"a\": {\"type\": \"rigid_body\", \"mass\": 1, "
      "\"inertia\": [1, 1, 1]}}, \"connections\": {\"j\": {\"from\": \"ground\", \"to\": \"a\", "
      "\"joint\": {\"type\": \"prismatic\", \"k_a\": 100, \"c_a\": 20}}}, \"inputs\": [{\"name\": "
      "\"F\", \"type\": \"force\", \"frame\": \"a\", \"direction\": [0, 0, 1]}], \"outputs\": "
      "[{\"name\": \"x\", \"type\": \"displacement\", \"frame\": \"a\", \"direction\": [0, 0, "
      "1]}]");
  double u = 100, y;
  pb_state *s = pb_state_new(m);
  for (int k = 0; k < 100; k++) pb_step_advance(m, s, &u);
  pb_step_output(m, s, &y);
  ASSERT_RELATIVE(y, 1 - exp(-1) * 2, 1e-12);  // 1 − e^{−10t}(1 + 10t) at 0.1 s
  free(s);
  double complex poles[2];
  REQUIRE(pb_model_poles(m, PB_CONTINUOUS, poles, &err));
  for (int i = 0; i < 2; i++) ASSERT_NEAR(creal(poles[i]), -10, 1e-6);
  pb_model_free(m);
}

// Truncation keeps the static gains and the low modes, and the zero that they make.
static void test_truncation_keeps_static_gains(void **state) {
  (void)state;
  pb_model *m = load("nano-hexapod"), *t = NULL;
  REQUIRE(pb_model_truncate(m, 1000, &t, &err));
  assert_true(t->nx < m->nx && t->nx >= 12);
  assert_int_equal(t->dof, m->dof);
  size_t n = m->ny * m->nu;
  double *full = malloc(n * sizeof *full), *cut = malloc(n * sizeof *cut), largest = 0;
  REQUIRE(pb_model_dc(m, full, &err));
  REQUIRE(pb_model_dc(t, cut, &err));
  for (size_t i = 0; i < n; i++) largest = fmax(largest, fabs(full[i]));
  for (size_t i = 0; i < n; i++) ASSERT_NEAR(cut[i], full[i], 1e-11 * largest);
  free(full), free(cut);
  // Between the suspension modes the collocated responses agree to what (f/f_cut)² leaves.
  double hz = 39;
  double complex *a = malloc(n * sizeof *a), *b = malloc(n * sizeof *b);
  REQUIRE(pb_model_frf(m, PB_CONTINUOUS, &hz, 1, a, &err));
  REQUIRE(pb_model_frf(t, PB_CONTINUOUS, &hz, 1, b, &err));
  assert_true(cabs(a[0] - b[0]) < 1e-3 * cabs(a[0]));
  free(a), free(b);
  pb_model_free(t);
  pb_error err = {0};
  assert_int_equal(pb_model_truncate(m, -1, &t, &err), PB_ERR_ARGUMENT);
  assert_null(t);
  pb_model_free(m);
}

// An overdamped mode above max_frequency stays where one of its two poles is below: here 1.6 Hz.
static void test_truncation_keeps_slow_poles(void **state) {
  (void)state;
  pb_model *m = compile("\"max_frequency\": 100, " GUIDED("1", "1e6", "1e5")), *t = NULL;
  assert_int_equal(m->nx, 2);
  double complex h;
  double hz = 3;
  REQUIRE(pb_model_frf(m, PB_CONTINUOUS, &hz, 1, &h, &err));
  double complex s = 2 * M_PI * hz * I, exact = 1 / (s * s + 1e5 * s + 1e6);
  assert_true(cabs(h - exact) < 1e-12 * cabs(exact));
  REQUIRE(pb_model_truncate(m, 1, &t, &err));  // both are above
  assert_int_equal(t->nx, 0);
  pb_model_free(t);
  pb_model_free(m);
}

// An overdamped pair: the slow eigenvalue of 1e-9/s beside one of 1e9/s, 1 − e^{−t·1e-9} after 1e8
// s whatever the period, and the static gain kept.
static void test_overdamped_pair(void **state) {
  (void)state;
  static const struct {
    double hz;
    uint64_t steps;
  } at[] = {{1e-8, 1}, {1e-2, 1000000}};
  for (size_t k = 0; k < 2; k++) {
    char text[1024];
    snprintf(text, sizeof text, "\"sample_rate\": %g, %s", at[k].hz, GUIDED("1", "1", "1e9"));
    pb_model *m = compile(text);
    pb_state *s = pb_state_new(m);
    double u = 1, y;
    while (s->step < at[k].steps) pb_step_advance(m, s, &u);
    pb_step_output(m, s, &y);
    ASSERT_RELATIVE(y, -expm1(-0.1), k ? 1e-8 : 1e-14);
    free(s);
    pb_model_free(m);
  }
}

// The hold of two real eigenvalues against long double: signs, sizes and couplings of every kind.
static void test_hold_of_real_pairs(void **state) {
  (void)state;
  static const double a[][4] = {
      {0, -1, 1, -1e9},     {0, -4, 4, -9},       {-1e6, 0, 3, -1e-6},
      {-1e-6, 2, 0, -1e6},  {-3, 1, 2, -4},       {0, 0, 1, -7},
      {-5e-3, 1, 1, -1e12}, {0, -1e4, 1e4, -1e8}, {-2e5, 7e-4, 3e-2, -1e-2}};
  for (size_t k = 0; k < sizeof a / sizeof *a; k++) {
    const long double h = 1e-3L, mu = ((long double)a[k][0] + a[k][3]) / 2,
                      half = ((long double)a[k][0] - a[k][3]) / 2,
                      off = (long double)a[k][1] * a[k][2], nu = sqrtl(half * half + off);
    const long double fast = mu - nu, slow = ((long double)a[k][0] * a[k][3] - off) / fast;
    const long double g1 = expm1l(fast * h) / fast, g2 = slow != 0 ? expm1l(slow * h) / slow : h;
    double ad[4], gd[4];
    REQUIRE(pb_block_discretize(2, a[k], 1e-3, ad, gd, &err));
    for (int i = 1; i < 3; i++) {
      const long double e = (expm1l(fast * h) - expm1l(slow * h)) / (fast - slow) * a[k][i];
      ASSERT_NEAR(ad[i], (double)e, 1e-13 * fabs((double)e));
      ASSERT_NEAR(gd[i], (double)((g1 - g2) / (fast - slow) * a[k][i]), 1e-13 * fabs(gd[i]));
    }
    // Trace and determinant: sums and products of what the eigenvalues give.
    ASSERT_RELATIVE(ad[0] + ad[3], (double)(expl(fast * h) + expl(slow * h)), 1e-14);
    ASSERT_RELATIVE(gd[0] + gd[3], (double)(g1 + g2), 1e-14);
    // A G = A_d − I, where the rows of A are not far apart in size.
    const double row = a[k][0] * gd[0] + a[k][2] * gd[1];
    ASSERT_NEAR(row, ad[0] - 1, 1e-13);
  }
}

// Numbers that are each allowed but overflow together are refused, not computed with.
static void test_overflow_is_refused(void **state) {
  (void)state;
  pb_model *m = NULL;
  pb_error err = {0};
  assert_int_equal(try_compile(GUIDED("1e-300", "1e30", "0"), &m, &err), PB_ERR_NUMERIC);
  assert_string_equal(err.where, "/components");
  assert_null(m);
  assert_int_equal(try_compile(GUIDED("1e-300", "1", "1e30"), &m, &err), PB_ERR_NUMERIC);
  assert_null(m);
}

// The sampled response is what stepping gives: response to an impulse, transformed.
static void test_sampled_response_is_what_steps_do(void **state) {
  (void)state;
  pb_model *m = compile(
      "\"sample_rate\": 50, \"components\": {\"a\": {\"type\": \"rigid_body\", \"mass\": 1, "
      "\"inertia\": [1, 1, 1]}}, \"connections\": {\"j\": {\"from\": \"ground\", \"to\": \"a\", "
      "\"joint\": {\"type\": \"prismatic\", \"k_a\": 900, \"c_a\": 12}}}, \"inputs\": [{\"name\": "
      "\"F\", \"type\": \"force\", \"frame\": \"a\", \"direction\": [0, 0, 1]}], \"outputs\": "
      "[{\"name\": \"a\", \"type\": \"acceleration\", \"frame\": \"a\", \"direction\": [0, 0, "
      "1]}]");
  double hz = 7.3, u = 1, y;
  double complex h, sum = 0;
  REQUIRE(pb_model_frf(m, PB_SAMPLED, &hz, 1, &h, &err));
  pb_state *s = pb_state_new(m);
  for (int k = 0; k < 400; k++) {
    pb_step_output(m, s, &y);
    sum += y * cexp(-I * 2 * M_PI * hz * k / 50);
    pb_step_advance(m, s, &u);
    u = 0;
  }
  ASSERT_NEAR(creal(sum), creal(h), 1e-12);
  ASSERT_NEAR(cimag(sum), cimag(h), 1e-12);
  free(s);
  pb_model_free(m);
}

static void test_derivative(void **state) {
  (void)state;
  pb_model *m = load("apa300ml-bench");
  double complex h[4], dh[4], a[4], b[4], s = -3 + I * 400;
  pb_model_evaluate(m, PB_CONTINUOUS, s, h, dh);
  pb_model_evaluate(m, PB_CONTINUOUS, s + 1e-3, a, NULL);
  pb_model_evaluate(m, PB_CONTINUOUS, s - 1e-3, b, NULL);
  for (int i = 0; i < 4; i++) assert_true(cabs((a[i] - b[i]) / 2e-3 - dh[i]) < 1e-5 * cabs(dh[i]));
  pb_model_free(m);
}

static void test_pack(void **state) {
  (void)state;
  pb_model *m = load("nano-hexapod"), *copy = NULL;
  double *data;
  size_t count;
  const char *in[12], *iu[12], *out[18], *ou[18];
  for (int i = 0; i < 12; i++) in[i] = m->input[i].name, iu[i] = m->input[i].unit;
  for (int i = 0; i < 18; i++) out[i] = m->output[i].name, ou[i] = m->output[i].unit;
  REQUIRE(pb_model_pack(m, &data, &count, &err));
  REQUIRE(pb_model_unpack(data, count, "copy", in, iu, out, ou, &copy, &err));
  assert_int_equal(copy->nx, m->nx);
  assert_int_equal(copy->pairs, m->pairs);
  assert_memory_equal(copy->ad, m->ad, m->block_value[m->blocks] * sizeof(double));
  assert_memory_equal(copy->bd, m->bd, m->nx * m->nu * sizeof(double));
  assert_string_equal(copy->output[3].name, m->output[3].name);
  pb_model_free(copy);
  for (size_t i = 0; i < 11; i++) {  // a header that lies is refused
    double kept = data[i];
    pb_error err = {0};
    data[i] = i < 3 ? -1 : kept + 1;
    pb_status st = pb_model_unpack(data, count, "copy", in, iu, out, ou, &copy, &err);
    if (st != PB_ERR_SYNTAX) fail_msg("header %zu changed: %s", i, pb_status_name(st));
    data[i] = kept;
  }
  pb_error err = {0};
  assert_int_equal(pb_model_unpack(data, count - 1, "copy", in, iu, out, ou, &copy, &err),
                   PB_ERR_SYNTAX);
  free(data);
  pb_model_free(m);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_blocks_of_distinct_eigenvalues),
      cmocka_unit_test(test_blocks_of_a_defective_matrix),
      cmocka_unit_test(test_blocks_of_overflow),
      cmocka_unit_test(test_discretisation),
      cmocka_unit_test(test_floating_body),
      cmocka_unit_test(test_critical_damping),
      cmocka_unit_test(test_truncation_keeps_static_gains),
      cmocka_unit_test(test_truncation_keeps_slow_poles),
      cmocka_unit_test(test_overdamped_pair),
      cmocka_unit_test(test_hold_of_real_pairs),
      cmocka_unit_test(test_overflow_is_refused),
      cmocka_unit_test(test_sampled_response_is_what_steps_do),
      cmocka_unit_test(test_derivative),
      cmocka_unit_test(test_pack),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
