// Integral force feedback.
//
//   K_IFF(s) = g · 1/(s + ω_i) · s/(s + ω_h),  ω_i = 2·2π, ω_h = 0.5·2π rad/s by default
//
// "Optimization using Finite Element Models" (T. Dehaeze, 2025), eq. 1.4: an integrator with
// limited gain at low frequency and a high-pass filter. Applied as V_a = +K_IFF V_s it damps the
// suspension.
#ifndef PB_CONTROL_IFF_H
#define PB_CONTROL_IFF_H

#include "control/lti.h"

typedef struct pb_iff {
  double gain;           // g, input unit per output unit and second; any sign
  double integrator_hz;  // ω_i / 2π, > 0
  double highpass_hz;    // ω_h / 2π, > 0
} pb_iff;

// The corner frequencies of the report, 2 Hz and 0.5 Hz.
pb_iff pb_iff_default(double gain);

// K_IFF on each of `struts` channels, continuous (2 states a channel). [init]
// PB_ERR_ARGUMENT for a non-finite gain, a corner that is not positive, no channel; PB_ERR_MEMORY.
pb_status pb_iff_continuous(const pb_iff *iff, size_t struts, pb_lti *out, pb_error *err);

// The same by Tustin's rule at a sample rate in Hz. [init]
pb_status pb_iff_discrete(const pb_iff *iff, size_t struts, double sample_rate, pb_lti *out,
                          pb_error *err);

#endif
