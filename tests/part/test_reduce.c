// The reduction against dense Craig–Bampton, and what it refuses.
#include "support/check.h"
#include "truss.h"

static const double two_pi = 6.283185307179586476925286766559;

// Largest difference of two elements, each entry against √(X_ii X_jj). Modes have no sign of their
// own, and none at all where frequencies are equal: M_bp is compared by M_bp M_bpᵀ.
static double compare_boundary(size_t b, size_t size, const double *x, const double *y) {
  double worst = 0;
  for (size_t j = 0; j < b; j++)
    for (size_t i = 0; i < b; i++)
      worst = fmax(worst, fabs(x[i + j * size] - y[i + j * size]) /
                              sqrt(y[i + i * size] * y[j + j * size]));
  return worst;
}

static double compare_drive(size_t b, size_t size, const double *x, const double *y) {
  double worst = 0;
  for (size_t j = 0; j < b; j++) {
    for (size_t i = 0; i < b; i++) {
      double sx = 0, sy = 0;
      for (size_t p = b; p < size; p++) {
        sx += x[i + p * size] * x[j + p * size];
        sy += y[i + p * size] * y[j + p * size];
      }
      worst = fmax(worst, fabs(sx - sy) / sqrt(y[i + i * size] * y[j + j * size]));
    }
  }
  return worst;
}

static void check_against_dense(const pb_fem *fem, size_t p, const char *name) {
  pb_reduce_options options = {.modes = p};
  pb_reduction *r = NULL;
  REQUIRE(pb_reduce(fem, &options, true, &r, &err));
  double *k, *m, *omega2;
  assert_int_equal(dense_reduce(fem, p, &k, &m, &omega2), 0);
  size_t b = 6 * fem->frames, size = b + p;
  assert_int_equal(r->size, size);
  double frequency = 0, shape = 0;
  for (size_t i = 0; i < p; i++)
    frequency = fmax(frequency, fabs(r->k[(b + i) * (size + 1)] / omega2[i] - 1));
  for (size_t j = b; j < size; j++)
    for (size_t i = 0; i < size; i++) {
      ASSERT_NEAR(r->m[i + j * size] - r->m[j + i * size], 0, 0);
      if (i >= b) ASSERT_NEAR(r->m[i + j * size], i == j, 0);
      if (i != j) ASSERT_NEAR(r->k[i + j * size], 0, 0);
    }
  // The shapes really give these matrices.
  size_t n = fem->k.n;
  double *ks = malloc(n * size * sizeof *ks);
  assert_non_null(ks);
  pb_sparse_multiply(&fem->k, size, r->shape, ks);
  for (size_t j = 0; j < size; j++)
    for (size_t i = 0; i < size; i++) {
      double sum = 0;
      for (size_t row = 0; row < n; row++) sum += r->shape[row + i * n] * ks[row + j * n];
      shape = fmax(shape, fabs(sum - r->k[i + j * size]) /
                              sqrt(r->k[i * (size + 1)] * r->k[j * (size + 1)]));
    }
  double stiffness = compare_boundary(b, size, r->k, k), mass = compare_boundary(b, size, r->m, m);
  double drive = compare_drive(b, size, r->m, m);
  print_message("%s: K %.1e  M %.1e  M_bp %.1e  ω² %.1e  shapes %.1e  rigid %.1e\n", name,
                stiffness, mass, drive, frequency, shape, r->rigid_residual);
  assert_true(stiffness < 1e-9 && mass < 1e-9 && drive < 1e-9 && frequency < 1e-9 && shape < 1e-9);
  assert_true(r->rigid_residual < 1e-12);
  ASSERT_RELATIVE(r->mass, r->full_mass, 1e-10);
  free(ks);
  free(k);
  free(m);
  free(omega2);
  pb_reduction_free(r);
}

static void test_averaged(void **state) {
  (void)state;
  for (int scalar = 0; scalar < 2; scalar++) {
    pb_fem fem;
    assert_int_equal(truss_build(70, 0.4, scalar, 7, &fem), 0);
    assert_int_equal(truss_frame(&fem, "left", PB_TIE_AVERAGED, 0, 0, 0.2), 0);
    assert_int_equal(truss_frame(&fem, "middle", PB_TIE_AVERAGED, 0, 0.4, 0.6), 0);
    assert_int_equal(truss_frame(&fem, "right", PB_TIE_AVERAGED, 0, 0.8, 1), 0);
    check_against_dense(&fem, 12, scalar ? "averaged, scalar mass" : "averaged");
    pb_fem_clear(&fem);
  }
}

