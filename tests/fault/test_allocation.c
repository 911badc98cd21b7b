// Every allocation of loading, assembling and compiling a plant fails once: each time the call
// reports it, hands nothing out and leaks nothing (the sanitizers' build sees to the latter).
#include "support/beam.h"
#include "support/check.h"
#include "support/faults.h"

#include "assembly/system.h"
#include "base/json.h"
#include "base/text.h"
#include "control/hac.h"
#include "control/jacobian.h"
#include "control/loop.h"
#include "control/margins.h"
#include "model/model.h"
#include "model/transfer.h"
#include "signal/psd.h"

typedef pb_status (*subject)(const char *input, pb_error *err);

// Runs the subject failing allocation 1, 2, … until it succeeds without one failing.
static void fail_each(subject call, const char *input, const char *name) {
  for (failing = 1;; failing++) {
    pb_error err = {0};
    allocations = 0;
    pb_status st = call(input, &err);
    bool reached = allocations >= failing;
    if (!st && reached) {
      failing = 0;
      fail_msg("%s: allocation %ld failed and nobody noticed", name, allocations);
    }
    if (st && !reached) {
      failing = 0;
      fail_msg("%s: failed by itself: %s: %s", name, err.where, err.message);
    }
    if (st && !err.message[0]) fail_msg("%s: a failure without a message", name);
    if (!st) break;
  }
  print_message("%s: %ld allocations failed in turn\n", name, failing - 1);
  assert_true(failing > 20);
  failing = 0;
}

static pb_status load(const char *path, pb_error *err) {
  pb_warnings warnings = {0};
  pb_model *model = NULL;
  pb_status st = pb_model_load(path, &warnings, &model, err);
  if (st && model) fail_msg("a model was handed out in spite of %s", err->message);
  pb_model_free(model);
  pb_warnings_clear(&warnings);
  return st;
}

static pb_status pack_and_truncate(const char *path, pb_error *err) {
  static pb_model *model, *copy;
  double *data = NULL;
  size_t count;
  if (!model) {
    long kept = failing;
    failing = 0;
    pb_status st = pb_model_load(path, NULL, &model, err);
    failing = kept, allocations = 0;
    if (st) return st;
  }
  const char *in[] = {"a", "b"}, *unit[] = {"V", "N"};
  pb_status st = pb_model_pack(model, &data, &count, err);
  if (!st) st = pb_model_unpack(data, count, "copy", in, unit, in, unit, &copy, err);
  if (!st) pb_model_free(copy);
  if (!st) st = pb_model_truncate(model, 1000, &copy, err);
  if (!st) pb_model_free(copy);
  free(data);
  if (!st) {
    pb_model_free(model);
    model = NULL;
  }
  return st;
}

static void test_bench(void **state) {
  (void)state;
  fail_each(load, PB_CONFIG "/plants/apa300ml-bench.json", "apa300ml-bench");
}

static void test_bench_electronics(void **state) {
  (void)state;
  fail_each(load, PB_CONFIG "/plants/apa300ml-bench-electronics.json",
            "apa300ml-bench-electronics");
}

static void test_bench_resistor(void **state) {
  (void)state;
  fail_each(load, PB_TEST_DATA "/resistor-bench.json", "resistor-bench");
}

static void test_hexapod(void **state) {
  (void)state;
  fail_each(load, PB_CONFIG "/plants/nano-hexapod.json", "nano-hexapod");
}

