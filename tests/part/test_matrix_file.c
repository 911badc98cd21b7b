// Readers of other programs' files: what is written in each format comes back; what is cut, mutated
// or does not fit is refused with its place, and nothing crashes.
#include "support/check.h"
#include "support/outside.h"

#include "base/text.h"
#include "part/matrix_file.h"

enum { N = OUTSIDE_SIZE };

static char folder[] = "/tmp/pb-matrix-XXXXXX";
static outside_element element;

static const char *in_folder(const char *name) {
  static char path[4][256];
  static int turn;
  turn = (turn + 1) % 4;
  snprintf(path[turn], sizeof path[turn], "%s/%s", folder, name);
  return path[turn];
}

static void write_bytes(const char *path, const char *bytes, size_t count) {
  FILE *f = fopen(path, "wb");
  assert_non_null(f);
  assert_int_equal(fwrite(bytes, 1, count, f), count);
  fclose(f);
}

static void write_text(const char *path, const char *text) {
  write_bytes(path, text, strlen(text));
}

// ---- round trip ---------------------------------------------------------------------------------

static void compare(const pb_sparse *s, const double *x, double digits, const char *name) {
  double dense[N * N] = {0};
  assert_int_equal(s->n, N);
  for (size_t j = 0; j < N; j++) {
    for (int64_t e = s->start[j]; e < s->start[j + 1]; e++)
      dense[(size_t)s->row[e] + j * N] = dense[j + (size_t)s->row[e] * N] = s->value[e];
  }
  for (size_t j = 0; j < N; j++) {
    for (size_t i = 0; i < N; i++) {
      double want = outside_entry(x, i, j), got = dense[i + j * N];
      if (fabs(got - want) > digits * fabs(want))
        fail_msg("%s (%zu, %zu): %.17g, expected %.17g", name, i, j, got, want);
    }
  }
}

static void check_labels(const pb_matrix_file *f, const char *name) {
  if (!f->label) fail_msg("%s: no labels", name);
  for (size_t i = 0; i < N; i++) {
    int64_t node = i < 18 ? element.node[i / 6] : 9001 + (int64_t)(i - 18);
    assert_int_equal(f->label[i].node, node);
    if (i < 18) assert_int_equal(f->label[i].direction, i % 6 + 1);
  }
}

static void round_trip(const outside_form *form, char which, const double *x) {
  const char *path = in_folder(form->name);
  pb_matrix_file f;
  pb_sparse s;
  form->write(path, which, x);
  REQUIRE(pb_matrix_file_read(path, NULL, &f, &err));
  assert_string_equal(pb_matrix_format_name(f.format), form->kind);
  if (form->labelled) check_labels(&f, form->name);
  REQUIRE(pb_matrix_file_symmetric(&f, path, &s, &err));
  compare(&s, x, form->digits, form->name);
  pb_sparse_clear(&s);
  pb_matrix_file_clear(&f);
}

static void test_round_trip(void **state) {
  (void)state;
  for (const outside_form *form = outside_forms; form->name; form++) {
    round_trip(form, 'K', element.k);
    round_trip(form, 'M', element.m);
  }
}

static void test_both_in_one(void **state) {
  (void)state;
  static const char *const form[] = {"print", "dmig-large", "abaqus-user-element"};
  for (int k = 0; k < 3; k++) {
    const char *path = in_folder(form[k]);
    pb_matrix_file f;
    pb_sparse s;
    pb_error why = {0};
    assert_int_equal(outside_write_both(form[k], path, &element), 0);
    assert_int_equal(pb_matrix_file_read(path, NULL, &f, &why), PB_ERR_SYNTAX);
    assert_non_null(strstr(why.message, "name one"));
    for (int m = 0; m < 2; m++) {
      REQUIRE(pb_matrix_file_read(path, m ? "M" : "K", &f, &err));
      REQUIRE(pb_matrix_file_symmetric(&f, path, &s, &err));
      compare(&s, m ? element.m : element.k, 1e-9, form[k]);
      pb_sparse_clear(&s);
      pb_matrix_file_clear(&f);
    }
    assert_int_equal(pb_matrix_file_read(path, "DAMPING", &f, &why), PB_ERR_SYNTAX);
  }
}

