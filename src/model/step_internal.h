// Between the parts of stepping (internal to src/model).
#ifndef PB_MODEL_STEP_INTERNAL_H
#define PB_MODEL_STEP_INTERNAL_H

#include "model/model.h"

// Doubles of a state before those of the electronics: x, held inputs, scratch. [any]
size_t pb_state_plain(const pb_model *model);

// What the plant does, before any electronics: C x(k) + D u(k−1) into y [ny], and one entry of it.
// [rt]
void pb_step_motion(const pb_model *model, const pb_state *state, double *y);
double pb_step_motion_of(const pb_model *model, const pb_state *state, size_t output);

#endif