// An element as component and as joint, a massless body, damping of both kinds.
static void test_elements(void **state) {
  (void)state;
  static const beam steel = {
      .length = 0.1, .ea = 2e7, .ei = 50, .gj = 40, .mass = 0.08, .polar_inertia = 2e-6};
  static const char *const text =
      "{\"schema\": \"plantbus.plant/1\", \"name\": \"t\", \"models\": {\"e\": {\"type\": "
      "\"super_element\", \"file\": \"pb-fault.mat\", \"modal_damping\": 0.01}}, \"components\": "
      "{\"beam\": {\"model\": \"e\", \"rayleigh\": {\"alpha\": 1, \"beta\": 1e-6}, \"frames\": "
      "{\"tip\": {\"node\": 2, \"offset\": [0, 0, 0.01]}}, \"stacks\": {\"actuator\": {\"frames\": "
      "[\"1\", \"2\"], \"axis\": [0, 0, 1]}}, \"g_a\": 1, \"ends\": [1, 2]}, \"a\": {\"type\": "
      "\"rigid_body\", \"mass\": 1, \"inertia\": [1, 1, 1], \"position\": [0, 0, 0.21]}, \"b\": "
      "{\"type\": \"rigid_body\", \"mass\": 0, \"inertia\": [0, 0, 0], \"position\": [0, 0, "
      "0.21]}}, "
      "\"connections\": {\"w\": {\"from\": \"ground\", \"to\": \"beam.1\", \"joint\": {\"type\": "
      "\"weld\"}}, \"j\": {\"from\": \"beam.tip\", \"to\": \"a\", \"joint\": {\"model\": \"e\", "
      "\"nodes\": [1, 2]}}, \"k\": "
      "{\"from\": \"a\", \"to\": \"b\", \"joint\": {\"type\": \"prismatic\", \"k_a\": 5}}}, "
      "\"inputs\": [{\"name\": \"V\", \"type\": \"actuator_voltage\", \"component\": \"beam\"}], "
      "\"outputs\": [{\"name\": \"x\", \"type\": \"acceleration\", \"frame\": \"b\", "
      "\"direction\": [1, 0, 0]}]}";
  double k[144], m[144], position[6];
  char directory[] = "/tmp/pb-fault-XXXXXX", plant[64], element[64];
  assert_non_null(mkdtemp(directory));
  snprintf(plant, sizeof plant, "%s/plant.json", directory);
  snprintf(element, sizeof element, "%s/pb-fault.mat", directory);
  beam_matrices(&steel, k, m, position);
  position[2] = 0, position[5] = 0.1;
  assert_int_equal(beam_write(element, 2, 12, k, m, position), 0);
  FILE *file = fopen(plant, "w");
  assert_non_null(file);
  fputs(text, file);
  fclose(file);
  fail_each(load, plant, "elements");
  unlink(plant), unlink(element), rmdir(directory);
}

// A loop around a plant with electronics: its solver, its state space.
static pb_status loop_solver(const char *path, pb_error *err) {
  pb_model *model = NULL;
  pb_lti controller = {0}, closed = {0};
  pb_loop_solver *solver = NULL;
  const size_t zero = 0;
  pb_status st = pb_model_load(path, NULL, &model, err);
  if (!st) st = pb_lti_new(0, 1, 1, 1 / model->sample_rate, &controller, err);
  if (!st) {
    const pb_loop loop = {model, &controller, &zero, &zero, 1, 1};
    bool stable;
    st = pb_loop_solver_new(&loop, &solver, err);
    if (!st) st = pb_loop_solver_stable(solver, 1, &stable, NULL, err);
    if (!st) st = pb_loop_closed(&loop, 1, &closed, err);
  }
  pb_loop_solver_free(solver);
  pb_lti_free(&closed);
  pb_lti_free(&controller);
  pb_model_free(model);
  return st;
}

// HAC around one strut: shape, plant, gain, controllers, margins.
static pb_status hac(const pb_model *model, pb_lti *shape, pb_lti *controller, pb_lti *both,
                     pb_mimo *mimo, double **grid, pb_error *err) {
  const size_t input = 0, output = 1;
  const pb_hac_channels channels = {1, &input, NULL, &output};
  const pb_hac_frame frame = {0};
  const pb_hac_shape wanted = pb_hac_shape_default(100, 1e4);
  pb_pole pole = {0, 90, 0.01};
  const pb_pole_list poles = {.count = 1, .item = &pole};
  double complex plant[64], l[64];
  double gain;
  size_t count;
  pb_status st = pb_hac_shape_discrete(&wanted, model->sample_rate, shape, err);
  if (!st) st = pb_margins_grid(60, 140, 6, &poles, grid, &count, err);
  if (!st) st = pb_hac_plant(model, &channels, &frame, NULL, 0, *grid, count, plant, err);
  if (!st) st = pb_hac_gains(shape, *grid, count, plant, plant, 1, false, &gain, err);
  if (!st) st = pb_hac_controller(shape, &gain, &frame, 1, controller, err);
  if (!st) st = pb_hac_combine(controller, 1, controller, 0, 1, both, err);
  if (!st) st = pb_hac_loop_gain(shape, &gain, 0, *grid, count, 1, plant, l, err);
  return st ? st : pb_mimo_analyse(*grid, count, 1, l, mimo, err);
}

