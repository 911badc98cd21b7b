// How many threads OpenBLAS may use: all processors (or as many as OPENBLAS_NUM_THREADS says) where
// a factorisation multiplies large blocks, one for the many small products besides, which threads
// only slow down (on a busy machine many times: every product waits for the slowest of them).
#ifndef PB_CLIENTS_PART_BLAS_THREADS_H
#define PB_CLIENTS_PART_BLAS_THREADS_H

#include "part/reduce.h"

// For this phase of a reduction. Does nothing where another BLAS is used.
void pb_blas_threads(pb_reduce_phase phase);

#endif
