// The element's own interior reduced once more with its frames held: see truncate.h.
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"
#include "part/truncate_internal.h"

static const double two_pi = 6.283185307179586476925286766559;

void interior_clear(interior *x) {
  free(x->k);
  free(x->m);
  free(x->hz);
  free(x->order);
  *x = (interior){0};
}

static double *block(const double *x, size_t n, size_t row, size_t rows, size_t col, size_t cols) {
  double *out = malloc((rows * cols + 1) * sizeof *out);
  for (size_t c = 0; out && c < cols; c++)
    memcpy(out + c * rows, x + row + (col + c) * n, rows * sizeof *out);
  return out;
}

// Of p eigenvalues, ascending: the first stands out of their rounding, p ε of the last. A
// coordinate that nothing holds has one of either sign there, by the processor's kernels.
static bool all_held(const double *lambda, size_t p) {
  return lambda[0] > 8 * (double)p * DBL_EPSILON * lambda[p - 1];
}

// Fixed-interface modes: Φ (p × p, M-normalised) and their frequencies.
static pb_status solve_interior(const char *name, interior *x, double *phi, double *mii,
                                pb_error *err) {
  int p = (int)x->p, itype = 1, info = 0, lwork = 1 + 6 * p + 2 * p * p, liwork = 3 + 5 * p;
  double *work = malloc((size_t)lwork * sizeof *work), *m = NULL;
  int *iwork = malloc((size_t)liwork * sizeof *iwork);
  m = block(mii, x->p, 0, x->p, 0, x->p);
  pb_status st = work && iwork && m ? PB_OK : pb_fail_memory(err, name);
  if (!st) {
    dsygvd_(&itype, "V", "U", &p, phi, &p, m, &p, x->hz, work, &lwork, iwork, &liwork, &info);
    if (info > p)
      st = pb_fail(err, PB_ERR_ELEMENT, name, "M of the modes is not positive definite");
    else if (info)
      st = pb_fail(err, PB_ERR_NUMERIC, name, "the fixed-interface modes did not converge");
    else if (p && !all_held(x->hz, x->p))
      st = pb_fail(err, PB_ERR_ELEMENT, name,
                   "its modes are not held by its frames: the lowest has ω² = %g, rounding beside "
                   "the highest, %g",
                   x->hz[0], x->hz[p - 1]);
  }
  for (size_t i = 0; !st && i < x->p; i++) x->hz[i] = sqrt(x->hz[i]) / two_pi;
  free(work);
  free(iwork);
  free(m);
  return st;
}

// T = [[I, 0], [Ψ, Φ]] (size × size), Ψ = −Φ ω⁻² Φᵀ K_ib.
static void make_transform(const pb_element_data *e, const interior *x, const double *phi,
                           double *t) {
  size_t n = e->size, b = x->b, p = x->p;
  memset(t, 0, n * n * sizeof *t);
  for (size_t j = 0; j < b; j++) {
    t[j + j * n] = 1;
    for (size_t q = 0; q < p; q++) {
      double load = 0, omega = two_pi * x->hz[q];
      for (size_t i = 0; i < p; i++) load += phi[i + q * p] * e->k[b + i + j * n];
      load /= omega * omega;
      if (load != 0)
        for (size_t i = 0; i < p; i++) t[b + i + j * n] -= phi[i + q * p] * load;
    }
  }
  for (size_t q = 0; q < p; q++) memcpy(t + b + (b + q) * n, phi + q * p, p * sizeof *t);
}

static void congruence(const double *t, const double *x, size_t size, double *work, double *out) {
  int n = (int)size;
  double one = 1, zero = 0;
  dgemm_("N", "N", &n, &n, &n, &one, x, &n, t, &n, &zero, work, &n);
  dgemm_("T", "N", &n, &n, &n, &one, t, &n, work, &n, &zero, out, &n);
  for (size_t j = 0; j < size; j++)
    for (size_t i = 0; i < j; i++)
      out[i + j * size] = out[j + i * size] = 0.5 * (out[i + j * size] + out[j + i * size]);
}

