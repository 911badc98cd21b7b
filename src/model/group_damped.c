// A group of weakly coupled modes by its damped modes x: see group.h, damped.h.
//
//   η = Σ x_k z_k + conjugates,  ż_k = λ_k z_k + x_kᵀ f,
//   y = Σ (Y_0 + λ_k Y_1 + λ_k² Y_2) x_k z_k + conjugates
//
// A displacement counts with (λ_k I + Ĉ) x_k instead of x_k. Left vectors are scaled cluster by
// cluster: with B_jk = x_jᵀ ((λ_j + λ_k) I + Ĉ) x_k they are B⁻¹ Xᵀ, which stays exact where
// eigenvalues of a cluster can hardly be told apart.
#include <stdlib.h>
#include <string.h>

#include "base/array.h"
#include "base/lapack.h"
#include "model/damped.h"
#include "model/group.h"

typedef struct shapes {
  const pb_modes *m;
  const size_t *mode;  // of the group
  pb_damped d;
  size_t nu, ny;             // with those of stacked coordinates
  double *b[2];              // columns × nu
  double *c[2];              // ny × columns
  double *gather, *product;  // of outputs or inputs; of a matrix product
  double *w[2];              // n × columns: (λ I + Ĉ) X; NULL without stacked coordinates
} shapes;

static void shapes_clear(shapes *s) {
  pb_damped_clear(&s->d);
  for (int i = 0; i < 2; i++) {
    free(s->b[i]);
    free(s->c[i]);
    free(s->w[i]);
  }
  free(s->gather);
  free(s->product);
}

// The plant's own outputs add up, order by order; what follows stacked coordinates is set.
static void outputs_zero(shapes *s) {
  for (int i = 0; i < 2; i++)
    for (size_t k = 0; k < s->d.columns; k++)
      memset(s->c[i] + k * s->ny, 0, s->m->ny * sizeof(double));
}

static pb_status shapes_new(shapes *s, pb_error *err) {
  const size_t n = s->d.n, columns = s->d.columns, nu = s->nu, ny = s->ny;
  bool ok = true;
  for (int i = 0; i < 2; i++) {
    s->b[i] = pb_array_new(columns * nu + 1, sizeof(double));
    s->c[i] = pb_array_new(ny * columns + 1, sizeof(double));
    s->w[i] = s->m->stacked ? pb_array_new(n * columns, sizeof(double)) : NULL;
    ok = ok && s->b[i] && s->c[i] && (s->w[i] || !s->m->stacked);
  }
  const size_t more = ny > nu ? ny : nu;
  s->gather = pb_array_new(n * more + 1, sizeof(double));
  s->product = pb_array_new(s->m->ny * columns + 1, sizeof(double));
  ok = ok && s->gather && s->product;
  if (!ok) return pb_fail_memory(err, "");
  outputs_zero(s);
  return PB_OK;
}

static size_t mode_of(const shapes *s, size_t row) {
  return s->mode[s->d.cluster.mode[row]];
}

// Y_order of the group's modes into `gather`. False: all zero.
static bool gather_outputs(shapes *s, int order) {
  const size_t ny = s->m->ny;
  bool any = false;
  for (size_t j = 0; j < s->d.n; j++) {
    const double *from = s->m->output[order] + mode_of(s, j) * ny;
    memcpy(s->gather + j * ny, from, ny * sizeof *from);
    for (size_t o = 0; o < ny && !any; o++) any = from[o] != 0;
  }
  return any;
}

static void add_outputs(shapes *s, int order) {
  const int ny = (int)s->m->ny, n = (int)s->d.n, columns = (int)s->d.columns;
  const double one = 1, zero = 0;
  if (!gather_outputs(s, order)) return;
  for (int part = 0; part < 2; part++) {
    dgemm_("N", "N", &ny, &columns, &n, &one, s->gather, &ny, s->d.x[part], &n, &zero, s->product,
           &ny);
    for (size_t k = 0; k < s->d.columns; k++) {
      double complex factor = part ? I : 1;
      for (int i = 0; i < order; i++) factor *= s->d.cluster.lambda[k];
      const double re = creal(factor), im = cimag(factor), *p = s->product + k * s->m->ny;
      for (size_t o = 0; o < s->m->ny; o++) {
        s->c[0][o + k * s->ny] += re * p[o];
        s->c[1][o + k * s->ny] += im * p[o];
      }
    }
  }
}

// (λ_k I + Ĉ) x_k
static void make_displaced(shapes *s) {
  const pb_damped *d = &s->d;
  for (size_t k = 0; k < d->columns; k++) {
    const double re = creal(d->cluster.lambda[k]), im = cimag(d->cluster.lambda[k]);
    for (size_t at = k * d->n; at < (k + 1) * d->n; at++) {
      s->w[0][at] = re * d->x[0][at] - im * d->x[1][at] + d->p[0][at];
      s->w[1][at] = re * d->x[1][at] + im * d->x[0][at] + d->p[1][at];
    }
  }
}

