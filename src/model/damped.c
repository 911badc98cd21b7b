// Damped modes by refinement of clusters: see damped.h.
#include "model/damped.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"

static const double tolerance = 1e-13;  // of a residual against its eigenvalue; the step follows
static const double most_tilt = 0.7;    // below 1 the vectors stay independent
enum { MOST_SWEEPS = 30, MOST_STALLS = 3 };

// Besides the result: the matrices in the order of the clusters, and work space.
typedef struct iteration {
  pb_damped *d;
  double *c, *w2;                // n × n: Ĉ; [n]: ω²
  double *in, *out;              // n × columns: of the product with the active columns
  double *r[2], *dx[2];          // [n] residual and correction of a column
  bool *active;                  // [clusters]
  double complex *t, *z, *turn;  // widest columns squared
  double complex *work;
  double *rwork;
  int *pivot;
  size_t widest;  // eigenpairs of the largest cluster
} iteration;

void pb_damped_clear(pb_damped *d) {
  pb_clusters_clear(&d->cluster);
  for (int i = 0; i < 2; i++) {
    free(d->x[i]);
    free(d->p[i]);
  }
  *d = (pb_damped){0};
}

static void iteration_clear(iteration *it) {
  free(it->c);
  free(it->w2);
  free(it->in);
  free(it->out);
  for (int i = 0; i < 2; i++) {
    free(it->r[i]);
    free(it->dx[i]);
  }
  free(it->active);
  free(it->t);
  free(it->z);
  free(it->turn);
  free(it->work);
  free(it->rwork);
  free(it->pivot);
}

static bool iteration_new(pb_damped *d, iteration *it) {
  const size_t n = d->n, values = n * d->columns, wide = 2 * d->cluster.widest;
  *it = (iteration){.d = d, .widest = wide};
  bool ok = true;
  for (int i = 0; i < 2; i++) {
    d->x[i] = calloc(values, sizeof(double));
    d->p[i] = malloc(values * sizeof(double));
    it->r[i] = malloc(n * sizeof(double));
    it->dx[i] = malloc(n * sizeof(double));
    ok = ok && d->x[i] && d->p[i] && it->r[i] && it->dx[i];
  }
  it->c = malloc(n * n * sizeof(double));
  it->w2 = malloc(n * sizeof(double));
  it->in = malloc(values * sizeof(double));
  it->out = malloc(values * sizeof(double));
  it->active = malloc(d->cluster.count * sizeof(bool));
  it->t = malloc(wide * wide * sizeof *it->t);
  it->z = malloc(wide * wide * sizeof *it->z);
  it->turn = malloc((wide + n) * wide * sizeof *it->turn);
  it->work = malloc(4 * wide * sizeof *it->work);
  it->rwork = malloc(2 * wide * sizeof(double));
  it->pivot = malloc(wide * sizeof(int));
  return ok && it->c && it->w2 && it->in && it->out && it->active && it->t && it->z && it->turn &&
         it->work && it->rwork && it->pivot;
}

// Ĉ and ω² in the clusters' order; X = the clusters' own vectors.
static void begin(const double *omega, const double *damping, iteration *it) {
  pb_damped *d = it->d;
  const pb_clusters *c = &d->cluster;
  const size_t n = d->n;
  for (size_t j = 0; j < n; j++) {
    it->w2[j] = omega[c->mode[j]] * omega[c->mode[j]];
    for (size_t i = 0; i < n; i++) it->c[i + j * n] = damping[c->mode[i] + c->mode[j] * n];
  }
  for (size_t k = 0; k < c->count; k++) {
    const size_t modes = c->start[k + 1] - c->start[k];
    const double complex *v = c->v + c->value[k];
    it->active[k] = true;
    for (size_t j = c->column[k]; j < c->column[k + 1]; j++, v += modes)
      for (size_t i = 0; i < modes; i++) {
        d->x[0][c->start[k] + i + j * n] = creal(v[i]);
        d->x[1][c->start[k] + i + j * n] = cimag(v[i]);
      }
  }
}

