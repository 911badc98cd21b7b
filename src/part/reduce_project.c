// K and M of the element from the constraint modes Ψ and the fixed-interface modes Φ:
//   K = diag(ΨᵀKΨ, ω²),  M = [ΨᵀMΨ, ΨᵀMΦ; ·, I].
// ΨᵀKΦ vanishes because K Ψ is a set of forces on the frames, which Φ does not move.
#include "part/reduce_internal.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"

static const double two_pi = 6.283185307179586476925286766559;

static void gemm_t(size_t m, size_t n, size_t k, const double *a, const double *b, double *c,
                   size_t ldc) {
  int im = (int)m, in = (int)n, ik = (int)k, ic = (int)ldc;
  double one = 1, zero = 0;
  if (m && n) dgemm_("T", "N", &im, &in, &ik, &one, a, &ik, b, &ik, &zero, c, &ic);
}

static void symmetrise(double *x, size_t n) {
  for (size_t j = 0; j < n; j++)
    for (size_t i = 0; i < j; i++)
      x[i + j * n] = x[j + i * n] = 0.5 * (x[i + j * n] + x[j + i * n]);
}

// The six rigid motions of the element's frames about its first one: boundary × 6.
static void rigid_motions(const reduce_work *w, double *r) {
  memset(r, 0, 6 * w->boundary * sizeof *r);
  for (size_t f = 0; f < w->frames; f++) {
    double x[3];
    for (size_t a = 0; a < 3; a++) x[a] = w->fem->frame[f].origin[a] - w->fem->frame[0].origin[a];
    for (size_t a = 0; a < 3; a++) {
      size_t b = (a + 1) % 3, c = (a + 2) % 3;
      r[6 * f + a + a * w->boundary] = 1;
      r[6 * f + 3 + a + (3 + a) * w->boundary] = 1;
      r[6 * f + b + (3 + a) * w->boundary] = -x[c];
      r[6 * f + c + (3 + a) * w->boundary] = x[b];
    }
  }
}

// Stiffness by which a row's forces are judged: K's own, or, of a single frame, whose K is zero but
// for rounding, what moves its mass at the first mode.
static double own_stiffness(const reduce_work *w, size_t i) {
  const pb_reduction *out = w->out;
  double first = w->modes ? w->omega2[0] : isfinite(w->next_omega2) ? w->next_omega2 : 0;
  size_t at = i * (out->size + 1);
  return fmax(out->k[at], first * out->m[at]);
}

// Largest |K R| against √(K_ii · RᵀR weighted by K's diagonal): free of units.
static void measure_rigid(const reduce_work *w, const double *r) {
  pb_reduction *out = w->out;
  size_t m = out->size, b = w->boundary;
  out->rigid_residual = 0;
  for (size_t c = 0; c < 6; c++) {
    const double *motion = r + c * b;
    double size = 0;
    for (size_t i = 0; i < b; i++) size += own_stiffness(w, i) * motion[i] * motion[i];
    for (size_t i = 0; i < b; i++) {
      double force = 0;
      for (size_t j = 0; j < b; j++) force += out->k[i + j * m] * motion[j];
      double scale = sqrt(size * own_stiffness(w, i));
      out->rigid_residual = fmax(out->rigid_residual, scale > 0 ? fabs(force) / scale : 0);
    }
  }
}

// The mean over the three translations of tᵀM t, of the element and of the full model.
static void measure_mass(const reduce_work *w, const double *r, double *t, double *mt) {
  pb_reduction *out = w->out;
  size_t m = out->size, b = w->boundary;
  out->mass = out->full_mass = 0;
  for (size_t c = 0; c < 3; c++) {
    for (size_t j = 0; j < b; j++)
      for (size_t i = 0; i < b; i++)
        out->mass += r[i + c * b] * out->m[i + j * m] * r[j + c * b] / 3;
    memset(t, 0, w->full * sizeof *t);
    for (size_t i = 0; i < w->fem->nodes; i++)
      if (w->fem->dof[c + 3 * i] >= 0) t[w->fem->dof[c + 3 * i]] = 1;
    reduce_mass_multiply(w, 1, t, mt);
    for (size_t i = 0; i < w->full; i++) out->full_mass += t[i] * mt[i] / 3;
  }
}

