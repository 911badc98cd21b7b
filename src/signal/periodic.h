// Frequency responses from periodic excitation in the steady state.
//
// Each of `experiments` ≥ nu experiments applies one periodic signal; its first periods are
// discarded by the caller, the others are transformed over exactly one period (no leakage) and
// averaged:
//   Ĥ(f) = Ȳ(f) Ū(f)⁻¹,  Ȳ [ny × e], Ū [nu × e]      (least squares when e > nu)
// The scatter from period to period gives the noise: with W = Ū⁻¹ (e × nu), P_e periods,
//   V_p = (Y_p − Ȳ) − Ĥ (U_p − Ū),
//   σ²_{o,e} = Σ_p |V_p|² / ((P_e − 1) P_e),  var Ĥ_oi = Σ_e |W_ei|² σ²_{o,e}
// In open loop the inputs repeat exactly and V is the output's scatter. In closed loop they carry
// the loop's answer to the noise, which is no noise of Y − H U; and because the averages Ȳ, Ū are
// taken over periods of one command first, Ĥ is the quotient of the responses of y and of u to that
// command (the command as instrument) and has no bias from the loop.
// The coherence quoted is what one period's power and scatter would give, less the power that noise
// alone gives to the mean (so that noise alone has none on average):
//   γ²_o = S / (S + Σ_e P_e σ²_{o,e}),  S = Σ_e (|Ȳ_oe|² − σ²_{o,e}).
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
// inputs: h[nf][ny][experiments], mean over runs of periods. The steady state cancels in it; what
// is left is the decay of what the start of the excitation set off, and noise. Outputs for which it
// is rounding have 0. [init] PB_ERR_STATE when an experiment has no two periods that follow one
// another, or runs of such periods that are not equally long.
pb_status pb_periodic_difference(const pb_periodic *periodic, pb_frf *out, pb_error *err);

// Finds what free motion adds to the means, to be left out by the estimates: decays at given poles,
// and trends, which are the free motion of rigid bodies and of what is slower than the record,
//   T(t) = Σ_k c_k λ_kᵗ + Σ_q b_q tᵠ,   q = 1 … 5,
// over a run of P periods of N samples. Period p has the lines
//   T_p(f) = Σ c λ^{pN} g(f) + …,   g = (1 − λ^N) / (1 − λ e^{−2πi f/f_s}),   D = T_{P−1} − T_0,
// so that c and b follow from D by least squares over the lines and the level (f = 0), and the
// means lose Σ_p T_p / P. A ramp has no difference at any line: it is seen at the level alone. The
// degree is the lowest whose remainder is within four times the least. Poles within a tenth of a
// radian of 1 over the run are left to the trends. What D leaves open widens the variance: by the
// remainder r of D (and rounding, 8 ε of the largest sample), var ΔȲ = |r|² ‖m (MᵀM)^{-½}‖², with M
// and m the columns of D and of the mean. Where the record is longer than two periods, and decays
// are less than a tenth of the scatter, σ² stays that of all periods; else it is that of r.
//
// pole[poles]: one of each conjugate pair (Im z > 0), or real, as z. *explained is the part of D's
// power at the lines that decays and trends explain; where it is below 0.5 with the poles, the
// trends are found without them and it is 0. Nothing is changed where experiments have different
// numbers of periods. Pushing a period undoes it. [init] Fails with PB_ERR_STATE as above,
// PB_ERR_NUMERIC (LAPACK), PB_ERR_MEMORY.
pb_status pb_periodic_settle(pb_periodic *periodic, const double complex *pole, size_t poles,
                             double *explained, pb_error *err);

// Estimates from the periods so far; can be called again later. [init]
// Fails with PB_ERR_STATE (an experiment with fewer than two periods), PB_ERR_NUMERIC (a non-finite
// record). Lines that the inputs do not excite have h = 0, coherence 0 and infinite variance.
pb_status pb_periodic_estimate(const pb_periodic *periodic, pb_frf *out, pb_error *err);

#endif
