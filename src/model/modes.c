// Undamped modes: see modes.h.
#include "model/modes.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/array.h"
#include "base/lapack.h"
#include "base/product.h"
#include "model/modes_internal.h"

static const double two_pi = 6.283185307179586476925286766559;

// Work space that eigen needs, for n modes; the steps after it share it.
static size_t space_size(size_t n) {
  return 3 * n * n + 6 * n + 1;
}

// omega2 and shape from (K, M) of the system.
static pb_status eigen(const pb_system *s, double *omega2, double *shape, double *space,
                       pb_error *err) {
  int n = (int)s->n, info = 0, lwork = 1 + 6 * n + 2 * n * n, liwork = 3 + 5 * n, type = 1;
  size_t bytes = s->n * s->n * sizeof(double);
  double *mass = space, *work = space + s->n * s->n;
  int *iwork = malloc((size_t)liwork * sizeof *iwork);
  if (!iwork) return pb_fail_memory(err, "");
  memcpy(mass, s->m, bytes);
  memcpy(shape, s->k, bytes);
  dsygvd_(&type, "V", "U", &n, shape, &n, mass, &n, omega2, work, &lwork, iwork, &liwork, &info);
  free(iwork);
  if (info > n)
    return pb_fail(err, PB_ERR_SINGULAR, "/components",
                   "the assembled mass matrix is not positive definite");
  if (info) return pb_fail(err, PB_ERR_NUMERIC, "", "the modes of the plant did not converge");
  return PB_OK;
}

static void multiply(const char *ta, size_t m, size_t n, size_t k, const double *a, size_t lda,
                     const double *b, double *c, const pb_workers *workers) {
  const pb_product product = {ta, "N", m, n, k, a, b, lda, k, 0, c, m};
  pb_product_make(&product, workers);
}

// Rounding of φᵀKφ: below it a mode counts as rigid.
static double noise_of(const pb_system *s, const double *phi) {
  double sum = 0;
  for (size_t j = 0; j < s->n; j++)
    for (size_t i = 0; i < s->n; i++) sum += fabs(phi[i] * s->k[i + j * s->n] * phi[j]);
  return 8 * DBL_EPSILON * sum;
}

// ω from ω², rigid-body modes set to 0 exactly, indefinite stiffness refused.
static pb_status clean(const pb_system *s, double *omega2, const double *shape, pb_modes *m,
                       pb_warnings *warnings, pb_error *err) {
  double largest = omega2[s->n - 1];
  for (size_t j = 0; j < s->n; j++) {
    double hz = sqrt(fabs(omega2[j])) / two_pi;
    if (!isfinite(hz))
      return pb_fail(err, PB_ERR_NUMERIC, "/components",
                     "a natural frequency overflows: a mass is too small for its stiffness");
    bool small = omega2[j] < 1e-9 * largest || s->n == 1;
    if (small && fabs(omega2[j]) <= noise_of(s, shape + j * s->n)) {
      omega2[j] = 0;
    } else if (omega2[j] < 0 && hz > 1) {
      return pb_fail(err, PB_ERR_SINGULAR, "/components",
                     "the assembled stiffness is indefinite (a mode at −%.4g Hz): check the "
                     "elements' rigid-body residuals",
                     hz);
    } else if (omega2[j] < 0) {
      omega2[j] = 0;
      pb_status st =
          pb_warn(warnings, err, "/components",
                  "a mode at −%.3g Hz, an element's rigid-body residual, counts as 0", hz);
      if (st) return st;
    }
    m->omega[j] = sqrt(omega2[j]);
    if (m->omega[j] == 0) m->rigid++;
  }
  return PB_OK;
}

// Ĉ, ΦᵀF and Y Φ. space: n × n.
static void project(const pb_system *s, const pb_workers *workers, const double *shape,
                    double *space, pb_modes *m) {
  size_t n = s->n;
  multiply("N", n, n, n, s->c, n, shape, space, workers);
  multiply("T", n, n, n, shape, n, space, m->damping, workers);
  for (size_t j = 0; j < n; j++)
    for (size_t i = 0; i < j; i++)
      m->damping[i + j * n] = m->damping[j + i * n] =
          0.5 * (m->damping[i + j * n] + m->damping[j + i * n]);
  multiply("T", n, s->nu, n, shape, n, s->f, m->force, workers);
  const double *y[3] = {s->y0, s->y1, s->y2};
  for (int i = 0; i < 3; i++) multiply("N", s->ny, n, n, y[i], s->ny, shape, m->output[i], workers);
  multiply("N", s->stacked, n, n, s->expand, s->stacked, shape, m->motion, workers);
}

