// See rates.h.
#include "model/rates.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/array.h"
#include "base/lapack.h"

static const double pi = 3.14159265358979323846;

int pb_rate_order(const char *unit) {
  if (!strcmp(unit, "m/s^2") || !strcmp(unit, "rad/s^2")) return 2;
  return !strcmp(unit, "m/s") || !strcmp(unit, "rad/s");
}

bool pb_has_rates(const pb_model *m, int least) {
  for (size_t o = 0; o < m->ny; o++)
    if (pb_rate_order(m->output[o].unit) >= least) return true;
  return false;
}

// ---- powers of A⁻¹ on B -------------------------------------------------------------------------

typedef struct solver {
  size_t n, direct;
  double *lu, *x;  // n × n; n × direct: A^−k B
  int *pivot;
  bool singular;
} solver;

static void solver_clear(solver *s) {
  free(s->lu);
  free(s->x);
  free(s->pivot);
}

static pb_status solver_new(const pb_model *m, size_t block, size_t direct, solver *s,
                            pb_error *err) {
  const size_t start = m->block_start[block], n = m->block_start[block + 1] - start;
  *s = (solver){.n = n, .direct = direct};
  s->lu = pb_array_new(n * n, sizeof *s->lu);
  s->x = pb_array_new(n * direct + 1, sizeof *s->x);
  s->pivot = malloc(n * sizeof *s->pivot);
  if (!s->lu || !s->x || !s->pivot) {
    solver_clear(s);
    return pb_fail_memory(err, "/max_frequency");
  }
  memcpy(s->lu, m->a + m->block_value[block], n * n * sizeof *s->lu);
  for (size_t i = 0; i < direct; i++)
    memcpy(s->x + i * n, m->b + start + i * m->nx, n * sizeof *s->x);
  int size = (int)n, info = 0;
  dgetrf_(&size, &size, s->lu, &size, s->pivot, &info);
  s->singular = info != 0;
  return PB_OK;
}

static void solver_step(solver *s) {
  int n = (int)s->n, nu = (int)s->direct, info = 0;
  dgetrs_("N", &n, &nu, s->lu, &n, s->pivot, s->x, &n, &info);
}

// −c x of one output and one input.
static long double seen(const pb_model *m, size_t block, const solver *s, size_t o, size_t i) {
  long double sum = 0;
  for (size_t j = 0; j < s->n; j++)
    sum -= (long double)m->c[o + (m->block_start[block] + j) * m->ny] * s->x[j + i * s->n];
  return sum;
}

// ---- static responses ---------------------------------------------------------------------------

// The same for a 2 × 2 block.
static void add_pair(const pb_model *m, size_t block, size_t direct, long double *sum,
                     double *size) {
  const size_t start = m->block_start[block], ny = m->ny;
  const double *a = m->a + m->block_value[block], *c0 = m->c + start * ny, *c1 = c0 + ny;
  const double det = a[0] * a[3] - a[1] * a[2];
  if (det == 0) return;
  for (size_t i = 0; i < direct; i++) {
    const double *b = m->b + start + i * m->nx;
    if (b[0] == 0 && b[1] == 0) continue;
    const double x0 = (a[2] * b[1] - a[3] * b[0]) / det, x1 = (a[1] * b[0] - a[0] * b[1]) / det;
    for (size_t o = 0; o < ny; o++) {
      const double part = c0[o] * x0 + c1[o] * x1;
      sum[o + i * ny] += part;
      size[o + i * ny] += fabs(part);
    }
  }
}

pb_status pb_static_add(const pb_model *m, size_t block, size_t direct, long double *sum,
                        double *size, pb_error *err) {
  if (m->block_start[block + 1] - m->block_start[block] == 2) {
    add_pair(m, block, direct, sum, size);
    return PB_OK;
  }
  solver s;
  pb_status st = solver_new(m, block, direct, &s, err);
  if (st) return st;
  if (!s.singular) {
    solver_step(&s);
    for (size_t i = 0; i < direct; i++)
      for (size_t o = 0; o < m->ny; o++) {
        const long double part = seen(m, block, &s, o, i);
        sum[o + i * m->ny] += part;
        size[o + i * m->ny] += (double)fabsl(part);
      }
  }
  solver_clear(&s);
  return PB_OK;
}

double pb_static_clean(long double sum, double size) {
  return fabsl(sum) > 8 * DBL_EPSILON * size ? (double)sum : 0;
}

typedef struct statics {
  long double *sum;  // ny × direct
  double *size;
} statics;

static void statics_clear(statics *s) {
  free(s->sum);
  free(s->size);
}

static pb_status statics_make(const pb_model *m, size_t direct, statics *s, pb_error *err) {
  s->sum = calloc(m->ny * direct + 1, sizeof *s->sum);
  s->size = calloc(m->ny * direct + 1, sizeof *s->size);
  pb_status st = s->sum && s->size ? PB_OK : pb_fail_memory(err, "/outputs");
  for (size_t k = m->blocks; k-- > 0 && !st;)
    st = pb_static_add(m, k, direct, s->sum, s->size, err);
  return st;
}

pb_status pb_rates_rest(const pb_model *m, size_t direct, double *rest, pb_error *err) {
  statics s;
  pb_status st = statics_make(m, direct, &s, err);
  for (size_t k = 0; k < m->ny * direct && !st; k++)
    rest[k] = pb_static_clean(s.sum[k] + m->d[k], s.size[k] + fabs(m->d[k]));
  statics_clear(&s);
  return st;
}

