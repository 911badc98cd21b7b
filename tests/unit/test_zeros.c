// Transmission zeros of models whose zeros are known in closed form or by interlacing.
#include "model/zeros.h"

#include "assembly/system.h"
#include "model/sampled_roots.h"
#include "plant/plant.h"
#include "support/check.h"

// A model of second-order blocks in companion form, [0 1; −w² −2ζw]; only what the zeros need.
typedef struct sketch {
  pb_model model;
  size_t count;  // blocks filled
} sketch;

static sketch sketch_new(size_t modes, size_t nu, size_t ny) {
  sketch k = {.model = {.nx = 2 * modes, .nu = nu, .ny = ny, .blocks = modes}};
  pb_model *m = &k.model;
  m->block_start = calloc(modes + 1, sizeof *m->block_start);
  m->block_value = calloc(modes + 1, sizeof *m->block_value);
  m->a = calloc(4 * modes + 1, sizeof *m->a);
  m->b = calloc(2 * modes * nu + 1, sizeof *m->b);
  m->c = calloc(2 * modes * ny + 1, sizeof *m->c);
  m->d = calloc(nu * ny, sizeof *m->d);
  for (size_t i = 0; i <= modes; i++) {
    m->block_start[i] = 2 * i;
    m->block_value[i] = 4 * i;
  }
  return k;
}

static void sketch_free(sketch *k) {
  free(k->model.block_start);
  free(k->model.block_value);
  free(k->model.a);
  free(k->model.b);
  free(k->model.c);
  free(k->model.d);
}

// Adds b cᵀ (c0 + c1 s) / (s² + 2 zeta w s + w²); b [nu] and c [ny] NULL: ones.
static void add_mode(sketch *k, double w, double zeta, double c0, double c1, const double *b,
                     const double *c) {
  pb_model *m = &k->model;
  size_t j = k->count++;
  double *a = &m->a[4 * j];
  a[0] = 0;
  a[1] = -w * w;
  a[2] = 1;
  a[3] = -2 * zeta * w;
  for (size_t i = 0; i < m->nu; i++) m->b[i * m->nx + 2 * j + 1] = b ? b[i] : 1;
  for (size_t o = 0; o < m->ny; o++) {
    m->c[2 * j * m->ny + o] = c0 * (c ? c[o] : 1);
    m->c[(2 * j + 1) * m->ny + o] = c1 * (c ? c[o] : 1);
  }
}

typedef struct result {
  double complex *zero;
  size_t count;
} result;

static result find_zeros(const pb_model *model, size_t channels, double band) {
  static const size_t order[4] = {0, 1, 2, 3};
  result r;
  pb_error err = {0};
  pb_status status = pb_model_zeros(model, order, order, channels, band, &r.zero, &r.count, &err);
  if (status) fail_msg("%s: %s", err.where, err.message);
  return r;
}

static void check_zero(double complex found, double complex expected, double tolerance) {
  double error = cabs(found - expected);
  if (error <= tolerance * cabs(expected)) return;
  fail_msg("zero %.15g %+.15gi, expected %.15g %+.15gi", creal(found), cimag(found),
           creal(expected), cimag(expected));
}

static double complex root(double w, double zeta) {
  return w * (-zeta + I * sqrt(1 - zeta * zeta));
}

// (s² + 2 zz z s + z²) / (s² + 2 zp p s + p²) as 1 + (c0 + c1 s) / (…).
static void add_biquad(sketch *k, double z, double zz, double p, double zp, const double *b,
                       const double *c) {
  add_mode(k, p, zp, z * z - p * p, 2 * (zz * z - zp * p), b, c);
}

static void test_biquad(void **state) {
  (void)state;
  sketch k = sketch_new(1, 1, 1);
  add_biquad(&k, 245.0, 0.004, 588.7, 0.01, NULL, NULL);
  k.model.d[0] = 1;
  // A gain of 1e-9 (metres per volt) changes nothing.
  for (size_t i = 0; i < 2; i++) k.model.c[i] *= 1e-9;
  k.model.d[0] *= 1e-9;
  result r = find_zeros(&k.model, 1, 0);
  assert_int_equal(r.count, 2);
  check_zero(r.zero[0], root(245, 0.004), 1e-12);
  check_zero(r.zero[1], conj(root(245, 0.004)), 1e-12);
  free(r.zero);
  r = find_zeros(&k.model, 1, 30);  // below 39 Hz
  assert_int_equal(r.count, 0);
  free(r.zero);
  sketch_free(&k);
}

