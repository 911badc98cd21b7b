// The compiled plant: modal state space, its exact zero-order-hold discretisation, its state and
// step.
//
//   ẋ = A x + B u,  y = C x + D u        A block diagonal: 2×2 blocks, larger ones only where the
//   x(k+1) = A_d x(k) + B_d u(k)         eigenvectors are too ill-conditioned to separate the modes
//   y(k)   = C x(k) + D u(k−1)           sampled with the input of the last interval still held
//
// u is what acts and y what the plant does; signal electronics (electronics.h) may lie between a
// command and u, and between y and what is measured. Models whose signals have none do without.
//
// A_d = e^{A T}, B_d = ∫₀ᵀ e^{A s} ds B are exact for an input that is constant over each step.
// A pb_model never changes after it is built: any number of threads may read it. What changes is
// the pb_state. Matrices are column-major.
#ifndef PB_MODEL_MODEL_H
#define PB_MODEL_MODEL_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/status.h"
#include "model/electronics.h"

struct pb_means;  // means.h
struct pb_system;
struct pb_step_pack;

typedef struct pb_signal {
  char *name;  // unique in its list
  char *unit;  // SI: "V", "N", "Nm", "m", "rad", "m/s", "m/s^2", …
} pb_signal;

typedef struct pb_model {
  char *name;            // of the plant
  double sample_rate;    // Hz
  double max_frequency;  // Hz; 0: no truncation
  size_t dof;            // degrees of freedom of the assembled plant, before truncation
  size_t nx, nu, ny;     // states kept (2 × dof without truncation), inputs, outputs
  pb_signal *input;      // [nu]
  pb_signal *output;     // [ny]
  size_t modes;          // = dof
  double *mode_hz;       // [modes] undamped natural frequencies, ascending
  double *mode_damping;  // [modes] φᵀCφ / (2 ω φᵀMφ); 0 for a rigid-body mode
  size_t blocks;         // diagonal blocks of A
  size_t pairs;          // leading blocks that are 2 × 2
  size_t widest;         // size of the largest block
  size_t *block_start;   // [blocks + 1] first state of each block; block_start[blocks] = nx
  size_t *block_value;   // [blocks + 1] first entry of each block in a and ad
  double *a, *ad;        // the blocks, column-major, one after the other
  double *b, *bd;        // nx × nu
  double *c;             // ny × nx
  double *d;             // ny × nu
  pb_electronics *input_electronics;   // [nu], NULL: no input has any
  pb_electronics *output_electronics;  // [ny], NULL: no output has any
  struct pb_step_pack *step;           // A_d, B_d, C, D laid out for stepping (step_kernel.h);
                                       // NULL: stepped from the arrays above
} pb_model;

// Everything that affects the next output, flat: copying pb_state_bytes() bytes is a snapshot.
typedef struct pb_state {
  uint64_t step;  // steps taken since the start of the epoch; t = step / sample_rate
  size_t nx, nu;  // of the model it belongs to
  uint64_t
      saturated;  // bit i: input i was cut in the last interval, by its slew limit or its range
  double data[];  // x [nx], then u [nu]: the input held over the last interval, as applied; then,
                  // for a model with blocks above 2 × 2, scratch [widest]; then what the
                  // electronics remember: delay lines, generators, the outputs measured now
} pb_state;

// Compiles an assembled system: modes, modal form, truncation, discretisation. [init]
// Units: as in the system. Fails with PB_ERR_NUMERIC (an eigenvalue method), PB_ERR_SINGULAR (an
// indefinite stiffness: the message names the frequency), PB_ERR_MEMORY. *out is owned by the
// caller.
pb_status pb_model_compile(const struct pb_system *system, pb_warnings *warnings, pb_model **out,
                           pb_error *err);

// Loads, assembles and compiles a plant file in one call. [init]
pb_status pb_model_load(const char *path, pb_warnings *warnings, pb_model **out, pb_error *err);

// The same with what the caller lends (may be NULL). A system that tells how
// stacked coordinates follow (system.h) gets each of them as two more outputs (all q_i, then all
// q̇_i) and two more inputs (a displacement of each in the metric of M: f = M q sets η = Φᵀf at
// once; then an impulse on each), after the plant's own; their columns of D stay zero. [init]
pb_status pb_model_compile_with(const struct pb_system *system, const struct pb_means *means,
                                pb_warnings *warnings, pb_model **out, pb_error *err);
pb_status pb_model_load_with(const char *path, const struct pb_means *means, pb_warnings *warnings,
                             pb_model **out, pb_error *err);

void pb_model_free(pb_model *model);

