// Frequency responses from periodic excitation in the steady state.
//
// Each of `experiments` ≥ nu experiments applies one periodic signal; its first periods are
// discarded by the caller, the others are transformed over exactly one period (no leakage) and
// averaged:
//   Ĥ(f) = Ȳ(f) Ū(f)⁻¹,  Ȳ [ny × e], Ū [nu × e]      (least squares when e > nu)
// The scatter from period to period gives the noise: with W = Ū⁻¹ (e × nu), P_e periods,
//   σ²_{o,e} = Σ_p |Y_p − Ȳ|² / ((P_e − 1) P_e),  var Ĥ_oi = Σ_e |W_ei|² σ²_{o,e}
// (the inputs repeat exactly; where they do not, this is an upper estimate)
// and the coherence quoted is what one period's power and scatter would give:
//   γ²_o = Σ_e |Ȳ_oe|² / Σ_e (|Ȳ_oe|² + P_e σ²_{o,e}).
// R. Pintelon, J. Schoukens, "System Identification: A Frequency Domain Approach", chapter 2.
#ifndef PB_SIGNAL_PERIODIC_H
#define PB_SIGNAL_PERIODIC_H

#include <stdbool.h>
#include <stddef.h>

#include "signal/frf.h"

typedef struct pb_periodic_options {
  double sample_rate;  // Hz
  size_t period;       // samples
  size_t experiments;  // ≥ nu
  double f1, f2;       // Hz, the lines that are excited
} pb_periodic_options;

typedef struct pb_periodic pb_periodic;

// Allocates everything that pushing needs. [init] PB_ERR_ARGUMENT names the option that is refused.
pb_status pb_periodic_new(const pb_periodic_options *options, size_t nu, size_t ny,
                          pb_periodic **out, pb_error *err);
void pb_periodic_free(pb_periodic *periodic);

// One sample of experiment e: u[nu] and the y[ny] that belongs to it. No allocation. [rt]
// True when it completed a period.
bool pb_periodic_push(pb_periodic *periodic, size_t experiment, const double *u, const double *y);

// Forgets the period under way: call it where the record has a gap. [rt]
void pb_periodic_break(pb_periodic *periodic);

// Whole periods so far of one experiment.
size_t pb_periodic_count(const pb_periodic *periodic, size_t experiment);

// Difference of the last and the first period of each experiment, as a response of `experiments`
// inputs: h[nf][ny][experiments]. The steady state cancels in it; what is left is the decay of what
// the start of the excitation set off, and noise. [init] PB_ERR_STATE when an experiment has fewer
// than two periods, or periods that do not follow one another.
pb_status pb_periodic_difference(const pb_periodic *periodic, pb_frf *out, pb_error *err);

// Removes from the means what free decays at given poles explain. With a transient Σ c λᵗ over the
// records, period p has the lines
//   T_p(f) = Σ c λ^{pN} g(f),   g = (1 − λ^N) / (1 − λ e^{−2πi f/f_s}),   D = T_{P−1} − T_0,
// so that c follows from D by least squares over the lines, and the means lose Σ_p T_p / P.
// The scatter becomes that of D's remainder. pole[poles]: one of each conjugate pair (Im z > 0), or
// real, as z. *explained is the part of D's power that the poles explain; below 0.5 nothing is
// changed, nor where experiments have different numbers of periods. Estimates after this; pushing
// further periods is not possible any more. [init] Fails with PB_ERR_STATE as above, PB_ERR_NUMERIC
// (LAPACK), PB_ERR_MEMORY.
pb_status pb_periodic_settle(pb_periodic *periodic, const double complex *pole, size_t poles,
                             double *explained, pb_error *err);

// Estimates from the periods so far; can be called again later. [init]
// Fails with PB_ERR_STATE (an experiment with fewer than two periods), PB_ERR_NUMERIC (a non-finite
// record). Lines that the inputs do not excite have h = 0, coherence 0 and infinite variance.
pb_status pb_periodic_estimate(const pb_periodic *periodic, pb_frf *out, pb_error *err);

#endif
