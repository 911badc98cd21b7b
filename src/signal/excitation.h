// Excitation signals, written into arrays u[n][nu] (row k: all inputs at step k), in the input's
// unit.
//
// Band-limited Gaussian noise: spectrum drawn line by line, zero outside [f1, f2], exact rms.
// Logarithmic chirp: u = A sin(2π f1 L (e^{t/L} − 1)), L = T / ln(f2/f1) (A. Farina, 2000).
// Multisine: u(n) = Σ_k A cos(2π k n/N + φ_k) over the lines k of [f1, f2]; random phases, or
// Schroeder's φ_k = −π k(k−1)/K (M. Schroeder, 1970); crest factor lowered on request by clipping
// and restoring the amplitudes (E. van der Ouderaa, J. Schoukens, J. Renneboog, 1988). Orthogonal
// multisines: experiment e multiplies input i by e^{2πi e i/nu}, so that at each line the nu × nu
// matrix of inputs is unitary up to a scale (T. Dobrowiecki, J. Schoukens, P. Guillaume, 2006).
//
// The same specification and seed give the same bits on hosts with the same C library.
#ifndef PB_SIGNAL_EXCITATION_H
#define PB_SIGNAL_EXCITATION_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/status.h"

typedef enum pb_phases { PB_PHASES_RANDOM, PB_PHASES_SCHROEDER } pb_phases;

typedef struct pb_noise_spec {
  double sample_rate;  // Hz
  double f1, f2;       // Hz, 0 ≤ f1 < f2 ≤ sample_rate / 2
  double rms;          // of each input, exact over the n samples
  bool periodic;       // repeats without a seam after n samples
  uint64_t seed;
} pb_noise_spec;

typedef struct pb_multisine_spec {
  double sample_rate;  // Hz
  double f1, f2;       // Hz, lines k with f1 ≤ k fs/N ≤ f2, k ≥ 1, below Nyquist
  double rms;          // of each input, exact
  pb_phases phases;
  unsigned crest_iterations;  // of crest-factor reduction; 0: none
  uint64_t seed;
} pb_multisine_spec;

// All: [init]; PB_ERR_ARGUMENT for a non-finite or impossible value (the message names it),
// PB_ERR_MEMORY. u is the caller's; unchanged on failure.

// u[n][nu]: independent noise on each input.
pb_status pb_excite_noise(const pb_noise_spec *spec, size_t n, size_t nu, double *u, pb_error *err);

// u[n]: one sweep from f1 to f2 (either order, both > 0) of the given amplitude over n samples.
pb_status pb_excite_chirp(double sample_rate, double f1, double f2, double amplitude, size_t n,
                          double *u, pb_error *err);

// u[n][nu]: one period of n samples, each input with phases of its own.
pb_status pb_excite_multisine(const pb_multisine_spec *spec, size_t n, size_t nu, double *u,
                              pb_error *err);

// u[nu][n][nu]: one period for each of nu experiments, orthogonal over the experiments.
pb_status pb_excite_orthogonal(const pb_multisine_spec *spec, size_t n, size_t nu, double *u,
                               pb_error *err);

// First and last line of [f1, f2] in a period of n samples; false when there is none. [any]
bool pb_multisine_lines(double sample_rate, double f1, double f2, size_t n, size_t *first,
                        size_t *last);

// max|u| / rms of column i of u[n][nu]. [any]
double pb_crest_factor(const double *u, size_t n, size_t nu, size_t i);

#endif
