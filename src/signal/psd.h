// Power spectral density of a signal, and its cumulative amplitude.
//
//   S(f_k) = 2/(f_s Σw²) |Σ_n w(n) x(n) e^{−2πi kn/N}|², averaged over segments; not doubled at 0
//   and at half the sample rate: one-sided, Σ_k S(f_k) f_s/N is the mean square of w x, scaled
//   A(f_k) = √(Σ_{j ≥ k} S(f_j) f_s/N): the rms of what lies at f_k and above
//
// P. Welch, 1967. Segments are given one by one, so that a record with gaps or stages can be used.
#ifndef PB_SIGNAL_PSD_H
#define PB_SIGNAL_PSD_H

#include <stddef.h>

#include "base/status.h"
#include "signal/window.h"

typedef struct pb_psd pb_psd;

// Segments of `length` samples, 4 or more; lines 0 … length/2, sample_rate/length apart. [init]
// PB_ERR_ARGUMENT, PB_ERR_MEMORY. Freed with pb_psd_free.
pb_status pb_psd_new(double sample_rate, size_t length, pb_window window, pb_psd **out,
                     pb_error *err);
void pb_psd_free(pb_psd *psd);

// One segment x[0], x[stride], … of `length` samples. No allocation. [rt]
void pb_psd_add(pb_psd *psd, const double *x, size_t stride);

size_t pb_psd_segments(const pb_psd *psd);
size_t pb_psd_lines(const pb_psd *psd);

// The average so far into density[lines], unit² per Hz; NaN without a segment. [any]
void pb_psd_density(const pb_psd *psd, double *density);

// A(f_k) into amplitude[lines]; lines f1 ≤ k·df ≤ f2 only, beyond them nothing is added. [any]
void pb_cumulative_amplitude(const double *density, size_t lines, double df, double f1, double f2,
                             double *amplitude);

#endif
