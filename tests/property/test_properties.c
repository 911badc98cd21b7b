// What holds for every plant, whatever its numbers: symmetry, rigid motions, passivity,
// reciprocity, composition of steps, snapshots, independence of the world's axes.
#include "support/beam.h"
#include "support/check.h"

#include "assembly/system.h"
#include "base/json.h"
#include "base/lapack.h"
#include "base/text.h"
#include "control/lti_ops.h"
#include "model/model.h"

static const char *const shipped[] = {"apa300ml-bench", "nano-hexapod", "nano-hexapod-1dof"};
#define SHIPPED (sizeof shipped / sizeof *shipped)

typedef struct built {
  pb_plant *plant;
  pb_system *system;
  pb_model *model;
} built;

static built build_text(const char *text) {
  built b = {0};
  REQUIRE(pb_plant_parse(text, strlen(text), NULL, NULL, &b.plant, &err));
  REQUIRE(pb_system_assemble(b.plant, NULL, &b.system, &err));
  REQUIRE(pb_model_compile(b.system, NULL, &b.model, &err));
  return b;
}

static char *shipped_text(size_t i) {
  char path[512], *text;
  size_t length;
  snprintf(path, sizeof path, PB_CONFIG "/plants/%s.json", shipped[i]);
  REQUIRE(pb_text_read(path, &text, &length, &err));
  return text;
}

static built build_shipped(size_t i) {
  char *text = shipped_text(i);
  built b = build_text(text);
  free(text);
  return b;
}

// The hexapod with electronics for its signals.
static built build_electronics(const char *electronics) {
  char patch[1024], *text = shipped_text(1), *with = NULL;
  snprintf(patch, sizeof patch, "{\"template\": {\"electronics\": %s}}", electronics);
  cJSON *file = cJSON_Parse(text), *change = cJSON_Parse(patch);
  assert_non_null(change);
  cJSON *merged = pb_json_merge(file, change);
  REQUIRE(pb_json_print(merged, &with, &err));
  built b = build_text(with);
  free(text), free(with);
  cJSON_Delete(file), cJSON_Delete(change), cJSON_Delete(merged);
  return b;
}

static void dispose(built *b) {
  pb_model_free(b->model);
  pb_system_free(b->system);
  pb_plant_free(b->plant);
}

static double smallest_eigenvalue(const double *a, size_t size, double *largest) {
  int n = (int)size, info, lwork = 1 + 6 * n + 2 * n * n, liwork = 3 + 5 * n;
  double *copy = malloc(size * size * sizeof *copy), *w = malloc(size * sizeof *w);
  double *work = malloc((size_t)lwork * sizeof *work), smallest;
  int *iwork = malloc((size_t)liwork * sizeof *iwork);
  memcpy(copy, a, size * size * sizeof *copy);
  dsyevd_("N", "U", &n, copy, &n, w, work, &lwork, iwork, &liwork, &info);
  assert_int_equal(info, 0);
  smallest = w[0];
  *largest = w[size - 1];
  free(copy), free(w), free(work), free(iwork);
  return smallest;
}

// M > 0, K ≥ 0, C ≥ 0, all symmetric to the last bit.
static void test_definite_matrices(void **state) {
  (void)state;
  for (size_t i = 0; i < SHIPPED; i++) {
    built b = build_shipped(i);
    const double *matrix[3] = {b.system->m, b.system->k, b.system->c};
    size_t n = b.system->n;
    for (int k = 0; k < 3; k++) {
      double largest, smallest = smallest_eigenvalue(matrix[k], n, &largest);
      for (size_t c = 0; c < n; c++)
        for (size_t r = 0; r < c; r++) assert_true(matrix[k][r + c * n] == matrix[k][c + r * n]);
      if (k == 0) assert_true(smallest > 0);
      if (smallest < -1e-12 * largest) fail_msg("%s: eigenvalue %g", shipped[i], smallest);
    }
    dispose(&b);
  }
}

