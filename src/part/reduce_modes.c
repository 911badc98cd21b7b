// Fixed-interface modes by block Lanczos with shift 0, in the inner product of M, with full
// reorthogonalisation.
//
// The operator A = K⁻¹M under the frames' constraints is symmetric in that inner product and its
// eigenvalues are θ = 1/ω². From A Q_j = Q_j H_j + Q_{j+1} B_j follow the Ritz pairs (θ, Q s) and,
// exactly, their residuals ‖A x − θ x‖_M = ‖B_j s_last‖. A block of eight finds eigenvalues of that
// multiplicity; where a block runs dry a random one goes on. Source: R. Grimes, J. Lewis, H. Simon,
// "A shifted block Lanczos algorithm for solving sparse symmetric generalized eigenproblems", SIAM
// J. Matrix Anal. Appl. 15, 1994.
#include "part/reduce_internal.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"
#include "signal/random.h"

enum { BLOCK = 8 };

static const double two_pi = 6.283185307179586476925286766559;
static const double tolerance = 1e-11;      // of the residual, relative to θ
static const double next_tolerance = 1e-3;  // of the first mode that is not kept
static const double dependent = 1e-12;      // length left of a direction by the basis, to drop it

typedef struct lanczos {
  reduce_work *w;
  size_t full, limit;              // limit: dimension of the space
  size_t k, room;                  // basis vectors, allocated ones
  size_t block;                    // vectors of the newest block, 0: the space is used up
  size_t last;                     // vectors of the block before it
  double *q;                       // full × k
  double *h;                       // room × room, upper triangle: QᵀM A Q
  double *u, *mu;                  // full × BLOCK: block at work and M times it
  double *spare;                   // full × BLOCK
  double coupling[BLOCK * BLOCK];  // B_j, block × last
  double *theta, *s;               // Ritz values ascending, k × k vectors
  size_t ritz;                     // size of the last decomposition
  pb_random random;
} lanczos;

static void gemm(const char *ta, const char *tb, size_t m, size_t n, size_t k, double alpha,
                 const double *a, size_t lda, const double *b, size_t ldb, double beta, double *c,
                 size_t ldc) {
  int im = (int)m, in = (int)n, ik = (int)k, ia = (int)lda, ib = (int)ldb, ic = (int)ldc;
  if (m && n) dgemm_(ta, tb, &im, &in, &ik, &alpha, a, &ia, b, &ib, &beta, c, &ic);
}

