// Connections of dense linear systems: see lti_ops.h.
#include "control/lti_ops.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"
#include "base/product.h"

// M[r0.., c0..] = scale · S, S rows × columns without padding; M has ld rows.
static void put(double *m, size_t ld, size_t r0, size_t c0, const double *s, size_t rows,
                size_t columns, double scale) {
  for (size_t c = 0; c < columns; c++) {
    for (size_t r = 0; r < rows; r++) m[r0 + r + (c0 + c) * ld] = scale * s[r + c * rows];
  }
}

// M[r0.., c0..] += A B, A rows × inner, B inner × columns.
static void add_product(double *m, size_t ld, size_t r0, size_t c0, const double *a,
                        const double *b, size_t rows, size_t inner, size_t columns) {
  if (rows == 0 || inner == 0 || columns == 0) return;
  int im = (int)rows, ik = (int)inner, in = (int)columns, ldm = (int)ld;
  double one = 1;
  dgemm_("N", "N", &im, &in, &ik, &one, a, &im, b, &ik, &one, m + r0 + c0 * ld, &ldm);
}

static pb_status check_connection(const pb_lti *g, const pb_lti *h, bool fits, pb_error *err) {
  if (g->dt != h->dt) {
    return pb_fail(err, PB_ERR_ARGUMENT, "lti", "sample periods %g s and %g s differ", g->dt,
                   h->dt);
  }
  if (!fits) {
    return pb_fail(err, PB_ERR_ARGUMENT, "lti", "%zu × %zu and %zu × %zu channels do not connect",
                   g->ny, g->nu, h->ny, h->nu);
  }
  return PB_OK;
}

pb_status pb_lti_copy(const pb_lti *lti, pb_lti *out, pb_error *err) {
  pb_status status = pb_lti_new(lti->nx, lti->nu, lti->ny, lti->dt, out, err);
  if (status != PB_OK) return status;
  put(out->a, lti->nx, 0, 0, lti->a, lti->nx, lti->nx, 1);
  put(out->b, lti->nx, 0, 0, lti->b, lti->nx, lti->nu, 1);
  put(out->c, lti->ny, 0, 0, lti->c, lti->ny, lti->nx, 1);
  put(out->d, lti->ny, 0, 0, lti->d, lti->ny, lti->nu, 1);
  return PB_OK;
}

void pb_lti_scale(pb_lti *lti, double gain) {
  for (size_t k = 0; k < lti->ny * lti->nx; k++) lti->c[k] *= gain;
  for (size_t k = 0; k < lti->ny * lti->nu; k++) lti->d[k] *= gain;
}

pb_status pb_lti_series(const pb_lti *g, const pb_lti *h, pb_lti *out, pb_error *err) {
  *out = (pb_lti){0};
  pb_status status = check_connection(g, h, g->ny == h->nu, err);
  if (status != PB_OK) return status;
  size_t n = g->nx + h->nx;
  status = pb_lti_new(n, g->nu, h->ny, g->dt, out, err);
  if (status != PB_OK) return status;
  put(out->a, n, 0, 0, g->a, g->nx, g->nx, 1);
  put(out->a, n, g->nx, g->nx, h->a, h->nx, h->nx, 1);
  add_product(out->a, n, g->nx, 0, h->b, g->c, h->nx, h->nu, g->nx);
  put(out->b, n, 0, 0, g->b, g->nx, g->nu, 1);
  add_product(out->b, n, g->nx, 0, h->b, g->d, h->nx, h->nu, g->nu);
  add_product(out->c, h->ny, 0, 0, h->d, g->c, h->ny, h->nu, g->nx);
  put(out->c, h->ny, 0, g->nx, h->c, h->ny, h->nx, 1);
  add_product(out->d, h->ny, 0, 0, h->d, g->d, h->ny, h->nu, g->nu);
  return PB_OK;
}

pb_status pb_lti_parallel(const pb_lti *g, const pb_lti *h, pb_lti *out, pb_error *err) {
  *out = (pb_lti){0};
  pb_status status = check_connection(g, h, g->ny == h->ny && g->nu == h->nu, err);
  if (status != PB_OK) return status;
  size_t n = g->nx + h->nx;
  status = pb_lti_new(n, g->nu, g->ny, g->dt, out, err);
  if (status != PB_OK) return status;
  put(out->a, n, 0, 0, g->a, g->nx, g->nx, 1);
  put(out->a, n, g->nx, g->nx, h->a, h->nx, h->nx, 1);
  put(out->b, n, 0, 0, g->b, g->nx, g->nu, 1);
  put(out->b, n, g->nx, 0, h->b, h->nx, h->nu, 1);
  put(out->c, g->ny, 0, 0, g->c, g->ny, g->nx, 1);
  put(out->c, g->ny, 0, g->nx, h->c, h->ny, h->nx, 1);
  for (size_t k = 0; k < g->ny * g->nu; k++) out->d[k] = g->d[k] + h->d[k];
  return PB_OK;
}