// 1 / ((s² + p²)(s² + q²)) has no finite zero; the pencil's four infinite eigenvalues are easily
// mistaken for large ones.
static void test_no_zeros(void **state) {
  (void)state;
  sketch k = sketch_new(2, 1, 1);
  double p = 300, q = 2000;
  add_mode(&k, p, 0, 1, 0, NULL, NULL);
  add_mode(&k, q, 0, -1, 0, NULL, NULL);
  result r = find_zeros(&k.model, 1, 0);
  assert_int_equal(r.count, 0);
  free(r.zero);
  sketch_free(&k);
}

// A real zero far from the poles: (1 + s/1e5) / (s² + …).
static void test_far_zero(void **state) {
  (void)state;
  sketch k = sketch_new(1, 1, 1);
  add_mode(&k, 500, 0.01, 1, -1e-5, NULL, NULL);
  result r = find_zeros(&k.model, 1, 0);
  assert_int_equal(r.count, 1);
  check_zero(r.zero[0], 1e5, 1e-12);
  free(r.zero);
  sketch_free(&k);
}

// Zeros at the origin: one for a velocity, two for an acceleration.
static void test_origin(void **state) {
  (void)state;
  sketch k = sketch_new(2, 1, 1);
  add_mode(&k, 500, 0.01, 0, 1, NULL, NULL);
  add_mode(&k, 90000, 0.01, 0, 1, NULL, NULL);
  result r = find_zeros(&k.model, 1, 0);
  assert_int_equal(r.count, 3);  // and the one pair between the two modes
  assert_true(r.zero[0] == 0);
  assert_true(cabs(r.zero[1]) > 500 && cabs(r.zero[2]) < 90000);
  free(r.zero);
  sketch_free(&k);
  k = sketch_new(2, 1, 1);  // s² / (s² + 2ζws + w²) = 1 − (w² + 2ζws) / (…)
  add_mode(&k, 500, 0.01, -500 * 500, -2 * 0.01 * 500, NULL, NULL);
  add_mode(&k, 90000, 0.01, -9e4 * 9e4, -2 * 0.01 * 9e4, NULL, NULL);
  k.model.d[0] = 2;
  r = find_zeros(&k.model, 1, 0);
  assert_int_equal(r.count, 4);
  assert_true(r.zero[0] == 0 && r.zero[1] == 0);
  free(r.zero);
  sketch_free(&k);
}

// A mode that input or output does not see is no zero; nor does it disturb the others.
static void test_unseen(void **state) {
  (void)state;
  sketch k = sketch_new(3, 1, 1);
  const double none[1] = {0}, hardly[1] = {1e-14};
  add_mode(&k, 400, 0.01, 1, 0, none, NULL);
  add_biquad(&k, 245, 0.004, 588.7, 0.01, NULL, NULL);
  add_mode(&k, 800, 0.01, 1, 0, NULL, hardly);
  k.model.d[0] = 1;
  result r = find_zeros(&k.model, 1, 0);
  assert_int_equal(r.count, 2);
  check_zero(r.zero[0], root(245, 0.004), 1e-12);
  free(r.zero);
  sketch_free(&k);
}

// Two modes of one frequency but for rounding: to a single channel they are one, of which the sum
// of both makes the zero.
static void test_double_mode(void **state) {
  (void)state;
  for (int split = 0; split < 3; split++) {
    sketch k = sketch_new(2, 1, 1);
    const double p = 588.7, z = 245, q = p * (1 + 3e-16 * pow(30, split));
    add_mode(&k, p, 0.01, 0.3 * (z * z - p * p), 0, NULL, NULL);
    add_mode(&k, q, 0.01, 0.7 * (z * z - p * p), 0, NULL, NULL);
    k.model.d[0] = 1;
    result r = find_zeros(&k.model, 1, 0);
    assert_int_equal(r.count, 2);
    check_zero(r.zero[0], root(z, 0.01 * p / z), 1e-9);
    free(r.zero);
    sketch_free(&k);
  }
}

// Collocated force and displacement: between two neighbouring poles lies exactly one zero. Modes
// from 40 Hz to 300 kHz with positive weights of several magnitudes; all found, each in its gap.
static sketch collocated(size_t modes) {
  sketch k = sketch_new(modes, 1, 1);
  double w = 2 * M_PI * 40, growth = pow(7500, 1.0 / (double)(modes - 1));
  for (size_t j = 0; j < modes; j++, w *= growth) {
    add_mode(&k, w, 0.01, exp(3 * sin(37.0 * (double)j)), 0, NULL, NULL);
  }
  return k;
}

