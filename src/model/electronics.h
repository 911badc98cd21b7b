// Signal electronics: what lies between a command and the force or voltage that acts, and between a
// motion and the number that is measured.
//
//   input:   command → quantised → delayed → × gain → + noise → slew limit → saturation = applied
//   output:  y(k)    → delayed → + noise → quantised = measured
//
// Quantised: the nearest multiple of the least significant bit, half steps away from zero. Noise is
// white and Gaussian, from a generator for each signal: the same seed gives the same bits.
#ifndef PB_MODEL_ELECTRONICS_H
#define PB_MODEL_ELECTRONICS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/status.h"

enum { PB_MAX_DELAY = 1000 };  // samples of one signal

typedef struct pb_electronics {
  double gain;          // ≠ 0; 1 for an output
  double quantisation;  // least significant bit, in the command's or the output's unit; 0: none
  double noise;         // rms, in the applied or the output's unit
  double low, high;     // saturation of an input, in the applied unit; both 0: none
  double slew;          // of an input, applied unit per second; 0: no limit
  uint32_t delay;       // whole samples
  uint64_t seed;        // of the noise, up to 2^53
} pb_electronics;

struct pb_model;
struct pb_state;

// Electronics that change nothing. [any]
pb_electronics pb_electronics_none(void);

// Whether all values are in their ranges (those of the plant file). [any]
bool pb_electronics_valid(const pb_electronics *electronics, bool is_input);

// What an input makes of a steady command, without noise: quantised, × gain, saturated. [rt]
double pb_electronics_steady(const pb_electronics *electronics, double command);

// Electronics of a signal of a model, none where it has no such block. [any]
pb_electronics pb_model_input_electronics(const struct pb_model *model, size_t input);
pb_electronics pb_model_output_electronics(const struct pb_model *model, size_t output);

// Samples between a command and the last output that answers it: the longest delay of an input and
// the longest of an output. [any]
size_t pb_model_delay(const struct pb_model *model);

// Gives a model without electronics a copy of another list (NULL: none): input [nu], output [ny].
// Fails with PB_ERR_MEMORY, the model unchanged. [init]
pb_status pb_electronics_attach(struct pb_model *model, const pb_electronics *input,
                                const pb_electronics *output, pb_error *err);

// Doubles that the electronics of a model need in a pb_state, after everything else. [any]
size_t pb_electronics_size(const struct pb_model *model);

// Delay lines full of zeros, generators seeded, outputs measured. The state is otherwise at rest.
// [rt]
void pb_electronics_reset(const struct pb_model *model, struct pb_state *state);

// From the command of the interval that begins to what is applied over it, which becomes the held
// input; sets `saturated`. Only for a model with input electronics. [rt]
void pb_electronics_apply(const struct pb_model *model, struct pb_state *state,
                          const double *command);

// Measures the outputs of a new step: goes on along delay lines and generators. Only for a model
// with output electronics. [rt]
void pb_electronics_sample(const struct pb_model *model, struct pb_state *state);

// The measured outputs of the current step. Only for a model with output electronics. [rt]
const double *pb_electronics_measured(const struct pb_model *model, const struct pb_state *state);

// Carries what the electronics remember from state a of one model to state b of another, for a
// change of model between two steps: delay lines, generators, inputs last applied and their bits of
// `saturated`. Input i of `to` continues input input_from[i] of `from`, output o output
// output_from[o]; −1: none, as after a reset. A longer delay line is filled up with the oldest
// value; a signal without electronics counts as one of delay 0. Generators go on where both signals
// have noise. Held inputs are carried for models without electronics too. b is a state of `to`
// (pb_state_new); its modal part and its step are left to the caller, who calls pb_state_measure
// once they are set. a and b are different states. [rt]
void pb_electronics_carry(const struct pb_model *from, const struct pb_state *a,
                          const int *input_from, const int *output_from, const struct pb_model *to,
                          struct pb_state *b);

// Measures the current step again, after x or the held inputs were changed from outside: the newest
// value of each output's delay line becomes that of the state as it is now, and the step's noise,
// which the state remembers, is added again. Generators do not move, so calling it twice changes
// nothing. Without output electronics there is nothing to do. [rt]
void pb_state_measure(const struct pb_model *model, struct pb_state *state);

#endif