// P = Ĉ X of clusters whose vectors are still their own: rows outside a cluster are zero.
static void multiply_first(iteration *it) {
  pb_damped *d = it->d;
  const pb_clusters *c = &d->cluster;
  const double one = 1, zero = 0;
  const int n = (int)d->n;
  for (size_t k = 0; k < c->count; k++) {
    const int modes = (int)(c->start[k + 1] - c->start[k]);
    const int columns = (int)(c->column[k + 1] - c->column[k]);
    const size_t first = c->column[k] * d->n;
    for (int i = 0; i < 2; i++)
      dgemm_("N", "N", &n, &columns, &modes, &one, it->c + c->start[k] * d->n, &n,
             d->x[i] + c->start[k] + first, &n, &zero, d->p[i] + first, &n);
  }
}

// Copies the active clusters' columns out of `whole` into `packed`, or back. Returns how many.
static size_t pack(const iteration *it, double *whole, double *packed, bool back) {
  const pb_clusters *c = &it->d->cluster;
  const size_t n = it->d->n;
  size_t columns = 0;
  for (size_t k = 0; k < c->count; k++) {
    if (!it->active[k]) continue;
    const size_t count = c->column[k + 1] - c->column[k];
    double *there = whole + c->column[k] * n, *here = packed + columns * n;
    memcpy(back ? there : here, back ? here : there, count * n * sizeof *here);
    columns += count;
  }
  return columns;
}

// P = Ĉ X of the active clusters.
static void multiply(iteration *it) {
  const int n = (int)it->d->n;
  const double one = 1, zero = 0;
  for (int i = 0; i < 2; i++) {
    const int columns = (int)pack(it, it->d->x[i], it->in, false);
    dgemm_("N", "N", &n, &columns, &n, &one, it->c, &n, it->in, &n, &zero, it->out, &n);
    pack(it, it->d->p[i], it->out, true);
  }
}

// R = λ² X + λ P + Ω² X of one column.
static void residual(const iteration *it, size_t k) {
  const pb_damped *d = it->d;
  const size_t n = d->n;
  const double complex l = d->cluster.lambda[k], l2 = l * l;
  const double *xr = d->x[0] + k * n, *xi = d->x[1] + k * n;
  const double *pr = d->p[0] + k * n, *pi = d->p[1] + k * n;
  const double lr = creal(l), li = cimag(l), l2r = creal(l2), l2i = cimag(l2);
  for (size_t i = 0; i < n; i++) {
    const double s = l2r + it->w2[i];
    it->r[0][i] = s * xr[i] - l2i * xi[i] + lr * pr[i] - li * pi[i];
    it->r[1][i] = s * xi[i] + l2i * xr[i] + lr * pi[i] + li * pr[i];
  }
}

static double complex quotient(double complex a, double complex b) {
  const double br = creal(b), bi = cimag(b), size = 1 / (br * br + bi * bi);
  const double ar = creal(a), ai = cimag(a);
  return (ar * br + ai * bi) * size + I * ((ai * br - ar * bi) * size);
}

static double magnitude(double complex a) {
  return sqrt(creal(a) * creal(a) + cimag(a) * cimag(a));
}

// What one column's residual says: how large it is, how far its correction tilts the vector, and
// where it stays within the column's own cluster.
typedef struct verdict {
  double error, tilt;
} verdict;

