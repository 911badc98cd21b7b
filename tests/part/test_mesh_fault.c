// Every allocation from part file to full model, and of the characteristics, fails once: each time
// the call reports it, hands nothing out and leaks nothing (the sanitizers' build sees to that).
#include "base/json.h"
#include "part/characteristics.h"
#include "support/check.h"
#include "support/faults.h"

typedef pb_status (*subject)(const cJSON *json, pb_error *err);

static pb_status mesh_only(const cJSON *json, pb_error *err) {
  pb_part read;
  pb_mesh mesh = {0};
  pb_status st = pb_part_read(json, &read, err);
  if (!st) st = pb_part_mesh(&read, &mesh, err);
  if (st) assert_null(mesh.xyz);
  pb_mesh_clear(&mesh);
  pb_part_clear(&read);
  return st;
}

static pb_status model(const cJSON *json, pb_error *err) {
  pb_part read;
  pb_mesh mesh = {0};
  pb_fem fem = {0};
  pb_status st = pb_part_read(json, &read, err);
  if (!st) read.density = 0.5;
  if (!st) st = pb_part_mesh(&read, &mesh, err);
  if (st) assert_null(mesh.xyz);
  if (!st) st = pb_part_model(&read, &mesh, &fem, err);
  if (st) assert_null(fem.xyz);
  pb_fem_clear(&fem);
  pb_mesh_clear(&mesh);
  pb_part_clear(&read);
  return st;
}

static pb_part part;
static pb_reduction *element;

static void make_element(const cJSON *json) {
  pb_mesh mesh;
  pb_fem fem;
  pb_reduce_options options = {.modes = 2};
  REQUIRE(pb_part_read(json, &part, &err));
  part.density = 0.5;
  REQUIRE(pb_part_mesh(&part, &mesh, &err));
  REQUIRE(pb_part_model(&part, &mesh, &fem, &err));
  REQUIRE(pb_reduce(&fem, &options, false, &element, &err));
  pb_fem_clear(&fem);
  pb_mesh_clear(&mesh);
}

// Of an element made once, before anything fails.
static pb_status characteristics(const cJSON *json, pb_error *err) {
  pb_characteristic value[PB_CHARACTERISTICS];
  size_t count;
  if (!element) {
    long kept = failing;
    failing = 0;
    make_element(json);
    failing = kept, allocations = 0;
  }
  pb_status st = pb_part_characteristics(&part, element, value, &count, err);
  if (st) {
    assert_int_equal(count, 0);
  } else {
    pb_reduction_free(element);
    pb_part_clear(&part);
    element = NULL;
  }
  return st;
}

// Fails allocation 1, 2, … until the subject succeeds without one failing.
static void fail_each(subject call, const char *name, long least) {
  char path[512];
  cJSON *json = NULL;
  snprintf(path, sizeof path, "%s/parts/%s.json", PB_CONFIG, name);
  failing = 0;
  REQUIRE(pb_json_read(path, &json, NULL, &err));
  for (failing = 1;; failing++) {
    pb_error error = {0};
    allocations = 0;
    pb_status st = call(json, &error);
    bool reached = allocations >= failing;
    long at = failing;
    failing = 0;
    if (!st && reached) fail_msg("%s: allocation %ld failed and nobody noticed", name, at);
    if (st && !reached) fail_msg("%s: failed by itself: %s", name, error.message);
    if (st) assert_int_equal(st, PB_ERR_MEMORY);
    failing = at;
    if (!st) break;
  }
  assert_true(failing > least);
  failing = 0;
  cJSON_Delete(json);
}

static void test_joint_model(void **state) {
  (void)state;
  fail_each(model, "flexible-joint", 20);
}

static void test_actuator_mesh(void **state) {
  (void)state;
  fail_each(mesh_only, "apa300ml", 10);
}

static void test_characteristics(void **state) {
  (void)state;
  fail_each(characteristics, "apa300ml", 6);
  fail_each(characteristics, "flexible-joint", 2);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_joint_model),
      cmocka_unit_test(test_actuator_mesh),
      cmocka_unit_test(test_characteristics),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
