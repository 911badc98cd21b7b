// Elements out of other programs' files: rows by labels, masters, lists; and what does not fit.
#include "support/check.h"
#include "support/outside.h"

#include "part/import.h"

enum { N = OUTSIDE_SIZE, FRAMES = OUTSIDE_FRAMES };

static char folder[] = "/tmp/pb-import-XXXXXX";
static outside_element element;
static char k_path[200], m_path[200], node_path[200];

static pb_import_request request(void) {
  return (pb_import_request){.k_file = k_path,
                             .m_file = m_path,
                             .node_file = node_path,
                             .modal = -1,
                             .length = 1,
                             .force = 1,
                             .time = 1};
}

static const outside_form *form_of(const char *name) {
  for (const outside_form *f = outside_forms; f->name; f++)
    if (!strcmp(f->name, name)) return f;
  fail_msg("no form %s", name);
  return NULL;
}

static void write_pair(const char *name) {
  const outside_form *form = form_of(name);
  snprintf(k_path, sizeof k_path, "%s/K-%s", folder, name);
  snprintf(m_path, sizeof m_path, "%s/M-%s", folder, name);
  form->write(k_path, 'K', element.k);
  form->write(m_path, 'M', element.m);
}

// masters: as of outside_write_listing; 0: only the frames are listed.
static void write_nodes(int masters) {
  snprintf(node_path, sizeof node_path, "%s/nodes.txt", folder);
  if (masters) {
    outside_write_listing(node_path, &element, 4, 0, masters);
    return;
  }
  FILE *f = fopen(node_path, "w");
  assert_non_null(f);
  fprintf(f, "node,x,y,z\n");
  for (int i = 0; i < FRAMES; i++)
    fprintf(f, "%ld,%.17g,%.17g,%.17g\n", element.node[i], element.position[3 * i],
            element.position[3 * i + 1], element.position[3 * i + 2]);
  fclose(f);
}

// order: which frame of the element each frame of the import is.
static void compare(const pb_import *got, const size_t *order, double digits, const char *name) {
  assert_int_equal(got->element.frames, FRAMES);
  assert_int_equal(got->element.size, N);
  for (size_t j = 0; j < N; j++) {
    size_t fj = j < 18 ? 6 * order[j / 6] + j % 6 : j;
    for (size_t i = 0; i < N; i++) {
      size_t fi = i < 18 ? 6 * order[i / 6] + i % 6 : i;
      double k = outside_entry(element.k, fi, fj), m = outside_entry(element.m, fi, fj);
      if (fabs(got->element.k[i + j * N] - k) > digits * fabs(k) ||
          fabs(got->element.m[i + j * N] - m) > digits * fabs(m))
        fail_msg("%s: entry (%zu, %zu) differs", name, i, j);
    }
  }
  for (size_t f = 0; f < FRAMES; f++) {
    assert_int_equal(got->node[f], element.node[order[f]]);
    for (size_t a = 0; a < 3; a++)
      ASSERT_NEAR(got->element.position[3 * f + a], element.position[3 * order[f] + a], 1e-12);
  }
}

static const size_t natural[] = {0, 1, 2};

static void test_every_format(void **state) {
  (void)state;
  write_nodes(0);
  for (const outside_form *form = outside_forms; form->name; form++) {
    pb_import got;
    pb_import_request r = request();
    write_pair(form->name);
    r.modal = OUTSIDE_MODES;
    REQUIRE(pb_import_read(&r, &got, &err));
    compare(&got, natural, form->digits, form->name);
    assert_string_equal(got.rows_by, form->labelled ? "labels" : "the list of nodes");
    assert_string_equal(pb_matrix_format_name(got.k.format), form->kind);
    pb_import_clear(&got);
  }
}

// K and M in one file, masters and nodes in one listing whose other nodes are no masters.
static void test_one_file(void **state) {
  (void)state;
  static const char *const form[] = {"print", "dmig-large", "abaqus-user-element"};
  for (int k = 0; k < 3; k++) {
    pb_import got;
    pb_import_request r = request();
    write_nodes(k % 2 ? 1 : -1);
    snprintf(k_path, sizeof k_path, "%s/both", folder);
    assert_int_equal(outside_write_both(form[k], k_path, &element), 0);
    r.m_file = k_path;
    if (k == 2) r.modal = OUTSIDE_MODES;  // its points 9001, 9002 have directions
    REQUIRE(pb_import_read(&r, &got, &err));
    compare(&got, natural, 1e-9, form[k]);
    assert_int_equal(got.listed, 2 * FRAMES);
    assert_string_equal(got.rows_by, k ? "labels" : "the list of masters");
    pb_import_clear(&got);
  }
}