// All poles on the left: these plants are damped and fixed.
static void test_stable(void **state) {
  (void)state;
  for (size_t i = 0; i < SHIPPED; i++) {
    built b = build_shipped(i);
    double complex *s = malloc(b.model->nx * sizeof *s), *z = malloc(b.model->nx * sizeof *z);
    REQUIRE(pb_model_poles(b.model, PB_CONTINUOUS, s, &err));
    REQUIRE(pb_model_poles(b.model, PB_SAMPLED, z, &err));
    for (size_t k = 0; k < b.model->nx; k++) {
      assert_true(creal(s[k]) < 0);
      ASSERT_NEAR(cabs(z[k]), exp(creal(s[k]) / b.model->sample_rate), 1e-12);
    }
    free(s), free(z);
    dispose(&b);
  }
}

// Forces and motions at the same point: the response matrix is symmetric (Maxwell, Betti), and its
// power is never negative (Im of the diagonal ≤ 0).
static void test_reciprocity_and_passivity(void **state) {
  (void)state;
  built b = build_shipped(1);
  const pb_model *m = b.model;
  int in = pb_model_input(m, "Fx"), out = pb_model_output(m, "Dx");
  double complex *h = malloc(m->nu * m->ny * sizeof *h);
  assert_true(in >= 0 && out >= 0);
  for (double hz = 1; hz < 3000; hz *= 1.7) {
    REQUIRE(pb_model_frf(m, PB_CONTINUOUS, &hz, 1, h, &err));
    for (int r = 0; r < 6; r++) {
      double scale = cabs(h[(size_t)(out + r) * m->nu + (size_t)(in + r)]);
      assert_true(cimag(h[(size_t)(out + r) * m->nu + (size_t)(in + r)]) <= 0);
      for (int c = 0; c < 6; c++) {
        double other = cabs(h[(size_t)(out + c) * m->nu + (size_t)(in + c)]);
        double complex a = h[(size_t)(out + r) * m->nu + (size_t)(in + c)];
        double complex t = h[(size_t)(out + c) * m->nu + (size_t)(in + r)];
        assert_true(cabs(a - t) <= 1e-10 * sqrt(scale * other));
      }
    }
  }
  free(h);
  dispose(&b);
}

// Two steps at dt are one at 2 dt with the same input.
static void test_steps_compose(void **state) {
  (void)state;
  for (size_t i = 0; i < SHIPPED; i++) {
    char *text = shipped_text(i);
    cJSON *fine = cJSON_Parse(text), *patch = cJSON_Parse("{\"sample_rate\": 5000}");
    cJSON *coarse = pb_json_merge(fine, patch);
    char *coarse_text = NULL;
    REQUIRE(pb_json_print(coarse, &coarse_text, &err));
    built a = build_text(text), b = build_text(coarse_text);
    pb_state *sa = pb_state_new(a.model), *sb = pb_state_new(b.model);
    double u[PB_MAX_INPUTS], ya[PB_MAX_OUTPUTS], yb[PB_MAX_OUTPUTS], peak[PB_MAX_OUTPUTS] = {0};
    double worst[PB_MAX_OUTPUTS] = {0};
    unsigned seed = 1;
    for (int k = 0; k < 400; k++) {
      for (size_t c = 0; c < a.model->nu; c++) {
        seed = seed * 1103515245u + 12345u;
        u[c] = (double)(seed >> 16 & 0x7fff) / 0x7fff - 0.5;
      }
      pb_step_advance(a.model, sa, u), pb_step_advance(a.model, sa, u);
      pb_step_advance(b.model, sb, u);
      pb_step_output(a.model, sa, ya), pb_step_output(b.model, sb, yb);
      for (size_t o = 0; o < a.model->ny; o++) {
        peak[o] = fmax(peak[o], fabs(ya[o]));
        worst[o] = fmax(worst[o], fabs(ya[o] - yb[o]));
      }
    }
    for (size_t o = 0; o < a.model->ny; o++) ASSERT_NEAR(worst[o], 0, 1e-10 * peak[o]);
    free(sa), free(sb), free(text), free(coarse_text);
    cJSON_Delete(fine), cJSON_Delete(patch), cJSON_Delete(coarse);
    dispose(&a), dispose(&b);
  }
}

