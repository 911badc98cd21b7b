// An independent step response in extended precision, by another method than the library's: dense
// matrix exponential of the whole second-order system, no modes.
#ifndef PB_TESTS_ORACLE_H
#define PB_TESTS_ORACLE_H

#include <stddef.h>

#include "assembly/system.h"

// Outputs after step[0..count) steps (ascending) of a unit step on input `input`: y[count][ny].
// Returns 0, or −1 when out of memory or M is not positive definite.
int oracle_step(const pb_system *system, double dt, size_t input, const size_t *step, size_t count,
                double *y);

#endif