static void test_rigid(void **state) {
  (void)state;
  pb_fem fem;
  assert_int_equal(truss_build(70, 0.4, false, 3, &fem), 0);
  assert_int_equal(truss_frame(&fem, "left", PB_TIE_RIGID, 0, 0, 0.15), 0);
  assert_int_equal(truss_frame(&fem, "right", PB_TIE_RIGID, 0, 0.85, 1), 0);
  check_against_dense(&fem, 12, "rigid");
  pb_fem_clear(&fem);
}

static void test_mixed(void **state) {
  (void)state;
  pb_fem fem;
  assert_int_equal(truss_build(70, 0.4, true, 5, &fem), 0);
  assert_int_equal(truss_frame(&fem, "left", PB_TIE_AVERAGED, 0, 0, 0.2), 0);
  assert_int_equal(truss_frame(&fem, "right", PB_TIE_RIGID, 0, 0.85, 1), 0);
  assert_int_equal(truss_frame(&fem, "front", PB_TIE_AVERAGED, 1, 0, 0.1), 0);  // shares with both
  check_against_dense(&fem, 12, "mixed");
  pb_fem_clear(&fem);
}

static void test_no_modes(void **state) {
  (void)state;
  pb_fem fem;
  assert_int_equal(truss_build(40, 0.5, true, 5, &fem), 0);
  assert_int_equal(truss_frame(&fem, "left", PB_TIE_AVERAGED, 0, 0, 0.4), 0);
  assert_int_equal(truss_frame(&fem, "right", PB_TIE_AVERAGED, 0, 0.6, 1), 0);
  check_against_dense(&fem, 0, "static");
  pb_fem_clear(&fem);
}

// Every mode there is: the element is then the full model in other coordinates.
static void test_all_modes(void **state) {
  (void)state;
  pb_fem fem;
  double *omega2;
  size_t count;
  assert_int_equal(truss_build(25, 0.6, false, 11, &fem), 0);
  assert_int_equal(truss_frame(&fem, "left", PB_TIE_AVERAGED, 0, 0, 0.5), 0);
  assert_int_equal(truss_frame(&fem, "right", PB_TIE_AVERAGED, 0, 0.5, 1), 0);
  assert_int_equal(dense_fixed(&fem, &omega2, &count), 0);
  check_against_dense(&fem, count, "all modes");
  pb_reduce_options options = {.modes = count, .check_points = 3};
  pb_reduction *r = NULL;
  REQUIRE(pb_reduce(&fem, &options, false, &r, &err));
  for (size_t i = 0; i < r->checks; i++) {
    print_message("check at %.4g Hz: %.1e\n", r->check[i].hz, r->check[i].error);
    assert_true(r->check[i].error < 1e-8);
  }
  pb_reduction_free(r);
  // Without any limit as well: what rounding adds to the last block is no mode.
  options = (pb_reduce_options){.max_hz = 1e12};
  REQUIRE(pb_reduce(&fem, &options, false, &r, &err));
  assert_int_equal(r->modes, count);
  pb_reduction_free(r);
  options = (pb_reduce_options){.modes = count + 1};
  pb_error err = {0};
  assert_int_equal(pb_reduce(&fem, &options, false, &r, &err), PB_ERR_ARGUMENT);
  assert_null(r);
  assert_non_null(strstr(err.message, "modes"));
  free(omega2);
  pb_fem_clear(&fem);
}

// All modes up to a frequency, and no more; the check's counts are those of the dense model.
static void check_band(pb_fem *fem, const char *name) {
  double *omega2;
  size_t count, expected = 0;
  assert_int_equal(dense_fixed(fem, &omega2, &count), 0);
  double limit = sqrt(sqrt(omega2[17] * omega2[18])) / two_pi;
  if (omega2[18] / omega2[17] < 1.0001) limit = 1.001 * sqrt(omega2[18]) / two_pi;
  while (sqrt(omega2[expected]) < two_pi * limit) expected++;
  pb_reduce_options options = {.max_hz = limit, .check_points = 4, .check_to_hz = 1.3 * limit};
  pb_reduction *r = NULL;
  REQUIRE(pb_reduce(fem, &options, false, &r, &err));
  print_message("%s: %zu modes up to %.5g Hz, counted at %.5g Hz\n", name, r->modes, limit,
                r->proven_hz);
  assert_int_equal(r->modes, expected);
  assert_true(r->proven_hz > r->fixed_hz[r->modes - 1]);
  ASSERT_RELATIVE(r->fixed_hz[expected - 1], sqrt(omega2[expected - 1]) / two_pi, 1e-9);
  for (size_t i = 0; i < r->checks; i++) {
    size_t below = 0;
    while (below < count && sqrt(omega2[below]) < two_pi * r->check[i].hz) below++;
    assert_int_equal(r->check[i].fixed_below, below);
    assert_true(r->check[i].free_below >= below + 6);
  }
  pb_reduction_free(r);
  free(omega2);
}