// A snapshot is a copy of bytes; what follows it is the same to the last bit.
static void test_snapshots_continue_bit_for_bit(void **state) {
  (void)state;
  built b = build_shipped(1);
  size_t bytes = pb_state_bytes(b.model);
  pb_state *s = pb_state_new(b.model), *copy = malloc(bytes);
  double u[12] = {1, -2, 0.5}, y[2][18];
  for (int k = 0; k < 100; k++) pb_step_advance(b.model, s, u);
  memcpy(copy, s, bytes);
  for (int run = 0; run < 2; run++) {
    pb_state *t = run ? copy : s;
    for (int k = 0; k < 100; k++) {
      u[3] = sin(0.1 * k);
      pb_step_advance(b.model, t, u);
    }
    pb_step_output(b.model, t, y[run]);
  }
  assert_memory_equal(y[0], y[1], sizeof y[0]);
  assert_memory_equal(s, copy, bytes);
  free(s), free(copy);
  dispose(&b);
}

// The same through delay lines, generators, slew and saturation, at a point where all of them are
// at work; and two states that are given the same commands never differ.
static void test_snapshots_with_electronics(void **state) {
  (void)state;
  built b = build_electronics(
      "{\"actuators\": {\"gain\": 20, \"delay\": 7, \"noise\": 0.1, \"quantisation\": 0.01, "
      "\"saturation\": [-20, 150], \"slew\": 40000}, \"sensors\": {\"delay\": 3, \"noise\": "
      "0.01, \"quantisation\": 0.001}, \"metrology\": {\"delay\": 11, \"noise\": 1e-9}}");
  size_t bytes = pb_state_bytes(b.model);
  pb_state *s = pb_state_new(b.model), *copy = malloc(bytes), *twin = pb_state_new(b.model);
  double u[12] = {0}, y[18], other[18];
  uint64_t cut = 0;
  for (int k = 0; k < 101; k++) {
    for (int i = 0; i < 6; i++) u[i] = 4 * sin(0.3 * k + i);
    pb_step_advance(b.model, s, u);
    pb_step_advance(b.model, twin, u);
    cut |= s->saturated;
  }
  assert_int_equal(cut, 63);
  assert_memory_equal(s, twin, bytes);
  memcpy(copy, s, bytes);
  for (int k = 0; k < 100; k++) {
    for (int i = 0; i < 6; i++) u[i] = 4 * cos(0.2 * k + i);
    pb_step_advance(b.model, s, u);
  }
  for (int k = 0; k < 100; k++) {
    for (int i = 0; i < 6; i++) u[i] = 4 * cos(0.2 * k + i);
    pb_step_advance(b.model, copy, u);
  }
  pb_step_output(b.model, s, y), pb_step_output(b.model, copy, other);
  assert_memory_equal(y, other, sizeof y);
  assert_memory_equal(s, copy, bytes);
  free(s), free(copy), free(twin);
  dispose(&b);
}