// ---- broken files -------------------------------------------------------------------------------

// Refused, with the file (and the line, in texts) and a sentence; nothing is handed out.
static void check_refusal(const char *path, pb_status st, const pb_matrix_file *f,
                          const pb_error *err, const char *what) {
  if (!st) fail_msg("%s: read in spite of it", what);
  if (st != PB_ERR_SYNTAX && st != PB_ERR_ELEMENT) fail_msg("%s: status %d", what, st);
  // The .dof file beside may be what does not fit.
  bool named = !strncmp(err->where, path, strlen(path) - 4);
  if (!named || !err->message[0]) fail_msg("%s: '%s' '%s'", what, err->where, err->message);
  assert_null(f->row);
  assert_null(f->label);
  assert_int_equal(f->count, 0);
}

static void test_truncation(void **state) {
  (void)state;
  for (const outside_form *form = outside_forms; form->name; form++) {
    const char *path = in_folder(form->name);
    char *text;
    size_t length;
    pb_matrix_file f, whole;
    form->write(path, 'K', element.k);
    REQUIRE(pb_text_read(path, &text, &length, &err));
    REQUIRE(pb_matrix_file_read(path, NULL, &whole, &err));
    for (size_t cut = 0; cut < length - 1; cut += 1 + length / 151) {
      pb_error err = {0};
      char what[200];
      snprintf(what, sizeof what, "%s cut at %zu of %zu", form->name, cut, length);
      write_bytes(path, text, cut);
      pb_status st = pb_matrix_file_read(path, NULL, &f, &err);
      // Formats without sizes can be cut between two entries, but never within one.
      if (!st && !form->counted && text[cut - 1] == '\n') {
        assert_true(f.count < whole.count);
        pb_matrix_file_clear(&f);
        continue;
      }
      if (!st && strchr(" ,\r\n", text[cut]) && !strncmp(text + cut, "ENDDATA", 7)) continue;
      check_refusal(path, st, &f, &err, what);
    }
    free(text);
    pb_matrix_file_clear(&whole);
  }
}

// A crash, a leak or an index beyond the matrix is what this looks for (with the sanitizers).
static void test_mutation(void **state) {
  (void)state;
  static const char bytes[] = "0123456789+-.eEdD,;*[]: \n\t$%/AKM\0\xff";
  uint64_t seed = 12345;
  size_t refused = 0, read = 0;
  for (const outside_form *form = outside_forms; form->name; form++) {
    const char *path = in_folder(form->name);
    char *text;
    size_t length;
    form->write(path, 'M', element.m);
    REQUIRE(pb_text_read(path, &text, &length, &err));
    for (int round = 0; round < 150; round++) {
      char *copy = malloc(length);
      memcpy(copy, text, length);
      for (int hit = 0; hit < 1 + round % 3; hit++) {
        seed = seed * 6364136223846793005u + 1442695040888963407u;
        // Half of the hits go to the head of the file, where sizes and names stand.
        size_t reach = round % 2 && length > 200 ? 200 : length;
        copy[(seed >> 33) % reach] = bytes[(seed >> 20) % (sizeof bytes - 1)];
      }
      write_bytes(path, copy, length);
      free(copy);
      pb_matrix_file f;
      pb_error err = {0};
      pb_status st = pb_matrix_file_read(path, NULL, &f, &err);
      if (st) {
        refused++;
        assert_true(err.message[0] != 0);
        assert_null(f.row);
        continue;
      }
      read++;
      for (size_t k = 0; k < f.count; k++) {
        assert_in_range(f.row[k], 0, f.rows - 1);
        assert_in_range(f.col[k], 0, f.cols - 1);
        assert_true(isfinite(f.value[k]));
      }
      pb_sparse s;
      if (f.rows < 100000 && !pb_matrix_file_symmetric(&f, path, &s, &err)) pb_sparse_clear(&s);
      pb_matrix_file_clear(&f);
    }
    free(text);
  }
  print_message("%zu mutated files refused, %zu read\n", refused, read);
  assert_true(refused > 500 && read > 100);
}

