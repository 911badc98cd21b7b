// Static condensation of massless motions: see eliminate.h.
//
// The mass matrix is scaled by D = diag(M)^-½ so that kilograms and kilogram square metres compare;
// the eigenvectors of D M D whose eigenvalue is zero to rounding are the massless motions Z, the
// others A.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "assembly/eliminate.h"
#include "base/array.h"
#include "base/lapack.h"

static const double massless = 1e-13;  // of the largest eigenvalue of the scaled mass matrix

// c(m × n) = op(a) b with all dimensions given as in dgemm.
static void multiply(const char *transa, size_t m, size_t n, size_t k, const double *a, size_t lda,
                     const double *b, size_t ldb, double *c) {
  int im = (int)m, in = (int)n, ik = (int)k, la = (int)lda, lb = (int)ldb;
  double one = 1, zero = 0;
  if (m && n) dgemm_(transa, "N", &im, &in, &ik, &one, a, &la, b, &lb, &zero, c, &im);
}

// Basis [A Z] of all motions: columns of `basis`; *count of them massless, last. Eigenvalues
// ascend, so the eigenvectors are stored in reverse.
static pb_status split(const pb_system *s, double *basis, size_t *count, pb_error *err) {
  int n = (int)s->n, info = 0, lwork = 1 + 6 * n + 2 * n * n, liwork = 3 + 5 * n;
  size_t size = s->n;
  double *scale = malloc(size * sizeof *scale), *w = malloc(size * sizeof *w);
  double *vector = pb_array_new(size * size, sizeof *vector);
  double *work = pb_array_new((size_t)lwork, sizeof *work);
  int *iwork = malloc((size_t)liwork * sizeof *iwork);
  pb_status st = PB_OK;
  if (!scale || !w || !vector || !work || !iwork) {
    st = pb_fail_memory(err, "/components");
    goto done;
  }
  double largest = 0;
  for (size_t i = 0; i < size; i++) largest = fmax(largest, s->m[i + i * size]);
  for (size_t i = 0; i < size; i++) {
    double mii = s->m[i + i * size];
    scale[i] = 1 / sqrt(mii > 1e-30 * largest ? mii : largest > 0 ? largest : 1);
  }
  for (size_t j = 0; j < size; j++)
    for (size_t i = 0; i < size; i++)
      vector[i + j * size] = s->m[i + j * size] * scale[i] * scale[j];
  dsyevd_("V", "U", &n, vector, &n, w, work, &lwork, iwork, &liwork, &info);
  if (info) {
    st = pb_fail(err, PB_ERR_NUMERIC, "/components", "the mass matrix cannot be decomposed");
    goto done;
  }
  *count = 0;
  for (size_t j = 0; j < size; j++) {
    if (w[j] < massless * (w[size - 1] > 0 ? w[size - 1] : 1)) (*count)++;
    for (size_t i = 0; i < size; i++)
      basis[i + (size - 1 - j) * size] = scale[i] * vector[i + j * size];
  }
done:
  free(scale);
  free(w);
  free(vector);
  free(work);
  free(iwork);
  return st;
}

// Index of the component in which the stacked motion q is largest.
static const char *name_of(const pb_plant *plant, const pb_layout *layout, const double *q) {
  const char *name = "/components";
  double best = -1;
  for (size_t i = 0; i < plant->component_count; i++) {
    double sum = 0;
    size_t n = pb_component_size(&plant->component[i]);
    for (size_t k = 0; k < n; k++) sum += q[layout->component[i] + k] * q[layout->component[i] + k];
    if (sum > best) best = sum, name = plant->component[i].pointer;
  }
  return name;
}

