// The diagonal blocks of a group of modes that damping couples.
//
// The group's states are s η and η̇ of its modes (cluster.h). Weakly coupled modes take their
// eigenvectors from damped.h; others from the dense state matrix, block-diagonalised (block.h).
#ifndef PB_MODEL_GROUP_H
#define PB_MODEL_GROUP_H

#include "model/build.h"
#include "model/modes.h"

// Appends the blocks of the modes mode[count] to the builder. Fails with PB_ERR_NUMERIC,
// PB_ERR_MEMORY. [init]
pb_status pb_group_build(const pb_modes *modes, const size_t *mode, size_t count,
                         const pb_means *means, pb_model_builder *builder, pb_error *err);

// The same by the method for weakly coupled modes. *done false, and nothing appended: it does not
// serve here.
pb_status pb_group_build_damped(const pb_modes *modes, const size_t *mode, size_t count,
                                const pb_means *means, pb_model_builder *builder, bool *done,
                                pb_error *err);

#endif
