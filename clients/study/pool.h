// Points computed by processes on this host's cores.
//
// Processes and not threads: file libraries that are not safe in threads stay out of the way, and a
// point that fails takes no other with it. Each worker takes the next point that nobody has, so
// that slow points do not wait in a queue; where a point is computed does not change its bits.
#ifndef PB_STUDY_POOL_H
#define PB_STUDY_POOL_H

#include "wire.h"

typedef struct study_pool {
  // Computes point `index`; called in a worker, or in this process where there is one worker.
  pb_status (*compute)(void *context, size_t index, pb_study_point *out, pb_error *err);
  // Takes a result over, in this process, in the order in which they come. A failure ends the run.
  pb_status (*collect)(void *context, study_message *message, pb_error *err);
  bool (*interrupted)(void);
  void *context;
} study_pool;

// Computes points index[0 … count−1]. [init] Fails as compute and collect do, with PB_ERR_STATE (a
// worker that died, an interrupt), PB_ERR_IO.
pb_status study_pool_run(const study_pool *pool, const size_t *index, size_t count, size_t workers,
                         pb_error *err);

#endif
