// Frequency responses of the 2 × 2 blocks of a model at many points at once.
//
//   c (p I − A)⁻¹ b = (p N_1 + N_0) / det(p I − A),   N_1 = c b,  N_0 = c adj(−A) b
//
// N_1 and N_0 are real, so that all blocks and points together are a product of real matrices.
// At points q slower than all blocks from one on, the static responses of these are taken out,
//
//   c (q I − A)⁻¹ b = −c A⁻¹ b + q (N_1 − N_0 (q + d_0 + d_1)/det(0)) / det(q)
//
// and added to D before anything else: what is left of D by what is stiff. An acceleration, in
// which D and the modes are 1e10 times what is left, keeps its digits at low frequencies so. Done
// for models with velocities or accelerations. Points are given as p = shift + q, which keeps the
// digits of q where p is near the poles (z near 1 of a sampled plant).
#ifndef PB_MODEL_FRF_PAIRS_H
#define PB_MODEL_FRF_PAIRS_H

#include <complex.h>

#include "model/model.h"

// h[f][o][i] = D, times 1/(1 + q) where the model is sampled (shift 1), and the response of the
// model's 2 × 2 blocks at shift + q[f], f < nf; a, b: the model's a and b, or ad and bd. Where a
// point is a pole the entries are not finite. Fails with PB_ERR_MEMORY. [init]
pb_status pb_pairs_response(const pb_model *model, const double *a, const double *b, double shift,
                            const double complex *q, size_t nf, double complex *h, pb_error *err);

#endif
