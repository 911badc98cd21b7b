// Truncation with an error budget: as few modes as the budget allows, the stiffness between frames
// exact, and poles and zeros where the table says, by solves of its own.
#include "support/beam.h"
#include "support/check.h"

#include "base/lapack.h"
#include "part/truncate.h"

enum { PARTS = 20, NODES = PARTS + 1, FRAMES = 4, SIZE = 6 * NODES };

// A beam of 20 parts whose first frames are its ends and two nodes between; all other nodes are
// interior coordinates, as modes are.
typedef struct subject {
  double position[3 * NODES], k[SIZE * SIZE], m[SIZE * SIZE];
  pb_element_data data;
} subject;

static subject beam20;

static int make(void **state) {
  (void)state;
  static const beam steel = {
      .length = 0.2, .ea = 2e7, .ei = 50, .gj = 40, .mass = 0.16, .polar_inertia = 4e-6};
  static const size_t frame[FRAMES] = {0, PARTS, 6, 13};
  static double k[SIZE * SIZE], m[SIZE * SIZE], position[3 * NODES];
  size_t order[NODES], at = FRAMES;
  beam_chain(&steel, PARTS, k, m, position);
  memcpy(order, frame, sizeof frame);
  for (size_t i = 0; i < NODES; i++)
    if (i != frame[0] && i != frame[1] && i != frame[2] && i != frame[3]) order[at++] = i;
  for (size_t i = 0; i < NODES; i++)
    memcpy(beam20.position + 3 * i, position + 3 * order[i], 3 * sizeof *position);
  for (size_t j = 0; j < SIZE; j++) {
    for (size_t i = 0; i < SIZE; i++) {
      size_t from = 6 * order[i / 6] + i % 6 + (6 * order[j / 6] + j % 6) * SIZE;
      beam20.k[i + j * SIZE] = k[from];
      beam20.m[i + j * SIZE] = m[from];
    }
  }
  beam20.data = (pb_element_data){
      .frames = FRAMES, .size = SIZE, .position = beam20.position, .k = beam20.k, .m = beam20.m};
  return 0;
}

static const pb_truncate_options options = {.low_hz = 0,
                                            .high_hz = 12000,
                                            .zero_error = 1e-3,
                                            .pole_error = 1e-3,
                                            .base = 0,
                                            .tip = 1,
                                            .stacks = true,
                                            .actuator = {2, 3},
                                            .sensor = {0, 2}};

// K_bb − K_bi K_ii⁻¹ K_ib by a dense solve.
static void condense(const pb_element_data *e, double *out) {
  int n = (int)e->size - 6 * FRAMES, b = 6 * FRAMES, info = 0;
  size_t size = e->size, inner = (size_t)n, outer = (size_t)b;
  double *kii = malloc((inner * inner + 1) * sizeof *kii);
  double *x = malloc((inner * outer + 1) * sizeof *x);
  int *pivot = malloc((inner + 1) * sizeof *pivot);
  for (size_t j = 0; j < inner; j++)
    for (size_t i = 0; i < inner; i++) kii[i + j * inner] = e->k[outer + i + (outer + j) * size];
  for (size_t j = 0; j < outer; j++)
    for (size_t i = 0; i < inner; i++) x[i + j * inner] = e->k[outer + i + j * size];
  if (n) dgesv_(&n, &b, kii, &n, pivot, x, &n, &info);
  assert_int_equal(info, 0);
  for (size_t j = 0; j < outer; j++) {
    for (size_t i = 0; i < outer; i++) {
      out[i + j * outer] = e->k[i + j * size];
      for (size_t l = 0; l < inner; l++)
        out[i + j * outer] -= e->k[i + (outer + l) * size] * x[l + j * inner];
    }
  }
  free(kii);
  free(x);
  free(pivot);
}

static void test_static(void **state) {
  (void)state;
  double before[36 * FRAMES * FRAMES], after[36 * FRAMES * FRAMES];
  pb_truncation t;
  REQUIRE(pb_element_truncate("beam", &beam20.data, &options, &t, &err));
  assert_in_range(t.modes, 1, 60);
  assert_int_equal(t.modes_before, SIZE - 6 * FRAMES);
  assert_int_equal(t.element.size, 6 * FRAMES + t.modes);
  condense(&beam20.data, before);
  condense(&t.element, after);
  for (size_t j = 0; j < 6 * FRAMES; j++) {
    for (size_t i = 0; i < 6 * FRAMES; i++) {
      double size = sqrt(before[i + i * 6 * FRAMES] * before[j + j * 6 * FRAMES]);
      ASSERT_NEAR(after[i + j * 6 * FRAMES], before[i + j * 6 * FRAMES], 1e-9 * size);
    }
  }
  pb_truncation_clear(&t);
}

