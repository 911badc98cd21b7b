// A group of coupled modes by its dense state matrix: see group.h.
#include "model/group.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/array.h"
#include "base/lapack.h"
#include "base/product.h"
#include "model/block.h"
#include "model/cluster.h"

// A state matrix by its blocks: A V = V diag(blocks). What a store keeps.
typedef struct diagonal {
  double *a, *v;  // n × n
  size_t *size;   // [n] block sizes
  size_t blocks;
} diagonal;

// One group's equations in its own states: s η and η̇ of each of its modes.
typedef struct group_system {
  size_t modes, n;     // g, 2g
  const size_t *mode;  // [g]
  double *a;           // n × n
  size_t nu, ny;       // with those of stacked coordinates
  double *b;           // n × nu
  double *c;           // ny × n
  const diagonal *d;   // of a store, or `own`
  diagonal *own;
} group_system;

static void diagonal_free(void *value) {
  diagonal *d = value;
  if (!d) return;
  free(d->a);
  free(d->v);
  free(d->size);
  free(d);
}

static diagonal *diagonal_new(size_t n) {
  diagonal *d = calloc(1, sizeof *d);
  if (!d) return NULL;
  d->a = pb_array_new(n * n, sizeof *d->a);
  d->v = pb_array_new(n * n, sizeof *d->v);
  d->size = malloc(n * sizeof *d->size);
  if (d->a && d->v && d->size) return d;
  diagonal_free(d);
  return NULL;
}

static void group_clear(group_system *g) {
  free(g->a);
  free(g->b);
  free(g->c);
  diagonal_free(g->own);
}

static pb_status group_new(const pb_modes *m, const size_t *mode, size_t count, group_system *g,
                           pb_error *err) {
  size_t n = 2 * count;
  *g = (group_system){.modes = count,
                      .n = n,
                      .mode = mode,
                      .nu = m->nu + 2 * m->stacked,
                      .ny = m->ny + 2 * m->stacked};
  g->a = pb_array_zero(n * n, sizeof(double));
  g->b = pb_array_zero(n * g->nu, sizeof(double));
  g->c = pb_array_zero(n * g->ny, sizeof(double));
  if (g->a && g->b && g->c) return PB_OK;
  group_clear(g);
  return pb_fail_memory(err, "");
}

// Outputs q and q̇, a displacement and an impulse, of each stacked coordinate.
static void fill_motion(const pb_modes *m, group_system *g, size_t mode, double s, size_t x) {
  const double *motion = m->motion + mode * m->stacked;
  for (size_t r = 0; r < m->stacked; r++) {
    g->c[m->ny + r + x * g->ny] = motion[r] / s;
    g->c[m->ny + m->stacked + r + (x + 1) * g->ny] = motion[r];
    g->b[x + (m->nu + r) * g->n] = motion[r] * s;
    g->b[x + 1 + (m->nu + m->stacked + r) * g->n] = motion[r];
  }
}

// States are laid out mode by mode, the fastest first: on a matrix graded so, the QR algorithm
// finds the small eigenvalues to an accuracy of their own instead of that of the largest.
static void group_fill(const pb_modes *m, group_system *g) {
  size_t count = g->modes, n = g->n, ny = m->ny, ld = g->ny;
  for (size_t j = 0; j < count; j++) {
    size_t mode = g->mode[j], x = 2 * (count - 1 - j), v = x + 1;
    double s = pb_mode_scale(m->omega[mode]), w2 = m->omega[mode] * m->omega[mode];
    g->a[x + v * n] = s;
    g->a[v + x * n] = -w2 / s;
    for (size_t i = 0; i < m->nu; i++) g->b[v + i * n] = m->force[mode + i * m->n];
    if (m->stacked) fill_motion(m, g, mode, s, x);
    for (size_t i = 0; i < count; i++)
      g->a[2 * (count - 1 - i) + 1 + v * n] = -m->damping[g->mode[i] + mode * m->n];
    for (size_t o = 0; o < ny; o++) {
      double acceleration = m->output[2][o + mode * ny];
      g->c[o + x * ld] = (m->output[0][o + mode * ny] - acceleration * w2) / s;
      g->c[o + v * ld] = m->output[1][o + mode * ny];
      for (size_t i = 0; i < count; i++)
        g->c[o + v * ld] -=
            m->output[2][o + g->mode[i] * ny] * m->damping[g->mode[i] + mode * m->n];
    }
  }
}