// Of the plant's own inputs.
static void make_inputs(shapes *s) {
  const int n = (int)s->d.n, columns = (int)s->d.columns, inputs = (int)s->m->nu;
  const double one = 1, zero = 0;
  for (size_t i = 0; i < s->m->nu; i++)
    for (size_t j = 0; j < s->d.n; j++)
      s->gather[j + i * s->d.n] = s->m->force[mode_of(s, j) + i * s->m->n];
  for (int part = 0; part < 2 && inputs; part++)
    dgemm_("T", "N", &columns, &inputs, &n, &one, s->d.x[part], &n, s->gather, &n, &zero,
           s->b[part], &columns);
}

static void transpose(const double *a, size_t rows, size_t cols, size_t ld, double *out) {
  enum { TILE = 16 };
  for (size_t j = 0; j < cols; j += TILE)
    for (size_t i = 0; i < rows; i += TILE)
      for (size_t jj = j; jj < j + TILE && jj < cols; jj++)
        for (size_t ii = i; ii < i + TILE && ii < rows; ii++) out[jj + ii * cols] = a[ii + jj * ld];
}

// Stacked coordinates: q = S x z, q̇ = λ q; an impulse counts with (S x)ᵀ, a displacement with S
// times (λ I + Ĉ) x.
static void make_motion(shapes *s) {
  const size_t ns = s->m->stacked, columns = s->d.columns, ny = s->ny;
  const int n = (int)s->d.n, rows = (int)ns, cols = (int)columns, ld = (int)ny;
  const double one = 1, zero = 0;
  for (size_t j = 0; j < s->d.n; j++)
    memcpy(s->gather + j * ns, s->m->motion + mode_of(s, j) * ns, ns * sizeof(double));
  for (int part = 0; part < 2; part++) {
    double *q = s->c[part] + s->m->ny, *v = q + ns, *b = s->b[part] + s->m->nu * columns;
    dgemm_("N", "N", &rows, &cols, &n, &one, s->gather, &rows, s->w[part], &n, &zero, v, &ld);
    transpose(v, ns, columns, ny, b);
    dgemm_("N", "N", &rows, &cols, &n, &one, s->gather, &rows, s->d.x[part], &n, &zero, q, &ld);
    transpose(q, ns, columns, ny, b + ns * columns);
  }
  for (size_t k = 0; k < columns; k++) {
    const double re = creal(s->d.cluster.lambda[k]), im = cimag(s->d.cluster.lambda[k]);
    const double *qr = s->c[0] + s->m->ny + k * ny, *qi = s->c[1] + s->m->ny + k * ny;
    for (size_t r = 0; r < ns; r++) {
      s->c[0][s->m->ny + ns + r + k * ny] = re * qr[r] - im * qi[r];
      s->c[1][s->m->ny + ns + r + k * ny] = re * qi[r] + im * qr[r];
    }
  }
}

// B of cluster c.
static void gram(const pb_damped *d, size_t c, double complex *b) {
  const size_t n = d->n, first = d->cluster.column[c], m = d->cluster.column[c + 1] - first;
  for (size_t k = 0; k < m; k++) {
    for (size_t j = 0; j < m; j++) {
      const double *xr = d->x[0] + (first + j) * n, *xi = d->x[1] + (first + j) * n;
      const double *ur = d->x[0] + (first + k) * n, *ui = d->x[1] + (first + k) * n;
      const double *pr = d->p[0] + (first + k) * n, *pi = d->p[1] + (first + k) * n;
      const double complex sum = d->cluster.lambda[first + j] + d->cluster.lambda[first + k];
      double xu[2] = {0, 0}, xp[2] = {0, 0};
      for (size_t i = 0; i < n; i++) {
        xu[0] += xr[i] * ur[i] - xi[i] * ui[i];
        xu[1] += xr[i] * ui[i] + xi[i] * ur[i];
        xp[0] += xr[i] * pr[i] - xi[i] * pi[i];
        xp[1] += xr[i] * pi[i] + xi[i] * pr[i];
      }
      b[j + k * m] = sum * (xu[0] + I * xu[1]) + (xp[0] + I * xp[1]);
    }
  }
}

// b ← B⁻¹ b, cluster by cluster.
static pb_status scale_inputs(shapes *s, bool *done, pb_error *err) {
  const pb_clusters *c = &s->d.cluster;
  const size_t nu = s->nu, ld = s->d.columns, wide = 2 * c->widest;
  double complex *b = pb_array_new(wide * wide, sizeof *b),
                 *x = pb_array_new(wide * nu + 1, sizeof *x);
  int *pivot = malloc(wide * sizeof *pivot);
  const bool ok = b && x && pivot;
  for (size_t k = 0; k < c->count && ok && *done; k++) {
    const size_t first = c->column[k], m = c->column[k + 1] - first;
    int size = (int)m, inputs = (int)nu, info = 0;
    gram(&s->d, k, b);
    for (size_t i = 0; i < nu; i++)
      for (size_t j = 0; j < m; j++)
        x[j + i * m] = s->b[0][first + j + i * ld] + I * s->b[1][first + j + i * ld];
    zgesv_(&size, &inputs, b, &size, pivot, x, &size, &info);
    *done = info == 0;
    for (size_t i = 0; i < nu; i++)
      for (size_t j = 0; j < m; j++) {
        s->b[0][first + j + i * ld] = creal(x[j + i * m]);
        s->b[1][first + j + i * ld] = cimag(x[j + i * m]);
      }
  }
  free(b);
  free(x);
  free(pivot);
  return ok ? PB_OK : pb_fail_memory(err, "");
}

