// See frf_pairs.h.
#include "model/frf_pairs.h"

#include <stdlib.h>

#include "base/array.h"
#include "base/lapack.h"

enum { BLOCKS = 128, POINTS = 256 };  // of one product, at most

typedef struct batch {
  const pb_model *m;
  const double *a, *b;
  double shift;
  size_t nf, entries;     // points; ny × nu
  size_t blocks, points;  // of one product
  double *point[2];       // [nf] q
  double *n;              // entries × 2 blocks: N_1 and N_0 of each block
  double *weight[2];      // points × 2 blocks: q / det and 1 / det
  double *sum[2];         // entries × nf
} batch;

static size_t smaller(size_t a, size_t b) {
  return a < b ? a : b;
}

static void batch_clear(batch *t) {
  free(t->n);
  for (int part = 0; part < 2; part++) {
    free(t->point[part]);
    free(t->weight[part]);
    free(t->sum[part]);
  }
}

static bool batch_new(batch *t, const double complex *q) {
  bool ok = true;
  t->n = pb_array_new(t->entries * 2 * t->blocks, sizeof(double));
  for (int part = 0; part < 2; part++) {
    t->point[part] = pb_array_new(t->nf, sizeof(double));
    t->weight[part] = pb_array_new(2 * t->points * t->blocks, sizeof(double));
    t->sum[part] = pb_array_zero(t->entries * t->nf, sizeof(double));
    ok = ok && t->point[part] && t->weight[part] && t->sum[part];
  }
  for (size_t f = 0; f < t->nf && ok; f++) {
    t->point[0][f] = creal(q[f]);
    t->point[1][f] = cimag(q[f]);
  }
  return ok && t->n;
}

// N_1 and N_0 of a block, the latter at q = 0: with d = shift − diag A.
static void numerators(const batch *t, size_t block, double *n1, double *n0) {
  const pb_model *m = t->m;
  const size_t start = m->block_start[block];
  const double *a = t->a + m->block_value[block], d0 = t->shift - a[0], d1 = t->shift - a[3];
  const double *c0 = m->c + start * m->ny, *c1 = c0 + m->ny;
  for (size_t i = 0; i < m->nu; i++) {
    const double b0 = t->b[start + i * m->nx], b1 = t->b[start + 1 + i * m->nx];
    const double x0 = d1 * b0 + a[2] * b1, x1 = d0 * b1 + a[1] * b0;
    for (size_t o = 0; o < m->ny; o++) {
      n1[o * m->nu + i] = c0[o] * b0 + c1[o] * b1;
      n0[o * m->nu + i] = c0[o] * x0 + c1[o] * x1;
    }
  }
}

// q / det and 1 / det of a block at `count` points: det = (q + d_0)(q + d_1) − a_01 a_10.
static void weights(const batch *t, size_t block, size_t first, size_t count,
                    double *const slope[2], double *const level[2]) {
  const double *a = t->a + t->m->block_value[block];
  const double d0 = t->shift - a[0], d1 = t->shift - a[3], off = a[1] * a[2];
  const double *re = t->point[0] + first, *im = t->point[1] + first;
  for (size_t f = 0; f < count; f++) {
    const double x = re[f] + d0, y = re[f] + d1, w = im[f];
    const double dr = x * y - w * w - off, di = (x + y) * w, size = 1 / (dr * dr + di * di);
    const double gr = dr * size, gi = -di * size;
    level[0][f] = gr;
    level[1][f] = gi;
    slope[0][f] = gr * re[f] - gi * w;
    slope[1][f] = gr * w + gi * re[f];
  }
}

// The sum over the blocks from `first` on, all points.
static void add_blocks(batch *t, size_t first, size_t blocks) {
  const int entries = (int)t->entries, inner = (int)(2 * blocks), ld = (int)t->points;
  const double one = 1;
  for (size_t k = 0; k < blocks; k++)
    numerators(t, first + k, t->n + 2 * k * t->entries, t->n + (2 * k + 1) * t->entries);
  for (size_t f = 0; f < t->nf; f += t->points) {
    const size_t count = smaller(t->nf - f, t->points);
    const int points = (int)count;
    for (size_t k = 0; k < blocks; k++) {
      double *const slope[2] = {t->weight[0] + 2 * k * t->points, t->weight[1] + 2 * k * t->points};
      double *const level[2] = {slope[0] + t->points, slope[1] + t->points};
      weights(t, first + k, f, count, slope, level);
    }
    for (int part = 0; part < 2; part++)
      dgemm_("N", "T", &entries, &points, &inner, &one, t->n, &entries, t->weight[part], &ld, &one,
             t->sum[part] + f * t->entries, &entries);
  }
}

pb_status pb_pairs_response(const pb_model *m, const double *a, const double *b, double shift,
                            const double complex *q, size_t nf, double complex *h, pb_error *err) {
  batch t = {.m = m, .a = a, .b = b, .shift = shift, .nf = nf, .entries = m->ny * m->nu};
  t.blocks = smaller(m->pairs, BLOCKS);
  t.points = smaller(nf, POINTS);
  if (!t.entries || !nf || !m->pairs) return PB_OK;
  const bool ok = batch_new(&t, q);
  for (size_t k = 0; k < m->pairs && ok; k += t.blocks)
    add_blocks(&t, k, smaller(m->pairs - k, t.blocks));
  for (size_t i = 0; i < t.entries * nf && ok; i++) h[i] += t.sum[0][i] + I * t.sum[1][i];
  batch_clear(&t);
  return ok ? PB_OK : pb_fail_memory(err, "");
}