static void test_band(void **state) {
  (void)state;
  static const pb_frame_tie ties[3][2] = {{PB_TIE_AVERAGED, PB_TIE_AVERAGED},
                                          {PB_TIE_RIGID, PB_TIE_AVERAGED},
                                          {PB_TIE_RIGID, PB_TIE_RIGID}};
  static const char *const name[3] = {"averaged", "mixed", "rigid"};
  for (size_t i = 0; i < 3; i++) {
    pb_fem fem;
    assert_int_equal(truss_build(60, 0.4, i != 1, 21, &fem), 0);
    assert_int_equal(truss_frame(&fem, "left", ties[i][0], 0, 0, 0.2), 0);
    assert_int_equal(truss_frame(&fem, "right", ties[i][1], 0, 0.8, 1), 0);
    check_band(&fem, name[i]);
    pb_fem_clear(&fem);
  }
}

// M may couple what K does not.
static void test_mass_beyond(void **state) {
  (void)state;
  pb_fem fem;
  assert_int_equal(truss_build(60, 0.35, true, 21, &fem), 0);
  size_t low = 0, high = 0;
  for (size_t i = 0; i < fem.nodes; i++) {
    if (fem.xyz[3 * i] < fem.xyz[3 * low]) low = i;
    if (fem.xyz[3 * i] > fem.xyz[3 * high]) high = i;
  }
  assert_int_equal(truss_couple(&fem, low, high, 0.5), 0);
  assert_int_equal(truss_frame(&fem, "left", PB_TIE_AVERAGED, 0, 0, 0.3), 0);
  assert_int_equal(truss_frame(&fem, "right", PB_TIE_AVERAGED, 0, 0.7, 1), 0);
  check_against_dense(&fem, 8, "masses coupled beyond the springs");
  check_band(&fem, "masses coupled beyond the springs");
  pb_fem_clear(&fem);
}

// Forty equal resonators, each on a spring of its own: one frequency forty times, five times what a
// block of the iteration can see at once. The count finds those that are missing.
static void test_many_equal(void **state) {
  (void)state;
  enum { MASSES = 40 };
  pb_fem fem;
  assert_int_equal(truss_build(45, 0.6, true, 9, &fem), 0);
  assert_int_equal(truss_frame(&fem, "left", PB_TIE_RIGID, 0, 0, 0.4), 0);
  assert_int_equal(truss_frame(&fem, "right", PB_TIE_RIGID, 0, 0.6, 1), 0);
  assert_int_equal(truss_hang(&fem, MASSES, fem.frame[0].node[0], 20, 0.05), 0);
  double *omega2;
  size_t count, equal = 0;
  assert_int_equal(dense_fixed(&fem, &omega2, &count), 0);
  while (omega2[equal] < 1.000001 * omega2[0]) equal++;
  assert_true(equal >= 3 * MASSES);
  pb_reduce_options options = {.max_hz = 1.5 * sqrt(omega2[0]) / two_pi};
  pb_reduction *r = NULL;
  REQUIRE(pb_reduce(&fem, &options, false, &r, &err));
  assert_int_equal(r->modes, equal);
  for (size_t i = 0; i < equal; i++)
    ASSERT_RELATIVE(r->fixed_hz[i], sqrt(omega2[0]) / two_pi, 1e-9);
  pb_reduction_free(r);
  free(omega2);
  pb_fem_clear(&fem);
}