pb_status pb_lti_append(const pb_lti *g, const pb_lti *h, pb_lti *out, pb_error *err) {
  *out = (pb_lti){0};
  pb_status status = check_connection(g, h, true, err);
  if (status != PB_OK) return status;
  size_t n = g->nx + h->nx, ny = g->ny + h->ny;
  status = pb_lti_new(n, g->nu + h->nu, ny, g->dt, out, err);
  if (status != PB_OK) return status;
  put(out->a, n, 0, 0, g->a, g->nx, g->nx, 1);
  put(out->a, n, g->nx, g->nx, h->a, h->nx, h->nx, 1);
  put(out->b, n, 0, 0, g->b, g->nx, g->nu, 1);
  put(out->b, n, g->nx, g->nu, h->b, h->nx, h->nu, 1);
  put(out->c, ny, 0, 0, g->c, g->ny, g->nx, 1);
  put(out->c, ny, g->ny, g->nx, h->c, h->ny, h->nx, 1);
  put(out->d, ny, 0, 0, g->d, g->ny, g->nu, 1);
  put(out->d, ny, g->ny, g->nu, h->d, h->ny, h->nu, 1);
  return PB_OK;
}

pb_status pb_lti_select(const pb_lti *lti, const size_t *input, size_t nu, const size_t *output,
                        size_t ny, pb_lti *out, pb_error *err) {
  *out = (pb_lti){0};
  if (!input) nu = lti->nu;
  if (!output) ny = lti->ny;
  for (size_t i = 0; input && i < nu; i++) {
    if (input[i] >= lti->nu) return pb_fail(err, PB_ERR_ARGUMENT, "lti", "no input %zu", input[i]);
  }
  for (size_t o = 0; output && o < ny; o++) {
    if (output[o] >= lti->ny)
      return pb_fail(err, PB_ERR_ARGUMENT, "lti", "no output %zu", output[o]);
  }
  pb_status status = pb_lti_new(lti->nx, nu, ny, lti->dt, out, err);
  if (status != PB_OK) return status;
  put(out->a, lti->nx, 0, 0, lti->a, lti->nx, lti->nx, 1);
  for (size_t i = 0; i < nu; i++) {
    size_t from = input ? input[i] : i;
    put(out->b, lti->nx, 0, i, lti->b + from * lti->nx, lti->nx, 1, 1);
  }
  for (size_t o = 0; o < ny; o++) {
    size_t row = output ? output[o] : o;
    for (size_t k = 0; k < lti->nx; k++) out->c[o + k * ny] = lti->c[row + k * lti->ny];
    for (size_t i = 0; i < nu; i++) {
      out->d[o + i * ny] = lti->d[row + (input ? input[i] : i) * lti->ny];
    }
  }
  return PB_OK;
}

static double norm_1(const double *m, size_t n) {
  double norm = 0;
  for (size_t c = 0; c < n; c++) {
    double sum = 0;
    for (size_t r = 0; r < n; r++) sum += fabs(m[r + c * n]);
    norm = fmax(norm, sum);
  }
  return norm;
}

// E = (I − sign·D_k D_g)⁻¹ into e [nu × nu]; f is work of the same size, pivot [nu].
static pb_status solve_algebraic_loop(const pb_lti *g, const pb_lti *k, double sign, double *e,
                                      double *f, int *pivot, pb_error *err) {
  size_t n = g->nu;
  memset(f, 0, n * n * sizeof *f);
  add_product(f, n, 0, 0, k->d, g->d, n, g->ny, n);
  for (size_t i = 0; i < n * n; i++) f[i] *= -sign;
  for (size_t i = 0; i < n; i++) f[i + i * n] += 1;
  memset(e, 0, n * n * sizeof *e);
  for (size_t i = 0; i < n; i++) e[i + i * n] = 1;
  double size = norm_1(f, n);
  int in = (int)n, info;
  dgesv_(&in, &in, f, &in, pivot, e, &in, &info);
  double condition = size * norm_1(e, n);
  if (info != 0 || !(condition < 1e12)) {
    return pb_fail(err, PB_ERR_SINGULAR, "feedback",
                   "the direct terms close an algebraic loop that has no solution");
  }
  return PB_OK;
}

