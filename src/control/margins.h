// How far a stable feedback loop is from instability.
//
// One loop, L(jω) with negative feedback: gain margin where L crosses the negative real axis (a
// factor above 1 that makes it unstable, and one below 1 where less gain does), phase margin where
// |L| = 1, delay margin the dead time that turns L to −1 at one of these frequencies (the highest
// decides it as a rule, whatever the phase margin of the lowest), modulus margin
// min |1 + L| = 1/max |S|. Several loops: the same of each characteristic
// locus λ_i(L(jω)), and the largest singular values of S = (I + L)⁻¹ and T = L S (S. Skogestad, I.
// Postlethwaite, "Multivariable Feedback Control", chapters 3, 4 and 9). Margins are distances;
// that the loop is stable is for the closed-loop poles to say.
#ifndef PB_CONTROL_MARGINS_H
#define PB_CONTROL_MARGINS_H

#include <complex.h>
#include <stddef.h>

#include "base/status.h"
#include "control/poles.h"

// Of one loop. Frequencies in Hz, NaN where there is no such crossing.
typedef struct pb_margins {
  double crossover_hz;             // highest |L| = 1
  double phase_degree, phase_hz;   // smallest over all |L| = 1; infinite where there is none
  double gain_up, gain_up_hz;      // smallest factor > 1 to the border; infinite: none
  double gain_down, gain_down_hz;  // largest factor < 1 to the border; 0: none
  double delay,
      delay_hz;  // s, smallest over all |L| = 1 of what turns L there to −1; infinite: none
  double modulus, modulus_hz;  // min |1 + L|, between the points of the grid too
} pb_margins;

// Margins of l[f · stride] at hz[nf], ascending: crossings lie on arcs through three neighbours, as
// of one resonance, so that the grid must be fine where L turns (pb_margins_grid). The end of the
// grid counts where L is real there, and 0 Hz where it is the begin. [any]
pb_margins pb_margins_of(const double *hz, size_t nf, const double complex *l, size_t stride);

// Ascending frequencies for margins, *hz [*count] owned by the caller: `points` even in logarithm
// from f1 to f2, and around each pole its own width times powers of 2. [init]
pb_status pb_margins_grid(double f1, double f2, size_t points, const pb_pole_list *poles,
                          double **hz, size_t *count, pb_error *err);

// Zero-initialise; free with pb_mimo_clear.
typedef struct pb_mimo {
  size_t nf, n;
  double complex *locus;  // [nf][n] eigenvalues of L, each column one continuous locus
  double *s, *t;          // [nf] largest singular value of S and of T
  pb_margins *margins;    // [n] of the loci
  double s_peak, s_peak_hz, t_peak, t_peak_hz;  // between the points too
  double s_low_hz;  // up to here the largest singular value of S stays below 1/√2; 0: nowhere
} pb_mimo;

// l: [nf][n][n] row-major at hz[nf]. [init] PB_ERR_NUMERIC (eigenvalues), PB_ERR_MEMORY.
pb_status pb_mimo_analyse(const double *hz, size_t nf, size_t n, const double complex *l,
                          pb_mimo *out, pb_error *err);
void pb_mimo_clear(pb_mimo *mimo);

// (I + L)⁻¹ of one frequency, n × n row-major as l; s = l is allowed; work [2 n²]. False: singular.
// [any]
int pb_sensitivity_of(size_t n, const double complex *l, double complex *s, double complex *work);

// Largest singular value of m, n × n in either order. [init] PB_ERR_NUMERIC, PB_ERR_MEMORY.
pb_status pb_largest_gain(size_t n, const double complex *m, double *out, pb_error *err);

#endif
