// See group_shapes.h. Panels of eigenpairs, whole clusters each, are made one by one in a work
// space that stays warm, and go to their places in the model at once.
#include "model/group_shapes.h"

#include <stdlib.h>
#include <string.h>

#include "base/array.h"
#include "base/lapack.h"
#include "base/product.h"

// What one worker makes a panel in: columns are eigenpairs, real and imaginary parts apart.
typedef struct space {
  double *w[2];       // modes × panel: (λ I + Ĉ) x; NULL without stacked coordinates
  double *c[2];       // outputs × panel
  double *f[2];       // inputs × panel
  double *product;    // the plant's own outputs × panel
  double complex *b;  // widest cluster squared
  double complex *x;  // widest cluster × inputs
  int *pivot;
  bool sound;
} space;

typedef struct work {
  const pb_group_shapes *g;
  pb_model *model;
  size_t nu, ny;      // with those of stacked coordinates
  double *output[3];  // own outputs × modes, in the clusters' order; NULL: all zero
  double *force;      // modes × own inputs
  double *motion;     // stacked × modes
  size_t *panel;      // [panels + 1] first cluster of each
  size_t panels, widest_panel, widest;  // eigenpairs of the largest panel, of the largest cluster
  space *space;                         // [workers]
} work;

// ---- work space ---------------------------------------------------------------------------------

static void space_clear(space *s) {
  for (int i = 0; i < 2; i++) {
    free(s->w[i]);
    free(s->c[i]);
    free(s->f[i]);
  }
  free(s->product);
  free(s->b);
  free(s->x);
  free(s->pivot);
}

static void work_clear(work *w, size_t workers) {
  for (size_t i = 0; w->space && i < workers; i++) space_clear(&w->space[i]);
  free(w->space);
  for (int i = 0; i < 3; i++) free(w->output[i]);
  free(w->force);
  free(w->motion);
  free(w->panel);
}

static bool space_new(const work *w, space *s) {
  const size_t panel = w->widest_panel, wide = w->widest;
  const bool stacked = w->g->modes->stacked > 0;
  bool ok = true;
  s->sound = true;
  for (int i = 0; i < 2; i++) {
    s->w[i] = stacked ? pb_array_new(w->g->d->n * panel, sizeof(double)) : NULL;
    s->c[i] = pb_array_new(w->ny * panel + 1, sizeof(double));
    s->f[i] = pb_array_new(w->nu * panel + 1, sizeof(double));
    ok = ok && (s->w[i] || !stacked) && s->c[i] && s->f[i];
  }
  s->product = pb_array_new(w->g->modes->ny * panel + 1, sizeof(double));
  s->b = pb_array_new(wide * wide, sizeof *s->b);
  s->x = pb_array_new(wide * w->nu + 1, sizeof *s->x);
  s->pivot = malloc(wide * sizeof *s->pivot);
  return ok && s->product && s->b && s->x && s->pivot;
}

static size_t mode_of(const work *w, size_t row) {
  return w->g->mode[w->g->d->cluster.mode[row]];
}

// Columns of a (rows × modes of the plant) that are the group's, in the clusters' order.
static double *gather(const work *w, const double *a, size_t rows) {
  double *out = pb_array_new(rows * w->g->d->n + 1, sizeof *out);
  for (size_t j = 0; out && j < w->g->d->n; j++)
    memcpy(out + j * rows, a + mode_of(w, j) * rows, rows * sizeof *out);
  return out;
}

static bool any(const double *a, size_t count) {
  for (size_t i = 0; i < count; i++)
    if (a[i] != 0) return true;
  return false;
}

static bool gather_all(work *w) {
  const pb_modes *m = w->g->modes;
  const size_t n = w->g->d->n;
  bool ok = true;
  for (int i = 0; i < 3; i++) {
    if (!any(m->output[i], m->ny * m->n)) continue;
    w->output[i] = gather(w, m->output[i], m->ny);
    ok = ok && w->output[i];
  }
  if (m->stacked) w->motion = gather(w, m->motion, m->stacked);
  w->force = pb_array_new(n * m->nu + 1, sizeof *w->force);
  for (size_t i = 0; w->force && i < m->nu; i++)
    for (size_t j = 0; j < n; j++) w->force[j + i * n] = m->force[mode_of(w, j) + i * m->n];
  return ok && w->force && (w->motion || !m->stacked);
}

