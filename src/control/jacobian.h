// The Jacobian of a parallel mechanism: strut elongations from the motion of its point of interest.
//
//   ε_L = J X,  X = [x y z Rx Ry Rz]ᵀ;   F = Jᵀ f,  f the forces along the struts
//
// Row k of J is [ŝ_kᵀ, (b_k × ŝ_k)ᵀ], with ŝ_k the strut's direction and b_k its joint on the
// platform seen from the point of interest: small motions of a rigid platform (B. Dasgupta,
// T. Mruthyunjaya, "The Stewart platform manipulator: a review", 2000). Without a geometry J
// follows from the static plant: forces at the point of interest move it by G_XF and the struts by
// G_εF, J = G_εF G_XF⁻¹.
//
// Matrices n × n, column-major. All functions: [init].
#ifndef PB_CONTROL_JACOBIAN_H
#define PB_CONTROL_JACOBIAN_H

#include "model/model.h"
#include "plant/template.h"

// J of a hexapod, 6 × 6, rows in the order of its struts. [any]
void pb_jacobian_geometry(const pb_hexapod *hexapod, double j[36]);

// J [n × n] from static gains: metrology[n] outputs along the struts, motion[n] outputs at the
// point of interest, force[n] inputs that act there along the same directions. PB_ERR_STATE where
// the plant floats, PB_ERR_SINGULAR where the forces do not move the point in n independent ways,
// PB_ERR_MEMORY.
pb_status pb_jacobian_static(const pb_model *model, const size_t *metrology, const size_t *motion,
                             const size_t *force, size_t n, double *j, pb_error *err);

// J⁻¹ and (may be NULL) the condition number of J in the 2-norm. PB_ERR_SINGULAR, PB_ERR_MEMORY,
// PB_ERR_NUMERIC.
pb_status pb_jacobian_invert(const double *j, size_t n, double *inverse, double *condition,
                             pb_error *err);

#endif
