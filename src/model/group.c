// A group of coupled modes by its dense state matrix: see group.h.
#include "model/group.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"
#include "model/block.h"
#include "model/cluster.h"

// One group's equations in its own states: s η and η̇ of each of its modes.
typedef struct group_system {
  size_t modes, n;     // g, 2g
  const size_t *mode;  // [g]
  double *a, *v;       // n × n
  double *b;           // n × nu
  double *c;           // ny × n
  size_t *size;        // [n] block sizes
  size_t blocks;
} group_system;

static void group_clear(group_system *g) {
  free(g->a);
  free(g->v);
  free(g->b);
  free(g->c);
  free(g->size);
}

static pb_status group_new(const pb_modes *m, const size_t *mode, size_t count, group_system *g,
                           pb_error *err) {
  size_t n = 2 * count;
  *g = (group_system){.modes = count, .n = n, .mode = mode};
  g->a = calloc(n * n, sizeof(double));
  g->v = malloc(n * n * sizeof(double));
  g->b = calloc(n * m->nu, sizeof(double));
  g->c = calloc(n * m->ny, sizeof(double));
  g->size = malloc(n * sizeof *g->size);
  if (g->a && g->v && g->b && g->c && g->size) return PB_OK;
  group_clear(g);
  return pb_fail_memory(err, "");
}

// States are laid out mode by mode, the fastest first: on a matrix graded so, the QR algorithm
// finds the small eigenvalues to an accuracy of their own instead of that of the largest.
static void group_fill(const pb_modes *m, group_system *g) {
  size_t count = g->modes, n = g->n, ny = m->ny;
  for (size_t j = 0; j < count; j++) {
    size_t mode = g->mode[j], x = 2 * (count - 1 - j), v = x + 1;
    double s = pb_mode_scale(m->omega[mode]), w2 = m->omega[mode] * m->omega[mode];
    g->a[x + v * n] = s;
    g->a[v + x * n] = -w2 / s;
    for (size_t i = 0; i < m->nu; i++) {
      const bool displaces = i - m->displacing < m->displacings;
      g->b[(displaces ? x : v) + i * n] = (displaces ? s : 1) * m->force[mode + i * m->n];
    }
    for (size_t i = 0; i < count; i++)
      g->a[2 * (count - 1 - i) + 1 + v * n] = -m->damping[g->mode[i] + mode * m->n];
    for (size_t o = 0; o < ny; o++) {
      double acceleration = m->output[2][o + mode * ny];
      g->c[o + x * ny] = (m->output[0][o + mode * ny] - acceleration * w2) / s;
      g->c[o + v * ny] = m->output[1][o + mode * ny];
      for (size_t i = 0; i < count; i++)
        g->c[o + v * ny] -=
            m->output[2][o + g->mode[i] * ny] * m->damping[g->mode[i] + mode * m->n];
    }
  }
}

// b ← V⁻¹ b, c ← c V, a ← diag(blocks).
static pb_status group_diagonalize(const pb_modes *m, group_system *g, pb_error *err) {
  if (g->modes == 1) {
    g->blocks = 1;
    g->size[0] = 2;
    return PB_OK;
  }
  pb_status st = pb_block_diagonalize(g->n, g->a, g->v, &g->blocks, g->size, "", err);
  if (st) return st;
  int n = (int)g->n, nu = (int)m->nu, ny = (int)m->ny, info = 0;
  double one = 1, zero = 0;
  double *c = malloc(g->n * m->ny * sizeof *c);
  int *pivot = malloc(g->n * sizeof *pivot);
  if (!c || !pivot) {
    free(c);
    free(pivot);
    return pb_fail_memory(err, "");
  }
  dgemm_("N", "N", &ny, &n, &n, &one, g->c, &ny, g->v, &n, &zero, c, &ny);
  free(g->c);
  g->c = c;
  dgesv_(&n, &nu, g->v, &n, pivot, g->b, &n, &info);
  free(pivot);
  if (info) return pb_fail(err, PB_ERR_NUMERIC, "", "the modal transformation is singular");
  return PB_OK;
}

// Hands the group's blocks over; a real eigenvalue shares a 2 × 2 block with the next one.
static pb_status group_emit(const pb_modes *m, const group_system *g, pb_model_builder *builder,
                            pb_error *err) {
  pb_status st = PB_OK;
  size_t at = 0;
  for (size_t k = 0; k < g->blocks && !st; k++) {
    size_t size = g->size[k];
    if (size == 1 && k + 1 < g->blocks && g->size[k + 1] == 1) size = 2, k++;
    pb_model_part part = {.size = size,
                          .a = g->a + at + at * g->n,
                          .lda = g->n,
                          .b = g->b + at,
                          .ldb = g->n,
                          .c = g->c + at * m->ny,
                          .ldc = m->ny};
    st = pb_model_builder_add(builder, &part, err);
    at += size;
  }
  return st;
}

static pb_status build_dense(const pb_modes *m, const size_t *mode, size_t count,
                             pb_model_builder *builder, pb_error *err) {
  group_system g;
  pb_status st = group_new(m, mode, count, &g, err);
  if (st) return st;
  group_fill(m, &g);
  st = group_diagonalize(m, &g, err);
  if (!st) st = group_emit(m, &g, builder, err);
  group_clear(&g);
  return st;
}

pb_status pb_group_build(const pb_modes *m, const size_t *mode, size_t count,
                         pb_model_builder *builder, pb_error *err) {
  bool done = false;
  pb_status st = count > 1 ? pb_group_build_damped(m, mode, count, builder, &done, err) : PB_OK;
  if (st || done) return st;
  return build_dense(m, mode, count, builder, err);
}
