// Velocities and accelerations of a modal model.
//
// An acceleration is the difference of what forces do to the masses at once, D u, and of what the
// modes answer: at low frequencies s² of a displacement, which is 1e-10 of either beside an
// element's light nodes. D is therefore made from the blocks themselves, so that a constant input
// accelerates nothing that is held. Blocks that truncation leaves out answer a constant input by a
// displacement, −C A⁻¹ B, which goes into D; the velocity that belongs to it is s times that, and
// the acceleration s²: each input gets one more pair of states for them, the residual mode of modal
// analysis,
//
//   P(s) = ω²/(s² + 2ζω s + ω²),   v = M_1 s P u,  a = M_2 s² P u
//
// with M_k the moments of what was left out, −C A^−(k+1) B: exact to the leading order, as the
// displacement is, and to the next two as well as one pair can (ω and ζ by least squares over the
// outputs; ω not below the limit, and a quarter of the sample rate where that is above it, so that
// the pair does not ring at an alias). Where damping couples what is kept to what is left out, an
// acceleration has M_1 s P besides: neither part vanishes by itself.
#ifndef PB_MODEL_RATES_H
#define PB_MODEL_RATES_H

#include "model/build.h"

// 2 of an acceleration, 1 of a velocity, 0 of everything else: by the signal's unit. [any]
int pb_rate_order(const char *unit);

// Whether a model has outputs of this order or above. [any]
bool pb_has_rates(const pb_model *model, int least);

// sum, size [ny × nu] += −C A⁻¹ B of a block and its magnitude, for the first `direct` inputs; a
// block that has no static response adds nothing. Fails with PB_ERR_MEMORY. [init]
pb_status pb_static_add(const pb_model *model, size_t block, size_t direct, long double *sum,
                        double *size, pb_error *err);

// What of a static response is left when it is below the rounding of what it adds up from: 0. [any]
double pb_static_clean(long double sum, double size);

// The static response of every output, ny × direct, without rounding: that of what floats is left
// out. Fails with PB_ERR_MEMORY. [init]
pb_status pb_rates_rest(const pb_model *model, size_t direct, double *rest, pb_error *err);

// Sets D of accelerations so that their static response is `rest` (leading dimension ld), for the
// first `direct` inputs. An entry that this would change by more than 1e-6 of what it adds up from
// stays: rigid-body modes that damping couples have no static response to make it from. Fails with
// PB_ERR_MEMORY. [init]
pb_status pb_rates_settle(pb_model *model, const double *rest, size_t ld, size_t direct,
                          pb_error *err);

typedef struct pb_residual {
  size_t ny, direct;
  int *order;               // [ny] pb_rate_order of each output
  long double *moment[4];   // ny × direct: M of s^(order − 1), s^order, …
  double slowest, fastest;  // rad/s: bounds of ω
  double rate;              // Hz, of the samples
} pb_residual;

// Residual pairs of this model's velocities and accelerations; slowest: the limit, rad/s. Fails
// with PB_ERR_MEMORY. [init]
pb_status pb_residual_open(const pb_model *model, size_t direct, double slowest,
                           pb_residual *residual, pb_error *err);
void pb_residual_close(pb_residual *residual);

// A block of the model that is left out. Fails with PB_ERR_MEMORY, PB_ERR_NUMERIC. [init]
pb_status pb_residual_add(pb_residual *residual, const pb_model *model, size_t block,
                          pb_error *err);

// Whether an input needs a pair; how many do. [any]
bool pb_residual_needs(const pb_residual *residual, size_t input);
size_t pb_residual_count(const pb_residual *residual);

// The pair of an input, of states x_1 = P u and x_2 = ẋ_1/ω: a [2 × 2], b [2] of this input, c and
// d [ny × 2] and [ny], to be added to D. [init]
void pb_residual_pair(const pb_residual *residual, size_t input, double *a, double *b, double *c,
                      double *d);

#endif
