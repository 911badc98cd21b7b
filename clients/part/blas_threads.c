// Threads of OpenBLAS: see blas_threads.h.
#include "blas_threads.h"

// Not in every BLAS: then their addresses are NULL.
extern void openblas_set_num_threads(int count) __attribute__((weak));
extern int openblas_get_num_threads(void) __attribute__((weak));

// The same of OpenMP: CHOLMOD starts four threads for each of its loops, whatever there are of
// processors. Its loops are short: starting and awaiting them takes longer than they do.
extern void omp_set_max_active_levels(int levels) __attribute__((weak));

void pb_blas_threads(pb_reduce_phase phase) {
  static int most = 0, present = 0;
  if (!most && omp_set_max_active_levels) omp_set_max_active_levels(0);
  if (!openblas_set_num_threads || !openblas_get_num_threads) return;
  if (!most) most = present = openblas_get_num_threads();  // processors, or the user's own limit
  int wanted = phase == PB_REDUCE_FACTOR ? most : 1;
  if (wanted == present) return;
  openblas_set_num_threads(wanted);
  present = wanted;
}