static pb_status find_or_diagonalize(group_system *g, const pb_means *means, pb_error *err) {
  const pb_mode_key key = {.first = g->a, .first_count = g->n * g->n};
  g->d = pb_mode_store_find(means->modes, PB_MODES_DENSE, &key);
  if (g->d) return PB_OK;
  diagonal *d = g->own = diagonal_new(g->n);
  if (!d) return pb_fail_memory(err, "");
  memcpy(d->a, g->a, g->n * g->n * sizeof *d->a);
  pb_status st = pb_block_diagonalize(g->n, d->a, d->v, &d->blocks, d->size, "", err);
  if (st) return st;
  g->d = pb_mode_store_keep(means->modes, PB_MODES_DENSE, &key, d, diagonal_free);
  if (g->d)
    g->own = NULL;
  else
    g->d = d;
  return PB_OK;
}

// b ← V⁻¹ b, c ← c V.
static pb_status group_transform(group_system *g, const pb_workers *workers, pb_error *err) {
  int n = (int)g->n, nu = (int)g->nu, info = 0;
  double *c = pb_array_new(g->n * g->ny, sizeof *c), *v = pb_array_new(g->n * g->n, sizeof *v);
  int *pivot = malloc(g->n * sizeof *pivot);
  if (!c || !v || !pivot) {
    free(c);
    free(v);
    free(pivot);
    return pb_fail_memory(err, "");
  }
  const pb_product product = {"N", "N", g->ny, g->n, g->n, g->c, g->d->v, g->ny, g->n, 0, c, g->ny};
  pb_product_make(&product, workers);
  free(g->c);
  g->c = c;
  memcpy(v, g->d->v, g->n * g->n * sizeof *v);
  dgesv_(&n, &nu, v, &n, pivot, g->b, &n, &info);
  free(v);
  free(pivot);
  if (info) return pb_fail(err, PB_ERR_NUMERIC, "", "the modal transformation is singular");
  return PB_OK;
}

// Hands the group's blocks over; a real eigenvalue shares a 2 × 2 block with the next one.
static pb_status group_emit(const group_system *g, const diagonal *d, pb_model_builder *builder,
                            pb_error *err) {
  pb_status st = PB_OK;
  size_t at = 0;
  for (size_t k = 0; k < d->blocks && !st; k++) {
    size_t size = d->size[k];
    if (size == 1 && k + 1 < d->blocks && d->size[k + 1] == 1) size = 2, k++;
    pb_model_part part = {.size = size,
                          .a = d->a + at + at * g->n,
                          .lda = g->n,
                          .b = g->b + at,
                          .ldb = g->n,
                          .c = g->c + at * g->ny,
                          .ldc = g->ny};
    st = pb_model_builder_add(builder, &part, err);
    at += size;
  }
  return st;
}

static pb_status build_dense(const pb_modes *m, const size_t *mode, size_t count,
                             const pb_means *means, pb_model_builder *builder, pb_error *err) {
  group_system g;
  pb_status st = group_new(m, mode, count, &g, err);
  if (st) return st;
  group_fill(m, &g);
  if (count == 1) {
    size_t size = 2;
    const diagonal whole = {.a = g.a, .size = &size, .blocks = 1};
    st = group_emit(&g, &whole, builder, err);
  } else {
    st = find_or_diagonalize(&g, means, err);
    if (!st) st = group_transform(&g, means->workers, err);
    if (!st) st = group_emit(&g, g.d, builder, err);
  }
  group_clear(&g);
  return st;
}

pb_status pb_group_build(const pb_modes *m, const size_t *mode, size_t count, const pb_means *lent,
                         pb_model_builder *builder, pb_error *err) {
  const pb_means means = pb_means_of(lent);
  bool done = false;
  pb_status st =
      count > 1 ? pb_group_build_damped(m, mode, count, &means, builder, &done, err) : PB_OK;
  if (st || done) return st;
  return build_dense(m, mode, count, &means, builder, err);
}
