// The full model's dynamic stiffness at the frames, and how many of its modes lie below a
// frequency, from one condensation of A = K − ω²M onto the border [pins, λ, rigid frames]:
//   S = [[A_pp, C_pᵀ, ·], [C_p, 0, C R], [·, RᵀCᵀ, RᵀA R]] − BᵀA_ff⁻¹B
// With z = (u_p, λ): S_zz z + S_zq q_rigid = [0; q_averaged], the frames' forces are −λ and
// S_qz z + S_qq q_rigid. Modes below ω with the frames held: negatives of A_ff and of S_zz, less
// one for each multiplier; with the frames free: those of A_ff and of S without the multipliers.
#ifndef PB_PART_REDUCE_DYNAMIC_H
#define PB_PART_REDUCE_DYNAMIC_H

#include "part/condense.h"
#include "part/reduce_internal.h"

// Numbers of the border as they are met, then by rows.
typedef struct gathered {
  size_t count, room;
  size_t *row, *column;
  double *value;
  bool failed;
} gathered;

// The condensation's border, with where the rows that it takes in stand in it.
typedef struct dynamic {
  const reduce_work *w;
  double shift;      // −ω²
  size_t size, z;    // columns of the border; of them pins and multipliers
  double *s;         // size × size
  size_t *pin_of;    // [full] SIZE_MAX: none
  size_t *frame_of;  // [full] rigid frame
  size_t *tie_of;    // [full] place of the row in the frame's tie, 3 i + direction
  size_t *rigid_at;  // [frames] first column of a rigid frame
  gathered g;
  pb_border border;
} dynamic;

// A frequency that meets an eigenvalue of a leading block is moved a little; *hz says where it was
// taken in the end. *negative: of A_ff; d->s: S in full. *d is to be cleared, also after a failure.
pb_status dynamic_condense(reduce_work *w, double *hz, dynamic *d, size_t *negative, pb_error *err);
void dynamic_clear(dynamic *d);

// Modes below, from what dynamic_condense told.
pb_status dynamic_count(const dynamic *d, size_t negative, size_t *fixed_below, size_t *free_below,
                        pb_error *err);

#endif
