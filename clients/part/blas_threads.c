// Threads of OpenBLAS: see blas_threads.h.
#include "blas_threads.h"

#include <unistd.h>

// Not in every BLAS: then its address is NULL.
extern void openblas_set_num_threads(int count) __attribute__((weak));

void pb_blas_threads(pb_reduce_phase phase) {
  static int present = -1;
  long online = sysconf(_SC_NPROCESSORS_ONLN);
  int wanted = phase == PB_REDUCE_FACTOR && online > 1 ? (int)online : 1;
  if (!openblas_set_num_threads || wanted == present) return;
  openblas_set_num_threads(wanted);
  present = wanted;
}
