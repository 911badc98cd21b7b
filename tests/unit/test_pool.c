// Threads that make a model together: every item once, and no two of them in one work space.
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "pool.h"

enum { ITEMS = 1000, RUNS = 200 };

typedef struct tally {
  atomic_int done[ITEMS], busy[PB_POOL_MOST];
  atomic_int faults;
} tally;

static void count_item(void *context, size_t item, size_t worker) {
  tally *t = context;
  if (worker >= PB_POOL_MOST || atomic_fetch_add(&t->busy[worker], 1) != 0)
    atomic_fetch_add(&t->faults, 1);
  atomic_fetch_add(&t->done[item], 1);
  atomic_fetch_sub(&t->busy[worker], 1);
}

static void a_pool_does_every_item_once(void **state) {
  (void)state;
  static tally t;
  pb_pool pool;
  pb_pool_open(&pool);
  assert_true(pool.workers.count >= 1 && pool.workers.count <= PB_POOL_MOST);
  for (int run = 1; run <= RUNS; run++) {
    pool.workers.run(&pool, ITEMS, count_item, &t);
    for (int i = 0; i < ITEMS; i++) assert_int_equal(atomic_load(&t.done[i]), run);
  }
  pool.workers.run(&pool, 0, count_item, &t);
  assert_int_equal(atomic_load(&t.faults), 0);
  pb_pool_close(&pool);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(a_pool_does_every_item_once)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
