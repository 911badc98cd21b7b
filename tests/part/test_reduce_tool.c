// plantbus-part reduce as a user runs it: formats, units, selections, results, refusals.
#include <sys/stat.h>

#include "e2e/tool_run.h"
#include "part/matrix_file.h"
#include "plant/element.h"
#include "support/check.h"
#include "truss.h"

static char folder[] = "/tmp/pb-reduce-XXXXXX";

// ---- files of an outside program ----------------------------------------------------------------

static FILE *create(const char *name) {
  char path[256];
  snprintf(path, sizeof path, "%s/%s", folder, name);
  FILE *f = fopen(path, "w");
  if (!f) fail_msg("cannot write %s", path);
  return f;
}

// Node numbers of the outside program: with gaps, ascending.
static long number_of(size_t node) {
  return 10 + 3 * (long)node;
}

static void write_market(const char *name, const pb_sparse *a, double factor) {
  FILE *f = create(name);
  fprintf(f, "%%%%MatrixMarket matrix coordinate real symmetric\n%zu %zu %lld\n", a->n, a->n,
          (long long)a->start[a->n]);
  for (size_t j = 0; j < a->n; j++)
    for (int64_t at = a->start[j]; at < a->start[j + 1]; at++)
      fprintf(f, "%zu %lld %.17g\n", j + 1, (long long)a->row[at] + 1, a->value[at] * factor);
  fclose(f);
}

static void write_calculix(const char *name, const pb_sparse *a) {
  FILE *f = create(name);
  for (size_t j = 0; j < a->n; j++)
    for (int64_t at = a->start[j]; at < a->start[j + 1]; at++)
      fprintf(f, "%lld %zu %20.13e\n", (long long)a->row[at] + 1, j + 1, a->value[at]);
  fclose(f);
}

static void write_nodes(const pb_fem *fem) {
  FILE *f = create("nodes.csv"), *mm = create("nodes-mm.csv"), *deck = create("deck.inp");
  fprintf(f, "node,x,y,z\n");
  fprintf(mm, "node,x,y,z\n");
  fprintf(deck, "** a deck\n*NODE, NSET=Everything\n");
  for (size_t i = 0; i < fem->nodes; i++) {
    const double *x = fem->xyz + 3 * i;
    fprintf(f, "%ld,%.17g,%.17g,%.17g\n", number_of(i), x[0], x[1], x[2]);
    fprintf(mm, "%ld,%.17g,%.17g,%.17g\n", number_of(i), 1e3 * x[0], 1e3 * x[1], 1e3 * x[2]);
    fprintf(deck, "%ld, %.15g, %.15g, %.15g\n", number_of(i), x[0], x[1], x[2]);
  }
  fprintf(deck, "*NSET, NSET=LEFT\n");
  for (size_t i = 0; i < fem->frame[0].nodes; i++)
    fprintf(deck, "%ld,%s", number_of(fem->frame[0].node[i]), i % 5 == 4 ? "\n" : " ");
  fprintf(deck, "\n*nset, generate, nset = Range\n10, 40, 3\n"
                "*NSET, NSET=ENDLESS, GENERATE\n1, 9000000000000000000, 5\n*STEP\n1, 2, 3\n");
  fclose(f);
  fclose(mm);
  fclose(deck);
  f = create("K.dof");
  for (size_t i = 0; i < 3 * fem->nodes; i++) fprintf(f, "%ld.%zu\n", number_of(i / 3), i % 3 + 1);
  fclose(f);
}

static void list_nodes(FILE *f, const pb_fem_frame *frame) {
  fprintf(f, "\"nodes\": [");
  for (size_t i = 0; i < frame->nodes; i++)
    fprintf(f, "%s%ld", i ? ", " : "", number_of(frame->node[i]));
  fprintf(f, "]");
}

