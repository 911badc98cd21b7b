// What damped modes x make of a group's inputs and outputs: its rows of B and columns of C.
//
//   η = Σ x_k z_k + conjugates,  ż_k = λ_k z_k + x_kᵀ f,
//   y = Σ (Y_0 + λ_k Y_1 + λ_k² Y_2) x_k z_k + conjugates
//
// Of stacked coordinates that are followed, q = S x z and q̇ = λ q; an impulse on them counts with
// (S x)ᵀ, a displacement with S times (λ I + Ĉ) x. Left vectors are scaled cluster by cluster: with
// B_jk = x_jᵀ ((λ_j + λ_k) I + Ĉ) x_k they are B⁻¹ Xᵀ, which stays exact where eigenvalues of a
// cluster can hardly be told apart.
#ifndef PB_MODEL_GROUP_SHAPES_H
#define PB_MODEL_GROUP_SHAPES_H

#include "model/damped.h"
#include "model/model.h"
#include "model/modes.h"

typedef struct pb_group_shapes {
  const pb_modes *modes;
  const size_t *mode;   // numbers of the group's modes
  const pb_damped *d;   // of the group
  const size_t *place;  // [columns] first state of each eigenpair in the model
} pb_group_shapes;

// Fills the model's b and c at the states of the group, in real form: those of a complex pair are
// 2 Re z and −2 Im z. *sound false, and the model unfinished: a cluster's B is singular. Fails with
// PB_ERR_MEMORY. [init]
pb_status pb_group_shapes_fill(const pb_group_shapes *shapes, const pb_workers *workers,
                               pb_model *model, bool *sound, pb_error *err);

#endif
