// Finding clusters and solving each by itself: see cluster.h.
//
// A mode j alone has λ_j² + ĉ_jj λ_j + ω_j² = 0. To first order the coupling ĉ_ij tilts its vector
// towards mode i by λ_j ĉ_ij / (λ_j² + ĉ_ii λ_j + ω_i²).
#include "model/cluster.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"

static const double strong = 1e-2;  // tilt above which two modes are solved together
static const double close = 1e-3;   // relative distance of eigenvalues below which they are
static const double sound_rcond = 1e-6;

double pb_mode_scale(double omega) {
  return omega > 0 ? omega : 1;
}

void pb_clusters_clear(pb_clusters *c) {
  free(c->mode);
  free(c->start);
  free(c->column);
  free(c->pairs);
  free(c->lambda);
  free(c->value);
  free(c->v);
  free(c->y);
  *c = (pb_clusters){0};
}

// Both eigenvalues of a mode alone; of a complex pair that with Im > 0 twice.
static void alone(double omega, double c, double complex lambda[2]) {
  double half = 0.5 * c, discriminant = half * half - omega * omega;
  if (discriminant < 0) {
    lambda[0] = lambda[1] = -half + I * sqrt(-discriminant);
    return;
  }
  double fast = -half - copysign(sqrt(discriminant), half);
  lambda[0] = fast;
  lambda[1] = fast != 0 ? omega * omega / fast : 0;
}

static bool tilts(double omega, double cii, double cij, double complex lambda) {
  double re = creal(lambda), im = cimag(lambda);
  double real = re * re - im * im + cii * re + omega * omega, imaginary = (2 * re + cii) * im;
  double gap2 = real * real + imaginary * imaginary;
  return (re * re + im * im) * cij * cij >= strong * strong * gap2;
}

static bool joined(size_t n, const double *omega, const double *damping,
                   const double complex *lambda, size_t i, size_t j) {
  double cij = damping[i + j * n];
  for (int a = 0; a < 2; a++) {
    double complex li = lambda[2 * i + a], lj = lambda[2 * j + a];
    if (tilts(omega[i], damping[i + i * n], cij, lj)) return true;
    if (tilts(omega[j], damping[j + j * n], cij, li)) return true;
    for (int b = 0; b < 2; b++) {
      double complex d = li - lambda[2 * j + b];
      double gap2 = creal(d) * creal(d) + cimag(d) * cimag(d);
      if (gap2 <= close * close * (creal(li) * creal(li) + cimag(li) * cimag(li))) return true;
    }
  }
  return false;
}

static size_t find(size_t *parent, size_t i) {
  while (parent[i] != i) i = parent[i] = parent[parent[i]];
  return i;
}

// Numbers the clusters in the order of their first modes and sorts the modes by cluster.
static void list_clusters(size_t *parent, size_t *number, pb_clusters *out) {
  for (size_t i = 0; i < out->n; i++) {
    size_t root = find(parent, i);
    number[i] = root == i ? out->count++ : number[root];
    out->start[number[i] + 1]++;
  }
  for (size_t k = 0; k < out->count; k++) {
    out->widest = out->start[k + 1] > out->widest ? out->start[k + 1] : out->widest;
    out->start[k + 1] += out->start[k];
    out->value[k] = out->start[k];  // here: the next free place
  }
  for (size_t i = 0; i < out->n; i++) out->mode[out->value[number[i]]++] = i;
}

static pb_status group_modes(const double *omega, const double *damping, pb_clusters *out,
                             pb_error *err) {
  size_t n = out->n;
  size_t *parent = malloc(n * sizeof *parent), *number = malloc(n * sizeof *number);
  double complex *lambda = malloc(2 * n * sizeof *lambda);
  bool ok = parent && number && lambda;
  for (size_t i = 0; i < n && ok; i++) {
    parent[i] = i;
    alone(omega[i], damping[i + i * n], lambda + 2 * i);
  }
  for (size_t j = 0; j < n && ok; j++)
    for (size_t i = 0; i < j; i++)
      if (joined(n, omega, damping, lambda, i, j)) {
        size_t a = find(parent, i), b = find(parent, j);
        parent[a > b ? a : b] = a > b ? b : a;
      }
  if (ok) list_clusters(parent, number, out);
  free(parent);
  free(number);
  free(lambda);
  return ok ? PB_OK : pb_fail_memory(err, "");
}

