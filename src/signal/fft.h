// Discrete Fourier transform of any length, double precision.
//
//   X(k) = Σ_n x(n) e^{−2πi kn/N}
//
// Lengths whose prime factors are 2, 3, 5 and 7 go through a mixed-radix Stockham transform
// (autosort: no bit reversal, unit stride). Any other length becomes a circular convolution of a
// power of two (L. Bluestein, "A linear filtering approach to the computation of the discrete
// Fourier transform", 1970). Written here because Debian has no double-precision transform under a
// permissive licence: kissfft is packaged in single precision, FFTW and GSL are GPL.
#ifndef PB_SIGNAL_FFT_H
#define PB_SIGNAL_FFT_H

#include <complex.h>
#include <stddef.h>

#include "base/status.h"

#define PB_FFT_MAX_LENGTH ((size_t)1 << 26)

// A plan and its work space. One thread at a time executes a plan.
typedef struct pb_fft {
  size_t n;
  size_t factors, factor[32];  // radices of the Stockham passes; 0 factors: Bluestein (or n = 1)
  double complex *root;        // [n] e^{−2πi k/n}
  double complex *work;        // [n], or [inner->n] for Bluestein
  struct pb_fft *inner;        // Bluestein: transform of the convolution's length
  double complex *chirp;       // [n] e^{−πi k²/n}
  double complex *kernel;      // [inner->n] transform of the conjugate chirp, divided by inner->n
  double complex *product;     // [inner->n]
} pb_fft;

// Prepares a transform of n points, 1 ≤ n ≤ PB_FFT_MAX_LENGTH. [init]
// Fails with PB_ERR_ARGUMENT (length), PB_ERR_MEMORY. Freed with pb_fft_clear.
pb_status pb_fft_init(size_t n, pb_fft *fft, pb_error *err);

// Frees what init allocated; a zeroed struct is allowed. [init]
void pb_fft_clear(pb_fft *fft);

// out[n] = transform of in[n]; in and out may be the same array. No allocation. [rt]
void pb_fft_forward(pb_fft *fft, const double complex *in, double complex *out);

// out[n] = inverse transform of in[n], with the factor 1/n; in and out may be the same. [rt]
void pb_fft_inverse(pb_fft *fft, const double complex *in, double complex *out);

#endif