// An eigenvector has no sign of its own: the frame motion that drives a mode most does so
// positively, the first among equals.
static void choose_signs(reduce_work *w) {
  size_t m = w->out->size, b = w->boundary;
  double *mass = w->out->m;
  for (size_t p = b; p < m; p++) {
    double largest = 0, sign = 1;
    for (size_t i = 0; i < b; i++)
      largest = fmax(largest, fabs(mass[i + p * m]) / sqrt(mass[i + i * m]));
    for (size_t i = b; i-- > 0;) {
      double part = mass[i + p * m] / sqrt(mass[i + i * m]);
      if (fabs(part) > 0.99 * largest) sign = part < 0 ? -1 : 1;
    }
    for (size_t i = 0; sign < 0 && i < b; i++) mass[i + p * m] = -mass[i + p * m];
    double *phi = w->phi + (p - b) * w->full;
    for (size_t i = 0; sign < 0 && i < w->full; i++) phi[i] = -phi[i];
  }
}

pb_status reduce_project_stiffness(reduce_work *w, pb_error *err) {
  size_t b = w->boundary;
  double *product = malloc(6 * w->full * sizeof *product);
  w->stiffness = malloc(b * b * sizeof *w->stiffness);
  pb_status st = product && w->stiffness ? PB_OK : pb_fail_memory(err, w->fem->name);
  for (size_t c = 0; !st && c < b; c += 6) {
    pb_sparse_multiply(&w->fem->k, 6, w->psi + c * w->full, product);
    gemm_t(b, 6, w->full, w->psi, product, w->stiffness + c * b, b);
  }
  free(product);
  return st;
}

// Six columns of Ψ at a time: their products with M against all that comes up to them.
static void project_columns(reduce_work *w, size_t c, double *product) {
  size_t m = w->out->size, b = w->boundary;
  const double *psi = w->psi + c * w->full;
  for (size_t j = c; j < c + 6; j++)
    memcpy(w->out->k + j * m, w->stiffness + j * b, b * sizeof *w->stiffness);
  reduce_mass_multiply(w, 6, psi, product);
  gemm_t(b, 6, w->full, w->psi, product, w->out->m + c * m, m);
  gemm_t(w->modes, 6, w->full, w->phi, product, w->out->m + b + c * m, m);
}

pb_status reduce_project(reduce_work *w, pb_error *err) {
  pb_reduction *out = w->out;
  size_t b = w->boundary, m = b + w->modes;
  pb_status st = reduce_begin(w, PB_REDUCE_PROJECT, err);
  if (st) return st;
  out->modes = w->modes;
  out->size = m;
  out->k = calloc(m * m, sizeof *out->k);
  out->m = calloc(m * m, sizeof *out->m);
  out->fixed_hz = malloc((w->modes + 1) * sizeof *out->fixed_hz);
  double *product = malloc(6 * w->full * sizeof *product), *r = malloc(6 * b * sizeof *r);
  if (!out->k || !out->m || !out->fixed_hz || !product || !r)
    st = pb_fail_memory(err, w->fem->name);
  for (size_t c = 0; !st && c < b; c += 6) {
    project_columns(w, c, product);
    st = reduce_progress(w, PB_REDUCE_PROJECT, (double)(c + 6), (double)b, err);
  }
  if (!st) {
    for (size_t p = 0; p < w->modes; p++) {
      out->fixed_hz[p] = sqrt(w->omega2[p]) / two_pi;
      out->k[(b + p) * (m + 1)] = w->omega2[p];
      out->m[(b + p) * (m + 1)] = 1;
      for (size_t i = 0; i < b; i++) out->m[i + (b + p) * m] = out->m[b + p + i * m];
    }
    choose_signs(w);
    for (size_t p = b; p < m; p++)
      for (size_t i = 0; i < b; i++) out->m[p + i * m] = out->m[i + p * m];
    symmetrise(out->k, m);
    symmetrise(out->m, m);
    rigid_motions(w, r);
    measure_rigid(w, r);
    measure_mass(w, r, product, product + w->full);
  }
  free(product);
  free(r);
  return st;
}