// Index of an input or output by name, or -1. [any]
int pb_model_input(const pb_model *model, const char *name);
int pb_model_output(const pb_model *model, const char *name);

// The index of a signal that must be there: of a list [count] of one kind, "input" or "output".
// Fails with PB_ERR_REFERENCE at `where`, listing the names there are. [any]
pb_status pb_signal_find(const pb_signal *signal, size_t count, const char *kind, const char *name,
                         const char *where, size_t *index, pb_error *err);

// Size in bytes of a state of this model. [any]
size_t pb_state_bytes(const pb_model *model);

// A state at rest at step 0, owned by the caller (free with free). NULL: out of memory.
// [init]
pb_state *pb_state_new(const pb_model *model);

// At rest, step 0, generators of noise seeded. [rt]
void pb_state_reset(const pb_model *model, pb_state *state);

// The outputs y [ny] of the current step: C x(k) + D u(k−1), of a model with output electronics as
// measured. Repeatable: asking changes nothing. No allocation, no failure. [rt]
void pb_step_output(const pb_model *model, const pb_state *state, double *y);

// x(k+1) = A_d x(k) + B_d u(k), step += 1. command [nu] is held over the interval; what its
// electronics make of it, or else the command itself, is u(k) and becomes the held input.
// No allocation. [rt]
void pb_step_advance(const pb_model *model, pb_state *state, const double *command);

// x ← A_d x + B_d u of the plant alone: x [nx], u [nu], scratch [widest block]. [rt]
void pb_step_state(const pb_model *model, double *x, const double *u, double *scratch);

typedef enum pb_time_base {
  PB_CONTINUOUS,  // H(jω) = C (jωI − A)⁻¹ B + D
  PB_SAMPLED,     // H(z) = C (zI − A_d)⁻¹ B_d + D z⁻¹, z = e^{jωT}: from u(k) to y(k)
  PB_APPLIED,     // the same from the inputs as applied: without input gain and input delay
} pb_time_base;

// PB_CONTINUOUS and PB_SAMPLED are from command to measured output: of the electronics they include
// the input's gain and both delays, as e^{−sdT} or z^{−d}. Quantisation, noise, slew and saturation
// are no part of a linear response. PB_APPLIED is what an experiment finds that takes the inputs
// from the samples; it includes the output's delay.

// Frequency responses at hz[nf] (Hz, > 0 where the plant has poles at 0).
// h is [nf][ny][nu], row-major as written: h[(f*ny + o)*nu + i]. Cost nf × nx × ny-or-nu.
// Fails with PB_ERR_ARGUMENT (non-finite or negative frequency, above Nyquist is allowed). [init]
pb_status pb_model_frf(const pb_model *model, pb_time_base base, const double *hz, size_t nf,
                       double complex *h, pb_error *err);

// H at one complex point s (continuous) or z (sampled), h is [ny][nu], and, when dh is not NULL,
// its derivative with respect to that point. Infinite at a pole. Models with blocks above 2 × 2
// need scratch memory: without it the results are NaN. [init]
void pb_model_evaluate(const pb_model *model, pb_time_base base, double complex point,
                       double complex *h, double complex *dh);

// Poles in rad/s (continuous) or as z (sampled): poles[nx], conjugates adjacent. Those of delay
// lines, at z = 0, are not listed. [init]
pb_status pb_model_poles(const pb_model *model, pb_time_base base, double complex *poles,
                         pb_error *err);

// Static gains from command to output, [ny][nu]; entries are infinite where the plant floats.
// [init]
pb_status pb_model_dc(const pb_model *model, double *gain, pb_error *err);

// A copy without the blocks whose |λ| exceeds 2π·hz; their static contribution goes into D. The
// electronics stay. Poles are among those of the model: unlike with the plant file's max_frequency
// there are no residual pairs, and velocities and accelerations lack what these would keep. [init]
pb_status pb_model_truncate(const pb_model *model, double hz, pb_model **out, pb_error *err);

// The whole compiled model as one array of doubles (names excluded), so that a bus can carry it to
// clients that have no element files: *data owned by the caller (free). [init]
pb_status pb_model_pack(const pb_model *model, double **data, size_t *count, pb_error *err);

// Inverse of pack; names and units are given apart ([nu] and [ny] strings each, copied). Refuses
// with PB_ERR_SYNTAX any array that is not a consistent model. [init]
pb_status pb_model_unpack(const double *data, size_t count, const char *name,
                          const char *const *input_name, const char *const *input_unit,
                          const char *const *output_name, const char *const *output_unit,
                          pb_model **out, pb_error *err);

#endif
