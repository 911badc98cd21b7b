// The state of the hexapod carried over between its models of every order: springs, element joints,
// all of elements (48 → 252 → 2100 → 48 states).
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/text.h"
#include "model/transfer.h"

typedef struct side {
  pb_model *model;
  pb_motion_map *map;
  pb_state *state;
} side;

static side side_of(const char *name) {
  char path[512], *text = NULL;
  size_t length;
  side s = {0};
  pb_error err = {PB_OK, "", ""};
  snprintf(path, sizeof path, PB_SHARED "/reference/nano-hexapod-%s.json", name);
  assert_int_equal(pb_text_read(path, &text, &length, &err), PB_OK);
  if (pb_model_parse(text, length, PB_SHARED "/reference", NULL, &s.model, &s.map, NULL, &err))
    fail_msg("%s: %s", err.where, err.message);
  free(text);
  s.state = pb_state_new(s.model);
  assert_non_null(s.state);
  return s;
}

static void side_free(side *s) {
  pb_model_free(s->model);
  pb_motion_map_free(s->map);
  free(s->state);
}

static double largest_of(const side *s, const double *y, char first) {
  double largest = 0.0;
  for (size_t o = 0; o < s->model->ny; o++)
    if (s->model->output[o].name[0] == first) largest = fmax(largest, fabs(y[o]));
  assert_true(largest > 0.0);
  return largest;
}

// Outputs whose names begin so do not jump by more than this part of the largest of them.
static void stays(const side *s, const double *ya, const double *yb, char first, double allowed) {
  const double largest = largest_of(s, yb, first);
  for (size_t o = 0; o < s->model->ny; o++)
    if (s->model->output[o].name[0] == first && !(fabs(yb[o] - ya[o]) < allowed * largest))
      fail_msg("%s jumps from %g to %g", s->model->output[o].name, ya[o], yb[o]);
}

// Displacements (of the platform and along the struts) and sensor voltages.
static void carry(const side *a, side *b, double displacement, double voltage) {
  pb_transfer *t = NULL;
  pb_transfer_report r;
  double ya[64], yb[64];
  pb_error err = {PB_OK, "", ""};
  if (pb_transfer_new(a->model, a->map, b->model, b->map, NULL, &t, &err)) fail_msg("%s", err.message);
  pb_transfer_apply(t, a->state, b->state);
  assert_int_equal(pb_transfer_examine(t, &r, &err), PB_OK);
  pb_step_output(a->model, a->state, ya);
  pb_step_output(b->model, b->state, yb);
  stays(b, ya, yb, 'D', displacement);
  stays(b, ya, yb, 'd', displacement);
  stays(b, ya, yb, 'V', voltage);
  if (!(r.energy_after > 0.8 * r.energy_before && r.energy_after < 1.25 * r.energy_before))
    fail_msg("energy %g became %g", r.energy_before, r.energy_after);
  pb_transfer_free(t);
}

static void any_order_follows_any_other(void **state) {
  (void)state;
  side springs = side_of("2dof-reduced"), joints = side_of("2dof-fem-joints");
  side all = side_of("fem-fem-joints"), back = side_of("2dof-reduced");
  double u[32];
  assert_int_equal(springs.model->nx, 48);
  assert_int_equal(joints.model->nx, 252);
  assert_int_equal(all.model->nx, 2100);
  for (int k = 0; k < 700; k++) {
    for (size_t i = 0; i < springs.model->nu; i++)
      u[i] = i < 6 ? sin(0.03 * k * (double)(i + 1)) : 0.0;
    pb_step_advance(springs.model, springs.state, u);
  }
  carry(&springs, &joints, 1e-9, 1e-9);
  // The actuators become elements, deformed by the forces that act inside them.
  carry(&joints, &all, 1e-9, 0.05);
  // And lumped again, their intermediate masses where their springs hold them; an axially soft
  // joint becomes a stiff one: the platform gives way.
  carry(&all, &back, 1e-2, 0.5);
  side_free(&springs);
  side_free(&joints);
  side_free(&all);
  side_free(&back);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(any_order_follows_any_other)};
  if (access(PB_SHARED "/reference", R_OK) != 0) {
    puts("skipped: no ../shared/reference");
    return 77;
  }
  return cmocka_run_group_tests(tests, NULL, NULL);
}
