// A transfer of a large state in the midst of steps: the dense product x' = X x + U u of
// transfer.h, which takes longer than a short interval, spread over the steps before the change.
//
// At its beginning, L steps ahead, the state x_0 is copied. Another thread computes what becomes of
// it, X A_d^L x_0; who steps adds what each input does to the new state, X A_d^{L−1−i} B_d u_i with
// matrices that were prepared. At the change both are added:
//
//   X x_L = X A_d^L x_0 + Σ X A_d^{L−1−i} B_d u_i
//
// Exact, but rounded otherwise than one product: states differ in their last bits.
#ifndef PB_MODEL_HANDOVER_H
#define PB_MODEL_HANDOVER_H

#include "model/transfer.h"

typedef struct pb_handover {
  pb_transfer *transfer;
  size_t steps;     // L
  double *g;        // nx' × (nu · L): X A_d^j B_d, j = 0 … L − 1
  double *base;     // [nx] x_0, then A_d^L x_0
  double *scratch;  // [widest block]
  double *rest;     // [nu] zeros
  double *carried;  // [nx'] X A_d^L x_0
  double *driven;   // [nx'] of the inputs so far
  size_t taken;     // steps since the beginning
} pb_handover;

// Prepares a handover over `steps` ≥ 1 steps of a transfer, which must outlive it. Fails with
// PB_ERR_MEMORY. [init]
pb_status pb_handover_new(pb_transfer *transfer, size_t steps, const pb_workers *workers,
                          pb_handover **out, pb_error *err);
void pb_handover_free(pb_handover *handover);  // NULL is allowed

// Begins with this state of the old model; may be begun again. [rt]
void pb_handover_begin(pb_handover *handover, const pb_state *before);

// What becomes of the state at the beginning; in any thread, once between begin and apply. [any]
void pb_handover_carry(pb_handover *handover);

// After each of the steps: `before` holds the input that acted. [rt]
void pb_handover_follow(pb_handover *handover, const pb_state *before);

// As pb_transfer_apply, after the last step and when it is carried. [rt]
void pb_handover_apply(pb_handover *handover, const pb_state *before, pb_state *after);

#endif
