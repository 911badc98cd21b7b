// Block Lanczos with shift 0: see reduce_lanczos.h.
#include "part/reduce_lanczos.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"

static const double dependent = 1e-12;  // length left of a direction by the basis, to drop it

static void gemm(const char *ta, const char *tb, size_t m, size_t n, size_t k, double alpha,
                 const double *a, size_t lda, const double *b, size_t ldb, double beta, double *c,
                 size_t ldc) {
  int im = (int)m, in = (int)n, ik = (int)k, ia = (int)lda, ib = (int)ldb, ic = (int)ldc;
  if (m && n) dgemm_(ta, tb, &im, &in, &ik, &alpha, a, &ia, b, &ib, &beta, c, &ic);
}

static pb_status eigen(size_t n, double *a, size_t ld, double *values, pb_error *err) {
  if (!n) return PB_OK;
  int in = (int)n, il = (int)ld, lwork = 1 + 6 * in + 2 * in * in, liwork = 3 + 5 * in, info = 0;
  double *work = malloc((size_t)lwork * sizeof *work);
  int *iwork = malloc((size_t)liwork * sizeof *iwork);
  pb_status st = work && iwork ? PB_OK : pb_fail_memory(err, "modes");
  if (!st) dsyevd_("V", "U", &in, a, &il, values, work, &lwork, iwork, &liwork, &info);
  if (!st && info) st = pb_fail(err, PB_ERR_NUMERIC, "modes", "dsyevd reports %d", info);
  free(work);
  free(iwork);
  return st;
}

static pb_status reserve(lanczos *z, size_t wanted, pb_error *err) {
  if (wanted <= z->room) return PB_OK;
  size_t room = wanted + wanted / 2 + 4 * BLOCK;
  double *q = realloc(z->q, room * z->full * sizeof *q);
  if (q) z->q = q;
  double *h = calloc(room * room, sizeof *h);
  if (!q || !h) {
    free(h);
    return pb_fail_memory(err, "modes");
  }
  for (size_t j = 0; j < z->k; j++) memcpy(h + j * room, z->h + j * z->room, z->k * sizeof *h);
  free(z->h);
  z->h = h;
  z->room = room;
  return PB_OK;
}

// ---- one block ----------------------------------------------------------------------------------

// u ← u − Q QᵀM u with the basis vectors from `first`; what was taken off goes to h (k × columns,
// zero above). mu is M u on return.
static void orthogonalise(lanczos *z, size_t first, size_t columns, double *h) {
  const double *q = z->q + first * z->full;
  size_t count = z->k - first;
  memset(h, 0, z->k * columns * sizeof *h);
  gemm("T", "N", count, columns, z->full, 1, q, z->full, z->mu, z->full, 0, h + first, z->k);
  gemm("N", "N", z->full, columns, count, -1, q, z->full, h + first, z->k, 1, z->u, z->full);
  reduce_mass_multiply(z->w, columns, z->u, z->mu);
}

// u = new u × b with orthonormal new columns; directions shorter than `least` are dropped. b is
// (returned) × columns. From uᵀMu = V Λ Vᵀ: new u = u V Λ^−½, b = Λ^½ Vᵀ.
static pb_status normalise(lanczos *z, size_t columns, double least, size_t *kept,
                           double b[BLOCK * BLOCK], pb_error *err) {
  double g[BLOCK * BLOCK], value[BLOCK], scaled[BLOCK * BLOCK];
  gemm("T", "N", columns, columns, z->full, 1, z->u, z->full, z->mu, z->full, 0, g, columns);
  pb_status st = eigen(columns, g, columns, value, err);
  if (st) return st;
  size_t first = 0;
  while (first < columns && !(value[first] > least * least)) first++;
  *kept = columns - first;
  for (size_t r = 0; r < *kept; r++) {
    double length = sqrt(value[first + r]);
    for (size_t c = 0; c < columns; c++) {
      b[r + c * *kept] = length * g[c + (first + r) * columns];
      scaled[c + r * columns] = g[c + (first + r) * columns] / length;
    }
  }
  double **pair[2] = {&z->u, &z->mu};
  for (size_t i = 0; i < 2; i++) {
    double *old = *pair[i];
    gemm("N", "N", z->full, *kept, columns, 1, old, z->full, scaled, columns, 0, z->spare, z->full);
    *pair[i] = z->spare;
    z->spare = old;
  }
  return PB_OK;
}

// Length of the longest column, in the norm of M.
static double longest(const lanczos *z, size_t columns) {
  double largest = 0;
  for (size_t c = 0; c < columns; c++) {
    double sum = 0;
    for (size_t i = c * z->full; i < (c + 1) * z->full; i++) sum += z->u[i] * z->mu[i];
    largest = fmax(largest, sum);
  }
  return sqrt(largest);
}

