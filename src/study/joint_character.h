// A flexible joint in six stiffnesses. [report 3.5]
//
// One frame on the ground, forces and torques on the other: each stiffness is one over the gain at
// 0 Hz from a force (torque) to the motion in its direction, the other motions free.
//   k_s = 1/(D_x/F_x), 1/(D_y/F_y)   k_a = 1/(D_z/F_z)
//   k_f = 1/(R_x/M_x), 1/(R_y/M_y)   k_t = 1/(R_z/M_z)
#ifndef PB_STUDY_JOINT_CHARACTER_H
#define PB_STUDY_JOINT_CHARACTER_H

#include "study/element_bench.h"

typedef struct pb_joint_character {
  double k[6];       // x y z (N/m), rx ry rz (Nm/rad); infinite: locked, 0: free
  double resonance;  // Hz, first mode of the joint alone with one frame fixed; NaN: none (lumped)
  double mass;       // kg; 0: without (lumped)
  double coupling;  // largest |G_ij|/√(G_ii G_jj) off the diagonal: how far the six are a picture
} pb_joint_character;

// bench receives the bench, for responses; the caller's (pb_bench_model_clear). [init]
pb_status pb_joint_characterize(const pb_element_source *source, pb_warnings *warnings,
                                pb_bench_model *bench, pb_joint_character *out, pb_error *err);

#endif