// The two frames three ways: by list, by set and box, and in millimetres.
static void write_frames(const pb_fem *fem) {
  const pb_fem_frame *a = &fem->frame[0], *b = &fem->frame[1];
  static const char *const name[3] = {"list.json", "place.json", "mm.json"};
  for (int way = 0; way < 3; way++) {
    FILE *f = create(name[way]);
    double s = way == 2 ? 1e3 : 1;
    fprintf(f,
            "{\"schema\": \"plantbus.frames/1\", \"sets\": \"deck.inp\", \"frames\": {\"left\": "
            "{\"origin\": [%.17g, %.17g, %.17g], ",
            s * a->origin[0], s * a->origin[1], s * a->origin[2]);
    if (way == 1) {
      fprintf(f, "\"set\": \"left\"");
    } else {
      list_nodes(f, a);
    }
    fprintf(f, "}, \"right\": {\"origin\": [%.17g, %.17g, %.17g], \"tie\": \"rigid\", ",
            s * b->origin[0], s * b->origin[1], s * b->origin[2]);
    if (way) {
      fprintf(f, "\"box\": [[%g, 0, 0], [%g, %g, %g]]", 0.8 * s, s, s, s);
    } else {
      list_nodes(f, b);
    }
    fprintf(f, "}}}\n");
    fclose(f);
  }
}

static pb_fem model;
static pb_reduction *expected;

static int set_up(void **state) {
  (void)state;
  if (!mkdtemp(folder)) return -1;
  if (truss_build(60, 0.4, true, 31, &model) ||
      truss_frame(&model, "left", PB_TIE_AVERAGED, 0, 0, 0.2) ||
      truss_frame(&model, "right", PB_TIE_RIGID, 0, 0.8, 1))
    return -1;
  write_market("K.mtx", &model.k, 1);
  write_market("M.mtx", &model.m, 1);
  write_market("K-mm.mtx", &model.k, 1e-3);
  write_market("M-mm.mtx", &model.m, 1e-3);
  write_calculix("K.sti", &model.k);
  write_calculix("K.mas", &model.m);
  write_nodes(&model);
  write_frames(&model);
  pb_reduce_options options = {.modes = 8};
  pb_error err;
  return (int)pb_reduce(&model, &options, false, &expected, &err);
}

static int remove_all(void **state) {
  (void)state;
  char command[300];
  pb_fem_clear(&model);
  pb_reduction_free(expected);
  snprintf(command, sizeof command, "rm -r %s", folder);
  return system(command);
}

// ---- running ------------------------------------------------------------------------------------

// @ stands for the folder.
static const char *line_of(const char *text) {
  static char line[4096];
  size_t to = 0;
  for (; *text; text++) {
    if (*text == '@') {
      to += (size_t)snprintf(line + to, sizeof line - to, "%s/", folder);
    } else {
      line[to++] = *text;
    }
    assert_true(to + 64 < sizeof line);
  }
  line[to] = 0;
  return line;
}

static cJSON *reduce(const char *options) {
  char text[3000];
  snprintf(text, sizeof text, "reduce --json %s", options);
  return tool_json("plantbus-part", TOOL_NO_DOMAIN, NULL, line_of(text), 0);
}

static void refuse(const char *options, int code, const char *says) {
  char text[3000];
  snprintf(text, sizeof text, "reduce %s", options);
  tool_result r = tool_run("plantbus-part", TOOL_NO_DOMAIN, NULL, line_of(text));
  if (r.code != code) fail_msg("%s: exit code %d, expected %d: %s", options, r.code, code, r.err);
  tool_says(r.err, says);
  tool_free(&r);
}

static double number_in(const cJSON *json, const char *key) {
  return tool_member(json, key)->valuedouble;
}

