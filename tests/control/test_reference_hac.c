// HAC-LAC on the reference plants: poles of the large plant's iteration against dense eigenvalues,
// and the border of stability by loci against the one by poles.
#include "support/check.h"

#include "control/hac.h"
#include "control/iff.h"
#include "control/lti_ops.h"
#include "control/margins.h"

typedef struct hexapod {
  pb_model *m;
  size_t input[6], read[12];
  pb_lti iff, h, hac, both;
  double gain[6];
  pb_loop loop;
} hexapod;

enum { GRID = 400 };

static void design(hexapod *p, const char *file, double bandwidth) {
  pb_warnings warnings = {0};
  pb_iff law = pb_iff_default(1000);
  pb_hac_shape shape = pb_hac_shape_default(bandwidth, 1e4);
  const pb_hac_frame frame = {0};
  static double complex plant[36 * (GRID + 1)];
  double hz[GRID + 1];
  REQUIRE(pb_model_load(file, &warnings, &p->m, &err));
  pb_warnings_clear(&warnings);
  for (size_t k = 0; k < 6; k++) {
    char name[3][8];
    snprintf(name[0], 8, "Va%zu", k + 1);
    snprintf(name[1], 8, "Vs%zu", k + 1);
    snprintf(name[2], 8, "dL%zu", k + 1);
    p->input[k] = (size_t)pb_model_input(p->m, name[0]);
    p->read[k] = (size_t)pb_model_output(p->m, name[1]);
    p->read[6 + k] = (size_t)pb_model_output(p->m, name[2]);
  }
  double rate = p->m->sample_rate;
  const pb_hac_channels channels = {6, p->input, p->read, p->read + 6};
  for (int k = 0; k < GRID; k++) hz[k] = bandwidth * pow(0.5 * rate / bandwidth, k / (GRID - 1.0));
  hz[GRID] = 0.01 * bandwidth;
  REQUIRE(pb_iff_discrete(&law, 6, rate, &p->iff, &err));
  REQUIRE(pb_hac_shape_discrete(&shape, rate, &p->h, &err));
  REQUIRE(pb_hac_plant(p->m, &channels, &frame, &p->iff, 0, hz, GRID + 1, plant, &err));
  REQUIRE(pb_hac_gains(&p->h, hz, GRID, plant, plant + 36 * GRID, 6, false, p->gain, &err));
  REQUIRE(pb_hac_controller(&p->h, p->gain, &frame, 6, &p->hac, &err));
  REQUIRE(pb_hac_combine(&p->iff, 0, &p->hac, 0, 6, &p->both, &err));
  p->loop = (pb_loop){p->m, &p->both, p->read, p->input, 1, 0};
}

static void clear(hexapod *p) {
  pb_lti_free(&p->iff);
  pb_lti_free(&p->h);
  pb_lti_free(&p->hac);
  pb_lti_free(&p->both);
  pb_model_free(p->m);
}

// Every oscillatory closed-loop pole of the band is found, and nothing that is no pole.
static void test_poles(void **state) {
  (void)state;
  const char *file = PB_SHARED "/reference/nano-hexapod-2dof-fem-joints.json";
  if (access(file, R_OK)) {
    print_message("%s is not here\n", file);
    skip();
  }
  hexapod p;
  design(&p, file, 150);
  pb_loop_solver *solver;
  pb_pole_list list;
  pb_lti closed;
  REQUIRE(pb_loop_solver_new(&p.loop, &solver, &err));
  REQUIRE(pb_loop_solver_poles(solver, 1, 5, 600, &list, &err));
  REQUIRE(pb_loop_closed(&p.loop, 1, &closed, &err));
  double complex *z = malloc(closed.nx * sizeof *z);
  REQUIRE(pb_lti_poles(&closed, z, &err));
  size_t dense = 0, found = 0, oscillatory = 0;
  for (size_t k = 0; k < closed.nx; k++) {
    pb_pole pole = pb_pole_from_z(z[k], p.m->sample_rate);
    if (!(cimag(z[k]) > 1e-4) || pole.hz < 5 || pole.hz > 600) continue;
    double nearest = INFINITY;
    dense++;
    for (size_t i = 0; i < list.count; i++) nearest = fmin(nearest, cabs(list.item[i].z - z[k]));
    ASSERT_NEAR(nearest, 0, 1e-6);
  }
  for (size_t i = 0; i < list.count; i++) {
    double nearest = INFINITY;
    oscillatory += cimag(list.item[i].z) > 1e-4;
    for (size_t k = 0; k < closed.nx; k++) nearest = fmin(nearest, cabs(list.item[i].z - z[k]));
    // Real ones come in sixes, one a strut: close together, and less exact.
    found += nearest < (cimag(list.item[i].z) > 1e-4 ? 1e-6 : 1e-3);
  }
  assert_true(dense >= 6);
  assert_int_equal(dense, oscillatory);
  assert_int_equal(found, list.count);
  free(z);
  pb_lti_free(&closed);
  pb_pole_list_clear(&list);
  pb_loop_solver_free(solver);
  clear(&p);
}

static bool stable_at(const hexapod *p, double factor) {
  pb_lti hac, both;
  pb_loop_solver *solver;
  bool stable;
  REQUIRE(pb_lti_copy(&p->hac, &hac, &err));
  pb_lti_scale(&hac, factor);
  REQUIRE(pb_hac_combine(&p->iff, 0, &hac, 0, 6, &both, &err));
  pb_loop loop = p->loop;
  loop.controller = &both;
  REQUIRE(pb_loop_solver_new(&loop, &solver, &err));
  REQUIRE(pb_loop_solver_stable(solver, 1, &stable, NULL, &err));
  pb_loop_solver_free(solver);
  pb_lti_free(&hac);
  pb_lti_free(&both);
  return stable;
}

// The smallest gain margin of the characteristic loci is where the poles reach the circle: 0.5 %
// below it they are all inside, 0.5 % above they are not.
static void test_border(void **state) {
  (void)state;
  enum { NF = 3000 };
  static double hz[NF];
  static double complex plant[36 * NF], l[36 * NF];
  const pb_hac_frame frame = {0};
  hexapod p;
  pb_mimo mimo;
  double border = INFINITY;
  design(&p, PB_CONFIG "/plants/nano-hexapod.json", 150);
  const pb_hac_channels channels = {6, p.input, p.read, p.read + 6};
  for (int k = 0; k < NF; k++) hz[k] = 0.1 * pow(0.5 * p.m->sample_rate / 0.1, k / (NF - 1.0));
  REQUIRE(pb_hac_plant(p.m, &channels, &frame, &p.iff, 0, hz, NF, plant, &err));
  REQUIRE(pb_hac_loop_gain(&p.h, p.gain, 0, hz, NF, 6, plant, l, &err));
  REQUIRE(pb_mimo_analyse(hz, NF, 6, l, &mimo, &err));
  for (int i = 0; i < 6; i++) border = fmin(border, mimo.margins[i].gain_up);
  print_message("border at %.4f times the gain\n", border);
  assert_true(border > 1.5 && border < 50);
  assert_true(stable_at(&p, 1));
  assert_true(stable_at(&p, 0.995 * border));
  assert_false(stable_at(&p, 1.005 * border));
  pb_mimo_clear(&mimo);
  clear(&p);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_poles), cmocka_unit_test(test_border)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
