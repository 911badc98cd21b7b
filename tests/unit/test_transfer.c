// The state of a running plant carried over to another model of it: what the parts were doing they
// go on doing.
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

#include "base/json.h"
#include "model/transfer.h"
#include "support/beam.h"
#include "support/patched.h"

typedef struct side {
  pb_model *model;
  pb_motion_map *map;
  pb_state *state;
} side;

static bool watching;
static int allocations;

void *__real_malloc(size_t size);
void *__real_calloc(size_t count, size_t size);
void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t count, size_t size);

void *__wrap_malloc(size_t size) {
  allocations += watching;
  return __real_malloc(size);
}

void *__wrap_calloc(size_t count, size_t size) {
  allocations += watching;
  return __real_calloc(count, size);
}

static side side_of(const char *text) {
  side s = {0};
  pb_error err = {PB_OK, "", ""};
  if (pb_model_parse(text, strlen(text), NULL, NULL, &s.model, &s.map, NULL, &err))
    fail_msg("%s: %s", err.where, err.message);
  assert_non_null(s.map);
  s.state = pb_state_new(s.model);
  assert_non_null(s.state);
  return s;
}

static void side_free(side *s) {
  pb_model_free(s->model);
  pb_motion_map_free(s->map);
  free(s->state);
}

// A plant file of config/plants with a merge patch.
static char *patched(const char *name, const char *patch) {
  char path[512];
  snprintf(path, sizeof path, PB_CONFIG "/plants/%s.json", name);
  return patched_plant(path, patch);
}

static side side_patched(const char *name, const char *patch) {
  char *text = patched(name, patch);
  side s = side_of(text);
  free(text);
  return s;
}

static void shake(side *s, int steps) {
  double u[32];
  for (int k = 0; k < steps; k++) {
    for (size_t i = 0; i < s->model->nu; i++) u[i] = i < 6 ? sin(0.03 * k * (double)(i + 1)) : 0.0;
    pb_step_advance(s->model, s->state, u);
  }
}

static pb_transfer_report carry(side *from, side *to) {
  pb_transfer *t = NULL;
  pb_transfer_report report;
  pb_error err = {PB_OK, "", ""};
  if (pb_transfer_new(from->model, from->map, to->model, to->map, NULL, &t, &err))
    fail_msg("%s: %s", err.where, err.message);
  watching = true;
  pb_transfer_apply(t, from->state, to->state);
  watching = false;
  assert_int_equal(allocations, 0);
  assert_int_equal(pb_transfer_examine(t, &report, &err), PB_OK);
  assert_int_equal(to->state->step, from->state->step);
  pb_transfer_free(t);
  return report;
}

// Largest difference of the outputs with this prefix, relative to the largest of them.
static double jump(const side *a, const side *b, const char *prefix) {
  double ya[64], yb[64], difference = 0.0, size = 0.0;
  pb_step_output(a->model, a->state, ya);
  pb_step_output(b->model, b->state, yb);
  for (size_t o = 0; o < b->model->ny; o++) {
    const char *name = b->model->output[o].name;
    const int was = pb_model_output(a->model, name);
    if (was < 0 || strncmp(name, prefix, strlen(prefix)) != 0) continue;
    difference = fmax(difference, fabs(yb[o] - ya[was]));
    size = fmax(size, fabs(ya[was]));
  }
  assert_true(size > 0.0);
  return difference / size;
}

static void the_same_plant_goes_on_as_it_was(void **state) {
  (void)state;
  side a = side_patched("nano-hexapod", "{}"), b = side_patched("nano-hexapod", "{}");
  shake(&a, 700);
  const pb_transfer_report r = carry(&a, &b);
  for (size_t i = 0; i < a.model->nx + a.model->nu; i++)
    if (!(fabs(a.state->data[i] - b.state->data[i]) < 1e-12)) fail_msg("state %zu", i);
  assert_true(r.energy_before > 0.0);
  assert_true(fabs(r.energy_after / r.energy_before - 1.0) < 1e-10);
  assert_true(r.output_jump < 1e-10);
  side_free(&a);
  side_free(&b);
}

// Stiffness, payload, damping: neither displacements nor velocities jump. Velocities are seen by
// stepping on: the gain of displacement in the next step.
// Forces and volts by another factor: the modes are the same ones, and so is every state.
static void gains_change_and_no_state_does(void **state) {
  (void)state;
  side a = side_patched("nano-hexapod", "{}");
  side b = side_patched("nano-hexapod", "{\"models\":{\"apa300ml\":{\"g_a\":1.3,\"g_s\":1e5}}}");
  shake(&a, 700);
  const pb_transfer_report r = carry(&a, &b);
  assert_memory_equal(a.state->data, b.state->data, a.model->nx * sizeof(double));
  assert_true(r.energy_before > 0.0);
  assert_true(fabs(r.energy_after / r.energy_before - 1.0) < 1e-12);
  assert_true(jump(&a, &b, "dL") < 1e-12);
  side_free(&a);
  side_free(&b);
}