pb_status interior_make(const char *name, const pb_element_data *e, interior *x, pb_error *err) {
  size_t n = e->size;
  *x = (interior){.b = 6 * e->frames, .p = n - 6 * e->frames};
  double *phi = block(e->k, n, x->b, x->p, x->b, x->p),
         *mii = block(e->m, n, x->b, x->p, x->b, x->p);
  double *t = malloc(n * n * sizeof *t), *work = malloc(n * n * sizeof *work);
  x->k = malloc(n * n * sizeof *x->k);
  x->m = malloc(n * n * sizeof *x->m);
  x->hz = malloc((x->p + 1) * sizeof *x->hz);
  bool ok = phi && mii && t && work && x->k && x->m && x->hz;
  pb_status st = ok ? PB_OK : pb_fail_memory(err, name);
  if (!st) st = solve_interior(name, x, phi, mii, err);
  if (!st) {
    make_transform(e, x, phi, t);
    congruence(t, e->k, n, work, x->k);
    congruence(t, e->m, n, work, x->m);
    // What is zero or one by construction is made so.
    for (size_t j = x->b; j < n; j++) {
      for (size_t i = 0; i < n; i++) {
        double omega = two_pi * x->hz[j - x->b];
        x->k[i + j * n] = x->k[j + i * n] = i == j ? omega * omega : 0;
        if (i >= x->b) x->m[i + j * n] = i == j;
      }
    }
  }
  free(phi);
  free(mii);
  free(t);
  free(work);
  if (st) interior_clear(x);
  return st;
}

typedef struct ranked {
  double weight;
  size_t mode;
} ranked;

static int by_weight(const void *a, const void *b) {
  const ranked *x = a, *y = b;
  if (x->weight != y->weight) return x->weight < y->weight ? 1 : -1;
  return (x->mode > y->mode) - (x->mode < y->mode);
}

// A mode adds −ω⁴ M_bq M_qb / (ω_q² − ω²) to the frames' dynamic stiffness: its size at the band's
// end against ω² M_bb, the largest over the frames' coordinates. Modes of the band come first.
pb_status interior_rank(const char *name, interior *x, double high_hz, pb_error *err) {
  ranked *list = malloc((x->p + 1) * sizeof *list);
  x->order = malloc((x->p + 1) * sizeof *x->order);
  if (!list || !x->order) {
    free(list);
    return pb_fail_memory(err, name);
  }
  size_t n = x->b + x->p;
  for (size_t q = 0; q < x->p; q++) {
    double ratio = pow(x->hz[q] / high_hz, 2), share = 0;
    for (size_t i = 0; i < x->b; i++) {
      double mass = x->m[i + i * n], coupling = x->m[i + (x->b + q) * n];
      if (mass > 0) share = fmax(share, coupling * coupling / mass);
    }
    list[q] = (ranked){ratio > 1.5 ? share / (ratio - 1) : INFINITY, q};
  }
  qsort(list, x->p, sizeof *list, by_weight);
  for (size_t q = 0; q < x->p; q++) x->order[q] = list[q].mode;
  free(list);
  return PB_OK;
}

static int ascending(const void *a, const void *b) {
  size_t x = *(const size_t *)a, y = *(const size_t *)b;
  return (x > y) - (x < y);
}

pb_status interior_take(const char *name, const pb_element_data *e, const interior *x, size_t modes,
                        pb_element_data *out, pb_error *err) {
  size_t n = x->b + modes, whole = x->b + x->p;
  *out = (pb_element_data){.frames = e->frames, .size = n};
  out->position = malloc(3 * e->frames * sizeof *out->position);
  out->k = malloc(n * n * sizeof *out->k);
  out->m = malloc(n * n * sizeof *out->m);
  size_t *from = malloc(n * sizeof *from);
  if (!out->position || !out->k || !out->m || !from) {
    free(from);
    pb_element_data_clear(out);
    return pb_fail_memory(err, name);
  }
  memcpy(out->position, e->position, 3 * e->frames * sizeof *out->position);
  for (size_t i = 0; i < n; i++) from[i] = i < x->b ? i : x->b + x->order[i - x->b];
  qsort(from, n, sizeof *from, ascending);
  for (size_t j = 0; j < n; j++) {
    for (size_t i = 0; i < n; i++) {
      out->k[i + j * n] = x->k[from[i] + from[j] * whole];
      out->m[i + j * n] = x->m[from[i] + from[j] * whole];
    }
  }
  free(from);
  return PB_OK;
}
