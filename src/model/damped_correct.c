// One sweep's corrections of damped modes: see damped_internal.h. A batch of columns is corrected
// at once, so that sums over modes become matrix products and the rest loops over columns.
#include <math.h>
#include <string.h>

#include "base/lapack.h"
#include "model/damped_internal.h"

enum { BATCH = PB_DAMPED_BATCH };

// What is being corrected, and what its residuals have shown so far, a column each.
typedef struct columns {
  const size_t *k;
  size_t count;
  double re[BATCH], im[BATCH];  // λ
  double size2[BATCH];          // |λ|²
  double error2[BATCH];         // largest |g|² against the larger |λ|²
  double tilt[BATCH];           // Σ |e| + |f|, in the 1-norm
} columns;

// R = λ² X + λ P + Ω² X
static void residual(const pb_iteration *it, const pb_damped_space *space, const columns *s) {
  const pb_damped *d = it->d;
  const size_t n = d->n;
  for (size_t k = 0; k < s->count; k++) {
    const double lr = s->re[k], li = s->im[k], l2r = lr * lr - li * li, l2i = 2 * lr * li;
    const double *xr = d->x[0] + s->k[k] * n, *xi = d->x[1] + s->k[k] * n;
    const double *pr = d->p[0] + s->k[k] * n, *pi = d->p[1] + s->k[k] * n;
    double *rr = space->r[0] + k * n, *ri = space->r[1] + k * n;
    for (size_t i = 0; i < n; i++) {
      const double w2 = l2r + it->w2[i];
      rr[i] = w2 * xr[i] - l2i * xi[i] + lr * pr[i] - li * pi[i];
      ri[i] = w2 * xi[i] + l2i * xr[i] + lr * pi[i] + li * pr[i];
    }
  }
}

// A cluster's vectors as [real parts, imaginary parts times sign], modes × 2 eigenpairs.
static void split(const double complex *v, size_t modes, size_t size, double sign, double *out) {
  for (size_t i = 0; i < modes * size; i++) {
    out[i] = creal(v[i]);
    out[modes * size + i] = sign * cimag(v[i]);
  }
}

// along = (Rᵀ of the cluster's rows) [Y_r Y_i], columns × 2 eigenpairs, of R_r and of R_i.
static void project(const pb_iteration *it, pb_damped_space *space, size_t c, const columns *s) {
  const pb_clusters *q = &it->d->cluster;
  const int n = (int)it->d->n, modes = (int)(q->start[c + 1] - q->start[c]), rows = BATCH;
  const size_t size = q->column[c + 1] - q->column[c];
  const int count = (int)s->count, twice = (int)(2 * size);
  const double one = 1, zero = 0;
  split(q->y + q->value[c], (size_t)modes, size, 1, space->basis);
  for (int part = 0; part < 2; part++)
    dgemm_("T", "N", &count, &twice, &modes, &one, space->r[part] + q->start[c], &n, space->basis,
           &modes, &zero, space->along[part], &rows);
}

// dX of the cluster's rows = v e + v̄ f; along holds [Re(e + f), Im(e − f)], [Im(e + f), Re(e − f)].
static void expand(const pb_iteration *it, pb_damped_space *space, size_t c, const columns *s) {
  const pb_clusters *q = &it->d->cluster;
  const int n = (int)it->d->n, modes = (int)(q->start[c + 1] - q->start[c]), rows = BATCH;
  const size_t size = q->column[c + 1] - q->column[c];
  const int count = (int)s->count, twice = (int)(2 * size);
  const double one = 1, zero = 0;
  for (int part = 0; part < 2; part++) {
    split(q->v + q->value[c], (size_t)modes, size, part ? 1 : -1, space->basis);
    dgemm_("N", "T", &modes, &count, &twice, &one, space->basis, &modes, space->along[part], &rows,
           &zero, space->dx[part] + q->start[c], &n);
  }
}

