// The plant being stepped: its model, its state, what runs beside it in the step, and the record of
// the current step.
//
//   y(k) = C x(k) + D u(k−1);   u(k) = clients' + hosted(y(k));   x(k+1) = A_d x(k) + B_d u(k)
//
// One thread at a time steps it: the listener in lockstep, the step thread in real time. No
// allocation and no failure after pb_stepper_init. What changes the model or the hosted items is
// prepared elsewhere as a pb_change and made between two steps.
#ifndef PB_STEPPER_H
#define PB_STEPPER_H

#include <stdbool.h>
#include <stdint.h>

#include "carrier.h"
#include "host.h"
#include "model/model.h"
#include "model/transfer.h"

// Bits of a record's flags; the same as the FLAG_ constants of the bus.
enum {
  PB_FLAG_HELD = 1,        // an acting member gave no command for the last interval
  PB_FLAG_LATE = 2,        // a command acted later than the step it was for
  PB_FLAG_NON_FINITE = 4,  // an output is not finite
  PB_FLAG_OVERRUN = 8,     // real time: the step began later than one interval
  PB_FLAG_SATURATED = 16,  // an input was cut by its electronics: range or slew
  PB_FLAG_COUNT = 5,
  PB_STEPPER_INPUTS = 32,
  PB_STEPPER_OUTPUTS = 64,
};

// What is published of one step.
typedef struct pb_record {
  uint64_t step;
  uint32_t epoch, revision, flags;
  uint32_t nu, ny;              // of this revision
  uint64_t hash;                // of all steps of the epoch up to and with this one
  double u[PB_STEPPER_INPUTS];  // applied over the interval that ended at this step
  double y[PB_STEPPER_OUTPUTS];
} pb_record;

typedef struct pb_stepper {
  const pb_model *model;
  pb_state *state;
  pb_host *host;  // NULL: none
  uint32_t revision;
  double y[PB_STEPPER_OUTPUTS];  // measured at the current step, as the hosted items see it
  pb_record now;                 // of the current step
} pb_stepper;

// Another model with another state, or another set of hosted items, or both. Whoever makes it owns
// what the pointers hold, before the change the new ones, after it the old ones.
typedef struct pb_change {
  uint64_t at_step;       // made at this step or the first after it
  const pb_model *model;  // NULL: stays
  pb_state *state;        // of that model
  pb_transfer *transfer;  // from the old state to the new one; NULL: `state` is taken as it is
  pb_carrier *carrier;    // real time: prepared to spread the transfer over steps; NULL: it is not
  size_t ahead;           // steps over which the carrier's handover is spread
  pb_handover *handover;  // set by whoever makes the change when all of it was spread
  uint32_t revision;
  int input_from[PB_STEPPER_INPUTS];  // old index of each input of the model; −1: new
  bool swaps_host;
  pb_host *host;       // taken when swaps_host; NULL: none
  uint64_t made_step;  // of the change
} pb_change;

// Borrows the model; at rest, epoch 1, revision 1. Fails with PB_ERR_ARGUMENT when the plant has
// more signals than the bus can carry, PB_ERR_MEMORY. [init]
pb_status pb_stepper_init(pb_stepper *stepper, const pb_model *model, pb_error *err);
void pb_stepper_free(pb_stepper *stepper);

// Whether the bus can carry the model's signals: PB_ERR_ARGUMENT when not. [any]
pb_status pb_stepper_admits(const pb_model *model, pb_error *err);

// Holds u, the clients' sum, over the current interval and goes to the next step; flags as known by
// the caller. [rt]
void pb_stepper_step(pb_stepper *stepper, const double *u, uint32_t flags);

// Makes a change before the current step's input is held. The record of the current step stays as
// it was published. [rt]
void pb_stepper_change(pb_stepper *stepper, pb_change *change);

// Makes the record of the current step anew, after a change that nobody was waiting in. [rt]
void pb_stepper_renew(pb_stepper *stepper);

// At rest at step 0 (state NULL) or in a saved state (pb_state_bytes of it, with its hash) in a new
// epoch; the hosted items start anew, the caller loads theirs. [rt]
void pb_stepper_restart(pb_stepper *stepper, const pb_state *state, uint64_t hash, uint32_t epoch);

#endif
