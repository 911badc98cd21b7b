// A dense state-space step with BLAS: see dense.h.
#include "dense.h"

#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"

static void fill_blocks(const pb_model *m, double *ab) {
  for (size_t k = 0; k < m->blocks; k++) {
    size_t start = m->block_start[k], n = m->block_start[k + 1] - start;
    for (size_t j = 0; j < n; j++)
      memcpy(ab + start + (start + j) * m->nx, m->ad + m->block_value[k] + j * n,
             n * sizeof(double));
  }
}

bench_dense bench_dense_of(const pb_model *m) {
  size_t nz = m->nx + m->nu;
  bench_dense d = {.nx = m->nx,
                   .nu = m->nu,
                   .ny = m->ny,
                   .ab = bench_memory(m->nx * nz, sizeof(double)),
                   .cd = bench_memory(m->ny * nz, sizeof(double)),
                   .z = bench_memory(nz, sizeof(double)),
                   .next = bench_memory(nz, sizeof(double))};
  fill_blocks(m, d.ab);
  memcpy(d.ab + m->nx * m->nx, m->bd, m->nx * m->nu * sizeof(double));
  memcpy(d.cd, m->c, m->ny * m->nx * sizeof(double));
  memcpy(d.cd + m->ny * m->nx, m->d, m->ny * m->nu * sizeof(double));
  return d;
}

void bench_dense_free(bench_dense *d) {
  free(d->ab);
  free(d->cd);
  free(d->z);
  free(d->next);
  *d = (bench_dense){0};
}

static void multiply(size_t rows, size_t columns, const double *a, const double *x, double *y) {
  const int m = (int)rows, n = (int)columns, one = 1;
  const double alpha = 1, beta = 0;
  dgemv_("N", &m, &n, &alpha, a, &m, x, &one, &beta, y, &one);
}

void bench_dense_output(const bench_dense *d, double *y) {
  multiply(d->ny, d->nx + d->nu, d->cd, d->z, y);
}

void bench_dense_advance(bench_dense *d, const double *u) {
  memcpy(d->z + d->nx, u, d->nu * sizeof *u);
  memcpy(d->next + d->nx, u, d->nu * sizeof *u);
  multiply(d->nx, d->nx + d->nu, d->ab, d->z, d->next);
  double *z = d->z;
  d->z = d->next;
  d->next = z;
}