// The file's element is the one that the library makes of the same model.
static void check_element(const char *name, double tolerance) {
  char path[300];
  pb_element *e = NULL;
  snprintf(path, sizeof path, "%s/%s", folder, name);
  REQUIRE(pb_element_load(path, NULL, &e, &err));
  assert_int_equal(e->size, expected->size);
  assert_int_equal(e->frames, 2);
  for (size_t i = 0; i < e->size * e->size; i++) {
    size_t p = i % e->size * (e->size + 1), q = i / e->size * (e->size + 1);
    ASSERT_NEAR(e->k[i], expected->k[i], tolerance * sqrt(expected->k[p] * expected->k[q]));
    ASSERT_NEAR(e->m[i], expected->m[i], tolerance * sqrt(expected->m[p] * expected->m[q]));
  }
  for (size_t i = 0; i < 6; i++) ASSERT_NEAR(e->position[i], expected->position[i], 1e-12);
  pb_element_free(e);
}

static void test_matrix_market(void **state) {
  (void)state;
  cJSON *json = reduce("@K.mtx @M.mtx --nodes @nodes.csv --frames @list.json --modes 8 -o @a.mat "
                       "--check 2");
  assert_int_equal(number_in(json, "full_dof"), 180);
  assert_int_equal(number_in(json, "size"), 20);
  ASSERT_RELATIVE(number_in(json, "mass"), expected->mass, 1e-12);
  assert_true(number_in(json, "rigid_residual") < 1e-12);
  const cJSON *fixed = tool_member(json, "fixed_hz"), *checks = tool_member(json, "checks");
  for (int i = 0; i < 8; i++)
    ASSERT_RELATIVE(cJSON_GetArrayItem(fixed, i)->valuedouble, expected->fixed_hz[i], 1e-12);
  assert_int_equal(cJSON_GetArraySize(checks), 2);
  assert_true(number_in(cJSON_GetArrayItem(checks, 0), "error") < 0.2);
  assert_int_equal(cJSON_GetArraySize(tool_member(json, "free_hz")), 20);
  cJSON_Delete(json);
  check_element("a.mat", 1e-12);
}

static void test_calculix(void **state) {
  (void)state;
  cJSON *json = reduce("@K.sti @K.mas --nodes @deck.inp --frames @place.json --modes 8 -o @c.mat");
  assert_string_equal(tool_member(json, "rows_from")->valuestring, "the stiffness file");
  cJSON_Delete(json);
  check_element("c.mat", 1e-9);  // the deck has fifteen digits
}

static void test_units(void **state) {
  (void)state;
  cJSON *json = reduce("@K-mm.mtx @M-mm.mtx --nodes @nodes-mm.csv --units mm-N-t --frames @mm.json "
                       "--modes 8 -o @mm.mat");
  cJSON_Delete(json);
  check_element("mm.mat", 1e-9);
}

// What is written as Matrix Market reads back to the same numbers.
static void test_market_output(void **state) {
  (void)state;
  char path[300];
  cJSON *json = reduce("@K.mtx @M.mtx --nodes @nodes.csv --dofs @K.dof --frames @list.json --modes "
                       "8 -o @out.mtx");
  tool_says(tool_member(json, "rows_from")->valuestring, "K.dof");
  cJSON_Delete(json);
  static const char *const name[2] = {"out.K.mtx", "out.M.mtx"};
  for (int which = 0; which < 2; which++) {
    pb_matrix_file file;
    pb_sparse a;
    snprintf(path, sizeof path, "%s/%s", folder, name[which]);
    REQUIRE(pb_matrix_file_read(path, NULL, &file, &err));
    REQUIRE(pb_matrix_file_symmetric(&file, path, &a, &err));
    const double *x = which ? expected->m : expected->k;
    assert_int_equal(a.n, expected->size);
    for (size_t j = 0; j < a.n; j++)
      for (int64_t at = a.start[j]; at < a.start[j + 1]; at++)
        ASSERT_NEAR(a.value[at], x[(size_t)a.row[at] + j * a.n],
                    1e-12 * sqrt(x[(size_t)a.row[at] * (a.n + 1)] * x[j * (a.n + 1)]));
    pb_sparse_clear(&a);
    pb_matrix_file_clear(&file);
  }
  pb_node_file places;
  snprintf(path, sizeof path, "%s/out.int_xyz.mtx", folder);
  REQUIRE(pb_node_file_read(path, &places, &err));
  assert_int_equal(places.count, 2);
  for (size_t i = 0; i < 6; i++) ASSERT_NEAR(places.xyz[i], expected->position[i], 0);
  pb_node_file_clear(&places);
}

