// Zeros and poles of a plant beside those of the same plant sampled.
//
// A plant that is stepped with held inputs has zeros of its own: those of
// H(z) = C (zI − A_d)⁻¹ B_d + D z⁻¹. Near each zero s_0 of the continuous plant below Nyquist lies
// one of them, z_0 = e^{s' T} with s' ≈ s_0, but not at it, and the damping of s' may have the
// other sign: lightly damped zeros are seen on the wrong side of the axis although the plant is
// minimum-phase (Åström, Hagander and Sternby, "Zeros of sampled systems", Automatica 20, 1984).
// Poles have z = e^{sT} exactly. Zeros that sampling adds (near z = −1) are none of the plant's and
// not listed.
#ifndef PB_MODEL_SAMPLED_ROOTS_H
#define PB_MODEL_SAMPLED_ROOTS_H

#include "model/model.h"

typedef struct pb_sampled_root {
  double complex s;     // of the continuous plant, rad/s, Im s ≥ 0
  double hz, damping;   // |s|/2π; −Re s/|s|, 0 at the origin
  size_t multiplicity;  // how often the list has this root
  bool has_sampled;   // false: |s| above Nyquist, or sampling leaves none that belongs to it alone
  double complex z;   // of the sampled plant
  double sampled_hz;  // |s'|/2π, s' = ln(z) f_s
  double sampled_damping;  // −Re s'/|s'|
  bool sign_differs;       // one of the two dampings is negative and the other is not, beyond 1e-9:
                           // what the sampled zero shows there is made by sampling
} pb_sampled_root;

// Zeros as pb_model_zeros lists them, one entry for each pair of conjugates (Im s ≥ 0), each with
// its sampled counterpart: followed as the period grows from 0 to that of the model, so that it is
// the zero's own and no other's. *out [*count] is the caller's (free). Fails as pb_model_zeros
// does. [init]
pb_status pb_model_sampled_zeros(const pb_model *model, const size_t *input, const size_t *output,
                                 size_t channels, double max_hz, pb_sampled_root **out,
                                 size_t *count, pb_error *err);

// Poles likewise, ascending in |s|; max_hz > 0: only those with |s| ≤ 2π·max_hz. Above Nyquist z is
// that of an alias, and has_sampled false. [init]
pb_status pb_model_sampled_poles(const pb_model *model, double max_hz, pb_sampled_root **out,
                                 size_t *count, pb_error *err);

#endif