// From the projections on eigenvector j and its conjugate to the corrections along them:
// e = g / (λ_j − λ), f = h / (λ̄_j − λ). apart[k] 0: not along j itself; mirror 0: j is real.
static void divide(double complex lambda, double mirror, const double *apart, double *const a[2],
                   double *const b[2], columns *s) {
  const double re = creal(lambda), im = cimag(lambda), size2 = re * re + im * im;
  for (size_t k = 0; k < s->count; k++) {
    const double gr = a[0][k] - b[1][k], gi = b[0][k] + a[1][k];
    const double hr = a[0][k] + b[1][k], hi = b[0][k] - a[1][k];
    const double dr = re - s->re[k], di = im - s->im[k], mi = -im - s->im[k];
    const double gain = apart[k] / (dr * dr + di * di + (1 - apart[k]));
    const double other = mirror / (dr * dr + mi * mi + (1 - mirror));
    const double er = (gr * dr + gi * di) * gain, ei = (gi * dr - gr * di) * gain;
    const double fr = (hr * dr + hi * mi) * other, fi = (hi * dr - hr * mi) * other;
    const double g2 = gr * gr + gi * gi, h2 = hr * hr + hi * hi, most = g2 > h2 ? g2 : h2;
    const double against = size2 > s->size2[k] ? size2 : s->size2[k];
    const double error2 = most / (against > 1e-300 ? against : 1);
    s->error2[k] = error2 > s->error2[k] ? error2 : s->error2[k];
    s->tilt[k] += fabs(er) + fabs(ei) + fabs(fr) + fabs(fi);
    a[0][k] = er + fr;
    a[1][k] = ei - fi;
    b[0][k] = ei + fi;
    b[1][k] = er - fr;
  }
}

// All corrections along the eigenvectors of cluster c; inside[2]: which columns are its own.
static void correct_along(const pb_iteration *it, pb_damped_space *space, size_t c,
                          const size_t inside[2], columns *s) {
  const pb_clusters *q = &it->d->cluster;
  const size_t first = q->column[c], size = q->column[c + 1] - first, pairs = q->pairs[c];
  double apart[BATCH];
  for (size_t k = 0; k < s->count; k++) apart[k] = 1;
  project(it, space, c, s);
  for (size_t j = 0; j < size; j++) {
    double *const a[2] = {space->along[0] + j * BATCH, space->along[0] + (size + j) * BATCH};
    double *const b[2] = {space->along[1] + j * BATCH, space->along[1] + (size + j) * BATCH};
    for (size_t k = inside[0]; k < inside[1]; k++) {
      const size_t rank = s->k[k] - first;
      const bool own = rank == j || (j < pairs && rank < pairs);
      apart[k] = own ? 0 : 1;
      if (own)
        it->own[it->value[c] + j + rank * size] = a[0][k] - b[1][k] + I * (b[0][k] + a[1][k]);
    }
    divide(q->lambda[first + j], j < pairs ? 1 : 0, apart, a, b, s);
  }
  expand(it, space, c, s);
}

void pb_damped_correct(const pb_iteration *it, pb_damped_space *space, const size_t *k,
                       size_t count) {
  pb_damped *d = it->d;
  const pb_clusters *q = &d->cluster;
  const size_t n = d->n;
  columns s = {.k = k, .count = count};
  for (size_t i = 0; i < count; i++) {
    s.re[i] = creal(q->lambda[k[i]]);
    s.im[i] = cimag(q->lambda[k[i]]);
    s.size2[i] = s.re[i] * s.re[i] + s.im[i] * s.im[i];
  }
  residual(it, space, &s);
  for (size_t c = 0, next = 0; c < q->count; c++) {
    const size_t from = next;
    while (next < count && it->home[k[next]] == c) next++;
    const size_t inside[2] = {from, next};
    correct_along(it, space, c, inside, &s);
  }
  for (size_t i = 0; i < count; i++) {
    const size_t home = it->home[k[i]];
    const bool real = k[i] - q->column[home] >= q->pairs[home];
    it->residual[k[i]] = sqrt(s.error2[i]);
    it->turned_by[k[i]] = s.tilt[i];
    for (int part = 0; part < (real ? 1 : 2); part++)
      for (size_t r = 0; r < n; r++) d->x[part][r + k[i] * n] += space->dx[part][r + i * n];
  }
}