// Each line: a whole file, and what its refusal says.
static void test_messages(void **state) {
  (void)state;
  static const struct {
    const char *text, *place, *message;
  } broken[] = {
      {"%%MatrixMarket matrix coordinate real symmetric\n2 2 2\n1 1 1\n2 2 x\n", ":4",
       "entry 2 of 2"},
      {"%%MatrixMarket matrix coordinate real symmetric\n2 2 2\n1 1 1\n3 2 5\n", ":4", "outside"},
      {"%%MatrixMarket matrix coordinate real symmetric\n2 2 3\n1 1 1\n2 2 5\n", ":4",
       "ends after 2"},
      {"%%MatrixMarket matrix coordinate real symmetric\n2 2 1\n1 1 1\n2 2 5\n", ":4", "more than"},
      {"%%MatrixMarket matrix coordinate real symmetric\n2 3 1\n1 1 1\n", ":2", "symmetric"},
      {"%%MatrixMarket matrix coordinate complex symmetric\n2 2 1\n1 1 1 0\n", ":1", "complex"},
      {"%%MatrixMarket matrix coordinate real general\n9 9 99999999999\n", ":2", "can hold"},
      {"%%MatrixMarket matrix coordinate real general\n1 1 1\n1 1 1e999\n", ":3", "expected"},
      {"%%MatrixMarket matrix coordinate real general\n1 1 1\n1 1 nan\n", ":3", "expected"},
      {"%%MatrixMarket matrix coordinate real general\n1 1 1\n1 1 0x10\n", ":3", "expected"},
      {"%%MatrixMarket matrix coordinate real symmetric\n2 2 4\n1 1 1\n2 2 5\n1 2 1\n2 1 1\n", ":6",
       "stored by its upper triangle"},
      {"MAT_K:\n[ 1, 1]: 1.0 [ 1, 2]: 2.0\n[ 2, 1]: 2.0 [ 2, 2] 3.0\n", ":3", "expected entries"},
      {"MAT_K:\n[ 1, 1]: 1.0 [ 1, 2]: 2.0\n[ 2, 1]: 2.0 [ 2, 1]: 3.0\n", ":3", "follows on"},
      {"MAT_K:\n[1,1]: 1.0\nMAT_K:\n[1,1]: 1.0\n", ":3", "second matrix"},
      {"1 1  1.0000000000000e+00\n1 2  1.0000000000000e+00\n1 3  1.0000000000000e+00\n", ":3",
       "lines are missing"},
      {"DMIG    KAAX           0       6       3       0\n", ":1", "complex"},
      {"DMIG    KAAX           0       6       2       0\n"
       "DMIG*   MAAX                           1               1\n",
       ":2", "without its header"},
      {"DMIG    KAAX           0       6       2       0                       2\n"
       "DMIG*   KAAX                           1               1\n"
       "*                      1               1 1.000000000D+01\n",
       ":3", "1 of the 2 columns"},
      {"DMIG    KAAX           0       6       2       0\n"
       "DMIG*   KAAX                           1               7\n",
       ":2", "component"},
      {"DMIG    KAAX           0       6       2       0\n"
       "DNIG*   KAAX                           1               1\n",
       ":2", "unknown entry"},
      {"DMIG,KAAX,0,6,2,0\n"
       "DMIG,KAAX,1,1,,1,1,1.00000000000000000000000000000000000000000000001E+07\n",
       ":2", "too long"},
      {"DMIG,KAAX,0,6,2,0\nDMIG,KAAX,1,1,,1,1,5.0,,+A,6.0\n", ":2", "too many"},
      {"1,1, 1,1, 5.0\n1,2, 1,9, 5.0\n", ":2", "direction"},
      {"*USER ELEMENT, NODES= 2, LINEAR\n** ELEMENT NODES\n** 1,2\n1,2\n1,3\n", ":5",
       "place of a node"},
      {"*USER ELEMENT, NODES= 2, LINEAR\n** ELEMENT NODES\n** 1\n1,2\n*MATRIX,TYPE=MASS\n1.0\n",
       ":4", "1 of 2 node numbers"},
      {"*USER ELEMENT, NODES= 1, LINEAR\n** ELEMENT NODES\n** 1\n1,2\n*MATRIX,TYPE=MASS\n1.0, "
       "2.0\n",
       ":6", "ends at row 2, column 2"},
      {"1,2,3,4,5,6\n1,2,3,4,5,6\n", ":2", "not a square"},
      {"1,2,3,4,5,6\n1,2,3,4,5\n", ":2", "5 numbers"},
      {"1,2,3,4,5,6\n1,2,3,4,5,a\n", ":2", "expected a number"},
      {"nothing of the kind\n", "", "no format"},
      {"", "", "no format"},
  };
  for (size_t k = 0; k < sizeof broken / sizeof *broken; k++) {
    const char *path = in_folder("broken.txt");
    char where[300];
    pb_matrix_file f;
    pb_error err = {0};
    write_text(path, broken[k].text);
    check_refusal(path, pb_matrix_file_read(path, NULL, &f, &err), &f, &err, broken[k].text);
    snprintf(where, sizeof where, "%s%s", path, broken[k].place);
    assert_string_equal(err.where, where);
    if (!strstr(err.message, broken[k].message))
      fail_msg("'%s' does not say '%s' of\n%s", err.message, broken[k].message, broken[k].text);
  }
  pb_matrix_file f;
  pb_error err = {0};
  assert_int_equal(pb_matrix_file_read(in_folder("none"), NULL, &f, &err), PB_ERR_IO);
  assert_int_equal(pb_matrix_file_read(folder, NULL, &f, &err), PB_ERR_IO);
}

