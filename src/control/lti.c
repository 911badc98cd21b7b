// Allocation of dense linear systems: see lti.h.
#include "control/lti.h"

#include <math.h>
#include <stdlib.h>

// calloc that gives a valid pointer for a matrix without entries.
static double *zeros(size_t rows, size_t columns) {
  size_t count = rows * columns;
  return calloc(count ? count : 1, sizeof(double));
}

pb_status pb_lti_new(size_t nx, size_t nu, size_t ny, double dt, pb_lti *out, pb_error *err) {
  *out = (pb_lti){0};
  if (nu == 0 || ny == 0 || !isfinite(dt) || dt < 0) {
    return pb_fail(err, PB_ERR_ARGUMENT, "lti", "%zu inputs, %zu outputs, period %g s", nu, ny, dt);
  }
  pb_lti lti = {.nx = nx, .nu = nu, .ny = ny, .dt = dt};
  lti.a = zeros(nx, nx);
  lti.b = zeros(nx, nu);
  lti.c = zeros(ny, nx);
  lti.d = zeros(ny, nu);
  if (!lti.a || !lti.b || !lti.c || !lti.d) {
    pb_lti_free(&lti);
    return pb_fail_memory(err, "lti");
  }
  *out = lti;
  return PB_OK;
}

void pb_lti_free(pb_lti *lti) {
  if (!lti) return;
  free(lti->a);
  free(lti->b);
  free(lti->c);
  free(lti->d);
  *lti = (pb_lti){0};
}
