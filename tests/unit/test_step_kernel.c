// The kernels of the step give the bits of the plain loops, each of them, at every shape.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/text.h"
#include "model/build.h"
#include "model/step_kernel.h"

// Deterministic numbers in (−1, 1), some of them exact zeros of both signs.
static double draw(uint64_t *seed) {
  *seed = *seed * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
  const int64_t value = (int64_t)*seed >> 11;
  if (*seed >> 33 & 7) return (double)value / 4503599627370496.0 * 0.25;
  return value & 1 ? 0.0 : -0.0;
}

// A stable model of random blocks; odd: the last block has three states.
static pb_model *random_model(size_t pairs, bool odd, size_t nu, size_t ny) {
  uint64_t seed = 1 + pairs + 100 * nu + 10000 * ny + odd;
  pb_model_builder builder;
  const size_t nx = 2 * pairs + (odd ? 3 : 0);
  assert_int_equal(pb_model_builder_open(&builder, nx, nu, ny, pairs, NULL), PB_OK);
  pb_model *m = builder.model, *out = NULL;
  m->sample_rate = 1000;
  m->name = pb_text_copy("random");
  for (size_t i = 0; i < nu + ny; i++) {
    pb_signal *s = i < nu ? &m->input[i] : &m->output[i - nu];
    s->name = pb_text_copy("s");
    s->unit = pb_text_copy("V");
  }
  for (size_t k = 0; k < nu * ny; k++) m->d[k] = draw(&seed);
  for (size_t k = 0; k < pairs + odd; k++) {
    const size_t n = k < pairs ? 2 : 3;
    double a[9], b[3 * 32], c[3 * 80], w = 10 + 900 * fabs(draw(&seed));
    const double pair[4] = {-1, -w, w, -2}, triple[9] = {-w, 0, 0, w, -w, 0, w, w, -2 * w};
    memcpy(a, n == 2 ? pair : triple, n * n * sizeof *a);
    for (size_t i = 0; i < n * nu; i++) b[i] = 100 * draw(&seed);
    for (size_t i = 0; i < n * ny; i++) c[i] = draw(&seed);
    pb_model_part part = {.size = n, .a = a, .b = b, .c = c, .lda = n, .ldb = n, .ldc = ny};
    assert_int_equal(pb_model_builder_add(&builder, &part, NULL), PB_OK);
  }
  assert_int_equal(pb_model_builder_close(&builder, 0, &out, NULL), PB_OK);
  assert_non_null(out->step);
  assert_int_equal(out->pairs, pairs);
  return out;
}

// State and outputs after every step with `kernel` (NULL: plain loops), into record.
static void run(pb_model *m, const pb_step_kernel *kernel, size_t steps, double *record) {
  pb_step_pack *pack = m->step;
  pb_state *s = pb_state_new(m);
  double u[32];
  uint64_t seed = 7;
  assert_non_null(s);
  pack->kernel = kernel;
  if (!kernel) m->step = NULL;
  for (size_t k = 0; k < steps; k++) {
    for (size_t i = 0; i < m->nu; i++) u[i] = draw(&seed);
    pb_step_advance(m, s, u);
    pb_step_output(m, s, record);
    record += m->ny;
    memcpy(record, s->data, (m->nx + m->nu) * sizeof *record);
    record += m->nx + m->nu;
  }
  m->step = pack;
  free(s);
}

static void compare(pb_model *m) {
  enum { STEPS = 20 };
  const size_t count = STEPS * (m->nx + m->nu + m->ny);
  double *plain = malloc(count * sizeof *plain), *fast = malloc(count * sizeof *fast);
  assert_non_null(plain);
  assert_non_null(fast);
  const pb_step_kernel *kernel[3], *chosen = m->step->kernel;
  const size_t kernels = pb_step_kernels(kernel);
  assert_ptr_equal(chosen, kernel[kernels - 1]);
  run(m, NULL, STEPS, plain);
  double size = 0;
  for (size_t i = 0; i < count; i++) size += fabs(plain[i]);
  assert_true(size > 0 && isfinite(size));
  for (size_t v = 0; v < kernels; v++) {
    run(m, kernel[v], STEPS, fast);
    for (size_t i = 0; i < count; i++)
      if (memcmp(&plain[i], &fast[i], sizeof *plain))
        fail_msg("%s, %zu states, %zu inputs, %zu outputs: number %zu is %.17g, plain %.17g",
                 kernel[v]->name, m->nx, m->nu, m->ny, i, fast[i], plain[i]);
  }
  free(plain);
  free(fast);
}

static void test_every_shape(void **state) {
  (void)state;
  // All widths of the last group, chunks of one to four groups, and more.
  for (size_t pairs = 0; pairs < 38; pairs++)
    for (int odd = 0; odd < 2; odd++) {
      if (!pairs && !odd) continue;
      pb_model *m = random_model(pairs, odd, 1 + pairs % 5, 1 + 7 * pairs % 13);
      compare(m);
      pb_model_free(m);
    }
}

static void test_every_number_of_outputs(void **state) {
  (void)state;
  for (size_t ny = 1; ny <= 75; ny++) {
    pb_model *m = random_model(9, ny % 3 == 0, 1 + ny % 32, ny);
    compare(m);
    pb_model_free(m);
  }
}

// A copy, a truncated one, and one that went over the bus step with a kernel, too.
static void test_copies_are_packed(void **state) {
  (void)state;
  pb_model *m = random_model(6, false, 3, 10), *narrow = NULL, *cut = NULL, *unpacked = NULL;
  const char *const name[] = {"s", "s", "s", "s", "s", "s", "s", "s", "s", "s"};
  double *data = NULL;
  size_t count = 0;
  assert_int_equal(pb_model_narrow(m, 2, 9, &narrow, NULL), PB_OK);
  assert_int_equal(pb_model_truncate(m, 1e6, &cut, NULL), PB_OK);
  assert_int_equal(pb_model_pack(m, &data, &count, NULL), PB_OK);
  assert_int_equal(pb_model_unpack(data, count, "random", name, name, name, name, &unpacked, NULL),
                   PB_OK);
  compare(narrow);
  compare(cut);
  compare(unpacked);
  free(data);
  pb_model_free(m);
  pb_model_free(narrow);
  pb_model_free(cut);
  pb_model_free(unpacked);
}

// Rows that are read together begin at a cache line: a load across lines costs twice.
static void test_alignment(void **state) {
  (void)state;
  pb_model *m = random_model(11, false, 3, 18);
  assert_int_equal((uintptr_t)m->step->advance % 64, 0);
  assert_int_equal((uintptr_t)m->step->output % 64, 0);
  assert_int_equal(m->step->states, 22);
  assert_int_equal(m->step->panels, 2);
  assert_int_equal(m->step->tail, 2);
  pb_model_free(m);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_every_shape),
      cmocka_unit_test(test_every_number_of_outputs),
      cmocka_unit_test(test_copies_are_packed),
      cmocka_unit_test(test_alignment),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
