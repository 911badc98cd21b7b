// The part of a model between chosen inputs and outputs, as many of each, scaled for root finding
// (internal to src/model).
//
//   H(s) = Σ_b C_b (sI − A_b)⁻¹ B_b + D      over the diagonal blocks b of A, continuous time
//
// Inputs and outputs are scaled so that the entries of H are about one, states so that B_b and C_b
// are alike; neither moves a zero. Matrices m × m are column-major.
#ifndef PB_MODEL_CHANNEL_H
#define PB_MODEL_CHANNEL_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

#include "base/status.h"
#include "model/model.h"

typedef struct pb_channel {
  size_t m, n, blocks;  // inputs = outputs, states, diagonal blocks
  size_t widest;        // states of the largest block
  size_t *start;        // [blocks + 1] first state of each block
  size_t *value;        // [blocks + 1] first entry of each block in a
  double *a;            // the blocks, column-major
  double *b, *c;        // [n][m] each: row i of B, column i of C
  double *d;            // m × m
  double *radius;       // [blocks] |det A_b|^(1/size), rad/s: where the block resonates
  double period;        // s; 0: continuous time
  double complex *work;
  int *pivot;
} pb_channel;

// Takes the channel out of a model. *out is freed with pb_channel_free, also after a failure.
// Fails with PB_ERR_ARGUMENT (indices), PB_ERR_SINGULAR (an input or output without effect),
// PB_ERR_MEMORY. [init]
pb_status pb_channel_open(const pb_model *model, const size_t *input, const size_t *output,
                          size_t count, pb_channel *out, pb_error *err);
void pb_channel_free(pb_channel *channel);

// The same channel sampled: held inputs over `period` seconds, A_d, B_d, and D z⁻¹. What a sampled
// channel is evaluated at is s with z = e^{sT}, and slopes are dH/ds. *out is freed with
// pb_channel_free, also after a failure. Fails with PB_ERR_NUMERIC, PB_ERR_MEMORY. [init]
pb_status pb_channel_sample(const pb_channel *channel, double period, pb_channel *out,
                            pb_error *err);

// Poles of a channel of continuous time, [n] in rad/s. Fails with PB_ERR_NUMERIC, PB_ERR_MEMORY.
// [init]
pb_status pb_channel_poles(const pb_channel *channel, double complex *pole, pb_error *err);

// H and, when dh is not NULL, dH/ds at s. size: the sum of the terms' largest entries, against
// which rounding errors of H count. Uses the channel's work space: one thread at a time. [init]
void pb_channel_evaluate(const pb_channel *channel, double complex s, double complex *h,
                         double complex *dh, double *size);

// Largest entry of one block's term at s. [init]
double pb_channel_block_size(const pb_channel *channel, size_t block, double complex s);

// Removes the blocks without keep[block]; with `residual` their response at s = 0 stays in D.
// [init]
void pb_channel_keep(pb_channel *channel, const bool *keep, bool residual);

// An independent copy. Fails with PB_ERR_MEMORY. [init]
pb_status pb_channel_copy(const pb_channel *channel, pb_channel *out, pb_error *err);

#endif