// The response that is predicted with gains and delays is the transform of the stepped impulse
// response; the bench is damped well, so that it ends soon and its sum keeps its digits.
static void test_sampled_response_with_electronics(void **state) {
  (void)state;
  enum { STEPS = 20000, LINES = 4 };
  static const double hz[LINES] = {20, 93.2, 700, 3100};
  char *text = shipped_text(0), *damped = NULL;
  cJSON *file = cJSON_Parse(text);
  cJSON *patch = cJSON_Parse("{\"models\": {\"apa300ml\": {\"c_1\": 3000, \"c_a\": 900}}}");
  cJSON *merged = pb_json_merge(file, patch);
  REQUIRE(pb_json_print(merged, &damped, &err));
  built b = build_text(damped);
  pb_electronics in[2] = {pb_electronics_none(), pb_electronics_none()}, out[2] = {in[0], in[0]};
  in[0].gain = -20, in[0].delay = 4, out[0].delay = 3, out[1].delay = 1;
  REQUIRE(pb_electronics_attach(b.model, in, out, &err));
  double complex sum[LINES][2] = {{0}}, h[LINES * 4];
  pb_state *s = pb_state_new(b.model);
  REQUIRE(pb_model_frf(b.model, PB_SAMPLED, hz, LINES, h, &err));
  for (int k = 0; k < STEPS; k++) {
    double u[2] = {k == 0, 0}, y[2];
    pb_step_output(b.model, s, y);
    pb_step_advance(b.model, s, u);
    for (int f = 0; f < LINES; f++) {
      double complex turn = cexp(-I * 2 * M_PI * hz[f] * k / b.model->sample_rate);
      for (int o = 0; o < 2; o++) sum[f][o] += y[o] * turn;
    }
  }
  for (int f = 0; f < LINES; f++)
    for (int o = 0; o < 2; o++)
      ASSERT_NEAR(cabs(sum[f][o] - h[f * 4 + o * 2]), 0, 1e-10 * cabs(h[f * 4 + o * 2]));
  free(s), free(text), free(damped);
  cJSON_Delete(file), cJSON_Delete(patch), cJSON_Delete(merged);
  dispose(&b);
}

// As one dense system, delays as states, the plant steps the same.
static void test_dense_system_with_electronics(void **state) {
  (void)state;
  built b = build_electronics(
      "{\"actuators\": {\"gain\": 20, \"delay\": 2}, \"sensors\": {\"delay\": 1}, "
      "\"metrology\": {\"delay\": 3}}");
  pb_lti lti;
  REQUIRE(pb_lti_from_model(b.model, PB_SAMPLED, &lti, &err));
  double *x = calloc(lti.nx, sizeof *x), *scratch = calloc(lti.nx, sizeof *scratch);
  pb_state *s = pb_state_new(b.model);
  double u[12], y[18], z[18], peak[18] = {0};
  for (int k = 0; k < 500; k++) {
    for (int i = 0; i < 12; i++) u[i] = sin(0.01 * k * (i + 1));
    pb_step_output(b.model, s, y);
    pb_step_advance(b.model, s, u);
    pb_lti_step(&lti, x, scratch, u, z);
    for (int o = 0; o < 18; o++) {
      peak[o] = fmax(peak[o], fabs(y[o]));
      ASSERT_NEAR(z[o], y[o], 1e-12 * peak[o]);
    }
  }
  free(x), free(scratch), free(s);
  pb_lti_free(&lti);
  dispose(&b);
}

// A plant without electronics steps as the recurrence says, operation by operation.
static void test_plain_steps_are_the_recurrence(void **state) {
  (void)state;
  for (size_t i = 0; i < SHIPPED; i++) {
    built b = build_shipped(i);
    const pb_model *m = b.model;
    pb_state *s = pb_state_new(m);
    double *x = calloc(m->nx, sizeof *x), u[PB_MAX_INPUTS], y[PB_MAX_OUTPUTS], z[PB_MAX_OUTPUTS];
    assert_int_equal(m->pairs, m->blocks);
    assert_int_equal(pb_state_bytes(m), sizeof(pb_state) + (m->nx + m->nu) * sizeof(double));
    for (int k = 0; k < 300; k++) {
      for (size_t c = 0; c < m->nu; c++) u[c] = sin(0.1 * k + (double)c);
      pb_step_advance(m, s, u);
      for (size_t p = 0; p < m->pairs; p++) {
        const double *a = m->ad + 4 * p, x0 = x[2 * p], x1 = x[2 * p + 1];
        x[2 * p] = a[0] * x0 + a[2] * x1, x[2 * p + 1] = a[1] * x0 + a[3] * x1;
      }
      for (size_t c = 0; c < m->nu; c++)
        for (size_t r = 0; r < m->nx; r++) x[r] += m->bd[r + c * m->nx] * u[c];
      memset(z, 0, sizeof z);
      for (size_t r = 0; r < m->nx; r++)
        for (size_t o = 0; o < m->ny; o++) z[o] += m->c[o + r * m->ny] * x[r];
      for (size_t c = 0; c < m->nu; c++)
        for (size_t o = 0; o < m->ny; o++) z[o] += m->d[o + c * m->ny] * u[c];
      pb_step_output(m, s, y);
      assert_memory_equal(s->data, x, m->nx * sizeof *x);
      assert_memory_equal(y, z, m->ny * sizeof *y);
    }
    free(s), free(x);
    dispose(&b);
  }
}