// The correction of column k in the direction of eigenvector j of cluster c and its conjugate,
// added to dx. *own: yᵀR, left to the caller where both are complex and of one cluster.
static void correct_along(const iteration *it, size_t c, size_t j, size_t k, bool same, bool pair,
                          double complex *own, verdict *out) {
  const pb_clusters *s = &it->d->cluster;
  const size_t modes = s->start[c + 1] - s->start[c], first = s->start[c];
  const size_t at = s->value[c] + (j - s->column[c]) * modes;
  const double *y = (const double *)(s->y + at), *v = (const double *)(s->v + at);
  const double *rr = it->r[0] + first, *ri = it->r[1] + first;
  const double complex lj = s->lambda[j], lk = s->lambda[k];
  double a = 0, b = 0, m = 0, p = 0;
  for (size_t i = 0; i < modes; i++) {
    a += y[2 * i] * rr[i];
    b += y[2 * i + 1] * ri[i];
    m += y[2 * i] * ri[i];
    p += y[2 * i + 1] * rr[i];
  }
  const double complex g = (a - b) + I * (m + p), h = (a + b) + I * (m - p);
  const double complex e = same ? 0 : quotient(g, lj - lk);
  const double complex f = pair ? quotient(h, conj(lj) - lk) : 0;
  const double size = fmax(magnitude(lj), magnitude(lk));
  if (same) *own = g;
  if (size > 0) out->error = fmax(out->error, fmax(magnitude(g), pair ? magnitude(h) : 0) / size);
  out->tilt += magnitude(e) + magnitude(f);
  const double er = creal(e) + creal(f), ei = cimag(e) + cimag(f);
  const double dr = creal(e) - creal(f), di = cimag(e) - cimag(f);
  for (size_t i = 0; i < modes; i++) {
    it->dx[0][first + i] += v[2 * i] * er - v[2 * i + 1] * di;
    it->dx[1][first + i] += v[2 * i] * ei + v[2 * i + 1] * dr;
  }
}

// Corrects column k of cluster `home`; own [eigenpairs of the cluster]: its column of YᵀR, of
// those that are not divided by differences.
static verdict correct_column(iteration *it, size_t home, size_t k, double complex *own) {
  pb_damped *d = it->d;
  const pb_clusters *s = &d->cluster;
  const size_t n = d->n;
  verdict out = {0, 0};
  residual(it, k);
  memset(it->dx[0], 0, n * sizeof(double));
  memset(it->dx[1], 0, n * sizeof(double));
  const bool complex_k = k - s->column[home] < s->pairs[home];
  for (size_t c = 0; c < s->count; c++)
    for (size_t j = s->column[c]; j < s->column[c + 1]; j++) {
      const bool pair = j - s->column[c] < s->pairs[c];
      const bool same = c == home && (j == k || (pair && complex_k));
      correct_along(it, c, j, k, same, pair, own + (j - s->column[home]) * (c == home), &out);
    }
  for (int i = 0; i < 2; i++)
    for (size_t r = 0; r < n; r++) d->x[i][r + k * n] += it->dx[i][r];
  if (!complex_k) memset(d->x[1] + k * n, 0, n * sizeof(double));
  return out;
}

// x ← x z for the first m columns of x (rows × m, real and imaginary parts ld apart).
static void turn_split(iteration *it, double *xr, double *xi, size_t n, size_t m) {
  double complex *row = it->turn;
  for (size_t i = 0; i < n; i++) {
    for (size_t k = 0; k < m; k++) {
      double sr = 0, si = 0;
      for (size_t j = 0; j < m; j++) {
        const double zr = creal(it->z[j + k * m]), zi = cimag(it->z[j + k * m]);
        sr += xr[i + j * n] * zr - xi[i + j * n] * zi;
        si += xr[i + j * n] * zi + xi[i + j * n] * zr;
      }
      row[k] = sr + I * si;
    }
    for (size_t k = 0; k < m; k++) {
      xr[i + k * n] = creal(row[k]);
      xi[i + k * n] = cimag(row[k]);
    }
  }
}

// a (rows × m) ← a z
static void turn(iteration *it, double complex *a, const double complex *z, size_t rows, size_t m) {
  for (size_t i = 0; i < rows; i++) {
    for (size_t k = 0; k < m; k++) {
      it->turn[k] = 0;
      for (size_t j = 0; j < m; j++) it->turn[k] += a[i + j * rows] * z[j + k * m];
    }
    for (size_t k = 0; k < m; k++) a[i + k * rows] = it->turn[k];
  }
}

