// Windows and trends of a segment, for spectral estimates.
#ifndef PB_SIGNAL_WINDOW_H
#define PB_SIGNAL_WINDOW_H

#include <stdbool.h>
#include <stddef.h>

typedef enum pb_window {
  PB_WINDOW_RECTANGULAR,
  PB_WINDOW_HANN,
  PB_WINDOW_HAMMING,
  PB_WINDOW_BLACKMAN,
  PB_WINDOW_FLAT_TOP,
} pb_window;

typedef enum pb_detrend { PB_DETREND_NONE, PB_DETREND_MEAN, PB_DETREND_LINEAR } pb_detrend;

// Fills w[n] with the periodic form (period n), cosine sums of G. Heinzel, A. Rüdiger, R.
// Schilling, "Spectrum and spectral density estimation by the DFT", 2002. [any]
void pb_window_fill(pb_window window, size_t n, double *w);

// "rectangular", "hann", "hamming", "blackman", "flattop"; false if unknown. [any]
bool pb_window_parse(const char *name, pb_window *window);

// Removes the mean, or the straight line of least squares, from x[n]. [rt]
void pb_detrend_apply(pb_detrend detrend, double *x, size_t n);

#endif