static void parameters_change_and_motion_does_not(void **state) {
  (void)state;
  static const char *const patches[] = {
      "{\"models\":{\"bottom\":{\"k_f\":20}}}",
      "{\"models\":{\"top\":{\"k_a\":2e8,\"k_t\":100}}}",
      "{\"template\":{\"payload\":{\"mass\":25}}}",
      "{\"template\":{\"payload\":{\"mass\":25,\"center_height\":0.25}}}",
      "{\"models\":{\"apa300ml\":{\"c_1\":500}}}",
      "{\"components\":{\"strut3\":{\"k_1\":600000}}}",
      "{\"connections\":{\"bottom_joint2\":{\"joint\":{\"model\":\"bottom\",\"k_f\":30}}}}",
  };
  for (size_t i = 0; i < sizeof patches / sizeof *patches; i++) {
    side a = side_patched("nano-hexapod", "{}"), b = side_patched("nano-hexapod", patches[i]);
    shake(&a, 700);
    carry(&a, &b);
    if (!(jump(&a, &b, "D") < 1e-10 && jump(&a, &b, "R") < 1e-10)) fail_msg("%s", patches[i]);
    side_free(&a);
    side_free(&b);
  }
}

static void a_payload_comes_and_goes(void **state) {
  (void)state;
  side a = side_patched("nano-hexapod", "{\"template\":{\"payload\":null}}");
  side b = side_patched("nano-hexapod", "{}");
  shake(&a, 700);
  carry(&a, &b);
  assert_true(jump(&a, &b, "D") < 1e-10);
  assert_true(jump(&a, &b, "R") < 1e-10);
  carry(&b, &a);
  assert_true(jump(&b, &a, "D") < 1e-10);
  side_free(&a);
  side_free(&b);
}

static void actuators_of_another_kind_keep_the_platform_still(void **state) {
  (void)state;
  side a = side_patched("nano-hexapod-1dof", "{}"), b = side_patched("nano-hexapod", "{}");
  shake(&a, 700);
  carry(&a, &b);
  assert_true(jump(&a, &b, "D") < 1e-2);
  side_free(&a);
  side_free(&b);
}

// --- joints as springs and as elements ---

static char element[64];

static int element_make(void **state) {
  (void)state;
  snprintf(element, sizeof element, "/tmp/pb-transfer-%ld.mat", (long)getpid());
  return beam_joint_write(element);
}

static int element_remove(void **state) {
  (void)state;
  return unlink(element);
}

static void order_changes_and_the_platform_does_not_move(void **state) {
  (void)state;
  char patch[512];
  snprintf(patch, sizeof patch,
           "{\"template\":{\"bottom_joint\":{\"type\":\"super_element\",\"file\":\"%s\",\"nodes\":"
           "[3,1],\"modal_damping\":0.01}}}",
           element);
  side springs = side_patched("nano-hexapod", "{}"), elements = side_patched("nano-hexapod", patch);
  side back = side_patched("nano-hexapod", "{}");
  assert_true(elements.model->nx > 2 * springs.model->nx);
  shake(&springs, 700);
  const pb_transfer_report r = carry(&springs, &elements);
  assert_true(jump(&springs, &elements, "D") < 1e-2);
  assert_true(r.energy_after > 0.5 * r.energy_before && r.energy_after < 2.0 * r.energy_before);
  carry(&elements, &back);
  assert_true(jump(&elements, &back, "D") < 1e-2);
  assert_true(jump(&springs, &back, "D") < 1e-2);
  shake(&back, 2000);
  for (size_t i = 0; i < back.model->nx; i++) assert_true(isfinite(back.state->data[i]));
  side_free(&springs);
  side_free(&elements);
  side_free(&back);
}

// --- two free bodies: what is known in closed form ---

static const char pair_form[] =
    "{\"schema\":\"plantbus.plant/1\",\"name\":\"pair\",\"components\":{"
    "\"a\":{\"type\":\"rigid_body\",\"mass\":2,\"inertia\":[1,1,1]},"
    "\"b\":{\"type\":\"rigid_body\",\"mass\":3,\"inertia\":[1,1,1]}},"
    "\"connections\":{\"joint\":{\"from\":\"a\",\"to\":\"b\",\"joint\":%s}},"
    "\"inputs\":[{\"name\":\"F\",\"type\":\"force\",\"frame\":\"a\",\"direction\":[1,0,0]}],"
    "\"outputs\":[{\"name\":\"va\",\"type\":\"velocity\",\"frame\":\"a\",\"direction\":[1,0,0]},"
    "{\"name\":\"vb\",\"type\":\"velocity\",\"frame\":\"b\",\"direction\":[1,0,0]}]}";