// Numbers as long as a free field may be: a cut exponent would be another number.
static void test_long_fields(void **state) {
  (void)state;
  const char *path = in_folder("long.pch");
  pb_matrix_file f;
  write_text(path, "DMIG,KAAX,0,6,2,0\nDMIG,KAAX,1,1,,1,1,1.2780705243E+007\n"
                   "DMIG,KAAX,2,1,,2,1,-1.278070524339920000E-07,\n,3,1,2.5,,4,1,-3.5-3\n");
  REQUIRE(pb_matrix_file_read(path, "K", &f, &err));
  assert_int_equal(f.count, 4);
  ASSERT_NEAR(f.value[0], 1.2780705243e7, 0);
  ASSERT_NEAR(f.value[1], -1.27807052433992e-7, 0);
  ASSERT_NEAR(f.value[3], -3.5e-3, 0);
  pb_matrix_file_clear(&f);
}

// The line is told however long the path is.
static void test_long_path(void **state) {
  (void)state;
  char path[600];
  int at = snprintf(path, sizeof path, "%s", folder);
  while (at < 400) at += snprintf(path + at, sizeof path - (size_t)at, "/.");
  snprintf(path + at, sizeof path - (size_t)at, "/far.mtx");
  write_text(path, "%%MatrixMarket matrix coordinate real general\n1 1 1\n1 1 x\n");
  pb_matrix_file f;
  pb_error why = {0};
  assert_int_equal(pb_matrix_file_read(path, NULL, &f, &why), PB_ERR_SYNTAX);
  assert_non_null(strstr(why.where, "/far.mtx:3"));
}

// Coordinates are no symmetric matrix: the half that is not stored would be zero.
static void test_symmetric_nodes(void **state) {
  (void)state;
  const char *path = in_folder("nodes.mtx");
  pb_node_file nodes;
  pb_error why = {0};
  write_text(path, "%%MatrixMarket matrix array real symmetric\n3 3\n1\n4\n2\n5\n3\n6\n");
  assert_int_equal(pb_node_file_read(path, &nodes, &why), PB_ERR_SYNTAX);
  assert_non_null(strstr(why.message, "symmetric, 3 × 3"));
}

