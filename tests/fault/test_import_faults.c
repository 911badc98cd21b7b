// Every allocation of the readers of outside files, of the doctor and of the truncation fails once:
// each time the call reports it, hands nothing out and leaks nothing.
#include "support/beam.h"
#include "support/check.h"
#include "support/faults.h"
#include "support/outside.h"

#include "part/import.h"
#include "part/truncate.h"
#include "plant/element_doctor.h"

static char folder[] = "/tmp/pb-faults-XXXXXX";
static outside_element element;

typedef pb_status subject(const char *name, pb_error *err);

// Fails allocation 1, 2, … until the subject succeeds without one failing.
static void fail_each(subject *call, const char *name, long least) {
  for (failing = 1;; failing++) {
    pb_error err = {0};
    allocations = 0;
    pb_status st = call(name, &err);
    bool reached = allocations >= failing;
    long at = failing;
    if (st == PB_OK && !reached) break;
    failing = 0;
    if (!st) fail_msg("%s: allocation %ld failed and nobody noticed", name, at);
    if (!reached) fail_msg("%s: failed by itself: %s: %s", name, err.where, err.message);
    if (st != PB_ERR_MEMORY) fail_msg("%s: allocation %ld: '%s'", name, at, err.message);
    failing = at;
  }
  long count = failing - 1;
  failing = 0;
  print_message("%s: %ld allocations failed in turn\n", name, count);
  assert_true(count >= least);
}

static const char *path_of(const char *name) {
  static char path[2][256];
  static int turn;
  turn = !turn;
  snprintf(path[turn], sizeof path[turn], "%s/%s", folder, name);
  return path[turn];
}

static pb_status read_matrix(const char *name, pb_error *err) {
  pb_matrix_file f;
  pb_sparse s = {0};
  const char *path = path_of(name);
  pb_status st = pb_matrix_file_read(path, NULL, &f, err);
  if (!st) st = pb_matrix_file_symmetric(&f, path, &s, err);
  if (st) assert_null(s.start);
  pb_sparse_clear(&s);
  pb_matrix_file_clear(&f);
  return st;
}

static void test_readers(void **state) {
  (void)state;
  for (const outside_form *form = outside_forms; form->name; form++) {
    form->write(path_of(form->name), 'K', element.k);
    // What matio makes of a failing allocation is its own affair: it says that the file is damaged.
    if (strcmp(form->kind, "MAT v5") != 0) fail_each(read_matrix, form->name, 5);
  }
}

static pb_status import(const char *name, pb_error *err) {
  char nodes[256];
  snprintf(nodes, sizeof nodes, "%s/nodes.txt", folder);
  const char *path = path_of(name);
  const pb_import_request r = {.k_file = path,
                               .m_file = path,
                               .node_file = nodes,
                               .modal = -1,
                               .length = 1,
                               .force = 1,
                               .time = 1};
  pb_import got;
  pb_status st = pb_import_read(&r, &got, err);
  if (st) assert_null(got.element.k);
  pb_import_clear(&got);
  return st;
}

static void test_import(void **state) {
  (void)state;
  assert_int_equal(outside_write_both("print", path_of("both"), &element), 0);
  outside_write_listing(path_of("nodes.txt"), &element, 4, 0, 1);
  fail_each(import, "both", 20);
}

static pb_status doctor(const char *name, pb_error *err) {
  pb_element_data cured, e = {.frames = OUTSIDE_FRAMES,
                              .size = OUTSIDE_SIZE,
                              .position = element.position,
                              .k = element.k,
                              .m = element.m};
  pb_diagnosis d;
  pb_element_held held;
  static const double z[3] = {0, 0, 1};
  pb_status st = pb_element_diagnose(name, &e, NULL, &d, &cured, err);
  if (st) assert_null(cured.k);
  pb_element_data_clear(&cured);
  return st ? st : pb_element_hold(name, &e, 0, 1, z, &held, err);
}

static void test_doctor(void **state) {
  (void)state;
  fail_each(doctor, "sound", 10);
  for (size_t i = 0; i < 3; i++) {
    double keep = element.position[i];
    element.position[i] = element.position[3 + i];
    element.position[3 + i] = keep;
  }
  fail_each(doctor, "swapped", 15);
  for (size_t i = 0; i < (size_t)OUTSIDE_SIZE * OUTSIDE_SIZE; i++)
    element.k[i] = (double)(float)element.k[i], element.m[i] = (double)(float)element.m[i];
  fail_each(doctor, "swapped and rounded", 20);
}

static pb_status truncation(const char *name, pb_error *err) {
  static const beam steel = {
      .length = 0.2, .ea = 2e7, .ei = 50, .gj = 40, .mass = 0.16, .polar_inertia = 4e-6};
  enum { SIZE = 6 * 6 };
  static double k[SIZE * SIZE], m[SIZE * SIZE], position[3 * 6];
  beam_chain(&steel, 5, k, m, position);
  const pb_element_data e = {.frames = 4, .size = SIZE, .position = position, .k = k, .m = m};
  const pb_truncate_options o = {
      .high_hz = 3000, .modes = 3, .tip = 3, .stacks = true, .actuator = {1, 2}, .sensor = {0, 1}};
  pb_truncation t;
  pb_status st = pb_element_truncate(name, &e, &o, &t, err);
  if (st) assert_null(t.element.k);
  pb_truncation_clear(&t);
  return st;
}

static void test_truncation(void **state) {
  (void)state;
  fail_each(truncation, "truncation", 100);
}

static int begin(void **state) {
  (void)state;
  outside_make(&element);
  return mkdtemp(folder) ? 0 : -1;
}

static int end(void **state) {
  (void)state;
  char command[300];
  snprintf(command, sizeof command, "rm -r %s", folder);
  return system(command);
}

int main(void) {
  only_growth_fails = true;  // giving memory back cannot hurt whoever asks
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_readers),
      cmocka_unit_test(test_import),
      cmocka_unit_test(test_truncation),
      cmocka_unit_test(test_doctor),
  };
  return cmocka_run_group_tests(tests, begin, end);
}