// A cluster's equations in the states s η, η̇ of its modes, the fastest mode first: on a matrix
// graded so, the QR algorithm finds small eigenvalues to an accuracy of their own.
static void fill(size_t n, const double *omega, const double *damping, const size_t *mode,
                 size_t modes, double *a) {
  size_t size = 2 * modes;
  memset(a, 0, size * size * sizeof *a);
  for (size_t j = 0; j < modes; j++) {
    size_t x = 2 * (modes - 1 - j), v = x + 1;
    double s = pb_mode_scale(omega[mode[j]]);
    a[x + v * size] = s;
    a[v + x * size] = -omega[mode[j]] * omega[mode[j]] / s;
    for (size_t i = 0; i < modes; i++)
      a[2 * (modes - 1 - i) + 1 + v * size] = -damping[mode[i] + mode[j] * n];
  }
}

// Work space for the largest cluster.
typedef struct work {
  double *a, *vectors, *inverse, *wr, *wi, *real;
  int *pivot, *whole, length;
} work;

static void work_clear(work *w) {
  free(w->a);
  free(w->vectors);
  free(w->inverse);
  free(w->wr);
  free(w->wi);
  free(w->real);
  free(w->pivot);
  free(w->whole);
}

static bool work_new(size_t modes, work *w) {
  size_t n = 2 * modes;
  *w = (work){.length = (int)(64 * n)};
  w->a = malloc(n * n * sizeof(double));
  w->vectors = malloc(n * n * sizeof(double));
  w->inverse = malloc(n * n * sizeof(double));
  w->wr = malloc(n * sizeof(double));
  w->wi = malloc(n * sizeof(double));
  w->real = malloc((size_t)w->length * sizeof(double));
  w->pivot = malloc(n * sizeof(int));
  w->whole = malloc(n * sizeof(int));
  return w->a && w->vectors && w->inverse && w->wr && w->wi && w->real && w->pivot && w->whole;
}

// Eigenvectors and their inverse. False: no convergence, or ill-conditioned.
static bool solve(work *w, size_t size) {
  int n = (int)size, info = 0, one = 1;
  double none = 0, norm = 0, rcond = 0;
  dgeev_("N", "V", &n, w->a, &n, w->wr, w->wi, &none, &one, w->vectors, &n, w->real, &w->length,
         &info);
  if (info) return false;
  memcpy(w->inverse, w->vectors, size * size * sizeof(double));
  for (size_t j = 0; j < size; j++) {
    double sum = 0;
    for (size_t i = 0; i < size; i++) sum += fabs(w->vectors[i + j * size]);
    norm = fmax(norm, sum);
  }
  dgetrf_(&n, &n, w->inverse, &n, w->pivot, &info);
  if (!info) dgecon_("1", &n, w->inverse, &n, &norm, &rcond, w->real, w->whole, &info);
  if (info || !(rcond >= sound_rcond)) return false;
  dgetri_(&n, w->inverse, &n, w->pivot, w->real, &w->length, &info);
  return info == 0;
}

// λ, v and y out of the real form: of state = v_r α + v_i β, (α − iβ)/2 is the coordinate of
// v_r + i v_i. Takes the complex pairs or the real eigenvalues; returns how many there were.
static size_t take(const work *w, bool pair, const double *omega, const size_t *mode, size_t modes,
                   double complex *lambda, double complex *v, double complex *y) {
  size_t size = 2 * modes, count = 0;
  for (size_t k = 0; k < size; k++) {
    if (w->wi[k] < 0 || (w->wi[k] != 0) != pair) continue;
    lambda[count] = w->wr[k] + I * w->wi[k];
    for (size_t i = 0; i < modes; i++) {
      size_t x = 2 * (modes - 1 - i), at = i + count * modes;
      const double *row = w->inverse + k + (x + 1) * size, *column = w->vectors + x + k * size;
      double s = pb_mode_scale(omega[mode[i]]);
      v[at] = (column[0] + (pair ? I * column[size] : 0)) / s;
      y[at] = pair ? 0.5 * (row[0] - I * row[1]) : row[0];
    }
    count++;
  }
  return count;
}