// Fails, naming the component that moves in the direction Z v, v the softest direction of K_zz.
static pb_status fail_singular(const pb_system *s, const pb_null_basis *basis,
                               const pb_layout *layout, const double *z, size_t nz, double *kzz,
                               pb_error *err) {
  int n = (int)nz, info = 0, lwork = 1 + 6 * n + 2 * n * n, liwork = 3 + 5 * n;
  double *w = malloc(nz * sizeof *w), *work = pb_array_new((size_t)lwork, sizeof *work);
  double *reduced = malloc(s->n * sizeof *reduced), *q = malloc(basis->n * sizeof *q);
  int *iwork = malloc((size_t)liwork * sizeof *iwork);
  const char *name = "/components";
  if (w && work && reduced && q && iwork) {
    dsyevd_("V", "U", &n, kzz, &n, w, work, &lwork, iwork, &liwork, &info);
    multiply("N", s->n, 1, nz, z, s->n, kzz, nz, reduced);
    if (!info && !pb_null_expand(basis, reduced, q, NULL)) name = name_of(s->plant, layout, q);
  }
  free(w);
  free(work);
  free(reduced);
  free(q);
  free(iwork);
  return pb_fail(err, PB_ERR_SINGULAR, name,
                 "it can move without mass and without stiffness: give it a mass (or inertia), a "
                 "stiffness, or lock the motion");
}

// x(n × cols) = K_zz⁻¹ b, in place, by the Cholesky factor.
static void solve(const double *factor, size_t nz, double *b, size_t cols) {
  int n = (int)nz, nrhs = (int)cols, info = 0;
  if (cols) dpotrs_("U", &n, &nrhs, factor, &n, b, &n, &info);
}

// The Cholesky factor of K_zz = ZᵀKZ; `scaled` tells singular from regular by the scaled pivots.
static bool factor_kzz(double *kzz, size_t nz) {
  int n = (int)nz, info = 0;
  double *diagonal = malloc(nz * sizeof *diagonal);
  if (!diagonal) return false;
  for (size_t i = 0; i < nz; i++) diagonal[i] = kzz[i + i * nz];
  dpotrf_("U", &n, kzz, &n, &info);
  bool ok = info == 0;
  for (size_t i = 0; i < nz && ok; i++)
    ok = kzz[i + i * nz] * kzz[i + i * nz] > 1e-12 * diagonal[i];
  free(diagonal);
  return ok;
}

typedef struct condensation {
  size_t n, na, nz;
  double *basis;    // n × n: [A Z]
  double *t;        // n × na: A − Z K_zz⁻¹ K_za
  double *kz;       // n × nz: K Z
  double *kzz;      // nz × nz, then its factor
  double *x;        // nz × max(na, nu)
  double *product;  // max(n, ny) × max(na, nu)
} condensation;

static void condensation_clear(condensation *c) {
  free(c->basis);
  free(c->t);
  free(c->kz);
  free(c->kzz);
  free(c->x);
  free(c->product);
  *c = (condensation){0};
}

static pb_status condensation_new(const pb_system *s, size_t nz, condensation *c, pb_error *err) {
  c->n = s->n;
  c->nz = nz;
  c->na = s->n - nz;
  size_t wide = c->na > s->nu ? c->na : s->nu, tall = c->n > s->ny ? c->n : s->ny;
  if (s->stacked > tall) tall = s->stacked;
  c->t = pb_array_new(c->n * c->na + 1, sizeof(double));
  c->kz = pb_array_new(c->n * nz, sizeof(double));
  c->kzz = pb_array_new(nz * nz, sizeof(double));
  c->x = pb_array_new(nz * wide + 1, sizeof(double));
  c->product = pb_array_new(tall * wide + 1, sizeof(double));
  bool ok = c->t && c->kz && c->kzz && c->x && c->product;
  return ok ? PB_OK : pb_fail_memory(err, "/components");
}

// a(na × na, in the front of a's storage) = Tᵀ a T
static void transform_square(const condensation *c, double *a) {
  multiply("N", c->n, c->na, c->n, a, c->n, c->t, c->n, c->product);
  multiply("T", c->na, c->na, c->n, c->t, c->n, c->product, c->n, a);
}

static void transform_output(const condensation *c, size_t ny, double *y) {
  multiply("N", ny, c->na, c->n, y, ny, c->t, c->n, c->product);
  memcpy(y, c->product, ny * c->na * sizeof *y);
}

