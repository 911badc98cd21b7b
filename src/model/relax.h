// Sensor stacks with a resistor: first-order states beside the modes.
#ifndef PB_MODEL_RELAX_H
#define PB_MODEL_RELAX_H

#include "assembly/system.h"
#include "model/build.h"

// Closes the builder's model, whose last inputs and outputs are the system's relaxations, over
// their states, block-diagonalises, truncates and discretises. The builder is empty afterwards, or
// on failure for the caller to discard. Fails with PB_ERR_NUMERIC, PB_ERR_MEMORY. [init]
pb_status pb_model_relax(const pb_system *system, pb_model_builder *builder, pb_model **out,
                         pb_error *err);

#endif
