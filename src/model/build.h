// Putting a pb_model together from diagonal blocks.
#ifndef PB_MODEL_BUILD_H
#define PB_MODEL_BUILD_H

#include "model/model.h"

typedef struct pb_model_builder {
  pb_model *model;  // blocks in the order in which they came, not discretised
  size_t capacity;  // of model->a
  bool plain;       // the model is to be narrowed, not to be stepped: not discretised
  size_t direct;    // leading inputs whose column of d is wanted; all unless the caller says less
  const double *rest;  // rest_rows × direct, the caller's: static responses of accelerations
                       // (rates.h); NULL: unknown
  size_t rest_rows;
} pb_model_builder;

// One diagonal block: a size × size (leading dimension lda), b size × nu (ldb), c ny × size (ldc).
typedef struct pb_model_part {
  size_t size;
  const double *a, *b, *c;
  size_t lda, ldb, ldc;
} pb_model_part;

// A model of these sizes, blocks to come; the caller fills name, signals, rates, modes and
// d.
pb_status pb_model_builder_open(pb_model_builder *builder, size_t nx, size_t nu, size_t ny,
                                size_t modes, pb_error *err);

pb_status pb_model_builder_add(pb_model_builder *builder, const pb_model_part *part, pb_error *err);

// Room for `count` more blocks of these sizes, for the caller to fill: entries of a from
// block_value of block *first on, rows of b and columns of c from its block_start on.
pb_status pb_model_builder_reserve(pb_model_builder *builder, const size_t *size, size_t count,
                                   size_t *first, pb_error *err);

// Sorts the blocks by natural frequency, 2 × 2 blocks first; replaces those above max_frequency
// (Hz; 0: none) by their static contribution and residual pairs (rates.h); discretises unless it is
// plain. The builder is empty afterwards.
pb_status pb_model_builder_close(pb_model_builder *builder, double max_frequency, pb_model **out,
                                 pb_error *err);

// Name, signals, rates, modes and electronics of one model for another that has the first of its
// inputs and outputs. d is the caller's.
pb_status pb_model_copy_header(const pb_model *from, pb_model *to, pb_error *err);

// Frees what an unfinished builder holds.
void pb_model_builder_discard(pb_model_builder *builder);

// Allocates a model and all its arrays for these sizes; a, ad have `values` entries. b, bd and c
// are not zeroed: the blocks fill them, and with a motion map they are large. NULL on failure.
pb_model *pb_model_allocate(size_t nx, size_t nu, size_t ny, size_t modes, size_t blocks,
                            size_t values);

// A copy with the first nu inputs and the first ny outputs only, discretised.
pb_status pb_model_narrow(const pb_model *model, size_t nu, size_t ny, pb_model **out,
                          pb_error *err);

// Fills ad and bd from a, b and sample_rate.
pb_status pb_model_discretize(pb_model *model, pb_error *err);

// Natural frequency of a block in rad/s: |det A|^(1/n) for n ≤ 2, else the root mean square entry
// of a row, which for the normal matrices at hand is that of its eigenvalues.
double pb_block_frequency(const double *a, size_t size);

#endif