// One mode of an equal pair is kept, the other is not: no count can be made at the cut, so it is
// made below, and nothing is missing.
static void test_cut_pair(void **state) {
  (void)state;
  pb_fem fem;
  size_t cuts = 0;
  assert_int_equal(bar_build(0.1, 0.01, 6, 2, &fem), 0);
  assert_int_equal(truss_frame(&fem, "left", PB_TIE_RIGID, 0, -1e-9, 1e-9), 0);
  assert_int_equal(truss_frame(&fem, "right", PB_TIE_RIGID, 0, 0.1 - 1e-9, 0.1 + 1e-9), 0);
  pb_reduce_options options = {.max_hz = 60e3};
  pb_reduction *all = NULL;
  REQUIRE(pb_reduce(&fem, &options, false, &all, &err));
  assert_true(all->modes > 8);
  for (size_t p = 1; p < all->modes; p++) {
    bool cut = all->fixed_hz[p] < (1 + 1e-8) * all->fixed_hz[p - 1];
    options = (pb_reduce_options){.modes = p, .prove = true};
    pb_reduction *r = NULL;
    REQUIRE(pb_reduce(&fem, &options, false, &r, &err));
    assert_int_equal(r->modes, p);
    ASSERT_RELATIVE(r->fixed_hz[p - 1], all->fixed_hz[p - 1], 1e-9);
    assert_true(r->proven_hz > 0);
    assert_true((r->proven_hz < r->fixed_hz[p - 1]) == cut);
    cuts += cut;
    pb_reduction_free(r);
  }
  assert_true(cuts >= 2);
  pb_reduction_free(all);
  pb_fem_clear(&fem);
}

// Masses that M does not have carry no modes: a limit above all there are finds those there are.
static void test_massless(void **state) {
  (void)state;
  pb_fem fem;
  assert_int_equal(truss_build(25, 0.6, true, 11, &fem), 0);
  assert_int_equal(truss_frame(&fem, "left", PB_TIE_RIGID, 0, 0, 0.3), 0);
  assert_int_equal(truss_frame(&fem, "right", PB_TIE_RIGID, 0, 0.7, 1), 0);
  assert_int_equal(truss_hang(&fem, 2, fem.frame[0].node[0], 20, 0), 0);
  pb_reduce_options options = {.max_hz = 1e12};
  pb_reduction *r = NULL;
  size_t between = 0;
  for (size_t i = 0; i < 25; i++) between += fem.xyz[3 * i] > 0.3 && fem.xyz[3 * i] < 0.7;
  REQUIRE(pb_reduce(&fem, &options, false, &r, &err));
  assert_int_equal(r->modes, 3 * between);
  pb_reduction_free(r);
  // No mass at all: no mode, though K is there.
  for (int64_t e = 0; e < fem.m.start[fem.m.n]; e++) fem.m.value[e] = 0;
  REQUIRE(pb_reduce(&fem, &options, false, &r, &err));
  assert_int_equal(r->modes, 0);
  pb_reduction_free(r);
  pb_error why = {0};
  options = (pb_reduce_options){.modes = 3};
  assert_int_equal(pb_reduce(&fem, &options, false, &r, &why), PB_ERR_ARGUMENT);
  assert_non_null(strstr(why.message, "the model has 0"));
  pb_fem_clear(&fem);
}

// The stiffness of a single frame is zero but for rounding, which is no resistance; a spring to the
// ground is one.
static void test_one_frame(void **state) {
  (void)state;
  pb_fem fem;
  pb_reduction *r = NULL;
  pb_reduce_options options = {.modes = 4};
  assert_int_equal(truss_build(40, 0.5, true, 5, &fem), 0);
  assert_int_equal(truss_frame(&fem, "only", PB_TIE_AVERAGED, 0, 0, 0.4), 0);
  REQUIRE(pb_reduce(&fem, &options, false, &r, &err));
  assert_true(r->rigid_residual < 1e-9);
  pb_reduction_free(r);
  fem.k.value[fem.k.start[1] - 1] *= 1.01;
  REQUIRE(pb_reduce(&fem, &options, false, &r, &err));
  assert_true(r->rigid_residual > 1e-5);
  pb_reduction_free(r);
  pb_fem_clear(&fem);
}

static void expect_refusal(const pb_fem *fem, pb_status status, const char *says) {
  pb_reduce_options options = {.modes = 3};
  pb_reduction *r = NULL;
  pb_error err = {0};
  assert_int_equal(pb_reduce(fem, &options, false, &r, &err), status);
  assert_null(r);
  print_message("%s: %s\n", err.where, err.message);
  if (!strstr(err.message, says)) fail_msg("'%s' does not say '%s'", err.message, says);
}