static void test_symmetry(void **state) {
  (void)state;
  static const struct {
    const char *text, *message;
  } wrong[] = {
      {"%%MatrixMarket matrix coordinate real general\n2 2 3\n1 1 1\n2 2 5\n1 2 1\n", "one side"},
      {"%%MatrixMarket matrix coordinate real general\n2 2 4\n1 1 1\n2 2 5\n1 2 1\n2 1 1.1\n",
       "entry (1, 2) is 1"},
      {"%%MatrixMarket matrix coordinate real general\n2 3 1\n1 1 1\n", "not square"},
  };
  for (size_t k = 0; k < sizeof wrong / sizeof *wrong; k++) {
    const char *path = in_folder("wrong.mtx");
    pb_matrix_file f;
    pb_sparse s;
    pb_error why = {0};
    write_text(path, wrong[k].text);
    REQUIRE(pb_matrix_file_read(path, NULL, &f, &err));
    assert_int_equal(pb_matrix_file_symmetric(&f, path, &s, &why), PB_ERR_ELEMENT);
    if (!strstr(why.message, wrong[k].message)) fail_msg("'%s'", why.message);
    assert_null(s.start);
    pb_matrix_file_clear(&f);
  }
}

// ---- node lists ---------------------------------------------------------------------------------

static void test_listings(void **state) {
  (void)state;
  for (int variant = 0; variant < 12; variant++) {
    const char *path = in_folder("nodes.txt");
    pb_node_file nodes;
    pb_dof_file rows;
    outside_write_listing(path, &element, variant < 6 ? 50 : 4, variant % 2, variant % 3 - 1);
    REQUIRE(pb_node_file_read(path, &nodes, &err));
    assert_int_equal(nodes.count, 2 * OUTSIDE_FRAMES);
    for (size_t i = 0; i < nodes.count; i++) {
      assert_int_equal(nodes.number[i], element.node[i / 2] + (int64_t)(i % 2));
      for (int a = 0; a < 3; a++)
        ASSERT_NEAR(nodes.xyz[3 * i + (size_t)a],
                    element.position[3 * (i / 2) + (size_t)a] + (i % 2 && a == 0 ? 0.5 : 0), 1e-6);
    }
    pb_node_file_clear(&nodes);
    pb_error err = {0};
    pb_status st = pb_dof_file_read(path, &rows, &err);
    if (variant % 3 == 1) {
      assert_int_equal(st, PB_ERR_SYNTAX);
      continue;
    }
    assert_int_equal(st, PB_OK);
    assert_int_equal(rows.count, 18);
    for (size_t i = 0; i < 18; i++) {
      assert_int_equal(rows.label[i].node, element.node[i / 6]);
      assert_int_equal(rows.label[i].direction, i % 6 + 1);
    }
    pb_dof_file_clear(&rows);
  }
}

static void test_node_forms(void **state) {
  (void)state;
  static const char *const good[] = {
      "** comment\n*HEADING\nx\n*NODE, NSET=ALL\n 7, 1., 2., 3.\n5, 0.5, 0, "
      "-1e-2\n*ELEMENT\n1,2,3\n",
      "node,x,y,z\n7,1,2,3\n5,0.5,0,-0.01\n",
      "7 1 2 3\n5\t0.5 0 -.01\n",
  };
  for (int k = 0; k < 3; k++) {
    const char *path = in_folder("nodes.csv");
    pb_node_file nodes;
    write_text(path, good[k]);
    REQUIRE(pb_node_file_read(path, &nodes, &err));
    assert_int_equal(nodes.count, 2);
    assert_int_equal(nodes.number[0], 5);
    ASSERT_NEAR(nodes.xyz[2], -0.01, 0);
    ASSERT_NEAR(nodes.xyz[3], 1, 0);
    pb_node_file_clear(&nodes);
  }
  const char *path = in_folder("nodes.mtx");
  pb_node_file nodes;
  write_text(path, "%%MatrixMarket matrix array real general\n2 3\n1\n4\n2\n5\n3\n6\n");
  REQUIRE(pb_node_file_read(path, &nodes, &err));
  assert_int_equal(nodes.count, 2);
  for (int k = 0; k < 6; k++) ASSERT_NEAR(nodes.xyz[k], k + 1, 0);
  pb_node_file_clear(&nodes);
}

