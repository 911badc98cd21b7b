// Threads that a caller lends. The library starts none: it hands out work in items whose results do
// not depend on who computes them, nor on how many do.
#ifndef PB_BASE_WORKERS_H
#define PB_BASE_WORKERS_H

#include <stddef.h>

// Computes one item; no two calls have the same `worker` at the same time.
typedef void (*pb_work)(void *context, size_t item, size_t worker);

typedef struct pb_workers {
  size_t count;  // work under way at once, by workers 0 … count − 1
  // Calls `work` once for each item < items and returns when all are done.
  void (*run)(void *pool, size_t items, pb_work work, void *context);
  void *pool;
} pb_workers;

static inline size_t pb_workers_count(const pb_workers *workers) {
  return workers && workers->count > 1 ? workers->count : 1;
}

// The workers, or NULL where so few operations are done sooner than others are woken. [any]
static inline const pb_workers *pb_workers_for(const pb_workers *workers, double operations) {
  return operations >= 2e7 ? workers : NULL;
}

// In the caller's thread, one after the other, without workers (NULL).
static inline void pb_workers_run(const pb_workers *workers, size_t items, pb_work work,
                                  void *context) {
  if (pb_workers_count(workers) > 1 && items > 1) {
    workers->run(workers->pool, items, work, context);
    return;
  }
  for (size_t item = 0; item < items; item++) work(context, item, 0);
}

#endif