static pb_status eigen(size_t n, double *a, size_t ld, double *values, pb_error *err) {
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

// u ← u − Q QᵀM u; what was taken off goes to h (k × columns). mu is M u on return.
static void orthogonalise(lanczos *z, size_t columns, double *h) {
  gemm("T", "N", z->k, columns, z->full, 1, z->q, z->full, z->mu, z->full, 0, h, z->k);
  gemm("N", "N", z->full, columns, z->k, -1, z->q, z->full, h, z->k, 1, z->u, z->full);
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

// Makes `columns` vectors in u the next block: orthogonal to the basis, twice, and to each other.
// h (k × columns) is what lay in the basis, the coupling the rest.
static pb_status append(lanczos *z, size_t columns, double *h, pb_error *err) {
  double b1[BLOCK * BLOCK], b2[BLOCK * BLOCK];
  size_t kept = 0, again = 0;
  double *h2 = malloc((z->k + 1) * BLOCK * sizeof *h2);
  if (!h2) return pb_fail_memory(err, "modes");
  reduce_mass_multiply(z->w, columns, z->u, z->mu);
  double least = dependent * longest(z, columns);
  orthogonalise(z, columns, h);
  pb_status st = normalise(z, columns, fmax(least, 1e-290), &kept, b1, err);
  if (!st && kept) {
    orthogonalise(z, kept, h2);
    gemm("N", "N", z->k, columns, kept, 1, h2, z->k, b1, kept, 1, h, z->k);
    st = normalise(z, kept, 0.5, &again, b2, err);
  }
  if (!st) {
    gemm("N", "N", again, columns, kept, 1, b2, again, b1, kept, 0, z->coupling, again);
    st = reserve(z, z->k + again, err);
  }
  if (!st) {
    memcpy(z->q + z->k * z->full, z->u, again * z->full * sizeof *z->q);
    z->k += again;
    z->last = columns;
    z->block = again;
  }
  free(h2);
  return st;
}

static pb_status append_random(lanczos *z, pb_error *err) {
  size_t columns = z->limit - z->k < BLOCK ? z->limit - z->k : BLOCK;
  double *h = malloc((z->k + 1) * BLOCK * sizeof *h);
  if (!h) return pb_fail_memory(err, "modes");
  for (size_t i = 0; i < columns * z->full; i++)
    z->mu[i] = z->w->rigid_row[i % z->full] ? 0 : pb_random_gaussian(&z->random);
  reduce_mass_multiply(z->w, columns, z->mu, z->u);
  pb_status st = reduce_respond(z->w, columns, z->u, err);
  if (!st) st = append(z, columns, h, err);
  if (!st) z->last = 0;  // nothing of A Q leads to it
  free(h);
  return st;
}

// One application of the operator to the newest block.
static pb_status extend(lanczos *z, pb_error *err) {
  size_t columns = z->block, k = z->k;
  double *h = malloc((k + 1) * BLOCK * sizeof *h);
  if (!h) return pb_fail_memory(err, "modes");
  memcpy(z->u, z->mu, columns * z->full * sizeof *z->u);
  pb_status st = reduce_respond(z->w, columns, z->u, err);
  if (!st) st = append(z, columns, h, err);
  for (size_t c = 0; !st && c < columns; c++)
    memcpy(z->h + (k - columns + c) * z->room, h + c * k, k * sizeof *h);
  free(h);
  return st;
}

// ---- Ritz pairs ---------------------------------------------------------------------------------

// Of the basis without its newest block, to which A was not applied yet.
static pb_status decompose(lanczos *z, pb_error *err) {
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

// Residual of the i-th largest Ritz pair, relative to its value.
static double residual(const lanczos *z, size_t i) {
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

static double omega2_of(const lanczos *z, size_t i) {
  return 1 / z->theta[z->ritz - 1 - i];
}

// ---- how many
// ------------------------------------------------------------------------------------

// How many modes the present Ritz values promise: by count, or all up to max_hz.
static size_t wanted(const lanczos *z) {
  const pb_reduce_options *o = z->w->options;
  if (!(o->max_hz > 0)) return o->modes;
  double top = two_pi * o->max_hz;
  size_t count = 0;
  while (count < z->ritz && omega2_of(z, count) > 0 && omega2_of(z, count) <= top * top) count++;
  return o->modes && o->modes < count ? o->modes : count;
}

// The first mode beyond is needed too, roughly: it says that there are no more, and between it and
// the last one is the place to count.
static bool is_done(const lanczos *z, size_t *converged) {
  size_t p = wanted(z);
  bool all = !z->block && z->k == z->limit;  // the basis is the whole space
  *converged = 0;
  while (*converged < p && *converged < z->ritz && residual(z, *converged) <= tolerance)
    ++*converged;
  if (*converged < p) return false;
  bool proven = z->w->options->max_hz > 0 || z->w->options->prove;
  return all || !proven || (p < z->ritz && residual(z, p) <= next_tolerance);
}

static pb_status fail_missing(const lanczos *z, pb_error *err) {
  return pb_fail(err, PB_ERR_ARGUMENT, z->w->fem->name,
                 "%zu fixed-interface modes are asked for; the model has %zu", z->w->options->modes,
                 z->ritz);
}

static pb_status iterate(lanczos *z, pb_error *err) {
  pb_status st = PB_OK;
  size_t checked = 0, converged = 0;
  bool done = false;
  while (!st && !done) {
    if (!z->block) st = append_random(z, err);
    bool dry = !z->block;
    if (!st && !dry) st = extend(z, err);
    size_t n = z->k - z->block;
    bool check = dry || !z->block || n >= checked + BLOCK + n / 32;
    if (st || (!dry && (!check || n < z->w->options->modes))) continue;
    st = decompose(z, err);
    if (st) break;
    checked = n;
    done = is_done(z, &converged);
    if (!done && dry) return fail_missing(z, err);
    st = reduce_progress(z->w, PB_REDUCE_MODES, (double)converged,
                         z->w->options->max_hz > 0 ? 0 : (double)z->w->options->modes, err);
  }
  return st;
}

// Phi = Q S of the first p.
static pb_status extract(lanczos *z, size_t p, pb_error *err) {
  reduce_work *w = z->w;
  double *phi = malloc((z->full * p + 1) * sizeof *phi);
  double *omega2 = malloc((p + 1) * sizeof *omega2), *s = malloc((z->ritz * p + 1) * sizeof *s);
  if (!phi || !omega2 || !s) {
    free(phi);
    free(omega2);
    free(s);
    return pb_fail_memory(err, "modes");
  }
  for (size_t i = 0; i < p; i++) {
    omega2[i] = omega2_of(z, i);
    memcpy(s + i * z->ritz, z->s + (z->ritz - 1 - i) * z->ritz, z->ritz * sizeof *s);
  }
  gemm("N", "N", z->full, p, z->ritz, 1, z->q, z->full, s, z->ritz, 0, phi, z->full);
  free(s);
  free(w->phi);
  free(w->omega2);
  w->phi = phi;
  w->omega2 = omega2;
  w->modes = p;
  w->next_omega2 = p < z->ritz ? omega2_of(z, p) : INFINITY;
  return PB_OK;
}

// Starts again beside the modes found: A Φ = Φ Θ, so nothing leads out of them.
static void lock(lanczos *z) {
  size_t p = z->w->modes;
  memcpy(z->q, z->w->phi, p * z->full * sizeof *z->q);
  memset(z->h, 0, z->room * z->room * sizeof *z->h);
  for (size_t i = 0; i < p; i++) z->h[i + i * z->room] = 1 / z->w->omega2[i];
  z->k = p;
  z->block = 0;
}

// Sylvester's law of inertia: as many negative pivots of K − σM under the constraints as modes
// below σ. Where modes are missing (more of one frequency than a block has vectors) they are looked
// for beside those found.
static pb_status prove(lanczos *z, pb_error *err) {
  reduce_work *w = z->w;
  pb_status st = PB_OK;
  size_t below = 0, free_below = 0, before = SIZE_MAX;
  while (!st) {
    double last = w->modes ? sqrt(w->omega2[w->modes - 1]) : 0;
    double next = isfinite(w->next_omega2) ? sqrt(w->next_omega2) : 1.5 * last;
    double hz = (last + next) / 2 / two_pi;
    if (!(hz > 0)) return PB_OK;  // the model has no modes at all
    st = reduce_count(w, hz, &below, &free_below, err);
    if (st) break;
    w->out->proven_hz = hz;
    if (below == w->modes) break;
    if (below < w->modes || below >= before)
      return pb_fail(err, PB_ERR_NUMERIC, w->fem->name,
                     "%zu modes were found below %.6g Hz where the model has %zu", w->modes, hz,
                     below);
    lock(z);
    st = iterate(z, err);
    if (!st) st = extract(z, wanted(z), err);
  }
  return st;
}

static pb_status run(lanczos *z, pb_error *err) {
  const pb_reduce_options *o = z->w->options;
  if (!(o->max_hz > 0) && o->modes > z->limit) {
    z->ritz = z->limit;
    return fail_missing(z, err);
  }
  if (!(o->max_hz > 0) && !o->modes) return extract(z, 0, err);
  pb_status st = iterate(z, err);
  if (!st) st = extract(z, wanted(z), err);
  if (!st && (o->max_hz > 0 || o->prove)) st = prove(z, err);
  return st;
}

pb_status reduce_modes(reduce_work *w, pb_error *err) {
  pb_status st = reduce_begin(w, PB_REDUCE_MODES, err);
  lanczos z = {.w = w, .full = w->full};
  size_t free_rows = w->factor.n + w->pins;
  z.limit = free_rows > 6 * w->averaged ? free_rows - 6 * w->averaged : 0;
  pb_random_seed(&z.random, 1, 0);
  z.u = malloc(w->full * BLOCK * sizeof *z.u);
  z.mu = malloc(w->full * BLOCK * sizeof *z.mu);
  z.spare = malloc(w->full * BLOCK * sizeof *z.spare);
  if (!st && (!z.u || !z.mu || !z.spare)) st = pb_fail_memory(err, w->fem->name);
  if (!st) st = run(&z, err);
  free(z.q);
  free(z.h);
  free(z.u);
  free(z.mu);
  free(z.spare);
  free(z.theta);
  free(z.s);
  return st;
}
