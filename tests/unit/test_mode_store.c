// What a caller lends to a compilation changes how long it takes and not one bit of the model:
// threads, and modes that were solved for before.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "model/transfer.h"
#include "pool.h"
#include "support/patched.h"

typedef struct made {
  pb_model *model;
  pb_motion_map *map;
} made;

static made make(const char *plant, const char *patch, const pb_means *means) {
  char path[512];
  made m = {0};
  pb_error err = {PB_OK, "", ""};
  snprintf(path, sizeof path, PB_CONFIG "/plants/%s.json", plant);
  char *text = patched_plant(path, patch);
  if (pb_model_parse_with(text, strlen(text), PB_CONFIG "/plants", means, NULL, &m.model, &m.map,
                          NULL, &err))
    fail_msg("%s: %s", err.where, err.message);
  free(text);
  return m;
}

static void made_free(made *m) {
  pb_model_free(m->model);
  pb_motion_map_free(m->map);
}

static void assert_same_bits(const made *a, const made *b) {
  const pb_model *x = a->model, *y = b->model;
  assert_int_equal(x->nx, y->nx);
  assert_int_equal(x->block_value[x->blocks], y->block_value[y->blocks]);
  assert_memory_equal(x->a, y->a, x->block_value[x->blocks] * sizeof(double));
  assert_memory_equal(x->bd, y->bd, x->nx * x->nu * sizeof(double));
  assert_memory_equal(x->c, y->c, x->ny * x->nx * sizeof(double));
  assert_memory_equal(x->d, y->d, x->ny * x->nu * sizeof(double));
  assert_memory_equal(a->map->bq, b->map->bq, x->nx * a->map->n * sizeof(double));
  assert_memory_equal(a->map->bv, b->map->bv, x->nx * a->map->n * sizeof(double));
  for (size_t j = 0; j < x->nx; j++) {
    assert_memory_equal(a->map->cq + j * a->map->ldc, b->map->cq + j * b->map->ldc,
                        a->map->n * sizeof(double));
    assert_memory_equal(a->map->cv + j * a->map->ldc, b->map->cv + j * b->map->ldc,
                        a->map->n * sizeof(double));
  }
}

// Items as they come, each by another worker's number; backwards, as threads may.
static size_t handed_out;

static void run_backwards(void *pool, size_t items, pb_work work, void *context) {
  (void)pool;
  for (size_t item = items; item-- > 0; handed_out++) work(context, item, item % 3);
}

static void threads_do_not_change_the_bits(void **state) {
  (void)state;
  const pb_workers backwards = {.count = 3, .run = run_backwards};
  pb_pool pool;
  pb_pool_open(&pool);
  const char *const plant[] = {"nano-hexapod", "nano-hexapod-element-joints",
                               "apa300ml-bench-element"};
  for (size_t i = 0; i < sizeof plant / sizeof plant[0]; i++) {
    made alone = make(plant[i], "{}", NULL);
    made three = make(plant[i], "{}", &(pb_means){.workers = &backwards});
    made pooled = make(plant[i], "{}", &(pb_means){.workers = &pool.workers});
    assert_same_bits(&alone, &three);
    assert_same_bits(&alone, &pooled);
    made_free(&alone);
    made_free(&three);
    made_free(&pooled);
  }
  assert_true(handed_out > 0);
  pb_pool_close(&pool);
}

static void workers_share_a_transfer(void **state) {
  (void)state;
  const pb_workers backwards = {.count = 3, .run = run_backwards};
  const char *patch = "{\"template\":{\"payload\":{\"mass\":3}}}";
  made a = make("nano-hexapod-element-joints", "{}", NULL);
  made b = make("nano-hexapod-element-joints", patch, NULL);
  pb_transfer *alone = NULL, *shared = NULL;
  handed_out = 0;
  assert_int_equal(pb_transfer_new(a.model, a.map, b.model, b.map, NULL, &alone, NULL), PB_OK);
  assert_int_equal(pb_transfer_new(a.model, a.map, b.model, b.map, &backwards, &shared, NULL),
                   PB_OK);
  assert_true(handed_out > 0);
  assert_non_null(alone->x);
  assert_memory_equal(alone->x, shared->x, a.model->nx * b.model->nx * sizeof(double));
  assert_memory_equal(alone->u, shared->u, a.model->nu * b.model->nx * sizeof(double));
  pb_transfer_free(alone);
  pb_transfer_free(shared);
  made_free(&a);
  made_free(&b);
}

// A change, what is newly solved for, and the model as without a store.
static void change(pb_mode_store *store, const char *patch, size_t solved) {
  const size_t before = store->count;
  made kept = make("nano-hexapod-element-joints", patch, &(pb_means){.modes = store});
  made anew = make("nano-hexapod-element-joints", patch, NULL);
  assert_same_bits(&kept, &anew);
  if (store->count - before != solved)
    fail_msg("%s: %zu solutions instead of %zu", patch, store->count - before, solved);
  made_free(&kept);
  made_free(&anew);
}

static void only_what_a_change_touches_is_solved_anew(void **state) {
  (void)state;
  pb_mode_store store = {0};
  change(&store, "{}", 2);  // undamped and damped modes
  change(&store, "{}", 0);
  change(&store, "{\"models\":{\"apa300ml\":{\"g_a\":5.4,\"g_s\":1e5}}}", 0);
  change(&store, "{\"models\":{\"apa300ml\":{\"c_1\":40}}}", 1);
  change(&store, "{}", 0);  // what was two changes ago
  change(&store, "{\"models\":{\"apa300ml\":{\"k_1\":310000}}}", 2);
  pb_mode_store_clear(&store);
}

static void what_two_changes_do_not_use_is_given_up(void **state) {
  (void)state;
  pb_mode_store store = {0};
  change(&store, "{\"models\":{\"apa300ml\":{\"k_1\":310000}}}", 2);
  change(&store, "{\"models\":{\"apa300ml\":{\"k_1\":320000}}}", 2);
  change(&store, "{\"models\":{\"apa300ml\":{\"k_1\":330000}}}", 2);
  assert_int_equal(store.count, 6);
  made last = make("nano-hexapod-element-joints", "{\"models\":{\"apa300ml\":{\"k_1\":340000}}}",
                   &(pb_means){.modes = &store});
  assert_int_equal(store.count, 6);
  made_free(&last);
  pb_mode_store_clear(&store);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(threads_do_not_change_the_bits),
      cmocka_unit_test(workers_share_a_transfer),
      cmocka_unit_test(only_what_a_change_touches_is_solved_anew),
      cmocka_unit_test(what_two_changes_do_not_use_is_given_up),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
