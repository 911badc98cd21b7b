// The thread that carries a large state over while the old model still steps: model/handover.h.
//
// It sleeps until whoever steps has begun the handover and posted `begun`, and tells by `carried`
// that it is through. Without it in time the whole product is left to the step of the change.
#ifndef PB_CARRIER_H
#define PB_CARRIER_H

#include <pthread.h>
#include <semaphore.h>
#include <stdatomic.h>
#include <stdbool.h>

#include "model/handover.h"

typedef struct pb_carrier {
  pb_handover *handover;  // owned; NULL: there is no such thread
  pthread_t thread;
  sem_t begun;
  atomic_bool carried, cancelled;
} pb_carrier;

// Steps ahead of the change at which a handover begins, where `rate` steps are taken a second: as
// long as the product may take a thread of ordinary priority. 0: it fits into a step as it is.
size_t pb_carrier_steps(const pb_transfer *transfer, double rate);

// Takes the handover over. False, and it stays the caller's: no thread could be had. `carrier`
// stays where it is until the end. [init]
bool pb_carrier_start(pb_carrier *carrier, pb_handover *handover);

// Ends the thread, whatever it is at, and frees the handover. All zero is allowed, and left.
void pb_carrier_end(pb_carrier *carrier);

#endif
