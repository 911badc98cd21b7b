// Transmission zeros: the points s where the transfer matrix H(s) = C (sI − A)⁻¹ B + D between
// chosen inputs and outputs (as many of each) loses rank. For one input and one output: H(s) = 0.
#ifndef PB_MODEL_ZEROS_H
#define PB_MODEL_ZEROS_H

#include <complex.h>
#include <stddef.h>

#include "base/status.h"
#include "model/model.h"

enum { PB_ZEROS_DIRECT = 420 };  // states up to which all zeros are found

// Zeros in rad/s of the continuous-time model from input[count] to output[count] (indices into the
// model's lists), ascending in magnitude, conjugates adjacent (positive imaginary part first).
// Gains and delays of the electronics move no zero.
// Modes that the channel does not see are no zeros. max_hz > 0: only zeros with |Im s| ≤ 2π·max_hz;
// needed for models of more than PB_ZEROS_DIRECT states; 0: all.
// *zeros [*zero_count] is owned by the caller (free). [init]
// Fails with PB_ERR_ARGUMENT (no or unequal channels, an index out of range, a large model without
// a band), PB_ERR_SINGULAR (the channel's transfer matrix is singular everywhere), PB_ERR_NUMERIC
// (the eigenvalue method), PB_ERR_MEMORY.
pb_status pb_model_zeros(const pb_model *model, const size_t *input, const size_t *output,
                         size_t count, double max_hz, double complex **zeros, size_t *zero_count,
                         pb_error *err);

#endif