// With u = E w + F [x; x_k]: F = sign·E [D_k C_g, C_k] into f [nu × n].
static void loop_input(const pb_lti *g, const pb_lti *k, double sign, const double *e, double *row,
                       double *f) {
  size_t n = g->nx + k->nx, nu = g->nu;
  memset(row, 0, nu * n * sizeof *row);
  add_product(row, nu, 0, 0, k->d, g->c, nu, g->ny, g->nx);
  put(row, nu, 0, g->nx, k->c, nu, k->nx, 1);
  for (size_t i = 0; i < nu * n; i++) row[i] *= sign;
  memset(f, 0, nu * n * sizeof *f);
  add_product(f, nu, 0, 0, e, row, nu, nu, n);
}

// y = [C_g 0] x + D_g u, then ẋ = A_g x + B_g u, ẋ_k = A_k x_k + B_k y.
static void close_loop(const pb_lti *g, const pb_lti *k, const double *e, const double *f,
                       pb_lti *out) {
  size_t n = out->nx;
  put(out->c, g->ny, 0, 0, g->c, g->ny, g->nx, 1);
  add_product(out->c, g->ny, 0, 0, g->d, f, g->ny, g->nu, n);
  add_product(out->d, g->ny, 0, 0, g->d, e, g->ny, g->nu, g->nu);
  put(out->a, n, 0, 0, g->a, g->nx, g->nx, 1);
  put(out->a, n, g->nx, g->nx, k->a, k->nx, k->nx, 1);
  add_product(out->a, n, 0, 0, g->b, f, g->nx, g->nu, n);
  add_product(out->a, n, g->nx, 0, k->b, out->c, k->nx, g->ny, n);
  add_product(out->b, n, 0, 0, g->b, e, g->nx, g->nu, g->nu);
  add_product(out->b, n, g->nx, 0, k->b, out->d, k->nx, g->ny, g->nu);
}

pb_status pb_lti_feedback(const pb_lti *g, const pb_lti *k, double sign, pb_lti *out,
                          pb_error *err) {
  *out = (pb_lti){0};
  pb_status status = check_connection(g, k, g->ny == k->nu && g->nu == k->ny, err);
  if (status != PB_OK) return status;
  size_t n = g->nx + k->nx, nu = g->nu;
  pb_lti closed = {0};
  size_t widest = n > nu ? n : nu;
  double *e = malloc(nu * nu * sizeof *e), *f = malloc(nu * widest * sizeof *f);
  double *row = malloc((nu * n + 1) * sizeof *row);
  int *pivot = malloc(nu * sizeof *pivot);
  status = e && f && row && pivot ? pb_lti_new(n, nu, g->ny, g->dt, &closed, err)
                                  : pb_fail_memory(err, "feedback");
  if (status == PB_OK) status = solve_algebraic_loop(g, k, sign, e, f, pivot, err);
  if (status == PB_OK) {
    loop_input(g, k, sign, e, row, f);
    close_loop(g, k, e, f, &closed);
    *out = closed;
    closed = (pb_lti){0};
  }
  pb_lti_free(&closed);
  free(e);
  free(f);
  free(row);
  free(pivot);
  return status;
}

pb_status pb_lti_delay(const pb_lti *lti, unsigned samples, pb_lti *out, pb_error *err) {
  *out = (pb_lti){0};
  if (samples == 0) return pb_lti_copy(lti, out, err);
  if (!(lti->dt > 0)) return pb_fail(err, PB_ERR_ARGUMENT, "delay", "the system is continuous");
  // A chain of `samples` stages of ny values; the last is the output.
  size_t ny = lti->ny, stages = samples * ny;
  pb_lti chain;
  pb_status status = pb_lti_new(stages, ny, ny, lti->dt, &chain, err);
  if (status != PB_OK) return status;
  for (size_t i = 0; i < stages; i++) {
    if (i < ny) chain.b[i + i * stages] = 1;
    if (i >= ny) chain.a[i + (i - ny) * stages] = 1;
    if (i >= stages - ny) chain.c[i - (stages - ny) + i * ny] = 1;
  }
  status = pb_lti_series(lti, &chain, out, err);
  pb_lti_free(&chain);
  return status;
}

void pb_lti_step(const pb_lti *lti, double *x, double *scratch, const double *u, double *y) {
  size_t nx = lti->nx, nu = lti->nu, ny = lti->ny;
  memset(y, 0, ny * sizeof *y);
  pb_add_columns(ny, nx, lti->c, x, y);
  pb_add_columns(ny, nu, lti->d, u, y);
  if (nx == 0) return;
  memset(scratch, 0, nx * sizeof *x);
  pb_add_columns(nx, nx, lti->a, x, scratch);
  pb_add_columns(nx, nu, lti->b, u, scratch);
  memcpy(x, scratch, nx * sizeof *x);
}
