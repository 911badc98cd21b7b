// Elements kept from one plant file to the next: read once as long as their file is the same one.
#include "support/beam.h"
#include "support/check.h"

#include <stdio.h>
#include <unistd.h>

#include "plant/element_store.h"
#include "plant/plant.h"

static const beam steel = {
    .length = 0.1, .ea = 2e7, .ei = 50, .gj = 40, .mass = 0.08, .polar_inertia = 2e-6};
static char path[64], text[1024];

// Writes the beam with a K whose triangles differ by `skew`, relative.
static void write_beam(const char *file, double mass, double skew) {
  beam b = steel;
  double k[144], m[144], position[6];
  b.mass = mass;
  beam_matrices(&b, k, m, position);
  for (size_t j = 0; j < 12; j++)
    for (size_t i = 0; i < j; i++) k[i + j * 12] *= 1 + skew;
  assert_int_equal(beam_write(file, 2, 12, k, m, position), 0);
}

static int setup(void **state) {
  (void)state;
  snprintf(path, sizeof path, "/tmp/pb-store-%ld.mat", (long)getpid());
  snprintf(text, sizeof text,
           "{\"schema\": \"plantbus.plant/1\", \"name\": \"beams\","
           "\"models\": {\"beam\": {\"type\": \"super_element\", \"file\": \"%s\"}},"
           "\"components\": {\"a\": {\"model\": \"beam\"},"
           "  \"b\": {\"model\": \"beam\", \"position\": [1, 0, 0]}},"
           "\"connections\": {"
           "  \"a\": {\"from\": \"ground\", \"to\": \"a.1\", \"joint\": {\"type\": \"weld\"}},"
           "  \"b\": {\"from\": \"ground\", \"to\": \"b.1\", \"joint\": {\"type\": \"weld\"}}},"
           "\"inputs\": [{\"name\": \"F\", \"type\": \"force\", \"frame\": \"a.2\","
           "  \"direction\": [0, 0, 1]}],"
           "\"outputs\": [{\"name\": \"y\", \"type\": \"displacement\", \"frame\": \"a.2\","
           "  \"direction\": [0, 0, 1]}]}",
           path);
  return 0;
}

static int teardown(void **state) {
  (void)state;
  unlink(path);
  return 0;
}

// The element of both components; the plant is gone, `told` notes and `warned` warnings came.
static pb_element *parse(pb_element_store *store, size_t *told, size_t *warned) {
  pb_warnings notes = {0}, warnings = {.notes = &notes};
  pb_plant *plant = NULL;
  REQUIRE(pb_plant_parse_stored(text, strlen(text), NULL, store, &warnings, &plant, &err));
  pb_element *e = plant->component[0].super.element;
  assert_ptr_equal(e, plant->component[1].super.element);
  pb_element_share(e);
  pb_plant_free(plant);
  *told = notes.count;
  *warned = warnings.count;
  pb_warnings_clear(&notes);
  pb_warnings_clear(&warnings);
  return e;
}

static void test_read_once(void **state) {
  (void)state;
  pb_element_store store = {0};
  size_t told, warned;
  write_beam(path, 0.08, 1e-6);
  pb_element *first = parse(&store, &told, &warned);
  assert_int_equal(told, 1);
  assert_int_equal(warned, 1);
  assert_int_equal(pb_element_users(first), 2);  // the store and this test
  pb_element *second = parse(&store, &told, &warned);
  assert_ptr_equal(first, second);
  assert_int_equal(told, 0);    // its health is no news
  assert_int_equal(warned, 1);  // that it is asymmetric is as true of this plant
  pb_element_free(second);
  pb_element_store_clear(&store);
  assert_int_equal(pb_element_users(first), 1);
  pb_element_free(first);
}

// The daemon's own text of a plant names its elements by absolute paths: the same files.
static void test_other_path(void **state) {
  (void)state;
  pb_element_store store = {0};
  pb_element_file file;
  size_t told, warned;
  char other[sizeof path + 8];
  write_beam(path, 0.08, 0);
  pb_element *e = parse(&store, &told, &warned);
  snprintf(other, sizeof other, "/tmp/../%s", path + 1);
  pb_element *same = pb_element_store_find(&store, other, &file);
  assert_ptr_equal(e, same);
  pb_element_free(same);
  pb_element_free(e);
  pb_element_store_clear(&store);
}

// Another file under the same name, of the same length: read anew, and the old one is given up.
static void test_file_replaced(void **state) {
  (void)state;
  pb_element_store store = {0};
  size_t told, warned;
  char other[sizeof path + 4];
  write_beam(path, 0.08, 0);
  pb_element *old = parse(&store, &told, &warned);
  snprintf(other, sizeof other, "%s.new", path);
  write_beam(other, 0.16, 0);
  assert_int_equal(rename(other, path), 0);
  pb_element *new = parse(&store, &told, &warned);
  assert_ptr_not_equal(old, new);
  assert_int_equal(told, 1);
  ASSERT_RELATIVE(new->health.mass, 0.16, 1e-9);
  ASSERT_RELATIVE(old->health.mass, 0.08, 1e-9);
  assert_int_equal(pb_element_users(old), 1);
  assert_int_equal(store.count, 1);
  pb_element_free(old);
  pb_element_free(new);
  pb_element_store_clear(&store);
}

static pb_element *named(const char *name) {
  double k[144], m[144], position[6];
  pb_element *e = NULL;
  beam_matrices(&steel, k, m, position);
  REQUIRE(pb_element_new(name, 2, 12, position, k, m, NULL, &e, &err));
  return e;
}

// Full: what was used longest ago gives way, unless somebody uses it.
static void test_bounded(void **state) {
  (void)state;
  pb_element_store store = {0};
  pb_element_file file;
  pb_element *held = NULL;
  write_beam(path, 0.08, 0);
  assert_null(pb_element_store_find(&store, path, &file));
  assert_true(file.known);
  for (int i = 0; i < PB_ELEMENT_STORE_MOST + 3; i++) {
    char name[16];
    snprintf(name, sizeof name, "beam %d", i);
    pb_element *e = named(name);
    pb_element_store_keep(&store, e, &file);
    if (i == 1)
      held = e;
    else
      pb_element_free(e);
  }
  assert_int_equal(store.count, PB_ELEMENT_STORE_MOST);
  bool kept[PB_ELEMENT_STORE_MOST + 3] = {false};
  for (size_t i = 0; i < store.count; i++)
    kept[atoi(store.item[i].element->file + strlen("beam "))] = true;
  for (int i = 0; i < PB_ELEMENT_STORE_MOST + 3; i++)
    assert_int_equal(kept[i], i != 0 && i != 2 && i != 3);
  assert_int_equal(pb_element_users(held), 2);
  pb_element_store_clear(&store);
  assert_int_equal(store.count, 0);
  pb_element_free(held);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_read_once),
      cmocka_unit_test(test_other_path),
      cmocka_unit_test(test_file_replaced),
      cmocka_unit_test(test_bounded),
  };
  return cmocka_run_group_tests(tests, setup, teardown);
}