// Diagonalises t, the effective matrix of a cluster's m complex eigenpairs, and turns its vectors
// accordingly. False: it is defective.
static bool turn_cluster(iteration *it, size_t c, size_t m) {
  pb_damped *d = it->d;
  pb_clusters *s = &d->cluster;
  const size_t modes = s->start[c + 1] - s->start[c], first = s->column[c] * d->n;
  int n = (int)m, one = 1, info = 0, length = (int)(4 * it->widest);
  double complex none = 0, *inverse = it->t;
  zgeev_("N", "V", &n, it->t, &n, s->lambda + s->column[c], &none, &one, it->z, &n, it->work,
         &length, it->rwork, &info);
  if (info) return false;
  turn(it, s->v + s->value[c], it->z, modes, m);
  turn_split(it, d->x[0] + first, d->x[1] + first, d->n, m);
  turn_split(it, d->p[0] + first, d->p[1] + first, d->n, m);
  memcpy(it->turn, it->z, m * m * sizeof *it->z);
  for (size_t i = 0; i < m * m; i++) inverse[i] = i % (m + 1) == 0;
  zgesv_(&n, &n, it->turn, &n, it->pivot, inverse, &n, &info);
  if (info) return false;
  for (size_t j = 0; j < m; j++)  // Y takes the inverse's transpose
    for (size_t i = 0; i < m; i++) it->z[i + j * m] = inverse[j + i * m];
  turn(it, s->y + s->value[c], it->z, modes, m);
  return true;
}

// Corrects all eigenpairs of a cluster.
static bool correct_cluster(iteration *it, size_t c, verdict *worst) {
  pb_clusters *s = &it->d->cluster;
  const size_t first = s->column[c], count = s->column[c + 1] - first, pairs = s->pairs[c];
  double complex *own = it->work;
  verdict here = {0, 0};
  for (size_t k = 0; k < count; k++) {
    verdict v = correct_column(it, c, first + k, own);
    here.error = fmax(here.error, v.error);
    here.tilt = fmax(here.tilt, v.tilt);
    if (k >= pairs || pairs == 1) {
      it->z[k] = s->lambda[first + k] - own[k];  // until all columns have seen the old one
    } else {
      for (size_t j = 0; j < pairs; j++)
        it->t[j + k * pairs] = (j == k ? s->lambda[first + k] : 0) - own[j];
    }
  }
  for (size_t k = pairs == 1 ? 0 : pairs; k < count; k++) s->lambda[first + k] = it->z[k];
  if (pairs > 1 && !turn_cluster(it, c, pairs)) return false;
  if (!(here.error > tolerance)) it->active[c] = false;
  worst->error = fmax(worst->error, here.error);
  worst->tilt = fmax(worst->tilt, here.tilt);
  return isfinite(here.error) && here.tilt < most_tilt;
}

static bool iterate(iteration *it) {
  double before = INFINITY;
  multiply_first(it);
  for (int sweep = 0, stalls = 0; sweep < MOST_SWEEPS && stalls < MOST_STALLS; sweep++) {
    verdict worst = {0, 0};
    bool left = false;
    if (sweep > 0) multiply(it);
    for (size_t c = 0; c < it->d->cluster.count; c++) {
      if (!it->active[c]) continue;
      if (!correct_cluster(it, c, &worst)) return false;
      left = left || it->active[c];
    }
    if (!left) return true;
    if (worst.error > 0.5 * before) stalls++;
    before = worst.error;
  }
  return false;
}

pb_status pb_damped_solve(size_t n, const double *omega, const double *damping, pb_damped *out,
                          bool *solved, pb_error *err) {
  iteration it = {0};
  *out = (pb_damped){.n = n};
  pb_status st = pb_clusters_make(n, omega, damping, &out->cluster, solved, err);
  if (st || !*solved) return st;
  out->columns = out->cluster.column[out->cluster.count];
  if (!iteration_new(out, &it)) st = pb_fail_memory(err, "");
  if (!st) {
    begin(omega, damping, &it);
    *solved = iterate(&it);
  }
  iteration_clear(&it);
  if (st || !*solved) pb_damped_clear(out);
  return st;
}