// All modes up to a frequency, with the count that proves it; a table for people.
static void test_band(void **state) {
  (void)state;
  char options[300];
  double limit = (expected->fixed_hz[4] + expected->fixed_hz[5]) / 2;
  snprintf(options, sizeof options,
           "@K.mtx @M.mtx --nodes @nodes.csv --frames @list.json --max-frequency %.17g", limit);
  cJSON *json = reduce(options);
  assert_int_equal(number_in(json, "modes"), 5);
  assert_true(number_in(json, "proven_hz") > expected->fixed_hz[4]);
  cJSON_Delete(json);
  snprintf(options, sizeof options,
           "reduce @K.mtx @M.mtx --nodes @nodes.csv --frames @list.json --max-frequency %.17g "
           "--name truss-6 --check 1",
           limit);
  tool_result r = tool_run("plantbus-part", TOOL_NO_DOMAIN, NULL, line_of(options));
  assert_int_equal(r.code, 0);
  tool_says(r.out, "truss-6: 180 degrees of freedom → 17 (2 frames, 5 modes");
  tool_says(r.out, "counted in the full model");
  tool_says(r.out, "against the full model");
  tool_says(r.out, "factorisation");
  assert_string_equal(r.err, "");  // no progress in a pipe
  tool_free(&r);
}

static size_t frame_nodes(const char *frame) {
  char options[600];
  snprintf(options, sizeof options,
           "@K.mtx @M.mtx --nodes @nodes.csv --sets @deck.inp --modes 2 --frame '%s'", frame);
  cJSON *json = reduce(options);
  size_t count = (size_t)number_in(cJSON_GetArrayItem(tool_member(json, "frames"), 0), "nodes");
  cJSON_Delete(json);
  return count;
}

static void test_selections(void **state) {
  (void)state;
  assert_int_equal(frame_nodes("a={\"set\":\"EVERYTHING\",\"origin\":\"centroid\"}"), 60);
  assert_int_equal(frame_nodes("a={\"set\":\"range\",\"origin\":[0,0,0]}"), 11);
  size_t left = 0, narrow = 0, round = 0;
  for (size_t i = 0; i < model.nodes; i++) {
    const double *x = model.xyz + 3 * i;
    left += fabs(x[0] - 0.1) <= 0.12;
    narrow += fabs(x[0] - 0.1) <= 0.12 && x[1] <= 0.2;
    round += fabs(hypot(x[1] - 0.2, x[2] - 0.15) - 0.1) <= 0.05;
  }
  assert_int_equal(frame_nodes("a={\"plane\":{\"point\":[0.1,5,5],\"normal\":[2,0,0],\"tolerance\":"
                               "0.12},\"origin\":[0,0,0],\"weights\":\"mass\"}"),
                   left);
  assert_int_equal(frame_nodes("a={\"plane\":{\"point\":[0.1,0,0],\"normal\":[1,0,0],\"tolerance\":"
                               "0.12},\"box\":[[-1,-1,-1],[1,0.2,1]],\"origin\":[0,0,0]}"),
                   narrow);
  assert_int_equal(frame_nodes("a={\"cylinder\":{\"point\":[7,0.2,0.15],\"axis\":[1,0,0],"
                               "\"radius\":0.1,\"tolerance\":0.05},\"origin\":[0,0,0],\"tie\":"
                               "\"rigid\"}"),
                   round);
}

#define FILES "@K.mtx @M.mtx --nodes @nodes.csv "

