// See frf_pairs.h.
#include "model/frf_pairs.h"

#include <math.h>
#include <stdlib.h>

#include "base/array.h"
#include "base/lapack.h"
#include "model/rates.h"

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
  size_t *from;           // [nf] blocks from this one on have their static response taken out
  size_t least;           // of all points
} batch;

static size_t smaller(size_t a, size_t b) {
  return a < b ? a : b;
}

static void batch_clear(batch *t) {
  free(t->n);
  free(t->from);
  for (int part = 0; part < 2; part++) {
    free(t->point[part]);
    free(t->weight[part]);
    free(t->sum[part]);
  }
}

static bool batch_new(batch *t, const double complex *q) {
  bool ok = true;
  t->n = pb_array_new(t->entries * 2 * t->blocks + 1, sizeof(double));
  t->from = malloc((t->nf + 1) * sizeof *t->from);
  for (int part = 0; part < 2; part++) {
    t->point[part] = pb_array_new(t->nf, sizeof(double));
    t->weight[part] = pb_array_new(2 * t->points * t->blocks + 1, sizeof(double));
    t->sum[part] = pb_array_zero(t->entries * t->nf, sizeof(double));
    ok = ok && t->point[part] && t->weight[part] && t->sum[part];
  }
  for (size_t f = 0; f < t->nf && ok; f++) {
    t->point[0][f] = creal(q[f]);
    t->point[1][f] = cimag(q[f]);
  }
  return ok && t->n && t->from;
}

// ---- statics ------------------------------------------------------------------------------------

// Half of the slowest eigenvalue of a block, as a distance from `shift`.
static double reach(const batch *t, size_t block) {
  const double *a = t->a + t->m->block_value[block], d0 = t->shift - a[0], d1 = t->shift - a[3];
  const double det = fabs(d0 * d1 - a[1] * a[2]);
  return det > 0 ? 0.5 * det / (fabs(d0 + d1) + sqrt(det)) : 0;
}

// from[f]: the first block from which on all are faster than point f.
static pb_status find_from(batch *t, const double complex *q, pb_error *err) {
  const size_t pairs = t->m->pairs;
  double *slowest = malloc((pairs + 1) * sizeof *slowest);
  if (!slowest) return pb_fail_memory(err, "");
  slowest[pairs] = INFINITY;
  for (size_t k = pairs; k-- > 0;) slowest[k] = fmin(slowest[k + 1], reach(t, k));
  for (size_t f = 0; f < t->nf; f++) {
    const double size = cabs(q[f]);
    t->from[f] = pairs;
    while (t->from[f] > 0 && slowest[t->from[f] - 1] > size) t->from[f]--;
    t->least = smaller(t->least, t->from[f]);
  }
  free(slowest);
  return PB_OK;
}

// h = D and the static responses of the blocks from[f] on, for the points that begin at `block`.
static void put_static(const batch *t, size_t block, const long double *sum, const double *size,
                       double complex *h) {
  const size_t ny = t->m->ny, nu = t->m->nu;
  for (size_t f = 0; f < t->nf; f++)
    if (t->from[f] == block)
      for (size_t o = 0; o < ny; o++)
        for (size_t i = 0; i < nu; i++)
          h[f * t->entries + o * nu + i] = pb_static_clean(sum[o + i * ny], size[o + i * ny]);
}

static pb_status put_all(const batch *t, long double *sum, double *size, double complex *h,
                         pb_error *err) {
  const pb_model *m = t->m;
  for (size_t k = 0; k < t->entries; k++) sum[k] = m->d[k], size[k] = fabs(m->d[k]);
  put_static(t, m->pairs, sum, size, h);
  pb_status st = PB_OK;
  for (size_t k = m->pairs; k-- > t->least && !st;) {
    st = pb_static_add(m, k, m->nu, sum, size, err);
    if (!st) put_static(t, k, sum, size, h);
  }
  return st;
}

// D of every point by itself: nothing cancels in a model without velocities and accelerations.
static void put_plain(const batch *t, const double complex *q, double complex *h) {
  const pb_model *m = t->m;
  for (size_t f = 0; f < t->nf; f++) {
    const double complex through = t->shift != 0 ? 1 / (1 + q[f]) : 1;
    for (size_t o = 0; o < m->ny; o++)
      for (size_t i = 0; i < m->nu; i++)
        h[f * t->entries + o * m->nu + i] = m->d[o + i * m->ny] * through;
  }
}

// Held inputs have the static responses of the continuous plant; D/(1 + q) = D − D q/(1 + q).
static pb_status put_statics(batch *t, const double complex *q, double complex *h, pb_error *err) {
  const pb_model *m = t->m;
  long double *sum = malloc((t->entries + 1) * sizeof *sum);
  double *size = malloc((t->entries + 1) * sizeof *size);
  pb_status st = sum && size ? find_from(t, q, err) : pb_fail_memory(err, "");
  if (!st) st = put_all(t, sum, size, h, err);
  for (size_t f = 0; f < t->nf && !st && t->shift != 0; f++) {
    const double complex later = q[f] / (1 + q[f]);
    for (size_t o = 0; o < m->ny; o++)
      for (size_t i = 0; i < m->nu; i++)
        h[f * t->entries + o * m->nu + i] -= m->d[o + i * m->ny] * later;
  }
  free(sum);
  free(size);
  return st;
}

static pb_status begin(batch *t, const double complex *q, double complex *h, pb_error *err) {
  t->least = t->m->pairs;
  if (pb_has_rates(t->m, 1)) return put_statics(t, q, h, err);
  put_plain(t, q, h);
  return PB_OK;
}

// ---- sums ---------------------------------------------------------------------------------------

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

// q / det and 1 / det of a block at `count` points: det = (q + d_0)(q + d_1) − a_01 a_10. Without
// the static response 1 / det − 1 / det(0) = −q (q + d_0 + d_1) / (det det(0)).
static void weights(const batch *t, size_t block, size_t first, size_t count,
                    double *const slope[2], double *const level[2]) {
  const double *a = t->a + t->m->block_value[block];
  const double d0 = t->shift - a[0], d1 = t->shift - a[3], off = a[1] * a[2];
  const double *re = t->point[0] + first, *im = t->point[1] + first, still = 1 / (d0 * d1 - off);
  const size_t *from = t->from + first;
  for (size_t f = 0; f < count; f++) {
    const double x = re[f] + d0, y = re[f] + d1, w = im[f];
    const double dr = x * y - w * w - off, di = (x + y) * w, size = 1 / (dr * dr + di * di);
    const double gr = dr * size, gi = -di * size;
    slope[0][f] = gr * re[f] - gi * w;
    slope[1][f] = gr * w + gi * re[f];
    level[0][f] = gr;
    level[1][f] = gi;
  }
  for (size_t f = 0; f < count && block >= t->least; f++) {
    if (block < from[f]) continue;
    const double tr = -(re[f] + d0 + d1) * still, ti = -im[f] * still;
    level[0][f] = slope[0][f] * tr - slope[1][f] * ti;
    level[1][f] = slope[0][f] * ti + slope[1][f] * tr;
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
  if (!t.entries || !nf) return PB_OK;
  pb_status st = batch_new(&t, q) ? begin(&t, q, h, err) : pb_fail_memory(err, "");
  for (size_t k = 0; k < m->pairs && !st; k += t.blocks)
    add_blocks(&t, k, smaller(m->pairs - k, t.blocks));
  for (size_t i = 0; i < t.entries * nf && !st; i++) h[i] += t.sum[0][i] + I * t.sum[1][i];
  batch_clear(&t);
  return st;
}