static void test_refusals(void **state) {
  (void)state;
  pb_fem fem;
  static const double origin[3] = {0};
  assert_int_equal(truss_build(30, 0.6, true, 2, &fem), 0);
  expect_refusal(&fem, PB_ERR_ARGUMENT, "no interface frame");
  assert_int_equal(truss_frame(&fem, "left", PB_TIE_AVERAGED, 0, 0, 0.5), 0);
  // Twice the same averages: no forces can tell them apart.
  assert_int_equal(truss_frame(&fem, "again", PB_TIE_AVERAGED, 0, 0, 0.5), 0);
  expect_refusal(&fem, PB_ERR_SINGULAR, "depend on each other");
  truss_drop_frame(&fem);
  // Two nodes lie on a line whatever they are.
  static const size_t two[2] = {4, 9};
  assert_int_equal(truss_frame_of(&fem, "line", PB_TIE_AVERAGED, origin, two, 2, NULL), 0);
  expect_refusal(&fem, PB_ERR_ARGUMENT, "line");
  truss_drop_frame(&fem);
  assert_int_equal(truss_frame_of(&fem, "line", PB_TIE_RIGID, origin, two, 2, NULL), 0);
  expect_refusal(&fem, PB_ERR_ARGUMENT, "line");
  truss_drop_frame(&fem);
  // Rigid frames that share a node.
  assert_int_equal(truss_frame(&fem, "a", PB_TIE_RIGID, 0, 0, 0.3), 0);
  assert_int_equal(truss_frame(&fem, "b", PB_TIE_RIGID, 0, 0.1, 0.5), 0);
  expect_refusal(&fem, PB_ERR_ARGUMENT, "two rigid frames");
  truss_drop_frame(&fem);
  truss_drop_frame(&fem);
  // A node that no row belongs to, as the points of a geometry are.
  fem.nodes++;
  fem.xyz = realloc(fem.xyz, 3 * fem.nodes * sizeof *fem.xyz);
  fem.dof = realloc(fem.dof, 3 * fem.nodes * sizeof *fem.dof);
  assert_true(fem.xyz && fem.dof);
  for (size_t i = 3 * fem.nodes - 3; i < 3 * fem.nodes; i++) fem.xyz[i] = 0.1, fem.dof[i] = -1;
  static const size_t lost[4] = {4, 9, 11, 30};
  assert_int_equal(truss_frame_of(&fem, "lost", PB_TIE_AVERAGED, origin, lost, 4, NULL), 0);
  expect_refusal(&fem, PB_ERR_ARGUMENT, "node 31 cannot move");
  truss_drop_frame(&fem);
  int64_t kept = fem.dof[5];
  fem.dof[5] = fem.dof[6];
  expect_refusal(&fem, PB_ERR_ARGUMENT, "another node's");
  fem.dof[5] = -1;
  expect_refusal(&fem, PB_ERR_ARGUMENT, "belongs to no node");
  fem.dof[5] = kept;
  double value = fem.m.value[3];
  fem.m.value[3] = NAN;
  expect_refusal(&fem, PB_ERR_ARGUMENT, "not finite");
  fem.m.value[3] = value;
  double *last = &fem.m.value[fem.m.start[8] - 1];
  value = *last;
  *last = -1;
  expect_refusal(&fem, PB_ERR_ARGUMENT, "row 8 of M (node 3) has a negative diagonal");
  *last = 0;  // a massless row is none
  pb_reduction *r = NULL;
  pb_reduce_options options = {.modes = 3};
  REQUIRE(pb_reduce(&fem, &options, false, &r, &err));
  pb_reduction_free(r);
  *last = value;
  pb_fem_clear(&fem);
}

// A node on a single spring swings freely; two clusters without a spring between them drift apart.
static void test_mechanisms(void **state) {
  (void)state;
  pb_fem fem;
  assert_int_equal(truss_build(40, 0.5, true, 4, &fem), 0);
  assert_int_equal(truss_swing(&fem), 0);
  assert_int_equal(truss_frame(&fem, "left", PB_TIE_AVERAGED, 0, 0, 0.4), 0);
  expect_refusal(&fem, PB_ERR_SINGULAR, "node 41");
  pb_fem_clear(&fem);

  assert_int_equal(truss_build(40, 0.5, true, 4, &fem), 0);
  assert_int_equal(truss_twin(&fem), 0);
  assert_int_equal(truss_frame(&fem, "left", PB_TIE_AVERAGED, 0, 0, 0.4), 0);
  expect_refusal(&fem, PB_ERR_SINGULAR, "falls into pieces: node 41");
  truss_drop_frame(&fem);
  // Rigid frames on both hold them together.
  assert_int_equal(truss_frame(&fem, "left", PB_TIE_RIGID, 0, 0, 0.3), 0);
  assert_int_equal(truss_frame(&fem, "right", PB_TIE_RIGID, 0, 0.7, 1), 0);
  check_against_dense(&fem, 6, "two pieces on rigid frames");
  pb_fem_clear(&fem);
}

