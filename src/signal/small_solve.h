// Small dense complex systems (a few dozen unknowns at most), solved in place and without LAPACK:
// called once a frequency or once an iteration, where a library call would cost more than the
// solve.
#ifndef PB_SIGNAL_SMALL_SOLVE_H
#define PB_SIGNAL_SMALL_SOLVE_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

// a·b by the plain formula. The compiler's own product tests for infinities first, which costs more
// than the product.
static inline double complex pb_product(double complex a, double complex b) {
  return CMPLX(creal(a) * creal(b) - cimag(a) * cimag(b),
               creal(a) * cimag(b) + cimag(a) * creal(b));
}

// Solves A X = B by elimination with partial pivoting. a is n × n, b is n × nrhs, column-major,
// both overwritten, b by X. False where a pivot is below 1e-13 of its row's largest entry (A
// singular to working precision) or not finite. [any]
bool pb_small_solve(size_t n, size_t nrhs, double complex *a, double complex *b);

#endif
