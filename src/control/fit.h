// Modes from measured frequency responses: a rational model with common poles over several
// channels.
//
//   H_c(z) ≈ Σ_n r_{c,n} / (w − p_n) + d_c,   w = (2/T)(z − 1)/(z + 1)
//
// w maps the z plane one to one, so that this is a general proper rational function of z, fitted
// where partial fractions are well conditioned; poles go back by z = (1 + w T/2)/(1 − w T/2),
// exactly. Relaxed vector fitting (B. Gustavsen, A. Semlyen, 1999; B. Gustavsen, 2006) with the QR
// compression over channels of D. Deschrijver et al. (2008). Poles come in conjugate pairs or real,
// unstable ones are reflected. Where the order is not given it is raised, a pair at a time where
// the error is largest, until the error reaches the noise or stops falling.
#ifndef PB_CONTROL_FIT_H
#define PB_CONTROL_FIT_H

#include "control/poles.h"
#include "signal/frf.h"

typedef enum pb_fit_weight {
  PB_FIT_RELATIVE,  // 1/|H|: the same relative accuracy in valleys as on peaks; for clean data
  PB_FIT_NOISE,  // 1/√(σ² + (floor |H|)²), σ² the variance of the estimate; for noisy data
} pb_fit_weight;

typedef struct pb_fit_options {
  double sample_rate;  // Hz
  double f1, f2;       // Hz, lines used; both 0: all
  size_t poles;        // order; 0: found
  size_t max_poles;    // limit of the search, which begins with 4; 0: 40
  double tolerance;    // relative rms error at which the search ends; 0: 1e-7
  double floor;        // of PB_FIT_NOISE: relative error that the data has at best; 0: 1e-4
  pb_fit_weight weight;
} pb_fit_options;

typedef struct pb_fit_channel {
  size_t output, input;  // of the frf
} pb_fit_channel;

// Zero-initialise; free with pb_fit_clear. Poles: one entry a conjugate pair (Im w > 0) or real
// pole.
typedef struct pb_fit {
  double sample_rate;
  size_t channels, poles;
  double complex *w;        // [poles] rad/s
  pb_pole *pole;            // [poles] by frequency
  double *strength;         // [poles] largest peak |r|/|Re p| of a channel over its median |H|
  double complex *residue;  // [channels][poles]; of a pair: that of the upper pole
  double *direct;           // [channels] d
  double error;             // √(Σ|Ĥ − H|² / Σ|H|²) over the lines, rms over the channels
} pb_fit;

// Fits channel[channels] of a measured response. Lines with infinite variance are left out. [init]
// PB_ERR_ARGUMENT (options, too few lines), PB_ERR_NUMERIC (LAPACK, non-finite data),
// PB_ERR_MEMORY.
pb_status pb_fit_frf(const pb_frf *frf, const pb_fit_channel *channel, size_t channels,
                     const pb_fit_options *options, pb_fit *out, pb_error *err);

void pb_fit_clear(pb_fit *fit);

// The fitted response of a channel. [any]
double complex pb_fit_evaluate(const pb_fit *fit, size_t channel, double hz);

// Zeros of one channel, upper half plane, by frequency. [init] PB_ERR_NUMERIC, PB_ERR_MEMORY.
pb_status pb_fit_zeros(const pb_fit *fit, size_t channel, pb_pole_list *out, pb_error *err);

// The fitted pole or zero nearest to a wanted one, in |Δs|/|s|; NULL for an empty list. [any]
const pb_pole *pb_pole_nearest(const pb_pole *pole, size_t count, pb_pole wanted,
                               double sample_rate);

#endif
