// The stiffness under the frames' constraints, by one Cholesky factor and a small dense border.
//
// With the six pinned rows p and the multipliers λ of the averages C u = q of free rows f:
//   [K_ff B; Bᵀ D₀] [u_f; z] = [f_f; g],  B = [K_fp, C_fᵀ], D₀ = [K_pp, C_pᵀ; C_p, 0], z = [u_p; λ]
//   W = K_ff⁻¹B,  D = D₀ − BᵀW,  z = D⁻¹(g − Bᵀy),  u_f = y − W z,  y = K_ff⁻¹f_f.
// The pins only keep K_ff positive definite: the border makes their rows unknowns again, so that a
// free part stays free. With a rigid frame no pin is needed.
#include "part/reduce_internal.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"

// ---- products with the border -------------------------------------------------------------------

// out (border × columns) ← Bᵀu, u with zeros in held rows.
static void multiply_border(const reduce_work *w, size_t columns, const double *u, double *out) {
  for (size_t c = 0; c < columns; c++) {
    memset(out + c * w->border, 0, w->pins * sizeof *out);
    for (size_t e = 0; e < w->pin_entries; e++)
      out[w->pin_entry[e].pin + c * w->border] +=
          w->pin_entry[e].value * u[w->pin_entry[e].row + c * w->full];
  }
  reduce_average(w, columns, u, out + w->pins, w->border);
}

// [u_p; λ] of the border's right-hand side, in place.
static void solve_border(const reduce_work *w, size_t columns, double *z) {
  int n = (int)w->border, nrhs = (int)columns, info = 0;
  if (!n) return;
  for (size_t i = 0; i < w->border * columns; i++) z[i] *= w->scale[i % w->border];
  dgetrs_("N", &n, &nrhs, w->d, &n, w->pivot, z, &n, &info);
  for (size_t i = 0; i < w->border * columns; i++) z[i] *= w->scale[i % w->border];
}

// u ← u − W z, and the pins' own motion; u has zeros in pinned rows.
static void correct(const reduce_work *w, size_t columns, const double *z, double *u) {
  int rows = (int)w->full, n = (int)columns, k = (int)w->border;
  double minus = -1, one = 1;
  if (k) dgemm_("N", "N", &rows, &n, &k, &minus, w->w, &rows, z, &k, &one, u, &rows);
  for (size_t c = 0; c < columns; c++)
    for (size_t p = 0; p < w->pins; p++) u[w->pin[p] + c * w->full] = z[p + c * w->border];
}

// ---- set-up -------------------------------------------------------------------------------------

// Columns of B into u: held rows are ignored by the solve that follows.
static void fill_border(const reduce_work *w, double *u) {
  for (size_t e = 0; e < w->pin_entries; e++)
    u[w->pin_entry[e].row + w->pin_entry[e].pin * w->full] += w->pin_entry[e].value;
  for (size_t a = 0; a < 6 * w->averaged; a++) {
    double *unit = w->scale;  // borrowed: [border] zeros
    unit[w->pins + a] = 1;
    reduce_spread(w, 1, unit + w->pins, w->border, u + (w->pins + a) * w->full);
    unit[w->pins + a] = 0;
  }
}

// D₀ − BᵀW into d.
static pb_status form_schur(const reduce_work *w, double *d, pb_error *err) {
  double *u = malloc(w->full * sizeof *u), *bw = malloc(w->border * sizeof *bw);
  if (!u || !bw) {
    free(u);
    free(bw);
    return pb_fail_memory(err, w->fem->name);
  }
  for (size_t c = 0; c < w->border; c++) {
    double *column = d + c * w->border;
    memset(column, 0, w->border * sizeof *column);
    memset(u, 0, w->full * sizeof *u);
    if (c < w->pins) {  // what a pin moves directly
      u[w->pin[c]] = 1;
      multiply_border(w, 1, u, column);
    } else {
      memset(bw, 0, w->border * sizeof *bw);
      bw[c] = 1;
      reduce_spread(w, 1, bw + w->pins, w->border, u);
      for (size_t p = 0; p < w->pins; p++) column[p] = u[w->pin[p]];
    }
    multiply_border(w, 1, w->w + c * w->full, bw);
    for (size_t i = 0; i < w->border; i++) column[i] -= bw[i];
  }
  free(u);
  free(bw);
  return PB_OK;
}

// Symmetric scaling that brings every row's largest entry to one (D. Ruiz, 2001), then LU.
static pb_status factor_schur(reduce_work *w, pb_error *err) {
  int n = (int)w->border, info = 0, *iwork = malloc((w->border + 1) * sizeof *iwork);
  double *work = malloc(4 * (w->border + 1) * sizeof *work), norm = 0, rcond = 0;
  if (!iwork || !work) {
    free(iwork);
    free(work);
    return pb_fail_memory(err, w->fem->name);
  }
  for (size_t i = 0; i < w->border; i++) w->scale[i] = 1;
  for (int pass = 0; pass < 20; pass++) {
    for (size_t j = 0; j < w->border; j++) {
      double largest = 0;
      for (size_t i = 0; i < w->border; i++)
        largest = fmax(largest, fabs(w->d[i + j * w->border] * w->scale[i] * w->scale[j]));
      work[j] = largest > 0 ? 1 / sqrt(largest) : 1;
    }
    for (size_t j = 0; j < w->border; j++) w->scale[j] *= work[j];
  }
  for (size_t j = 0; j < w->border; j++) {
    double sum = 0;
    for (size_t i = 0; i < w->border; i++)
      sum += fabs(w->d[i + j * w->border] *= w->scale[i] * w->scale[j]);
    norm = fmax(norm, sum);
  }
  dgetrf_(&n, &n, w->d, &n, w->pivot, &info);
  if (!info) dgecon_("1", &n, w->d, &n, &norm, &rcond, work, iwork, &info);
  free(iwork);
  free(work);
  if (!info && rcond > 1e-13) return PB_OK;
  return pb_fail(err, PB_ERR_SINGULAR, w->fem->name,
                 "the frames' averages depend on each other (two frames on the same nodes?), or "
                 "the part has a mechanism (condition %.1e)",
                 rcond > 0 ? 1 / rcond : INFINITY);
}

