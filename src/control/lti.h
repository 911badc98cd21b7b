// Linear time-invariant systems in dense state space: controllers, and plants small enough to close
// loops around.
//
//   ẋ = A x + B u,       y = C x + D u      (dt = 0)
//   x(k+1) = A x + B u,  y = C x + D u      (dt > 0, in seconds)
//
// Column-major. All functions: [init]; PB_ERR_ARGUMENT for sizes that do not fit, PB_ERR_MEMORY.
#ifndef PB_CONTROL_LTI_H
#define PB_CONTROL_LTI_H

#include <complex.h>
#include <stddef.h>

#include "base/status.h"

typedef struct pb_lti {
  size_t nx, nu, ny;
  double dt;  // seconds; 0: continuous time
  double *a;  // nx × nx
  double *b;  // nx × nu
  double *c;  // ny × nx
  double *d;  // ny × nu
} pb_lti;

// Allocates zeroed matrices of the given sizes into *out (freed with pb_lti_free).
pb_status pb_lti_new(size_t nx, size_t nu, size_t ny, double dt, pb_lti *out, pb_error *err);

// Frees the matrices and zeroes the struct.
void pb_lti_free(pb_lti *lti);

#endif