static void check_interlacing(size_t modes, double band) {
  sketch k = collocated(modes);
  result r = find_zeros(&k.model, 1, band);
  size_t gaps = modes - 1;
  if (band > 0) {
    gaps = 0;
    while (sqrt(-k.model.a[4 * (gaps + 1) + 1]) < 2 * M_PI * band) gaps++;
  }
  if (r.count / 2 < gaps || r.count / 2 > gaps + 1 || (band == 0 && r.count != 2 * gaps)) {
    fail_msg("%zu zeros in %zu gaps", r.count, gaps);
  }
  for (size_t j = 0; j < gaps; j++) {
    double low = sqrt(-k.model.a[4 * j + 1]), high = sqrt(-k.model.a[4 * j + 5]);
    double size = cabs(r.zero[2 * j]);
    if (!(low < size && size < high)) fail_msg("%g is not between %g and %g", size, low, high);
    assert_true(creal(r.zero[2 * j]) < 0);
    assert_true(r.zero[2 * j + 1] == conj(r.zero[2 * j]));
  }
  free(r.zero);
  sketch_free(&k);
}

static void test_interlacing(void **state) {
  (void)state;
  check_interlacing(2, 0);
  check_interlacing(151, 0);
}

// 1300 states: by way of a truncated model. The zeros in the band are exact nevertheless.
static void test_large(void **state) {
  (void)state;
  check_interlacing(650, 1000);
  sketch k = collocated(650);
  result r = find_zeros(&k.model, 1, 1000);
  for (size_t j = 0; j < r.count; j += 2) {
    double complex h = 0, size = 0;
    for (size_t i = 0; i < 650; i++) {
      const double *a = &k.model.a[4 * i], s2 = k.model.c[2 * i];
      double complex s = r.zero[j], term = s2 / (s * s - a[3] * s - a[1]);
      h += term;
      size += cabs(term);
    }
    if (cabs(h) > 1e-11 * cabs(size)) fail_msg("zero %zu: H = %g of %g", j, cabs(h), cabs(size));
  }
  free(r.zero);
  sketch_free(&k);
}

// L diag(h1, h2) R with constant L, R: the zeros of h1 and of h2 together, none of them visible in
// a single entry.
static void check_two_by_two(double z1, double z2) {
  sketch k = sketch_new(2, 2, 2);
  const double l[2][2] = {{1e-6, 2e-6}, {-3, 1}}, r1[2] = {1, 0.5}, r2[2] = {-40, 70};
  const double c1[2] = {l[0][0], l[1][0]}, c2[2] = {l[0][1], l[1][1]};
  add_biquad(&k, z1, 0.004, 588.7, 0.01, r1, c1);
  add_biquad(&k, z2, 0.004, 700, 0.02, r2, c2);
  for (size_t i = 0; i < 2; i++) {
    for (size_t o = 0; o < 2; o++) k.model.d[i * 2 + o] = c1[o] * r1[i] + c2[o] * r2[i];
  }
  result found = find_zeros(&k.model, 2, 0);
  assert_int_equal(found.count, 4);
  check_zero(found.zero[0], root(z1, 0.004), 1e-9);
  check_zero(found.zero[2], root(z2, 0.004), 1e-9);
  free(found.zero);
  sketch_free(&k);
}

static void test_square(void **state) {
  (void)state;
  check_two_by_two(245, 400);
  check_two_by_two(245, 245);  // a double zero, as symmetric plants have them
}

static void test_refusals(void **state) {
  (void)state;
  sketch k = sketch_new(1, 2, 2);
  const double b[2] = {1, 2}, c[2] = {1, 0};
  const size_t first[2] = {0, 1}, beyond[1] = {2}, blind[1] = {1};
  add_mode(&k, 500, 0.01, 1, 0, b, NULL);
  double complex *zeros = &(double complex){0};
  size_t count = 7;
  pb_error err = {0};
  pb_status status = pb_model_zeros(&k.model, first, beyond, 1, 0, &zeros, &count, &err);
  assert_int_equal(status, PB_ERR_ARGUMENT);
  assert_null(zeros);
  assert_int_equal(count, 0);
  assert_int_equal(pb_model_zeros(&k.model, first, first, 0, 0, &zeros, &count, &err),
                   PB_ERR_ARGUMENT);
  assert_int_equal(pb_model_zeros(&k.model, first, first, 1, -1, &zeros, &count, &err),
                   PB_ERR_ARGUMENT);
  // One mode between two inputs and two outputs: rank one everywhere.
  assert_int_equal(pb_model_zeros(&k.model, first, first, 2, 0, &zeros, &count, &err),
                   PB_ERR_SINGULAR);
  k.count = 0;
  add_mode(&k, 500, 0.01, 1, 0, b, c);
  assert_int_equal(pb_model_zeros(&k.model, first, blind, 1, 0, &zeros, &count, &err),
                   PB_ERR_SINGULAR);
  sketch_free(&k);
  k = collocated(650);
  assert_int_equal(pb_model_zeros(&k.model, first, first, 1, 0, &zeros, &count, &err),
                   PB_ERR_ARGUMENT);
  assert_non_null(strstr(err.message, "give a highest frequency"));
  sketch_free(&k);
}