// Makes `columns` vectors in u the next block: orthogonal to the basis and to each other. They
// reach the basis from `first` on, the rest of it but for rounding: that falls to the second pass.
// h (k × columns) is what lay in the basis, the coupling the rest.
static pb_status append(lanczos *z, size_t first, size_t columns, double *h, pb_error *err) {
  double b1[BLOCK * BLOCK], b2[BLOCK * BLOCK];
  size_t kept = 0, again = 0;
  double *h2 = malloc((z->k + 1) * BLOCK * sizeof *h2);
  if (!h2) return pb_fail_memory(err, "modes");
  reduce_mass_multiply(z->w, columns, z->u, z->mu);
  double least = dependent * longest(z, columns);
  orthogonalise(z, first, columns, h);
  pb_status st = normalise(z, columns, fmax(least, 1e-290), &kept, b1, err);
  if (!st && kept) {
    orthogonalise(z, 0, kept, h2);
    gemm("N", "N", z->k, columns, kept, 1, h2, z->k, b1, kept, 1, h, z->k);
    st = normalise(z, kept, 0.5, &again, b2, err);
  }
  if (!st) {
    gemm("N", "N", again, columns, kept, 1, b2, again, b1, kept, 0, z->coupling, again);
    st = reserve(z, z->k + again, err);
  }
  if (!st) {
    if (again) memcpy(z->q + z->k * z->full, z->u, again * z->full * sizeof *z->q);
    z->k += again;
    z->last = columns;
    z->block = again;
  }
  free(h2);
  return st;
}

pb_status lanczos_append_random(lanczos *z, pb_error *err) {
  size_t left = z->k < z->limit ? z->limit - z->k : 0, columns = left < BLOCK ? left : BLOCK;
  double *h = malloc((z->k + 1) * BLOCK * sizeof *h);
  if (!h) return pb_fail_memory(err, "modes");
  for (size_t i = 0; i < columns * z->full; i++)
    z->mu[i] = z->w->rigid_row[i % z->full] ? 0 : pb_random_gaussian(&z->random);
  reduce_mass_multiply(z->w, columns, z->mu, z->u);
  pb_status st = reduce_respond(z->w, columns, z->u, err);
  if (!st) st = append(z, 0, columns, h, err);
  if (!st) z->last = 0;  // nothing of A Q leads to it
  free(h);
  return st;
}

// One application of the operator to the newest block; being symmetric, it leads back to the block
// before and no further.
pb_status lanczos_extend(lanczos *z, pb_error *err) {
  size_t columns = z->block, k = z->k;
  double *h = malloc((k + 1) * BLOCK * sizeof *h);
  if (!h) return pb_fail_memory(err, "modes");
  memcpy(z->u, z->mu, columns * z->full * sizeof *z->u);
  pb_status st = reduce_respond(z->w, columns, z->u, err);
  if (!st) st = append(z, k - columns - z->last, columns, h, err);
  for (size_t c = 0; !st && c < columns; c++)
    memcpy(z->h + (k - columns + c) * z->room, h + c * k, k * sizeof *h);
  free(h);
  return st;
}

// ---- Ritz pairs ---------------------------------------------------------------------------------

pb_status lanczos_decompose(lanczos *z, pb_error *err) {
  size_t n = z->k - z->block;
  double *s = malloc((n * n + 1) * sizeof *s), *theta = malloc((n + 1) * sizeof *theta);
  if (!s || !theta) {
    free(s);
    free(theta);
    return pb_fail_memory(err, "modes");
  }
  for (size_t j = 0; j < n; j++) memcpy(s + j * n, z->h + j * z->room, n * sizeof *s);
  free(z->s);
  free(z->theta);
  z->s = s;
  z->theta = theta;
  z->ritz = n;
  return eigen(n, s, n, theta, err);
}

double lanczos_residual(const lanczos *z, size_t i) {
  size_t n = z->ritz, column = n - 1 - i;
  double sum = 0;
  for (size_t r = 0; r < z->block; r++) {
    double entry = 0;
    for (size_t c = 0; c < z->last; c++)
      entry += z->coupling[r + c * z->block] * z->s[n - z->last + c + column * n];
    sum += entry * entry;
  }
  return sqrt(sum) / fabs(z->theta[column]);
}

double lanczos_omega2(const lanczos *z, size_t i) {
  return 1 / z->theta[z->ritz - 1 - i];
}

pb_status lanczos_vectors(const lanczos *z, size_t count, double *out, pb_error *err) {
  double *s = malloc((z->ritz * count + 1) * sizeof *s);
  if (!s) return pb_fail_memory(err, "modes");
  for (size_t i = 0; i < count; i++)
    memcpy(s + i * z->ritz, z->s + (z->ritz - 1 - i) * z->ritz, z->ritz * sizeof *s);
  gemm("N", "N", z->full, count, z->ritz, 1, z->q, z->full, s, z->ritz, 0, out, z->full);
  free(s);
  return PB_OK;
}

// ---- begin and end ------------------------------------------------------------------------------

pb_status lanczos_begin(lanczos *z, pb_error *err) {
  pb_random_seed(&z->random, 1, 0);
  z->u = malloc(z->full * BLOCK * sizeof *z->u);
  z->mu = malloc(z->full * BLOCK * sizeof *z->mu);
  z->spare = malloc(z->full * BLOCK * sizeof *z->spare);
  return z->u && z->mu && z->spare ? PB_OK : pb_fail_memory(err, z->w->fem->name);
}

void lanczos_clear(lanczos *z) {
  free(z->q);
  free(z->h);
  free(z->u);
  free(z->mu);
  free(z->spare);
  free(z->theta);
  free(z->s);
}
