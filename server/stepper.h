// The plant being stepped: its model, its state and the record of the current step.
//
//   y(k) = C x(k) + D u(k−1);   x(k+1) = A_d x(k) + B_d u(k)
//
// One thread at a time steps it: the listener in lockstep, the step thread in real time. No
// allocation and no failure after pb_stepper_init.
#ifndef PB_STEPPER_H
#define PB_STEPPER_H

#include <stdbool.h>
#include <stdint.h>

#include "model/model.h"

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
  uint32_t epoch, flags;
  double u[PB_STEPPER_INPUTS];  // held over the interval that ended at this step
  double y[PB_STEPPER_OUTPUTS];
} pb_record;

typedef struct pb_stepper {
  const pb_model *model;
  pb_state *state;
  pb_record now;  // of the current step
} pb_stepper;

// Borrows the model; at rest, epoch 1. Fails with PB_ERR_ARGUMENT when the plant has more signals
// than the bus can carry, PB_ERR_MEMORY. [init]
pb_status pb_stepper_init(pb_stepper *stepper, const pb_model *model, pb_error *err);
void pb_stepper_free(pb_stepper *stepper);

// Holds u over the current interval and goes to the next step; flags as known by the caller. [rt]
void pb_stepper_step(pb_stepper *stepper, const double *u, uint32_t flags);

// At rest at step 0 (state NULL) or in a saved state (pb_state_bytes of it) in a new epoch. [rt]
void pb_stepper_restart(pb_stepper *stepper, const pb_state *state, uint32_t epoch);

#endif