// ---- zeros of higher order ----------------------------------------------------------------------

// Masses on vertical guides: a chain from the ground through masses of 1 kg with 1e4 N/m and
// 10 Ns/m, and on each of them an absorber of 0.1 kg with 400 N/m and 0.2 Ns/m, or none.
static pb_model *chain(size_t masses, bool absorbers) {
  char text[8192], *at = text;
  const char *sep = "";
  at += sprintf(at, "{\"schema\": \"plantbus.plant/1\", \"name\": \"chain\", \"sample_rate\": "
                    "10000, \"components\": {");
  for (size_t k = 0; k < masses * (absorbers ? 2 : 1); k++, sep = ",")
    at += sprintf(at, "%s \"m%zu\": {\"type\": \"rigid_body\", \"mass\": %s, \"inertia\": [1,1,1]}",
                  sep, k, k < masses ? "1" : "0.1");
  at += sprintf(at, "}, \"connections\": {");
  sep = "";
  for (size_t k = 0; k < masses * (absorbers ? 2 : 1); k++, sep = ",") {
    char from[16] = "ground";
    if (k >= masses)
      sprintf(from, "m%zu", k - masses);
    else if (k > 0)
      sprintf(from, "m%zu", k - 1);
    at += sprintf(at,
                  "%s \"j%zu\": {\"from\": \"%s\", \"to\": \"m%zu\", \"joint\": {\"type\": "
                  "\"prismatic\", \"k_a\": %s}}",
                  sep, k, from, k, k < masses ? "1e4, \"c_a\": 10" : "400, \"c_a\": 0.2");
  }
  sprintf(at,
          "}, \"inputs\": [{\"name\": \"F\", \"type\": \"force\", \"frame\": \"m0\", "
          "\"direction\": [0,0,1]}], \"outputs\": [{\"name\": \"y\", \"type\": \"displacement\", "
          "\"frame\": \"m%zu\", \"direction\": [0,0,1]}]}",
          masses - 1);
  pb_plant *plant = NULL;
  pb_system *system = NULL;
  pb_model *model = NULL;
  REQUIRE(pb_plant_parse(text, strlen(text), NULL, NULL, &plant, &err));
  REQUIRE(pb_system_assemble(plant, NULL, &system, &err));
  REQUIRE(pb_model_compile(system, NULL, &model, &err));
  pb_system_free(system);
  pb_plant_free(plant);
  return model;
}

// From the first mass to the last but through every spring between: (c s + k) for each of them, and
// for each absorber m s² + c s + k, all at the same places.
static void check_chain(size_t masses, bool absorbers) {
  const size_t order[1] = {0};
  const double complex absorber = -1 + I * sqrt(3999);
  pb_model *model = chain(masses, absorbers);
  pb_sampled_root *root;
  size_t count, at = 0;
  result r = find_zeros(model, 1, 0);
  assert_int_equal(r.count, masses - 1 + (absorbers ? 2 * masses : 0));
  for (size_t k = 0; absorbers && k < masses; k++, at += 2) {
    check_zero(r.zero[at], absorber, 1e-12);
    check_zero(r.zero[at + 1], conj(absorber), 1e-12);
  }
  for (; at < r.count; at++) {
    check_zero(r.zero[at], -1000, 1e-9);
    assert_true(cimag(r.zero[at]) == 0);
  }
  free(r.zero);
  REQUIRE(pb_model_sampled_zeros(model, order, order, 1, 0, &root, &count, &err));
  assert_int_equal(count, masses - 1 + (absorbers ? masses : 0));
  for (size_t k = 0; k < count; k++) {
    assert_int_equal(root[k].multiplicity, absorbers && k < masses ? masses : masses - 1);
    assert_true(root[k].has_sampled && !root[k].sign_differs);
  }
  free(root);
  pb_model_free(model);
}