static bool stop_at(void *context, pb_reduce_phase phase, double done, double total) {
  (void)done;
  (void)total;
  return phase != *(const pb_reduce_phase *)context;
}

// Stopped in each phase: nothing is handed out, nothing leaks.
static void test_stop(void **state) {
  (void)state;
  pb_fem fem;
  assert_int_equal(truss_build(40, 0.5, true, 5, &fem), 0);
  assert_int_equal(truss_frame(&fem, "left", PB_TIE_AVERAGED, 0, 0, 0.4), 0);
  for (pb_reduce_phase phase = 0; phase < PB_REDUCE_PHASES; phase++) {
    pb_reduce_options options = {
        .modes = 4, .check_points = 1, .progress = stop_at, .context = &phase};
    pb_reduction *r = NULL;
    pb_error err = {0};
    assert_int_equal(pb_reduce(&fem, &options, false, &r, &err), PB_ERR_STATE);
    assert_null(r);
  }
  pb_fem_clear(&fem);
}

// A clamped–clamped bar of square section without lateral contraction: axial frequencies
// n/(2L) √(E/ρ) are those of the wave equation, torsion's too, and bending ones come in equal pairs
// near Timoshenko's.
static void test_square_bar(void **state) {
  (void)state;
  pb_fem fem;
  const double length = 0.1, side = 0.01;
  assert_int_equal(bar_build(length, side, 20, 2, &fem), 0);
  assert_int_equal(truss_frame(&fem, "left", PB_TIE_RIGID, 0, -1e-9, 1e-9), 0);
  assert_int_equal(truss_frame(&fem, "right", PB_TIE_RIGID, 0, length - 1e-9, length + 1e-9), 0);
  pb_reduce_options options = {.max_hz = 60e3, .check_points = 2};
  pb_reduction *r = NULL;
  REQUIRE(pb_reduce(&fem, &options, false, &r, &err));
  // Element: two frames hold axial stiffness E A / L between them, bending 12 E I / L³ less shear.
  double axial = 200e9 * side * side / length;
  ASSERT_RELATIVE(r->k[0], axial, 1e-6);
  ASSERT_RELATIVE(r->k[6], -axial, 1e-6);
  double inertia = side * side * side * side / 12,
         phi = 12 * 2.0 * inertia / (5.0 / 6 * side * side) / (length * length);  // E/G = 2
  ASSERT_RELATIVE(r->k[1 + r->size], 12 * 200e9 * inertia / pow(length, 3) / (1 + phi), 0.01);
  ASSERT_RELATIVE(r->mass, 7800 * side * side * length, 1e-9);
  double wave = sqrt(200e9 / 7800) / (2 * length);
  size_t axial_found = 0, pairs = 0;
  for (size_t i = 0; i < r->modes; i++) {
    for (int n = 1; n <= 2; n++) axial_found += fabs(r->fixed_hz[i] / (n * wave) - 1) < 3e-5;
    pairs += i && r->fixed_hz[i] / r->fixed_hz[i - 1] - 1 < 1e-9;
  }
  print_message("bar: %zu modes, axial %zu, equal pairs %zu, check %.1e\n", r->modes, axial_found,
                pairs, r->check[1].error);
  assert_int_equal(axial_found, 2);
  assert_true(pairs >= 4);
  assert_true(r->check[0].error < 0.02 && r->check[0].error > 0);
  pb_reduction_free(r);
  pb_fem_clear(&fem);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_averaged),    cmocka_unit_test(test_rigid),
      cmocka_unit_test(test_mixed),       cmocka_unit_test(test_no_modes),
      cmocka_unit_test(test_all_modes),   cmocka_unit_test(test_band),
      cmocka_unit_test(test_mass_beyond), cmocka_unit_test(test_many_equal),
      cmocka_unit_test(test_refusals),    cmocka_unit_test(test_mechanisms),
      cmocka_unit_test(test_stop),        cmocka_unit_test(test_square_bar),
      cmocka_unit_test(test_cut_pair),    cmocka_unit_test(test_massless),
      cmocka_unit_test(test_one_frame),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
