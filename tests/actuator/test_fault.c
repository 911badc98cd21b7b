// Every allocation of characterising and tuning an actuator fails once: each time the call reports
// it and hands nothing out (the sanitizers' build sees to what would leak).
#include "base/json.h"
#include "study/actuator_character.h"
#include "study/actuator_fit.h"
#include "study/element_limits.h"
#include "study/joint_character.h"
#include "support/beam.h"
#include "support/check.h"
#include "support/faults.h"

typedef pb_status (*subject)(pb_error *err);

// Fails allocation 1, 1 + stride, … until the subject succeeds without one failing.
static void fail_each(subject call, long stride, const char *name) {
  for (failing = 1;; failing += stride) {
    pb_error err = {0};
    allocations = 0;
    const pb_status st = call(&err);
    const bool reached = allocations >= failing;
    const long at = failing;
    failing = 0;
    if (!st && reached) fail_msg("%s: allocation %ld failed and nobody noticed", name, at);
    if (st && !reached) fail_msg("%s: failed by itself: %s: %s", name, err.where, err.message);
    if (st && !err.message[0]) fail_msg("%s: a failure without a message", name);
    failing = at;
    if (!st) break;
  }
  print_message("%s: up to %ld allocations failed\n", name, failing - 1);
  assert_true(failing > 20);
  failing = 0;
}

static const char actuator_plant[] = "{\"models\":{\"apa\":{\"type\":\"apa_2dof\",\"k_1\":3e5,\"c_"
                                     "1\":18,\"k_a\":2.15e6,\"c_a\":0.35,"
                                     "\"k_e\":4.3e6,\"c_e\":0.7,\"g_a\":2.7,\"g_s\":5.3e5,\"mass\":"
                                     "0.112,\"intermediate_mass\":0.001,"
                                     "\"length\":0.03,\"radius\":0.02}}}";

static pb_status source(pb_element_source *out, pb_error *err) {
  return pb_element_source_plant(actuator_plant, "plant", NULL, NULL, pb_element_is_actuator, out,
                                 err);
}

static pb_status characterize(pb_error *err) {
  const pb_stack_nominal nominal = {.stroke = 20e-6, .length = 0.02};
  pb_element_source s = {0};
  pb_bench_model bench = {0};
  pb_actuator_character c;
  pb_status st = source(&s, err);
  if (!st) st = pb_actuator_characterize(&s, &nominal, NULL, &bench, &c, err);
  if (st) assert_null(bench.model);
  pb_bench_model_clear(&bench);
  pb_element_source_clear(&s);
  return st;
}

static char column_file[64];

static pb_status characterize_element(pb_error *err) {
  const pb_stack_nominal nominal = {.stroke = 20e-6, .length = 0.02};
  const pb_actuator_layout layout = {.ends = {1, 5},
                                     .actuator = {2, 3},
                                     .sensor = {3, 4},
                                     .axis = {0, 0, 1},
                                     .polarity = 1,
                                     .g_a = 1,
                                     .g_s = 1};
  pb_element_source s = {0};
  pb_bench_model bench = {0};
  pb_actuator_character c;
  pb_status st = pb_element_source_actuator(column_file, &layout, &s, err);
  if (!st) st = pb_actuator_characterize(&s, &nominal, NULL, &bench, &c, err);
  pb_bench_model_clear(&bench);
  pb_element_source_clear(&s);
  return st;
}

static pb_status fit(pb_error *err) {
  enum { LINES = 60 };
  const pb_actuator_bench options = {.load = 5};
  const pb_apa_refine_options refine = {2, 300, true};
  double hz[LINES];
  pb_element_source s = {0};
  pb_bench_model bench = {0};
  pb_apa_data data = {0};
  pb_apa_landmarks l;
  pb_apa_2dof apa;
  pb_apa_match match = {0};
  pb_apa_refine_report report;
  for (int i = 0; i < LINES; i++) hz[i] = 1 + 5 * i;
  pb_status st = source(&s, err);
  if (!st) st = pb_actuator_bench_build(&s, &options, NULL, &bench, err);
  if (!st) st = pb_apa_data_of_model(bench.model, hz, LINES, &data, err);
  if (!st) st = pb_apa_landmarks_of_model(bench.model, &l, err);
  if (!st) st = pb_apa_from_landmarks(&l, 0, 5.056, 1e-3, 2, &apa, err);
  if (!st) st = pb_apa_refine(&data, &refine, &apa, &report, err);
  if (!st) st = pb_apa_match_find(&data, &apa, l.pole_hz, 0.2, &match, err);
  pb_apa_match_clear(&match);
  pb_apa_data_clear(&data);
  pb_bench_model_clear(&bench);
  pb_element_source_clear(&s);
  return st;
}

static pb_status joint(pb_error *err) {
  const size_t nodes[2] = {1, 5};
  pb_element_source s = {0};
  pb_bench_model bench = {0};
  pb_joint_character c;
  pb_status st = pb_element_source_joint(column_file, nodes, 0.01, &s, err);
  if (!st) st = pb_joint_characterize(&s, NULL, &bench, &c, err);
  pb_bench_model_clear(&bench);
  pb_element_source_clear(&s);
  return st;
}

static void the_2dof_actuator(void **state) {
  (void)state;
  fail_each(characterize, 1, "characterize");
  fail_each(fit, 1, "fit");
}

// matio allocates too, and not all of its failures can be told from a missing variable.
static void elements(void **state) {
  (void)state;
  enum { PARTS = 4, FRAMES = PARTS + 1, SIZE = 6 * FRAMES };
  static double k[SIZE * SIZE], m[SIZE * SIZE], position[3 * FRAMES];
  const beam column = {
      .length = 0.08, .ea = 4.7e6, .ei = 40, .gj = 30, .mass = 0.1, .polar_inertia = 2e-6};
  snprintf(column_file, sizeof column_file, "/tmp/pb-fault-%d.mat", (int)getpid());
  beam_chain(&column, PARTS, k, m, position);
  assert_int_equal(beam_write(column_file, FRAMES, SIZE, k, m, position), 0);
  fail_each(characterize_element, 3, "an element");
  fail_each(joint, 3, "a joint");
  unlink(column_file);
}

int main(void) {
  cJSON_Hooks hooks = {__wrap_malloc, free};
  cJSON_InitHooks(&hooks);
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(the_2dof_actuator),
      cmocka_unit_test(elements),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