// x (rows × m, real and imaginary parts apart) ← x z, z split in the basis' place.
static void turn_split(pb_iteration *it, double *const x[2], size_t rows, size_t m) {
  const int n = (int)rows, size = (int)m;
  const double one = 1, minus = -1, zero = 0;
  const double *zr = it->basis, *zi = zr + m * m;
  double *tr = it->turned, *ti = tr + rows * m;
  dgemm_("N", "N", &n, &size, &size, &one, x[0], &n, zr, &size, &zero, tr, &n);
  dgemm_("N", "N", &n, &size, &size, &minus, x[1], &n, zi, &size, &one, tr, &n);
  dgemm_("N", "N", &n, &size, &size, &one, x[0], &n, zi, &size, &zero, ti, &n);
  dgemm_("N", "N", &n, &size, &size, &one, x[1], &n, zr, &size, &one, ti, &n);
  memcpy(x[0], tr, rows * m * sizeof *tr);
  memcpy(x[1], ti, rows * m * sizeof *ti);
}

// a (rows × m) ← a z
static void turn(pb_iteration *it, double complex *a, size_t rows, size_t m) {
  double complex *row = it->work;
  for (size_t i = 0; i < rows; i++) {
    for (size_t k = 0; k < m; k++) {
      row[k] = 0;
      for (size_t j = 0; j < m; j++) row[k] += a[i + j * rows] * it->z[j + k * m];
    }
    for (size_t k = 0; k < m; k++) a[i + k * rows] = row[k];
  }
}

// Diagonalises t, the effective matrix of a cluster's m complex eigenpairs, and turns all that
// belongs to them.
static bool turn_cluster(pb_iteration *it, size_t c, size_t m) {
  pb_damped *d = it->d;
  pb_clusters *q = &d->cluster;
  const size_t modes = q->start[c + 1] - q->start[c], first = q->column[c] * d->n;
  int n = (int)m, one = 1, info = 0, length = (int)(4 * it->widest);
  double complex none = 0, *inverse = it->t;
  zgeev_("N", "V", &n, it->t, &n, q->lambda + q->column[c], &none, &one, it->z, &n, it->work,
         &length, it->rwork, &info);
  if (info) return false;
  turn(it, q->v + q->value[c], modes, m);
  split(it->z, m, m, 1, it->basis);
  turn_split(it, (double *const[2]){d->x[0] + first, d->x[1] + first}, d->n, m);
  turn_split(it, (double *const[2]){d->p[0] + first, d->p[1] + first}, d->n, m);
  for (size_t i = 0; i < m * m; i++) inverse[i] = i % (m + 1) == 0;
  zgesv_(&n, &n, it->z, &n, it->pivot, inverse, &n, &info);
  if (info) return false;
  for (size_t j = 0; j < m; j++)  // Y takes the inverse's transpose
    for (size_t i = 0; i < m; i++) it->z[i + j * m] = inverse[j + i * m];
  turn(it, q->y + q->value[c], modes, m);
  return true;
}

bool pb_damped_turn(pb_iteration *it, size_t c) {
  pb_clusters *q = &it->d->cluster;
  const size_t first = q->column[c], size = q->column[c + 1] - first, pairs = q->pairs[c];
  const double complex *own = it->own + it->value[c];
  double complex *lambda = q->lambda + first;
  for (size_t k = pairs > 1 ? pairs : 0; k < size; k++) lambda[k] -= own[k + k * size];
  if (pairs < 2) return true;
  for (size_t k = 0; k < pairs; k++)
    for (size_t j = 0; j < pairs; j++)
      it->t[j + k * pairs] = (j == k ? lambda[k] : 0) - own[j + k * size];
  return turn_cluster(it, c, pairs);
}