static void test_order(void **state) {
  (void)state;
  static const int64_t wanted[] = {300, 101, 205};
  static const size_t order[] = {2, 0, 1};
  pb_import got;
  pb_import_request r = request();
  write_nodes(1);
  write_pair("dmig-large.pch");
  r.frames = 3;
  r.frame = wanted;
  REQUIRE(pb_import_read(&r, &got, &err));
  compare(&got, order, 1e-9, "order");
  pb_import_clear(&got);
}

static void test_units(void **state) {
  (void)state;
  pb_import got;
  pb_import_request r = request();
  write_nodes(0);
  write_pair("market-symmetric.mtx");
  r.modal = OUTSIDE_MODES;
  r.length = 1e-3;
  REQUIRE(pb_import_read(&r, &got, &err));
  ASSERT_RELATIVE(got.element.k[0], 1e3 * element.k[0], 1e-12);
  ASSERT_RELATIVE(got.element.k[4 + 4 * N], 1e-3 * element.k[4 + 4 * N], 1e-12);
  ASSERT_RELATIVE(got.element.m[18 + 18 * N], 1, 1e-12);
  ASSERT_RELATIVE(got.element.k[18 + 18 * N], element.k[18 + 18 * N], 1e-12);
  ASSERT_NEAR(got.element.position[2], 1e-3 * element.position[2], 1e-15);
  pb_import_clear(&got);
}

static void refuse(const pb_import_request *r, const char *message) {
  pb_import got;
  pb_error err = {0};
  pb_status st = pb_import_read(r, &got, &err);
  if (!st) fail_msg("read in spite of: %s", message);
  if (!strstr(err.message, message)) fail_msg("'%s' does not say '%s'", err.message, message);
  assert_null(got.element.k);
  assert_null(got.node);
}

static void write_text(char path[200], const char *name, const char *text) {
  snprintf(path, 200, "%s/%s", folder, name);
  FILE *f = fopen(path, "w");
  assert_non_null(f);
  fputs(text, f);
  fclose(f);
}

static void test_refusals(void **state) {
  (void)state;
  static const int64_t two[] = {101, 205}, strange[] = {101, 205, 999};
  pb_import_request r = request();
  write_nodes(0);
  write_pair("market-symmetric.mtx");
  refuse(&r, "--modal 2, if those are modes");
  r.modal = 5;
  refuse(&r, "2 modal coordinates, but --modal says 5");
  r.node_file = NULL;
  refuse(&r, "coordinates are missing");
  r = request(), r.modal = 2, r.frames = 3, r.frame = strange;
  refuse(&r, "frame 999 is not among the nodes");
  r = request(), r.modal = 2, r.half = true;
  write_pair("market-general.mtx");
  refuse(&r, "both sides of the diagonal");

  write_pair("dmig-large.pch");
  r = request(), r.frames = 2, r.frame = two;
  refuse(&r, "belongs to node 300, which --frames does not name");
  write_text(node_path, "nodes.csv", "101,0,0,0\n205,0,0,1\n");
  r = request();
  refuse(&r, "belongs to node 300, which the node list lacks");

  write_nodes(1);
  write_pair("market-symmetric.mtx");
  r = request();
  write_text(m_path, "m.mtx", "%%MatrixMarket matrix coordinate real symmetric\n2 2 1\n1 1 1\n");
  refuse(&r, "M has 2 rows, K has 20");
  write_text(k_path, "k.mtx", "%%MatrixMarket matrix coordinate real symmetric\n2 2 1\n1 1 1\n");
  refuse(&r, "2 rows, but 18 masters are listed");
}

// A full model of a finite-element program has nodes of three directions.
static void test_full_model(void **state) {
  (void)state;
  char dof[200];
  pb_import_request r = request();
  write_text(node_path, "n.csv", "1,0,0,0\n2,0,0,1\n");
  write_text(dof, "full.dof", "1.1\n1.2\n1.3\n");
  write_text(k_path, "full.sti",
             "1 1  1.0000000000000e+00\n2 2  1.0000000000000e+00\n3 3  1.0000000000000e+00\n");
  r.m_file = k_path;
  refuse(&r, "node 1 has the directions 1 2 3");
  write_text(dof, "full.dof", "1.1\n1.2\n");
  refuse(&r, "tells of 2 rows");
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
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_every_format), cmocka_unit_test(test_one_file),
      cmocka_unit_test(test_order),        cmocka_unit_test(test_units),
      cmocka_unit_test(test_refusals),     cmocka_unit_test(test_full_model),
  };
  return cmocka_run_group_tests(tests, begin, end);
}