pb_status pb_rates_settle(pb_model *m, const double *rest, size_t ld, size_t direct,
                          pb_error *err) {
  if (!pb_has_rates(m, 2)) return PB_OK;
  statics s;
  pb_status st = statics_make(m, direct, &s, err);
  for (size_t i = 0; i < direct && !st; i++) {
    for (size_t o = 0; o < m->ny; o++) {
      if (pb_rate_order(m->output[o].unit) != 2) continue;
      double *d = m->d + o + i * m->ny;
      const double settled = (double)(rest[o + i * ld] - s.sum[o + i * m->ny]);
      if (fabs(settled - *d) <= 1e-6 * (s.size[o + i * m->ny] + fabs(*d))) *d = settled;
    }
  }
  statics_clear(&s);
  return st;
}

// ---- what is left out ---------------------------------------------------------------------------

enum { MOMENTS = 4, OWN = 1 };  // OWN: that of s^order

pb_status pb_residual_open(const pb_model *m, size_t direct, double slowest, pb_residual *r,
                           pb_error *err) {
  *r = (pb_residual){.ny = m->ny, .slowest = slowest, .fastest = slowest, .rate = m->sample_rate};
  if (pb_has_rates(m, 1)) r->direct = direct;
  r->order = calloc(m->ny + 1, sizeof *r->order);
  bool ok = r->order;
  for (int k = 0; k < MOMENTS; k++) {
    r->moment[k] = calloc(m->ny * r->direct + 1, sizeof *r->moment[k]);
    ok = ok && r->moment[k];
  }
  if (!ok) {
    pb_residual_close(r);
    return pb_fail_memory(err, "/max_frequency");
  }
  for (size_t o = 0; o < m->ny; o++) r->order[o] = pb_rate_order(m->output[o].unit);
  return PB_OK;
}

void pb_residual_close(pb_residual *r) {
  free(r->order);
  for (int k = 0; k < MOMENTS; k++) free(r->moment[k]);
  *r = (pb_residual){0};
}

pb_status pb_residual_add(pb_residual *r, const pb_model *m, size_t block, pb_error *err) {
  if (!r->direct) return PB_OK;
  const size_t n = m->block_start[block + 1] - m->block_start[block];
  solver s;
  pb_status st = solver_new(m, block, r->direct, &s, err);
  if (st) return st;
  r->fastest = fmax(r->fastest, pb_block_frequency(m->a + m->block_value[block], n));
  for (int power = 0; power < 5 && !s.singular; power++) {
    solver_step(&s);
    for (size_t o = 0; o < r->ny; o++) {
      const int k = power - r->order[o] + OWN;
      if (!r->order[o] || k < 0 || k >= MOMENTS) continue;
      for (size_t i = 0; i < r->direct; i++)
        r->moment[k][o + i * r->ny] += seen(m, block, &s, o, i);
    }
  }
  solver_clear(&s);
  return PB_OK;
}

bool pb_residual_needs(const pb_residual *r, size_t input) {
  if (input >= r->direct) return false;
  for (size_t o = 0; o < r->ny; o++)
    if (r->order[o] && r->moment[OWN][o + input * r->ny] != 0) return true;
  return false;
}

size_t pb_residual_count(const pb_residual *r) {
  size_t count = 0;
  for (size_t i = 0; i < r->direct; i++) count += pb_residual_needs(r, i);
  return count;
}

// Largest moment of an output, over the inputs.
static double largest(const pb_residual *r, size_t o) {
  double most = 0;
  for (size_t i = 0; i < r->direct; i++)
    most = fmax(most, (double)fabsl(r->moment[OWN][o + i * r->ny]));
  return most;
}

// M(s)/M_0 = 1 + α s + β s² …, P = 1 − (2ζ/ω) s + (4ζ² − 1)/ω² s² …, over all outputs.
static void fit(const pb_residual *r, size_t input, double *omega, double *zeta) {
  double own = 0, alpha = 0, beta = 0;
  for (size_t o = 0; o < r->ny; o++) {
    const double scale = r->order[o] ? largest(r, o) : 0;
    if (scale == 0) continue;
    const size_t at = o + input * r->ny;
    const double m0 = (double)(r->moment[OWN][at] / scale);
    own += m0 * m0;
    alpha += m0 * (double)(r->moment[OWN + 1][at] / scale);
    beta += m0 * (double)(r->moment[OWN + 2][at] / scale);
  }
  alpha /= own, beta /= own;
  const double slow2 = r->slowest * r->slowest, fast2 = r->fastest * r->fastest;
  const double inverse = fmin(fmax(alpha * alpha - beta, 1 / fast2), 1 / slow2);
  const double sampled = 2 * pi * r->rate;
  *omega = fmin(1 / sqrt(inverse), fmax(r->slowest, 0.25 * sampled));
  *zeta = *omega < 0.5 * sampled ? fmin(fmax(-0.5 * alpha * *omega, 0), 1) : 1;
}

void pb_residual_pair(const pb_residual *r, size_t input, double *a, double *b, double *c,
                      double *d) {
  double omega, zeta;
  fit(r, input, &omega, &zeta);
  a[0] = 0, a[1] = -omega, a[2] = omega, a[3] = -2 * zeta * omega;
  b[0] = 0, b[1] = omega;
  for (size_t o = 0; o < r->ny; o++) {
    const size_t at = o + input * r->ny;
    const bool twice = r->order[o] == 2;
    const double below = twice ? (double)r->moment[0][at] : 0;
    const double own = r->order[o] ? (double)r->moment[OWN][at] + 2 * zeta / omega * below : 0;
    d[o] = twice ? own * omega * omega : 0;
    c[o] = -d[o];
    c[o + r->ny] = twice ? below * omega - 2 * zeta * d[o] : own * omega;
  }
}
