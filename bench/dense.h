// The baseline of the step: the same model as dense matrices, stepped with BLAS.
//
//   y = [C D] [x; u held],   [x; u] ← [A_d B_d] [x; u]        two calls of dgemv a step
#ifndef PB_BENCH_DENSE_H
#define PB_BENCH_DENSE_H

#include "bench.h"
#include "model/model.h"

typedef struct bench_dense {
  size_t nx, nu, ny;
  double *ab;  // nx × (nx + nu), column-major
  double *cd;  // ny × (nx + nu)
  double *z;   // [nx + nu] states, then the held inputs
  double *next;
} bench_dense;

bench_dense bench_dense_of(const pb_model *model);
void bench_dense_free(bench_dense *dense);
void bench_dense_output(const bench_dense *dense, double *y);
void bench_dense_advance(bench_dense *dense, const double *u);

#endif
