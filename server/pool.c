// See pool.h.
#include "pool.h"

#include <sched.h>
#include <string.h>

// Takes items until there are none; called and left with the lock held.
static void work_off(pb_pool *pool, size_t worker) {
  while (pool->next < pool->items) {
    const size_t item = pool->next++;
    pthread_mutex_unlock(&pool->lock);
    pool->work(pool->context, item, worker);
    pthread_mutex_lock(&pool->lock);
  }
}

static void *pool_thread(void *context) {
  pb_pool *pool = context;
  unsigned long turn = 0;
  pthread_mutex_lock(&pool->lock);
  const size_t worker = ++pool->started;
  while (!pool->stop) {
    if (pool->turn == turn) {
      pthread_cond_wait(&pool->begun, &pool->lock);
      continue;
    }
    turn = pool->turn;
    pool->busy++;
    work_off(pool, worker);
    if (--pool->busy == 0) pthread_cond_signal(&pool->ended);
  }
  pthread_mutex_unlock(&pool->lock);
  return NULL;
}

// With the first work: what is small never asks for them, and need not wait for their end.
static void threads_start(pb_pool *pool) {
  while (pool->threads + 1 < pool->workers.count) {
    if (pthread_create(&pool->thread[pool->threads], NULL, pool_thread, pool) != 0) break;
    pthread_setname_np(pool->thread[pool->threads++], "pb-compile");
  }
  pool->workers.count = pool->threads + 1;
}

// A thread that wakes when all is done finds no item, and nothing of the context is touched.
static void pool_run(void *whose, size_t items, pb_work work, void *context) {
  pb_pool *pool = whose;
  if (pool->turn == 0) threads_start(pool);
  pthread_mutex_lock(&pool->lock);
  pool->work = work;
  pool->context = context;
  pool->items = items;
  pool->next = 0;
  pool->turn++;
  pthread_cond_broadcast(&pool->begun);
  work_off(pool, 0);
  while (pool->busy > 0) pthread_cond_wait(&pool->ended, &pool->lock);
  pthread_mutex_unlock(&pool->lock);
}

static size_t processors(void) {
  cpu_set_t set;
  if (sched_getaffinity(0, sizeof set, &set) != 0) return 1;
  const size_t count = (size_t)CPU_COUNT(&set);
  return count < PB_POOL_MOST ? count : PB_POOL_MOST;
}

void pb_pool_open(pb_pool *pool) {
  memset(pool, 0, sizeof *pool);
  pthread_mutex_init(&pool->lock, NULL);
  pthread_cond_init(&pool->begun, NULL);
  pthread_cond_init(&pool->ended, NULL);
  pool->workers = (pb_workers){.count = processors(), .run = pool_run, .pool = pool};
}

void pb_pool_close(pb_pool *pool) {
  pthread_mutex_lock(&pool->lock);
  pool->stop = true;
  pthread_cond_broadcast(&pool->begun);
  pthread_mutex_unlock(&pool->lock);
  for (size_t i = 0; i < pool->threads; i++) pthread_join(pool->thread[i], NULL);
  pthread_cond_destroy(&pool->begun);
  pthread_cond_destroy(&pool->ended);
  pthread_mutex_destroy(&pool->lock);
}
