// Frequency responses from random records by Welch's method of averaged modified periodograms.
//
//   S_ab(f) = mean over segments of A(f) B(f)*,   A, B transforms of windowed segments
//   H1 = S_yu S_uu⁻¹          (noise on the outputs; nu inputs at once)
//   H2 = S_yy / S_uy          (noise on the input; one input)
//   γ² = S_yu S_uu⁻¹ S_uy / S_yy                              multiple coherence, one per output
//   var Ĥ_oi = S_yy (1 − γ²) [S_uu⁻¹]_ii / (n_e − nu)
// with n_e the number of segments corrected for their overlap. P. Welch, 1967; J. Bendat, A.
// Piersol, "Random Data", chapters 7, 9 and 11; var is that of least squares with n_e complex
// observations.
#ifndef PB_SIGNAL_SPECTRUM_H
#define PB_SIGNAL_SPECTRUM_H

#include <stddef.h>

#include "signal/frf.h"
#include "signal/window.h"

typedef enum pb_estimator { PB_ESTIMATE_H1, PB_ESTIMATE_H2 } pb_estimator;

typedef struct pb_welch_options {
  double sample_rate;  // Hz
  size_t length;       // samples a segment; resolution = sample_rate / length
  double overlap;      // 0 … 0.95 of a segment
  pb_window window;
  pb_detrend detrend;
  double f1, f2;  // Hz, lines kept; both 0: all from the first above 0 to Nyquist
} pb_welch_options;

typedef struct pb_welch pb_welch;

// Allocates everything that pushing needs. [init] PB_ERR_ARGUMENT names the option that is refused.
pb_status pb_welch_new(const pb_welch_options *options, size_t nu, size_t ny, pb_welch **out,
                       pb_error *err);
void pb_welch_free(pb_welch *welch);

// One sample of all signals: u[nu] and the y[ny] that belongs to it. Every completed segment is
// transformed and added. No allocation. [rt] True when a segment was completed.
bool pb_welch_push(pb_welch *welch, const double *u, const double *y);

// Forgets the segment under way: call it where the record has a gap. [rt]
void pb_welch_break(pb_welch *welch);

size_t pb_welch_segments(const pb_welch *welch);

// Estimates from the segments so far; can be called again later. [init]
// Fails with PB_ERR_STATE (fewer than nu + 1 segments), PB_ERR_ARGUMENT (H2 with several inputs),
// PB_ERR_NUMERIC (a record with a non-finite value). Lines that the inputs do not excite
// independently have h = 0, coherence 0 and infinite variance.
pb_status pb_welch_estimate(const pb_welch *welch, pb_estimator estimator, pb_frf *out,
                            pb_error *err);

// All in one: arrays u[n][nu] and y[n][ny].
pb_status pb_welch_record(const pb_welch_options *options, const double *u, size_t nu,
                          const double *y, size_t ny, size_t n, pb_estimator estimator, pb_frf *out,
                          pb_error *err);

#endif