static bool panels_make(work *w) {
  const pb_clusters *c = &w->g->d->cluster;
  const size_t target = pb_product_panel(w->g->d->columns);
  w->panel = malloc((c->count + 1) * sizeof *w->panel);
  if (!w->panel) return false;
  for (size_t k = 0; k < c->count; k++) {
    const size_t begin = w->panels ? c->column[w->panel[w->panels - 1]] : 0;
    if (k == 0 || c->column[k + 1] - begin > target) w->panel[w->panels++] = k;
    const size_t wide = c->column[k + 1] - c->column[w->panel[w->panels - 1]];
    const size_t own = c->column[k + 1] - c->column[k];
    if (wide > w->widest_panel) w->widest_panel = wide;
    if (own > w->widest) w->widest = own;
  }
  w->panel[w->panels] = c->count;
  return true;
}

// ---- a panel ------------------------------------------------------------------------------------

// out (leading dimension ld) = op(a) b, b the vectors of the panel's eigenpairs.
static void multiply(const char *op, size_t m, size_t n, size_t k, const double *a, size_t lda,
                     const double *b, double *out, size_t ld) {
  pb_product_make(&(pb_product){op, "N", m, n, k, a, b, lda, k, 0, out, ld}, NULL);
}

static void add_outputs(const work *w, space *s, size_t first, size_t count, int order) {
  const size_t ny = w->g->modes->ny, n = w->g->d->n;
  for (int part = 0; part < 2; part++) {
    multiply("N", ny, count, n, w->output[order], ny, w->g->d->x[part] + first * n, s->product, ny);
    for (size_t k = 0; k < count; k++) {
      double complex factor = part ? I : 1;
      for (int i = 0; i < order; i++) factor *= w->g->d->cluster.lambda[first + k];
      const double re = creal(factor), im = cimag(factor), *p = s->product + k * ny;
      for (size_t o = 0; o < ny; o++) {
        s->c[0][o + k * w->ny] += re * p[o];
        s->c[1][o + k * w->ny] += im * p[o];
      }
    }
  }
}

// Of the plant's own inputs and outputs.
static void make_own(const work *w, space *s, size_t first, size_t count) {
  const pb_modes *m = w->g->modes;
  const size_t n = w->g->d->n;
  for (int part = 0; part < 2; part++) {
    for (size_t k = 0; k < count; k++) memset(s->c[part] + k * w->ny, 0, m->ny * sizeof(double));
    if (m->nu)
      multiply("T", m->nu, count, n, w->force, n, w->g->d->x[part] + first * n, s->f[part], w->nu);
  }
  for (int order = 0; order < 3; order++)
    if (w->output[order]) add_outputs(w, s, first, count, order);
}

// (λ I + Ĉ) x
static void make_displaced(const work *w, space *s, size_t first, size_t count) {
  const pb_damped *d = w->g->d;
  for (size_t k = 0; k < count; k++) {
    const double complex lambda = d->cluster.lambda[first + k];
    const double re = creal(lambda), im = cimag(lambda);
    const size_t from = (first + k) * d->n, to = k * d->n;
    for (size_t i = 0; i < d->n; i++) {
      s->w[0][to + i] = re * d->x[0][from + i] - im * d->x[1][from + i] + d->p[0][from + i];
      s->w[1][to + i] = re * d->x[1][from + i] + im * d->x[0][from + i] + d->p[1][from + i];
    }
  }
}

static void make_velocities(const work *w, space *s, size_t first, size_t count) {
  const size_t ns = w->g->modes->stacked;
  for (size_t k = 0; k < count; k++) {
    const double complex lambda = w->g->d->cluster.lambda[first + k];
    const double re = creal(lambda), im = cimag(lambda);
    const double *qr = s->c[0] + w->g->modes->ny + k * w->ny;
    const double *qi = s->c[1] + w->g->modes->ny + k * w->ny;
    double *vr = s->c[0] + w->g->modes->ny + ns + k * w->ny;
    double *vi = s->c[1] + w->g->modes->ny + ns + k * w->ny;
    for (size_t r = 0; r < ns; r++) {
      vr[r] = re * qr[r] - im * qi[r];
      vi[r] = re * qi[r] + im * qr[r];
    }
  }
}