// In closed form, each vector of unit length as a state.
static size_t take_alone(double omega, double damping, double complex *lambda, double complex *v,
                         double complex *y) {
  double complex both[2];
  alone(omega, damping, both);
  size_t count = cimag(both[0]) != 0 ? 1 : 2;
  double s = pb_mode_scale(omega);
  for (size_t k = 0; k < count; k++) {
    lambda[k] = both[k];
    v[k] = 1 / hypot(s, cabs(both[k]));
    y[k] = 1 / (v[k] * (2 * both[k] + damping));
  }
  return count;
}

// Nearly critical: the two eigenvectors of a mode alone are nearly parallel.
static bool alone_sound(double omega, double damping) {
  return fabs(0.25 * damping * damping - omega * omega) > 1e-6 * omega * omega;
}

static pb_status allocate(pb_clusters *out, pb_error *err) {
  size_t n = out->n, values = 0;
  for (size_t k = 0; k < out->count; k++) {
    size_t modes = out->start[k + 1] - out->start[k];
    values += 2 * modes * modes;
  }
  out->column = calloc(out->count + 1, sizeof *out->column);
  out->pairs = calloc(out->count + 1, sizeof *out->pairs);
  out->lambda = malloc(2 * n * sizeof *out->lambda);
  out->v = malloc(values * sizeof *out->v);
  out->y = malloc(values * sizeof *out->y);
  bool ok = out->column && out->pairs && out->lambda && out->v && out->y;
  return ok ? PB_OK : pb_fail_memory(err, "");
}

// One cluster's eigenpairs. False: they are ill-conditioned.
static bool solve_cluster(const double *omega, const double *damping, size_t k, work *w,
                          pb_clusters *out) {
  const size_t *mode = out->mode + out->start[k];
  size_t modes = out->start[k + 1] - out->start[k], count;
  double complex *lambda = out->lambda + out->column[k];
  double complex *v = out->v + out->value[k], *y = out->y + out->value[k];
  if (modes == 1) {
    double c = damping[mode[0] + mode[0] * out->n];
    if (!alone_sound(omega[mode[0]], c)) return false;
    count = take_alone(omega[mode[0]], c, lambda, v, y);
    out->pairs[k] = count == 1;
  } else {
    fill(out->n, omega, damping, mode, modes, w->a);
    if (!solve(w, 2 * modes)) return false;
    size_t pairs = out->pairs[k] = take(w, true, omega, mode, modes, lambda, v, y);
    size_t done = pairs * modes;
    count = pairs + take(w, false, omega, mode, modes, lambda + pairs, v + done, y + done);
  }
  out->column[k + 1] = out->column[k] + count;
  out->value[k + 1] = out->value[k] + modes * count;
  return true;
}

static pb_status solve_clusters(const double *omega, const double *damping, pb_clusters *out,
                                bool *sound, pb_error *err) {
  work w = {0};
  pb_status st = allocate(out, err);
  if (!st && !work_new(out->widest, &w)) st = pb_fail_memory(err, "");
  out->value[0] = 0;
  for (size_t k = 0; k < out->count && !st && *sound; k++)
    *sound = solve_cluster(omega, damping, k, &w, out);
  work_clear(&w);
  return st;
}

pb_status pb_clusters_make(size_t n, const double *omega, const double *damping, pb_clusters *out,
                           bool *sound, pb_error *err) {
  *out = (pb_clusters){.n = n};
  *sound = true;
  out->mode = malloc(n * sizeof *out->mode);
  out->start = calloc(n + 1, sizeof *out->start);
  out->value = calloc(n + 1, sizeof *out->value);
  pb_status st = out->mode && out->start && out->value ? PB_OK : pb_fail_memory(err, "");
  if (!st) st = group_modes(omega, damping, out, err);
  if (!st) *sound = out->count > 1;
  if (!st && *sound) st = solve_clusters(omega, damping, out, sound, err);
  if (st || !*sound) pb_clusters_clear(out);
  return st;
}