// ---- constraint modes ---------------------------------------------------------------------------

// The rigid frames' own motion in their columns of psi, and the forces −K u of it in `force`, one
// block of six columns for each rigid frame.
static void load_rigid(const reduce_work *w, double *force) {
  for (size_t f = 0; f < w->frames; f++) {
    if (!w->frame[f].rigid) continue;
    double *psi = w->psi + 6 * f * w->full;
    for (size_t d = 0; d < 6; d++) reduce_move_rigid(w, f, d, psi + d * w->full);
    pb_sparse_multiply(&w->fem->k, 6, psi, force);
    for (size_t i = 0; i < 6 * w->full; i++) force[i] = -force[i];
    force += 6 * w->full;
  }
}

static void respond_averaged(const reduce_work *w, const reduce_frame *frame, double *z,
                             double *psi) {
  memset(z, 0, 6 * w->border * sizeof *z);
  for (size_t d = 0; d < 6; d++) z[frame->border + d + d * w->border] = 1;
  solve_border(w, 6, z);
  correct(w, 6, z, psi);
}

// y: K_ff⁻¹ of the forces. The averages must stay where they are, though some of their nodes may be
// among the rigid frame's. There are no pins where there is a rigid frame.
static void respond_rigid(const reduce_work *w, double *y, double *z, double *psi) {
  double *moved = z + 6 * w->border;
  multiply_border(w, 6, y, z);
  reduce_average(w, 6, psi, moved, w->border);
  for (size_t i = 0; i < 6 * w->border; i++) z[i] = -moved[i] - z[i];
  solve_border(w, 6, z);
  correct(w, 6, z, y);
  for (size_t i = 0; i < 6 * w->full; i++) psi[i] += y[i];
}

// solved: K_ff⁻¹ of the rigid frames' forces, six columns each; used up.
static pb_status constraint_modes(reduce_work *w, double *solved, pb_error *err) {
  double *z = malloc(12 * (w->border + 1) * sizeof *z);
  if (!z) return pb_fail_memory(err, w->fem->name);
  for (size_t f = 0; f < w->frames; f++) {
    double *psi = w->psi + 6 * f * w->full;
    if (w->frame[f].rigid) {
      respond_rigid(w, solved, z, psi);
      solved += 6 * w->full;
    } else {
      respond_averaged(w, &w->frame[f], z, psi);
    }
  }
  free(z);
  return PB_OK;
}

// One triangular solve in a few passes: for the border and for the rigid frames' forces.
static pb_status solve_columns(reduce_work *w, size_t columns, double *x, pb_error *err) {
  enum { AT_ONCE = 48 };
  pb_status st = PB_OK;
  for (size_t c = 0; !st && c < columns; c += AT_ONCE) {
    size_t count = columns - c < AT_ONCE ? columns - c : AT_ONCE;
    st = pb_factor_solve(&w->factor, count, x + c * w->full, err);
    if (!st) st = reduce_progress(w, PB_REDUCE_STATIC, (double)(c + count), (double)columns, err);
  }
  return st;
}

pb_status reduce_static(reduce_work *w, pb_error *err) {
  pb_status st = reduce_factor(w, err);
  if (!st) st = reduce_begin(w, PB_REDUCE_STATIC, err);
  if (st) return st;
  size_t columns = w->border + 6 * (w->frames - w->averaged);
  w->w = calloc(w->full * columns, sizeof *w->w);
  w->psi = calloc(w->full * w->boundary, sizeof *w->psi);
  w->d = malloc((w->border * w->border + 1) * sizeof *w->d);
  w->scale = calloc(w->border + 1, sizeof *w->scale);
  w->pivot = malloc((w->border + 1) * sizeof *w->pivot);
  if (!w->w || !w->psi || !w->d || !w->scale || !w->pivot) return pb_fail_memory(err, w->fem->name);
  double *forces = w->w + w->full * w->border;
  fill_border(w, w->w);
  load_rigid(w, forces);
  st = solve_columns(w, columns, w->w, err);
  if (!st && w->border) st = form_schur(w, w->d, err);
  if (!st && w->border) st = factor_schur(w, err);
  if (!st) st = constraint_modes(w, forces, err);
  return st;
}

pb_status reduce_respond(reduce_work *w, size_t columns, double *u, pb_error *err) {
  double *z = calloc((w->border + 1) * columns, sizeof *z);
  double *force = malloc((w->pins + 1) * columns * sizeof *force);
  pb_status st = z && force ? PB_OK : pb_fail_memory(err, w->fem->name);
  for (size_t c = 0; !st && c < columns; c++)
    for (size_t p = 0; p < w->pins; p++) force[p + c * w->pins] = u[w->pin[p] + c * w->full];
  if (!st) st = pb_factor_solve(&w->factor, columns, u, err);
  if (!st && w->border) {
    multiply_border(w, columns, u, z);
    for (size_t i = 0; i < w->border * columns; i++) z[i] = -z[i];
    for (size_t c = 0; c < columns; c++)
      for (size_t p = 0; p < w->pins; p++) z[p + c * w->border] += force[p + c * w->pins];
    solve_border(w, columns, z);
    correct(w, columns, z, u);
  }
  free(z);
  free(force);
  return st;
}
