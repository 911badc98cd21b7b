// Super-elements: reading MAT files, the health check, modal damping.
#include "support/beam.h"
#include "support/check.h"

#include <sys/stat.h>

#include "plant/element.h"

static const beam steel = {
    .length = 0.1, .ea = 2e7, .ei = 50, .gj = 40, .mass = 0.08, .polar_inertia = 2e-6};
static char path[64];

static int setup(void **state) {
  (void)state;
  snprintf(path, sizeof path, "/tmp/pb-element-%ld.mat", (long)getpid());
  return 0;
}

static int teardown(void **state) {
  (void)state;
  unlink(path);
  return 0;
}

static void test_round_trip(void **state) {
  (void)state;
  double k[144], m[144], position[6];
  pb_element *e;
  beam_matrices(&steel, k, m, position);
  assert_int_equal(beam_write(path, 2, 12, k, m, position), 0);
  pb_warnings w = {0};
  REQUIRE(pb_element_load(path, &w, &e, &err));
  assert_int_equal(w.count, 0);
  assert_int_equal(e->frames, 2);
  assert_int_equal(e->size, 12);
  assert_memory_equal(e->k, k, sizeof k);
  assert_memory_equal(e->m, m, sizeof m);
  assert_memory_equal(e->position, position, sizeof position);
  ASSERT_RELATIVE(e->health.mass, steel.mass, 1e-12);
  for (int i = 0; i < 3; i++) ASSERT_NEAR(e->health.center[i], 0, 1e-12);
  assert_true(fabs(e->health.rigid_hz) < 1);
  assert_true(e->health.flexible_hz > 100);
  pb_element_free(e);
}

// An off-centre part: the beam's frames moved along z by 30 mm.
static void test_center_of_mass(void **state) {
  (void)state;
  double k[144], m[144], position[6];
  pb_element *e;
  beam_matrices(&steel, k, m, position);
  position[0] += 0.01, position[3] += 0.01, position[2] += 0.03, position[5] += 0.03;
  REQUIRE(pb_element_new("beam", 2, 12, position, k, m, NULL, &e, &err));
  ASSERT_NEAR(e->health.center[0], 0.01, 1e-12);
  ASSERT_NEAR(e->health.center[1], 0, 1e-12);
  ASSERT_NEAR(e->health.center[2], 0.03, 1e-12);
  pb_element_free(e);
}

static void refuse(const char *name, size_t frames, size_t size, const double *position, double *k,
                   double *m, pb_status code, const char *part) {
  pb_element *e = NULL;
  pb_error err = {0};
  pb_status st = pb_element_new(name, frames, size, position, k, m, NULL, &e, &err);
  if (st != code || !strstr(err.message, part))
    fail_msg("gave %s: %s; expected …%s…", pb_status_name(st), err.message, part);
  assert_string_equal(err.where, name);
  assert_null(e);
}

static void test_unhealthy_matrices(void **state) {
  (void)state;
  double k[144], m[144], position[6];
  beam_matrices(&steel, k, m, position);
  k[5] = NAN;
  refuse("part", 2, 12, position, k, m, PB_ERR_ELEMENT, "not finite");
  beam_matrices(&steel, k, m, position);
  m[0] = -m[0];
  refuse("part", 2, 12, position, k, m, PB_ERR_ELEMENT, "positive definite");
  beam_matrices(&steel, k, m, position);
  k[4 * 12] *= 1.5;
  refuse("part", 2, 12, position, k, m, PB_ERR_ELEMENT, "not symmetric");
  refuse("part", 3, 12, position, k, m, PB_ERR_SYNTAX, "do not fit");
}

// Swapped frames and grounded parts do not pass unnoticed, nor do small asymmetries.
static void test_warnings(void **state) {
  (void)state;
  double k[144], m[144], position[6];
  pb_warnings w = {0};
  pb_element *e;
  beam_matrices(&steel, k, m, position);
  for (int i = 0; i < 12; i++) k[13 * i] *= 1.02;
  REQUIRE(pb_element_new("grounded", 2, 12, position, k, m, &w, &e, &err));
  assert_int_equal(w.count, 1);
  assert_non_null(strstr(w.item[0].message, "rigid-body"));
  pb_element_free(e);
  pb_warnings_clear(&w);
  beam_matrices(&steel, k, m, position);
  k[4 * 12] *= 1 + 1e-6;
  REQUIRE(pb_element_new("asymmetric", 2, 12, position, k, m, &w, &e, &err));
  assert_true(w.count >= 1);
  assert_non_null(strstr(w.item[0].message, "symmetric"));
  assert_true(e->k[4 * 12] == e->k[4]);
  pb_element_free(e);
  pb_warnings_clear(&w);
}

static void test_broken_files(void **state) {
  (void)state;
  double k[144], m[144], position[6];
  pb_element *e = NULL;
  pb_error err = {0};
  assert_int_equal(pb_element_load("/nonexistent.mat", NULL, &e, &err), PB_ERR_IO);
  unlink(path);
  assert_int_equal(mkfifo(path, 0600), 0);  // refused without waiting for a writer
  assert_int_equal(pb_element_load(path, NULL, &e, &err), PB_ERR_IO);
  assert_non_null(strstr(err.message, "regular"));
  unlink(path);
  beam_matrices(&steel, k, m, position);
  assert_int_equal(beam_write(path, 2, 12, k, m, position), 0);
  FILE *file = fopen(path, "r+b");
  assert_non_null(file);
  fseek(file, 0, SEEK_END);
  long size = ftell(file);
  for (long cut = size - 8; cut > 0; cut -= size / 23) {  // truncated anywhere: refused, no crash
    assert_int_equal(ftruncate(fileno(file), cut), 0);
    memset(&err, 0, sizeof err);
    pb_status st = pb_element_load(path, NULL, &e, &err);
    if (st != PB_ERR_SYNTAX && st != PB_ERR_IO && st != PB_ERR_ELEMENT)
      fail_msg("cut at %ld of %ld gave %s", cut, size, pb_status_name(st));
    assert_string_equal(err.where, path);
    assert_null(e);
  }
  fclose(file);
}

// In modal coordinates C = MΦ diag(2ξω) ΦᵀM is ΦᵀCΦ = diag(2ξω).
static void test_modal_damping(void **state) {
  (void)state;
  double k[144], m[144], position[6], c[144] = {0};
  pb_element *e;
  beam_matrices(&steel, k, m, position);
  REQUIRE(pb_element_new("beam", 2, 12, position, k, m, NULL, &e, &err));
  REQUIRE(pb_element_damping(e, 0.02, c, &err));
  for (int a = 0; a < 12; a++) {
    for (int b = 0; b < 12; b++) {
      double value = 0, expected = a == b ? 0.04 * sqrt(fmax(e->omega2[a], 0)) : 0;
      for (int i = 0; i < 12; i++)
        for (int j = 0; j < 12; j++)
          value += e->shape[i + 12 * a] * c[i + 12 * j] * e->shape[j + 12 * b];
      ASSERT_NEAR(value, expected, 1e-9 * 0.04 * sqrt(e->omega2[11]));
    }
  }
  pb_element_free(e);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_round_trip),         cmocka_unit_test(test_center_of_mass),
      cmocka_unit_test(test_unhealthy_matrices), cmocka_unit_test(test_warnings),
      cmocka_unit_test(test_broken_files),       cmocka_unit_test(test_modal_damping),
  };
  return cmocka_run_group_tests(tests, setup, teardown);
}