// Of stacked coordinates.
static void make_motion(const work *w, space *s, size_t first, size_t count) {
  const pb_modes *m = w->g->modes;
  const size_t ns = m->stacked, n = w->g->d->n;
  make_displaced(w, s, first, count);
  for (int part = 0; part < 2; part++) {
    double *q = s->c[part] + m->ny, *f = s->f[part] + m->nu;
    multiply("N", ns, count, n, w->motion, ns, s->w[part], f, w->nu);
    multiply("N", ns, count, n, w->motion, ns, w->g->d->x[part] + first * n, q, w->ny);
    for (size_t k = 0; k < count; k++) memcpy(f + ns + k * w->nu, q + k * w->ny, ns * sizeof *f);
  }
  make_velocities(w, s, first, count);
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

// f ← f B⁻ᵀ of cluster c, whose eigenpairs begin at column `at` of the panel.
static bool scale(const work *w, space *s, size_t c, size_t at) {
  const pb_clusters *q = &w->g->d->cluster;
  const size_t nu = w->nu, m = q->column[c + 1] - q->column[c];
  double *re = s->f[0] + at * nu, *im = s->f[1] + at * nu;
  int size = (int)m, inputs = (int)nu, info = 0;
  gram(w->g->d, c, s->b);
  for (size_t j = 0; j < m; j++)
    for (size_t i = 0; i < nu; i++) s->x[j + i * m] = re[i + j * nu] + I * im[i + j * nu];
  zgesv_(&size, &inputs, s->b, &size, s->pivot, s->x, &size, &info);
  for (size_t j = 0; j < m; j++)
    for (size_t i = 0; i < nu; i++) {
      re[i + j * nu] = creal(s->x[j + i * m]);
      im[i + j * nu] = cimag(s->x[j + i * m]);
    }
  return info == 0;
}

// ---- into the model -----------------------------------------------------------------------------

static bool is_pair(const pb_clusters *q, size_t c, size_t column) {
  return column - q->column[c] < q->pairs[c];
}

static void put_outputs(const work *w, const space *s, size_t at, size_t place, bool pair) {
  for (int part = 0; part < (pair ? 2 : 1); part++)
    memcpy(w->model->c + (place + (size_t)part) * w->ny, s->c[part] + at * w->ny,
           w->ny * sizeof(double));
}

// A few inputs of all eigenpairs at a time, so that what lies side by side in B is written
// together.
static void put_inputs(const work *w, const space *s, size_t panel, size_t first) {
  enum { TILE = 8 };
  const pb_clusters *q = &w->g->d->cluster;
  const size_t nx = w->model->nx, nu = w->nu;
  for (size_t i = 0; i < nu; i += TILE) {
    const size_t end = i + TILE < nu ? i + TILE : nu;
    for (size_t c = w->panel[panel]; c < w->panel[panel + 1]; c++)
      for (size_t k = q->column[c]; k < q->column[c + 1]; k++) {
        const double *re = s->f[0] + (k - first) * nu, *im = s->f[1] + (k - first) * nu;
        double *out = w->model->b + w->g->place[k];
        const bool pair = is_pair(q, c, k);
        for (size_t r = i; r < end; r++) {
          out[r * nx] = pair ? 2 * re[r] : re[r];
          if (pair) out[r * nx + 1] = -2 * im[r];
        }
      }
  }
}

static void make_panel(void *context, size_t panel, size_t worker) {
  const work *w = context;
  const pb_clusters *q = &w->g->d->cluster;
  space *s = &w->space[worker];
  const size_t first = q->column[w->panel[panel]], count = q->column[w->panel[panel + 1]] - first;
  make_own(w, s, first, count);
  if (w->g->modes->stacked) make_motion(w, s, first, count);
  for (size_t c = w->panel[panel]; c < w->panel[panel + 1]; c++) {
    s->sound = scale(w, s, c, q->column[c] - first) && s->sound;
    for (size_t k = q->column[c]; k < q->column[c + 1]; k++)
      put_outputs(w, s, k - first, w->g->place[k], is_pair(q, c, k));
  }
  put_inputs(w, s, panel, first);
}

pb_status pb_group_shapes_fill(const pb_group_shapes *shapes, const pb_workers *workers,
                               pb_model *model, bool *sound, pb_error *err) {
  const pb_damped *d = shapes->d;
  workers = pb_workers_for(workers, 4.0 * (double)d->n * (double)d->columns *
                                        (double)(model->nu + model->ny));
  const size_t count = pb_workers_count(workers);
  work w = {.g = shapes, .model = model, .nu = model->nu, .ny = model->ny};
  bool ok = gather_all(&w) && panels_make(&w);
  w.space = ok ? calloc(count, sizeof *w.space) : NULL;
  ok = ok && w.space;
  for (size_t i = 0; i < count && ok; i++) ok = space_new(&w, &w.space[i]);
  if (ok) pb_workers_run(workers, w.panels, make_panel, &w);
  *sound = true;
  for (size_t i = 0; i < count && ok; i++) *sound = *sound && w.space[i].sound;
  work_clear(&w, count);
  return ok ? PB_OK : pb_fail_memory(err, "");
}