static void test_refusals(void **state) {
  (void)state;
  refuse("@K.mtx", 2, "expected the files");
  refuse("@K.mtx @M.mtx --modes 3", 2, "--nodes");
  refuse(FILES "--modes 3", 2, "no frame");
  refuse(FILES "--frames @list.json", 2, "how many modes");
  refuse(FILES "--frames @list.json --modes 3 --units inch", 2, "--units");
  refuse(FILES "--frames @list.json --modes 0", 2, "--modes");
  refuse(FILES "--frames @none.json --modes 3", 1, "none.json");
  refuse("@none.mtx @M.mtx --nodes @nodes.csv --frames @list.json --modes 3", 1, "none.mtx");
  refuse(FILES "--frames @list.json --modes 500", 1, "modes are asked for");
  refuse(FILES "--modes 3 --frame a", 1, "NAME=");
  refuse(FILES "--modes 3 --frame a={", 1, "--frame");
  refuse(FILES "--modes 3 --frame 'a={\"nodes\":[10,13,16,19]}'", 1, "/a/origin");
  refuse(FILES "--modes 3 --frame 'a={\"origin\":[0,0,0]}'", 1, "says of no nodes");
  refuse(FILES "--modes 3 --frame 'a={\"nodes\":[10,11],\"origin\":[0,0,0]}'", 1,
         "there is no node 11");
  refuse(FILES "--modes 3 --frame 'a={\"nodes\":[10,10],\"origin\":[0,0,0]}'", 1, "named twice");
  refuse(FILES "--modes 3 --frame 'a={\"nodes\":[10,13,16],\"origin\":[0,0,0],\"colour\":1}'", 1,
         "colour");
  refuse(FILES "--modes 3 --frame 'a={\"set\":\"left\",\"origin\":[0,0,0]}'", 1,
         "no file with node sets");
  refuse(FILES "--modes 3 --sets @deck.inp --frame 'a={\"set\":\"top\",\"origin\":[0,0,0]}'", 1,
         "no node set top");
  refuse(FILES "--modes 3 --frame 'a={\"box\":[[5,5,5],[6,6,6]],\"origin\":[0,0,0]}'", 1,
         "no node is selected");
  refuse(FILES "--modes 3 --frame 'a={\"nodes\":[10,13,16],\"origin\":[0,0,0],\"weights\":[1,2]}'",
         1, "/a/weights");
  refuse(FILES "--modes 3 --frame 'a={\"nodes\":[10,13,16],\"origin\":[0,0,0],\"tie\":\"loose\"}'",
         1, "/a/tie");
  refuse(FILES "--modes 3 --sets @deck.inp --frame 'a={\"set\":\"endless\",\"origin\":[0,0,0]}'", 1,
         "a range of more than");
  FILE *f = create("sparse.mtx");
  fprintf(f, "%%%%MatrixMarket matrix coordinate real symmetric\n4000000000 4000000000 1\n1 1 1\n");
  fclose(f);
  refuse("@sparse.mtx @sparse.mtx --nodes @nodes.csv --frames @list.json --modes 3", 1,
         "rows without any stiffness");
  refuse("@K.sti @K.mas --nodes @out.int_xyz.mtx --frames @list.json --modes 3", 1,
         "belongs to node");
  refuse("@K.mtx @M.mtx --nodes @out.int_xyz.mtx --frames @list.json --modes 3", 1,
         "do not fit the 2 nodes");
  refuse("@K.mtx @out.M.mtx --nodes @nodes.csv --frames @list.json --modes 3", 1, "has 20 rows");
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_matrix_market), cmocka_unit_test(test_calculix),
      cmocka_unit_test(test_units),         cmocka_unit_test(test_market_output),
      cmocka_unit_test(test_band),          cmocka_unit_test(test_selections),
      cmocka_unit_test(test_refusals),
  };
  return cmocka_run_group_tests(tests, set_up, remove_all);
}
