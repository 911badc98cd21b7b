// Relative gain array: how much the loops of a square plant act on one another.
//
//   Λ(G) = G ∘ (G⁻¹)ᵀ,   RGA number = Σ |Λ − I|
//
// Rows and columns of Λ add up to 1; the number is 0 for a diagonal plant. It does not depend on
// the scaling of inputs and outputs. E. Bristol (1966); S. Skogestad, I. Postlethwaite,
// "Multivariable Feedback Control", 3.4.
#ifndef PB_STUDY_RGA_H
#define PB_STUDY_RGA_H

#include <complex.h>
#include <stddef.h>

#include "base/status.h"

enum { PB_RGA_LARGEST = 32 };

// Λ into rga, both n × n in the same order of storage. [init] PB_ERR_ARGUMENT (n = 0 or above
// PB_RGA_LARGEST), PB_ERR_SINGULAR.
pb_status pb_rga(size_t n, const double complex *g, double complex *rga, pb_error *err);

// Σ |Λ_ij − δ_ij|. Fails as pb_rga. [init]
pb_status pb_rga_number(size_t n, const double complex *g, double *number, pb_error *err);

#endif
