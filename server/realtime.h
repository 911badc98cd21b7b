// Real time: a thread that takes one step each interval of dt / speed by absolute deadlines.
//
// At deadline k+1 the thread takes the newest inputs from a ring, holds them over [k, k+1),
// advances, and puts record k+1 into another ring. It makes no call into the middleware, allocates
// nothing, and takes no lock. A semaphore tells the thread that publishes. A deadline missed by a
// whole interval counts as an overrun; the grid of deadlines is kept, and moved only when it is
// `PB_REALTIME_BEHIND` seconds behind (the steps are then late for good: `slips` counts how often).
#ifndef PB_REALTIME_H
#define PB_REALTIME_H

#include <pthread.h>
#include <semaphore.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "ring.h"
#include "stepper.h"

enum { PB_REALTIME_RECORDS = 1024, PB_REALTIME_INPUTS = 256 };
#define PB_REALTIME_BEHIND 0.05

// Inputs on their way to the step thread.
typedef struct pb_held_input {
  uint64_t for_step;  // the step they were meant for; UINT64_MAX: whichever is next
  bool counted;       // that they are late is counted already
  double u[PB_STEPPER_INPUTS];
} pb_held_input;

typedef struct pb_realtime_options {
  double speed;  // plant seconds per second, > 0
  int priority;  // SCHED_FIFO priority asked for; 0: none
  int cpu;       // processor asked for; −1: none
} pb_realtime_options;

typedef struct pb_realtime {
  pb_stepper *stepper;  // the step thread's while it runs
  pb_realtime_options options;
  pthread_t thread;
  bool running;
  atomic_bool stop;
  sem_t published;  // raised for each record
  pb_ring records;  // step thread → publisher
  pb_ring inputs;   // whoever holds the caller's lock → step thread
  pb_record record_slot[PB_REALTIME_RECORDS];
  pb_held_input input_slot[PB_REALTIME_INPUTS];
  atomic_uint_fast64_t overruns, late, dropped, slips;  // since the daemon started
  atomic_bool fifo, affinity;                           // obtained
} pb_realtime;

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

#endif
