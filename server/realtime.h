// Real time: a thread that takes one step each interval of dt / speed by absolute deadlines.
//
// At deadline k+1 the thread takes the newest inputs from a ring, holds them over [k, k+1),
// advances, and puts record k+1 into another ring. It makes no call into the middleware, allocates
// nothing, and takes no lock. A semaphore tells the thread that publishes.
//
// A deadline missed by a whole interval counts as an overrun. What follows is the overrun policy's:
//   catch-up  the grid of deadlines is kept, late steps are taken one after the other; it is moved
//             only when it is PB_REALTIME_BEHIND seconds behind (`slips` counts how often)
//   skip      deadlines that are over are left out (`skipped` counts them): plant time falls behind
//             the wall clock and no two steps are closer than an interval
//   stop      the thread ends (`gave_up`)
#ifndef PB_REALTIME_H
#define PB_REALTIME_H

#include <pthread.h>
#include <semaphore.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "histogram.h"
#include "ring.h"
#include "stepper.h"

enum { PB_REALTIME_RECORDS = 1024, PB_REALTIME_INPUTS = 256 };
#define PB_REALTIME_BEHIND 0.05

typedef enum pb_overrun { PB_OVERRUN_CATCH_UP, PB_OVERRUN_SKIP, PB_OVERRUN_STOP } pb_overrun;

// Inputs on their way to the step thread.
typedef struct pb_held_input {
  uint64_t for_step;  // the step they were meant for; UINT64_MAX: whichever is next
  uint32_t revision;  // of the model whose inputs these are
  bool counted;       // that they are late is counted already
  double u[PB_STEPPER_INPUTS];
} pb_held_input;

typedef struct pb_realtime_options {
  double speed;  // plant seconds per second, > 0
  int priority;  // SCHED_FIFO priority asked for; 0: none
  int cpu;       // processor asked for; −1: none
  pb_overrun overrun;
} pb_realtime_options;

typedef struct pb_realtime {
  pb_stepper *stepper;  // the step thread's while it runs
  pb_realtime_options options;
  pthread_t thread;
  bool running;
  atomic_bool stop, gave_up;
  sem_t published;  // raised for each record, and when a change was made or the thread gave up
  pb_ring records;  // step thread → publisher
  pb_ring inputs;   // whoever holds the caller's lock → step thread
  pb_record record_slot[PB_REALTIME_RECORDS];
  pb_held_input input_slot[PB_REALTIME_INPUTS];
  _Atomic(pb_change *) change;                                   // → step thread: to be made
  _Atomic(pb_change *) changed;                                  // step thread →: made
  atomic_uint_fast64_t overruns, skipped, late, dropped, slips;  // since the daemon started
  atomic_bool fifo, affinity, flush;                             // obtained
  pb_histogram jitter;     // from a deadline to the begin of its step
  pb_histogram step_time;  // of a step: input, advance, outputs
} pb_realtime;

// "catch-up", "skip", "stop"; −1 for anything else. [any]
const char *pb_overrun_name(pb_overrun overrun);
int pb_overrun_parse(const char *name);

// Once, before the first start. Fails with PB_ERR_IO. [init]
pb_status pb_realtime_init(pb_realtime *realtime, pb_stepper *stepper, pb_error *err);
void pb_realtime_free(pb_realtime *realtime);

// Starts and ends the step thread; from the first to the second the stepper belongs to it. u:
// inputs that act now. [init]
pb_status pb_realtime_start(pb_realtime *realtime, const pb_realtime_options *options,
                            const double *u, pb_error *err);
void pb_realtime_stop(pb_realtime *realtime);

// Hands inputs to the step thread; one caller at a time. False: the ring is full. [any]
bool pb_realtime_input(pb_realtime *realtime, const pb_held_input *input);

// Hands a change to the step thread, which gives it back through pb_realtime_changed when it is
// made. One at a time. [any]
void pb_realtime_change(pb_realtime *realtime, pb_change *change);

// Takes a change back that is not made yet; false: it is. [any]
bool pb_realtime_revoke(pb_realtime *realtime);

// The change that was made since the last call, or NULL. [any]
pb_change *pb_realtime_changed(pb_realtime *realtime);

#endif
