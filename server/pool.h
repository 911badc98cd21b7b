// Threads for the making of a model: base/workers.h.
#ifndef PB_SERVER_POOL_H
#define PB_SERVER_POOL_H

#include <pthread.h>
#include <stdbool.h>

#include "base/workers.h"

enum { PB_POOL_MOST = 4 };  // what a model is made of does not share well among more

typedef struct pb_pool {
  pb_workers workers;  // of a thread for each processor, the one that calls `run` among them
  pthread_mutex_t lock;
  pthread_cond_t begun, ended;
  pthread_t thread[PB_POOL_MOST];
  size_t threads, started;  // besides the caller's; that have asked for their number
  unsigned long turn;       // raised by each `run`
  bool stop;
  pb_work work;
  void *context;
  size_t items, next, busy;  // next item that nobody has; threads that may still be at one
} pb_pool;

// A thread for each processor that this one may use, with its scheduling; started when `run` first
// has work for them, by the one thread that may call it. `pool` stays where it is until it is
// closed.
void pb_pool_open(pb_pool *pool);
void pb_pool_close(pb_pool *pool);

#endif