static pb_status allocate(const pb_system *s, pb_modes *m, pb_error *err) {
  size_t n = s->n;
  *m = (pb_modes){.n = n, .nu = s->nu, .ny = s->ny, .stacked = s->stacked};
  m->omega = malloc(n * sizeof(double));
  m->damping = pb_array_new(n * n, sizeof(double));
  m->force = pb_array_new(n * s->nu, sizeof(double));
  m->motion = s->stacked ? pb_array_new(s->stacked * n, sizeof(double)) : NULL;
  bool ok = m->omega && m->damping && m->force && (m->motion || !s->stacked);
  for (int i = 0; i < 3; i++) {
    m->output[i] = pb_array_new(n * s->ny, sizeof(double));
    ok = ok && m->output[i];
  }
  return ok ? PB_OK : pb_fail_memory(err, "");
}

// Φ and ω² of one K and M: what a store keeps.
typedef struct undamped {
  double *omega2;  // [n]
  double *shape;   // n × n
} undamped;

static void undamped_free(void *value) {
  undamped *u = value;
  if (!u) return;
  free(u->omega2);
  free(u->shape);
  free(u);
}

static undamped *undamped_new(size_t n) {
  undamped *u = calloc(1, sizeof *u);
  if (!u) return NULL;
  u->omega2 = malloc(n * sizeof *u->omega2);
  u->shape = pb_array_new(n * n, sizeof *u->shape);
  if (u->omega2 && u->shape) return u;
  undamped_free(u);
  return NULL;
}

static pb_status solve(const pb_system *s, const pb_workers *workers, undamped *u, pb_error *err) {
  double *space = pb_array_new(space_size(s->n), sizeof *space);
  pb_status st = space ? eigen(s, u->omega2, u->shape, space, err) : pb_fail_memory(err, "");
  if (!st) st = pb_modes_restore(s, workers, u->omega2, u->shape, space, err);
  free(space);
  return st;
}

// *own: to be freed by the caller; NULL where the store has it.
static pb_status find_or_solve(const pb_system *s, const pb_means *means, const undamped **out,
                               undamped **own, pb_error *err) {
  const pb_mode_key key = {s->k, s->m, s->n * s->n, s->n * s->n};
  *own = NULL;
  *out = pb_mode_store_find(means->modes, PB_MODES_UNDAMPED, &key);
  if (*out) return PB_OK;
  undamped *u = undamped_new(s->n);
  pb_status st = u ? solve(s, means->workers, u, err) : pb_fail_memory(err, "");
  *out = st ? NULL : pb_mode_store_keep(means->modes, PB_MODES_UNDAMPED, &key, u, undamped_free);
  if (*out) return PB_OK;
  *out = *own = u;
  return st;
}

pb_status pb_modes_solve(const pb_system *s, const pb_means *lent, pb_warnings *warnings,
                         pb_modes *out, pb_error *err) {
  const pb_means means = pb_means_of(lent);
  const undamped *u = NULL;
  undamped *own = NULL;
  double *omega2 = malloc(s->n * sizeof *omega2), *space = NULL;
  pb_status st = allocate(s, out, err);
  if (!st && !omega2) st = pb_fail_memory(err, "");
  if (!st) st = find_or_solve(s, &means, &u, &own, err);
  if (!st) memcpy(omega2, u->omega2, s->n * sizeof *omega2);
  if (!st) st = clean(s, omega2, u->shape, out, warnings, err);
  if (!st) space = pb_array_new(s->n * s->n, sizeof *space);
  if (!st && !space) st = pb_fail_memory(err, "");
  if (!st) project(s, means.workers, u->shape, space, out);
  if (!st && out->rigid)
    st = pb_warn(warnings, err, "/connections",
                 "the plant floats: %zu of its %zu modes are rigid-body motions without stiffness",
                 out->rigid, out->n);
  undamped_free(own);
  free(omega2);
  free(space);
  if (st) pb_modes_clear(out);
  return st;
}

void pb_modes_clear(pb_modes *m) {
  free(m->omega);
  free(m->damping);
  free(m->force);
  free(m->motion);
  for (int i = 0; i < 3; i++) free(m->output[i]);
  *m = (pb_modes){0};
}