static pb_status hac_design(const char *path, pb_error *err) {
  const size_t force = 1, output = 1;
  pb_model *model = NULL;
  pb_lti shape = {0}, controller = {0}, both = {0};
  pb_mimo mimo = {0};
  pb_psd *psd = NULL;
  double *grid = NULL, j, inverse, condition;
  pb_status st = pb_model_load(path, NULL, &model, err);
  if (!st) st = hac(model, &shape, &controller, &both, &mimo, &grid, err);
  if (!st) st = pb_jacobian_static(model, &output, &output, &force, 1, &j, err);
  if (!st) st = pb_jacobian_invert(&j, 1, &inverse, &condition, err);
  if (!st) st = pb_psd_new(1000, 64, PB_WINDOW_HANN, &psd, err);
  pb_psd_free(psd);
  pb_mimo_clear(&mimo);
  pb_lti_free(&shape);
  pb_lti_free(&controller);
  pb_lti_free(&both);
  free(grid);
  pb_model_free(model);
  return st;
}

// A plant and a changed one with their maps, and the way from one to the other.
static pb_status transfer(const char *path, pb_error *err) {
  pb_model *from = NULL, *to = NULL;
  pb_motion_map *from_map = NULL, *to_map = NULL;
  pb_transfer *way = NULL;
  pb_transfer_report report;
  char *text = NULL, *canonical = NULL;
  size_t length;
  pb_status st = pb_text_read(path, &text, &length, err);
  if (!st) st = pb_model_parse(text, length, NULL, NULL, &from, &from_map, &canonical, err);
  if (!st) st = pb_model_parse(text, length, NULL, NULL, &to, &to_map, NULL, err);
  if (!st) st = pb_transfer_new(from, from_map, to, to_map, NULL, &way, err);
  if (!st) st = pb_transfer_examine(way, &report, err);
  pb_transfer_free(way);
  pb_motion_map_free(from_map);
  pb_motion_map_free(to_map);
  pb_model_free(from);
  pb_model_free(to);
  free(canonical);
  free(text);
  return st;
}

static void test_transfer(void **state) {
  (void)state;
  fail_each(transfer, PB_CONFIG "/plants/apa300ml-bench-electronics.json", "transfer");
}

static void test_loop(void **state) {
  (void)state;
  fail_each(loop_solver, PB_CONFIG "/plants/apa300ml-bench-electronics.json",
            "loop with electronics");
}

static void test_hac(void **state) {
  (void)state;
  fail_each(hac_design, PB_CONFIG "/plants/apa300ml-bench.json", "HAC");
}

static void test_pack_and_truncate(void **state) {
  (void)state;
  fail_each(pack_and_truncate, PB_CONFIG "/plants/apa300ml-bench.json", "pack and truncate");
  fail_each(pack_and_truncate, PB_CONFIG "/plants/apa300ml-bench-electronics.json",
            "pack and truncate with electronics");
}

int main(void) {
  cJSON_Hooks hooks = {__wrap_malloc, free};
  cJSON_InitHooks(&hooks);
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_bench),
      cmocka_unit_test(test_bench_electronics),
      cmocka_unit_test(test_bench_resistor),
      cmocka_unit_test(test_hexapod),
      cmocka_unit_test(test_elements),
      cmocka_unit_test(test_transfer),
      cmocka_unit_test(test_loop),
      cmocka_unit_test(test_pack_and_truncate),
      cmocka_unit_test(test_hac),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