// One mode less than chosen breaks the budget; the chosen number keeps it.
static void test_fewest(void **state) {
  (void)state;
  pb_truncation t, less;
  REQUIRE(pb_element_truncate("beam", &beam20.data, &options, &t, &err));
  assert_true(t.worst_zero <= options.zero_error && t.worst_pole <= options.pole_error);
  assert_true(t.worst_zero > 0 && t.rows > 40);
  pb_truncate_options fixed = options;
  fixed.modes = t.modes - 1;
  REQUIRE(pb_element_truncate("beam", &beam20.data, &fixed, &less, &err));
  assert_true(less.worst_zero > options.zero_error || less.worst_pole > options.pole_error);
  pb_truncation_clear(&less);
  fixed = options;
  fixed.zero_error = fixed.pole_error = 1e-5;
  REQUIRE(pb_element_truncate("beam", &beam20.data, &fixed, &less, &err));
  assert_true(less.modes > t.modes);
  pb_truncation_clear(&less);
  fixed.modes = SIZE - 6 * FRAMES;  // nothing dropped: nothing changes
  REQUIRE(pb_element_truncate("beam", &beam20.data, &fixed, &less, &err));
  assert_true(less.worst_zero < 1e-7 && less.worst_pole < 1e-7);
  pb_truncation_clear(&less);
  pb_truncation_clear(&t);
}

// |cᵀ(K − λM)⁻¹b| with frame 0 held.
static double response(const pb_element_data *e, double hz, const double *b, const double *c) {
  int n = (int)e->size - 6, one = 1, info;
  size_t left = (size_t)n, size = e->size;
  double lambda = pow(2 * 3.14159265358979323846 * hz, 2), sum = 0;
  double *a = malloc(left * left * sizeof *a), *x = malloc(left * sizeof *x);
  int *pivot = malloc(left * sizeof *pivot);
  for (size_t j = 0; j < left; j++) {
    x[j] = b[6 + j];
    for (size_t i = 0; i < left; i++) {
      size_t at = 6 + i + (6 + j) * size;
      a[i + j * left] = e->k[at] - lambda * e->m[at];
    }
  }
  dgesv_(&n, &one, a, &n, pivot, x, &n, &info);
  for (size_t i = 0; i < left; i++) sum += c[6 + i] * x[i];
  free(a);
  free(x);
  free(pivot);
  return sum;
}

// The response changes its sign at each zero of the actuator that the table tells.
static void test_zeros(void **state) {
  (void)state;
  double b[SIZE] = {0}, c[SIZE] = {0};
  b[6 * 2 + 2] = -1, b[6 * 3 + 2] = 1;
  c[6 * 2 + 2] = 1;  // against frame 0, which is held
  pb_truncation t;
  pb_truncate_options wide = options;
  wide.high_hz = 60000;
  wide.zero_error = wide.pole_error = 1e-2;
  REQUIRE(pb_element_truncate("beam", &beam20.data, &wide, &t, &err));
  int found = 0;
  for (size_t k = 0; k < t.rows; k++) {
    const pb_truncate_row *r = &t.row[k];
    if (strcmp(r->what, "zero actuator → sensor") || strcmp(r->boundary, "held")) continue;
    for (int side = 0; side < 2; side++) {
      const pb_element_data *e = side ? &t.element : &beam20.data;
      double hz = side ? r->after : r->before;
      double low = response(e, hz * (1 - 1e-6), b, c), high = response(e, hz * (1 + 1e-6), b, c);
      // Bending and torsion take no part: their poles are zeros of this channel without a change of
      // sign.
      if (low * high < 0) found++;
    }
  }
  if (found < 2) fail_msg("%d changes of sign", found);
  pb_truncation_clear(&t);
}

static void test_refusals(void **state) {
  (void)state;
  static const struct {
    pb_truncate_options change;
    const char *message;
  } wrong[] = {
      {{.high_hz = 0, .tip = 1}, "is empty"},
      {{.high_hz = 100, .low_hz = 200, .tip = 1}, "is empty"},
      {{.high_hz = 100, .base = 1, .tip = 1}, "are not two"},
      {{.high_hz = 100, .tip = 9}, "are not two"},
      {{.high_hz = 100, .tip = 1, .modes = 500}, "not 500"},
      {{.high_hz = 100, .tip = 1, .stacks = true}, "pairs of frames"},
  };
  pb_truncation t;
  pb_error err = {0};
  for (size_t k = 0; k < sizeof wrong / sizeof *wrong; k++) {
    assert_int_equal(pb_element_truncate("beam", &beam20.data, &wrong[k].change, &t, &err),
                     PB_ERR_ARGUMENT);
    if (!strstr(err.message, wrong[k].message)) fail_msg("'%s'", err.message);
    assert_null(t.element.k);
  }
  // An interior coordinate that nothing holds.
  static double k[SIZE * SIZE];
  memcpy(k, beam20.k, sizeof k);
  for (size_t i = 0; i < SIZE; i++) k[i + (SIZE - 1) * SIZE] = k[SIZE - 1 + i * SIZE] = 0;
  pb_element_data loose = beam20.data;
  loose.k = k;
  assert_int_equal(pb_element_truncate("beam", &loose, &options, &t, &err), PB_ERR_ELEMENT);
  assert_non_null(strstr(err.message, "not held by its frames"));
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_static),
      cmocka_unit_test(test_fewest),
      cmocka_unit_test(test_zeros),
      cmocka_unit_test(test_refusals),
  };
  return cmocka_run_group_tests(tests, make, NULL);
}
