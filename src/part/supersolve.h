// Triangular solves with a supernodal factor for eight right-hand sides that lie side by side.
//
// A factor is far larger than the caches and a solve reads all of it, so the time of a block of
// right-hand sides is the time of reading the factor, if the arithmetic keeps up: here each number
// of L is read once, in order, and used for all eight at once. (Through the BLAS every panel is
// first copied, which for so few columns costs as much as using it.)
#ifndef PB_PART_SUPERSOLVE_H
#define PB_PART_SUPERSOLVE_H

#include <cholmod.h>

enum { PB_SUPERSOLVE_WIDTH = 8 };

// y ← L⁻ᵀL⁻¹ y, y [n][8]; spare [largest number of rows of a supernode][8]. l: supernodal, numeric,
// long, real. [any]
void pb_supersolve(const cholmod_factor *l, double *y, double *spare);

#endif
