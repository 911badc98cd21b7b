// Relative gain array: see rga.h.
#include "study/rga.h"

#include <math.h>
#include <string.h>

#include "signal/small_solve.h"

pb_status pb_rga(size_t n, const double complex *g, double complex *rga, pb_error *err) {
  double complex work[PB_RGA_LARGEST * PB_RGA_LARGEST], inverse[PB_RGA_LARGEST * PB_RGA_LARGEST];
  if (n == 0 || n > PB_RGA_LARGEST)
    return pb_fail(err, PB_ERR_ARGUMENT, "RGA", "%zu channels; from 1 to %d are possible", n,
                   PB_RGA_LARGEST);
  memcpy(work, g, n * n * sizeof *g);
  for (size_t k = 0; k < n * n; k++) inverse[k] = k % (n + 1) == 0;
  if (!pb_small_solve(n, n, work, inverse))
    return pb_fail(err, PB_ERR_SINGULAR, "RGA", "the plant is singular at this frequency");
  for (size_t r = 0; r < n; r++)
    for (size_t c = 0; c < n; c++) rga[r + c * n] = g[r + c * n] * inverse[c + r * n];
  return PB_OK;
}

pb_status pb_rga_number(size_t n, const double complex *g, double *number, pb_error *err) {
  double complex rga[PB_RGA_LARGEST * PB_RGA_LARGEST];
  pb_status status = pb_rga(n, g, rga, err);
  *number = 0;
  for (size_t k = 0; k < n * n && !status; k++) *number += cabs(rga[k] - (k % (n + 1) == 0));
  return status;
}