// A free chain of two beams and a mass on a bushing: six rigid-body modes, whatever its pose, and
// the flexible modes do not depend on the pose.
static void test_six_rigid_modes_in_any_pose(void **state) {
  (void)state;
  static const beam steel = {
      .length = 0.1, .ea = 2e7, .ei = 50, .gj = 40, .mass = 0.08, .polar_inertia = 2e-6};
  static const char *const pose[2] = {"\"position\": [0, 0, 0.05]",
                                      "\"position\": [0.04, 0, 0.03], \"z_axis\": [0.8, 0, 0.6]"};
  static const char *const mass_axes[2] = {"", ", \"z_axis\": [0.8, 0, 0.6]"};
  double k[144], m[144], position[6], first[2] = {0};
  char file[64];
  snprintf(file, sizeof file, "/tmp/pb-property-%ld.mat", (long)getpid());
  beam_matrices(&steel, k, m, position);
  assert_int_equal(beam_write(file, 2, 12, k, m, position), 0);
  for (int i = 0; i < 2; i++) {
    char text[2048];
    snprintf(text, sizeof text,
             "{\"schema\": \"plantbus.plant/1\", \"name\": \"free\", \"components\": {\"beam\": "
             "{\"type\": \"super_element\", \"file\": \"%s\", %s}, \"mass\": {\"type\": "
             "\"rigid_body\", \"mass\": 1, \"inertia\": [0.001, 0.002, 0.003]%s}}, "
             "\"connections\": {\"j\": {\"from\": \"beam.1\", \"to\": \"mass\", \"joint\": "
             "{\"type\": \"bushing\", \"k_f\": 5, \"k_t\": 9, \"k_a\": 1e6, \"k_s\": 1e5}}}, "
             "\"inputs\": [{\"name\": \"F\", \"type\": \"force\", \"frame\": \"mass\", "
             "\"direction\": [1, 0, 0]}], \"outputs\": [{\"name\": \"x\", \"type\": "
             "\"displacement\", \"frame\": \"beam.2\", \"direction\": [1, 0, 0]}]}",
             file, pose[i], mass_axes[i]);
    built b = build_text(text);
    size_t rigid = 0;
    while (rigid < b.model->modes && b.model->mode_hz[rigid] == 0) rigid++;
    assert_int_equal(rigid, 6);
    for (size_t j = 6; j < b.model->modes; j++) {
      if (i == 0) continue;
      assert_true(b.model->mode_hz[j] > 1);
    }
    first[i] = b.model->mode_hz[6];
    dispose(&b);
  }
  unlink(file);
  ASSERT_RELATIVE(first[1], first[0], 1e-9);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_definite_matrices),
      cmocka_unit_test(test_stable),
      cmocka_unit_test(test_reciprocity_and_passivity),
      cmocka_unit_test(test_steps_compose),
      cmocka_unit_test(test_snapshots_continue_bit_for_bit),
      cmocka_unit_test(test_snapshots_with_electronics),
      cmocka_unit_test(test_sampled_response_with_electronics),
      cmocka_unit_test(test_dense_system_with_electronics),
      cmocka_unit_test(test_plain_steps_are_the_recurrence),
      cmocka_unit_test(test_six_rigid_modes_in_any_pose),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