// A block of the complex pair k in real form: its states are 2 Re z and −2 Im z.
static pb_status emit_pair(const shapes *s, size_t k, double *b, double *c,
                           pb_model_builder *builder, pb_error *err) {
  const size_t nu = s->nu, ny = s->ny, ld = s->d.columns;
  const double re = creal(s->d.cluster.lambda[k]), im = cimag(s->d.cluster.lambda[k]);
  const double a[4] = {re, -im, im, re};
  for (size_t i = 0; i < nu; i++) {
    b[2 * i] = 2 * s->b[0][k + i * ld];
    b[2 * i + 1] = -2 * s->b[1][k + i * ld];
  }
  for (int part = 0; part < 2; part++)
    memcpy(c + (size_t)part * ny, s->c[part] + k * ny, ny * sizeof *c);
  const pb_model_part part = {.size = 2, .a = a, .lda = 2, .b = b, .ldb = 2, .c = c, .ldc = ny};
  return pb_model_builder_add(builder, &part, err);
}

// A block of the real eigenvalues j and k; only that of j when both are the same.
static pb_status emit_real(const shapes *s, size_t j, size_t k, double *b, double *c,
                           pb_model_builder *builder, pb_error *err) {
  const size_t nu = s->nu, ny = s->ny, ld = s->d.columns, at[2] = {j, k};
  const size_t size = j == k ? 1 : 2;
  const double a[4] = {creal(s->d.cluster.lambda[j]), 0, 0, creal(s->d.cluster.lambda[k])};
  for (size_t r = 0; r < size; r++) {
    for (size_t i = 0; i < nu; i++) b[r + size * i] = s->b[0][at[r] + i * ld];
    memcpy(c + r * ny, s->c[0] + at[r] * ny, ny * sizeof *c);
  }
  const pb_model_part part = {
      .size = size, .a = a, .lda = size, .b = b, .ldb = size, .c = c, .ldc = ny};
  return pb_model_builder_add(builder, &part, err);
}

static pb_status emit(const shapes *s, pb_model_builder *builder, pb_error *err) {
  const pb_clusters *c = &s->d.cluster;
  double *b = pb_array_new(2 * s->nu + 1, sizeof *b),
         *out = pb_array_new(2 * s->ny + 1, sizeof *out);
  pb_status st = b && out ? PB_OK : pb_fail_memory(err, "");
  size_t waiting = s->d.columns;  // a real eigenvalue without a partner yet
  for (size_t i = 0; i < c->count && !st; i++)
    for (size_t k = c->column[i]; k < c->column[i + 1] && !st; k++) {
      if (k - c->column[i] < c->pairs[i]) {
        st = emit_pair(s, k, b, out, builder, err);
      } else if (waiting == s->d.columns) {
        waiting = k;
      } else {
        st = emit_real(s, waiting, k, b, out, builder, err);
        waiting = s->d.columns;
      }
    }
  if (!st && waiting < s->d.columns) st = emit_real(s, waiting, waiting, b, out, builder, err);
  free(b);
  free(out);
  return st;
}

static pb_status solve(shapes *s, size_t count, bool *done, pb_error *err) {
  const pb_modes *m = s->m;
  double *omega = malloc(count * sizeof *omega),
         *damping = pb_array_new(count * count, sizeof *damping);
  pb_status st = omega && damping ? PB_OK : pb_fail_memory(err, "");
  for (size_t j = 0; j < count && !st; j++) {
    omega[j] = m->omega[s->mode[j]];
    for (size_t i = 0; i < count; i++)
      damping[i + j * count] = m->damping[s->mode[i] + s->mode[j] * m->n];
  }
  if (!st) st = pb_damped_solve(count, omega, damping, &s->d, done, err);
  free(omega);
  free(damping);
  return st;
}

pb_status pb_group_build_damped(const pb_modes *m, const size_t *mode, size_t count,
                                pb_model_builder *builder, bool *done, pb_error *err) {
  shapes s = {.m = m, .mode = mode, .nu = m->nu + 2 * m->stacked, .ny = m->ny + 2 * m->stacked};
  pb_status st = solve(&s, count, done, err);
  if (!st && *done) st = shapes_new(&s, err);
  if (!st && *done) {
    for (int order = 0; order < 3; order++) add_outputs(&s, order);
    make_inputs(&s);
    if (m->stacked) {
      make_displaced(&s);
      make_motion(&s);
    }
    st = scale_inputs(&s, done, err);
  }
  if (!st && *done) st = emit(&s, builder, err);
  shapes_clear(&s);
  return st;
}