// D += Y_0 Z K_zz⁻¹ Zᵀ F, and expand_u alike.
static void add_static(const condensation *c, pb_system *s) {
  const double *z = c->basis + c->na * c->n;
  multiply("T", c->nz, s->nu, c->n, z, c->n, s->f, c->n, c->x);
  solve(c->kzz, c->nz, c->x, s->nu);
  multiply("N", c->n, s->nu, c->nz, z, c->n, c->x, c->nz, c->product);
  int ny = (int)s->ny, nu = (int)s->nu, n = (int)c->n;
  double one = 1;
  dgemm_("N", "N", &ny, &nu, &n, &one, s->y0, &ny, c->product, &n, &one, s->d, &ny);
  if (s->stacked)
    multiply("N", s->stacked, s->nu, c->n, s->expand, s->stacked, c->product, c->n, s->expand_u);
}

static bool damps(const condensation *c, const pb_system *s) {
  const double *z = c->basis + c->na * c->n;
  for (size_t j = 0; j < c->nz; j++) {
    multiply("N", c->n, 1, c->n, s->c, c->n, z + j * c->n, c->n, c->product);
    for (size_t i = 0; i < c->n; i++)
      if (fabs(c->product[i]) > 0) return true;
  }
  return false;
}

static pb_status condense(pb_system *s, condensation *c, const pb_null_basis *basis,
                          const pb_layout *layout, pb_warnings *warnings, pb_error *err) {
  const double *z = c->basis + c->na * c->n;
  multiply("N", c->n, c->nz, c->n, s->k, c->n, z, c->n, c->kz);
  multiply("T", c->nz, c->nz, c->n, z, c->n, c->kz, c->n, c->kzz);
  if (!factor_kzz(c->kzz, c->nz)) {
    multiply("T", c->nz, c->nz, c->n, z, c->n, c->kz, c->n, c->kzz);
    return fail_singular(s, basis, layout, z, c->nz, c->kzz, err);
  }
  if (damps(c, s)) {
    pb_status st =
        pb_warn(warnings, err, "/components",
                "%zu massless motions are condensed statically: what damping acts on them "
                "follows the static shape",
                c->nz);
    if (st) return st;
  }
  add_static(c, s);
  multiply("T", c->nz, c->na, c->n, c->kz, c->n, c->basis, c->n, c->x);
  solve(c->kzz, c->nz, c->x, c->na);
  multiply("N", c->n, c->na, c->nz, z, c->n, c->x, c->nz, c->t);
  for (size_t i = 0; i < c->n * c->na; i++) c->t[i] = c->basis[i] - c->t[i];
  transform_square(c, s->m);
  transform_square(c, s->c);
  transform_square(c, s->k);
  multiply("T", c->na, s->nu, c->n, c->t, c->n, s->f, c->n, c->product);
  memcpy(s->f, c->product, c->na * s->nu * sizeof *s->f);
  transform_output(c, s->ny, s->y0);
  transform_output(c, s->ny, s->y1);
  transform_output(c, s->ny, s->y2);
  if (s->stacked) transform_output(c, s->stacked, s->expand);
  s->n = c->na;
  return PB_OK;
}

// A Cholesky factorisation with healthy pivots shows that nothing is massless, without the
// eigenvectors.
static bool has_massless(const pb_system *s, bool *failed) {
  int n = (int)s->n, info = 0;
  size_t size = s->n;
  double *a = pb_array_new(size * size, sizeof *a);
  *failed = !a;
  if (!a) return false;
  memcpy(a, s->m, size * size * sizeof *a);
  dpotrf_("U", &n, a, &n, &info);
  bool found = info != 0;
  for (size_t i = 0; i < size && !found; i++)
    found = a[i + i * size] * a[i + i * size] < 1e-9 * s->m[i + i * size];
  free(a);
  return found;
}

pb_status pb_condense(pb_system *s, const pb_null_basis *basis, const pb_layout *layout,
                      pb_warnings *warnings, pb_error *err) {
  bool failed = false;
  bool suspect = has_massless(s, &failed);
  if (failed) return pb_fail_memory(err, "/components");
  if (!suspect) return PB_OK;
  condensation c = {0};
  size_t nz = 0;
  c.basis = pb_array_new(s->n * s->n, sizeof *c.basis);
  if (!c.basis) return pb_fail_memory(err, "/components");
  pb_status st = split(s, c.basis, &nz, err);
  if (!st && nz) st = condensation_new(s, nz, &c, err);
  if (!st && nz) st = condense(s, &c, basis, layout, warnings, err);
  condensation_clear(&c);
  return st;
}