// A joint is locked in motion: both go on with one velocity, and the momentum is what it was.
static void locking_a_joint_conserves_momentum(void **state) {
  (void)state;
  char text[2048];
  double before[2], after[2];
  const double u = 5.0;
  snprintf(text, sizeof text, pair_form,
           "{\"type\":\"bushing\",\"k_s\":1e3,\"k_a\":1e3,\"k_f\":1,\"k_t\":1}");
  side loose = side_of(text);
  snprintf(text, sizeof text, pair_form, "{\"type\":\"weld\"}");
  side welded = side_of(text);
  for (int k = 0; k < 300; k++) pb_step_advance(loose.model, loose.state, &u);
  carry(&loose, &welded);
  pb_step_output(loose.model, loose.state, before);
  pb_step_output(welded.model, welded.state, after);
  const double momentum = 2.0 * before[0] + 3.0 * before[1];
  assert_true(fabs(before[0] - before[1]) > 0.05 * fabs(before[0]));
  assert_true(fabs(after[0] - after[1]) < 1e-12);
  assert_true(fabs(5.0 * after[0] - momentum) < 1e-10 * fabs(momentum));
  side_free(&loose);
  side_free(&welded);
}

static void held_inputs_follow_their_names(void **state) {
  (void)state;
  side a = side_patched("apa300ml-bench", "{}");
  side b = side_patched("apa300ml-bench",
                        "{\"inputs\":[{\"name\":\"F\",\"type\":\"force\",\"frame\":\"mass\","
                        "\"direction\":[0,0,1]},{\"name\":\"Va\",\"type\":\"actuator_voltage\","
                        "\"component\":\"apa\"}]}");
  const double u[2] = {7.0, -3.0};
  for (int k = 0; k < 50; k++) pb_step_advance(a.model, a.state, u);
  carry(&a, &b);
  assert_true(b.state->data[b.model->nx] == -3.0 && b.state->data[b.model->nx + 1] == 7.0);
  assert_true(jump(&a, &b, "y") < 1e-12);
  side_free(&a);
  side_free(&b);
}

// --- residual pairs of velocities and accelerations above max_frequency ---

#define SEEN                                                                                      \
  "\"outputs\":[{\"name\":\"a\",\"type\":\"acceleration\",\"frame\":\"mass\",\"direction\":[0,0," \
  "1]},"                                                                                          \
  "{\"name\":\"v\",\"type\":\"velocity\",\"frame\":\"mass\",\"direction\":[0,0,1]}]"

static double largest_of(const side *s) {
  double y[2];
  pb_step_output(s->model, s->state, y);
  return fmax(fabs(y[0]), fabs(y[1]));
}

// At rest under held inputs, whose order changes with the limit: nothing begins to ring.
static void residual_pairs_rest_under_what_is_held(void **state) {
  (void)state;
  side whole =
      side_patched("apa300ml-bench", "{\"models\":{\"apa300ml\":{\"c_1\":2000}}," SEEN "}");
  side cut = side_patched("apa300ml-bench",
                          "{\"max_frequency\":20,\"models\":{\"apa300ml\":{\"c_1\":2000}}," SEEN
                          ",\"inputs\":[{\"name\":\"F\",\"type\":\"force\",\"frame\":\"mass\","
                          "\"direction\":[0,0,1]},{\"name\":\"Va\",\"type\":\"actuator_voltage\","
                          "\"component\":\"apa\"}]}");
  const double u[2] = {70, -3}, turned[2] = {-3, 70};
  double most = 0;
  assert_int_equal(cut.model->nx, 4);  // nothing but the two pairs
  for (int k = 0; k < 100000; k++) {
    pb_step_advance(whole.model, whole.state, u);
    most = fmax(most, largest_of(&whole));
  }
  carry(&whole, &cut);
  for (int k = 0; k < 100; k++) {
    assert_true(largest_of(&cut) < 1e-9 * most);
    pb_step_advance(cut.model, cut.state, turned);
  }
  side again = side_patched(
      "apa300ml-bench", "{\"max_frequency\":20,\"models\":{\"apa300ml\":{\"c_1\":2000}}," SEEN "}");
  carry(&cut, &again);
  for (int k = 0; k < 100; k++) {
    assert_true(largest_of(&again) < 1e-9 * most);
    pb_step_advance(again.model, again.state, u);
  }
  side_free(&whole);
  side_free(&cut);
  side_free(&again);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(the_same_plant_goes_on_as_it_was),
      cmocka_unit_test(gains_change_and_no_state_does),
      cmocka_unit_test(parameters_change_and_motion_does_not),
      cmocka_unit_test(a_payload_comes_and_goes),
      cmocka_unit_test(actuators_of_another_kind_keep_the_platform_still),
      cmocka_unit_test(order_changes_and_the_platform_does_not_move),
      cmocka_unit_test(locking_a_joint_conserves_momentum),
      cmocka_unit_test(held_inputs_follow_their_names),
      cmocka_unit_test(residual_pairs_rest_under_what_is_held),
  };
  return cmocka_run_group_tests(tests, element_make, element_remove);
}