static void test_broken_nodes(void **state) {
  (void)state;
  static const struct {
    const char *text, *place, *message;
  } broken[] = {
      {"   NODE   X   Y   Z\n  1  0.0  0.0  0.0\n  2  0.0  0.0\n", ":3", "3 real numbers"},
      {"   NODE   X   Y   Z\n  1  0.0  0.0  0.0\n  2  0.0  0.0  0x\n", ":3", "3 real numbers"},
      {"   NODE   X   Y   Z\n  1  0.0  0.0  0.0\n  2  0.0  0.0  0.0", ":3", "truncated"},
      {"   NODE   X   Y   Z\n  1  0.0  0.0  0.0\n  1  0.0  0.0  0.0\n", "", "node 1 twice"},
      {"   NODE   X   Y   Z\n\n", "", "no nodes"},
      {"   NODE   X   Y   Z\n  1  0.0  0.0  0.0\n\n   NODF   X   Y   Z\n  2  0.0  0.0  0.0\n", ":5",
       "without a header"},
      {"*NODE\n1, 0., 0.\n", ":2", "3 real numbers"},
      {"1,2,3,4\n2,3,4\n", ":2", "3 real numbers"},
  };
  for (size_t k = 0; k < sizeof broken / sizeof *broken; k++) {
    const char *path = in_folder("nodes.txt");
    char where[300];
    pb_node_file nodes;
    pb_error err = {0};
    write_text(path, broken[k].text);
    assert_int_equal(pb_node_file_read(path, &nodes, &err), PB_ERR_SYNTAX);
    snprintf(where, sizeof where, "%s%s", path, broken[k].place);
    assert_string_equal(err.where, where);
    if (!strstr(err.message, broken[k].message)) fail_msg("'%s'", err.message);
    assert_null(nodes.number);
  }
  const char *path = in_folder("masters.txt");
  pb_dof_file rows;
  pb_error why = {0};
  write_text(path, "  NODE DOF\n  5 UX\n  5 UW\n");
  assert_int_equal(pb_dof_file_read(path, &rows, &why), PB_ERR_SYNTAX);
  assert_non_null(strstr(why.where, "masters.txt:3"));
  write_text(path, "  NODE DOF\n  5 UX\n  5 UX\n");
  assert_int_equal(pb_dof_file_read(path, &rows, &why), PB_ERR_SYNTAX);
  write_text(path, "  NODE DOF\n  5 UX\n\n  NODE DQF\n  5 UY\n");
  assert_int_equal(pb_dof_file_read(path, &rows, &why), PB_ERR_SYNTAX);
  assert_non_null(strstr(why.message, "without a header"));
  write_text(path, "  NODE LABEL SUPPORT\n  5 UX OFF\n  5 ROTZ OFF\n");
  REQUIRE(pb_dof_file_read(path, &rows, &err));
  assert_int_equal(rows.label[1].direction, 6);
  pb_dof_file_clear(&rows);
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
      cmocka_unit_test(test_round_trip),      cmocka_unit_test(test_both_in_one),
      cmocka_unit_test(test_truncation),      cmocka_unit_test(test_mutation),
      cmocka_unit_test(test_messages),        cmocka_unit_test(test_symmetry),
      cmocka_unit_test(test_long_fields),     cmocka_unit_test(test_long_path),
      cmocka_unit_test(test_symmetric_nodes), cmocka_unit_test(test_listings),
      cmocka_unit_test(test_node_forms),      cmocka_unit_test(test_broken_nodes),
  };
  return cmocka_run_group_tests(tests, begin, end);
}