static void test_multiple(void **state) {
  (void)state;
  check_chain(2, false);
  check_chain(3, false);
  check_chain(2, true);
  check_chain(3, true);
}

// ---- the sampled plant --------------------------------------------------------------------------

// The response vanishes at each sampled zero, and no two of them are the same.
static void check_sampled(const pb_model *model, size_t input, size_t output,
                          const pb_sampled_root *root, size_t count) {
  const size_t entries = model->nu * model->ny, at = output * model->nu + input;
  double complex *h = malloc(2 * entries * sizeof *h), *dh = h + entries;
  for (size_t k = 0; k < count; k++) {
    if (!root[k].has_sampled) continue;
    pb_model_evaluate(model, PB_SAMPLED, root[k].z, h, dh);
    // Newton's step from there, by another sum that rounds by 1e-8 of |z − 1| at most.
    assert_true(cabs(h[at] / dh[at]) < 1e-7 * cabs(root[k].z - 1));
    for (size_t i = 0; i < k; i++) assert_true(root[i].z != root[k].z);
  }
  free(h);
}

// The hexapod of elements: the strut's force sensor has its zeros on the left, and sampling at
// 10 kHz moves the three slowest to the right (figures of an independent recomputation).
static void test_sampled_signs(void **state) {
  (void)state;
  static const double hz[] = {23.45, 68.10, 104.05}, damping[] = {0.00107, 0.00238, 0.00358},
                      sampled[] = {-0.0092, -0.00125, -0.00040};
  pb_model *model = NULL;
  pb_sampled_root *root;
  size_t count;
  REQUIRE(pb_model_load(PB_CONFIG "/plants/nano-hexapod-elements.json", NULL, &model, &err));
  const size_t input = (size_t)pb_model_input(model, "Va1"),
               output = (size_t)pb_model_output(model, "Vs1");
  REQUIRE(pb_model_sampled_zeros(model, &input, &output, 1, 1000, &root, &count, &err));
  assert_true(count > 5);
  for (size_t k = 0; k < 3; k++) {
    ASSERT_NEAR(root[k].hz, hz[k], 0.006);
    ASSERT_NEAR(root[k].damping, damping[k], 6e-6);
    ASSERT_NEAR(root[k].sampled_damping, sampled[k], 5e-5);
    assert_true(root[k].has_sampled && root[k].sign_differs);
  }
  for (size_t k = 3; k < count; k++) {
    assert_true(root[k].has_sampled == (root[k].hz < 5000));
    assert_false(root[k].sign_differs);
  }
  check_sampled(model, input, output, root, count);
  free(root);
  pb_model_free(model);
}

// Poles have z = e^{sT} and no other damping; above Nyquist only an alias.
static void test_sampled_poles(void **state) {
  (void)state;
  sketch k = sketch_new(2, 1, 1);
  k.model.sample_rate = 1000;
  add_mode(&k, 2 * M_PI * 100, 0.01, 1, 0, NULL, NULL);
  add_mode(&k, 2 * M_PI * 900, 0.02, 1, 0, NULL, NULL);
  pb_sampled_root *root;
  size_t count;
  REQUIRE(pb_model_sampled_poles(&k.model, 0, &root, &count, &err));
  assert_int_equal(count, 2);
  ASSERT_RELATIVE(root[0].sampled_hz, 100, 1e-12);
  ASSERT_RELATIVE(root[0].sampled_damping, 0.01, 1e-12);
  assert_true(root[0].has_sampled && !root[0].sign_differs);
  ASSERT_RELATIVE(root[1].hz, 900, 1e-12);
  assert_true(!root[1].has_sampled && root[1].sampled_hz < 500);
  free(root);
  sketch_free(&k);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_biquad),        cmocka_unit_test(test_no_zeros),
      cmocka_unit_test(test_far_zero),      cmocka_unit_test(test_origin),
      cmocka_unit_test(test_unseen),        cmocka_unit_test(test_double_mode),
      cmocka_unit_test(test_interlacing),   cmocka_unit_test(test_large),
      cmocka_unit_test(test_square),        cmocka_unit_test(test_multiple),
      cmocka_unit_test(test_sampled_signs), cmocka_unit_test(test_sampled_poles),
      cmocka_unit_test(test_refusals),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
