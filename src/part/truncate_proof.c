// Poles and zeros of an element by which a truncation is judged: see truncate.h.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"
#include "part/truncate_internal.h"

static const double two_pi = 6.283185307179586476925286766559;

// K and M with some coordinates held, and the ones left of each channel's vectors.
typedef struct held {
  size_t n;
  double *k, *m;  // n × n
  size_t *kept;   // [n] coordinates of the element
} held;

typedef struct proof_job {
  const char *name;
  const pb_element_data *e;
  const pb_truncate_options *o;
  double top;  // Hz
  pb_proof *out;
  pb_error *err;
} proof_job;

static void clear_held(held *h) {
  free(h->k);
  free(h->m);
  free(h->kept);
  *h = (held){0};
}

static bool is_tip(const proof_job *j, size_t i) {
  return i / 6 == j->o->tip && i % 6 < 3 && i < 6 * j->e->frames;
}

// base: the base frame is held; coordinate < size: this one, too.
static pb_status hold(const proof_job *j, bool base, size_t coordinate, held *h) {
  size_t size = j->e->size;
  *h = (held){0};
  h->kept = malloc(size * sizeof *h->kept);
  h->k = malloc(size * size * sizeof *h->k);
  h->m = malloc(size * size * sizeof *h->m);
  if (!h->kept || !h->k || !h->m) {
    clear_held(h);
    return pb_fail_memory(j->err, j->name);
  }
  for (size_t i = 0; i < size; i++)
    if (i != coordinate && !(base && i / 6 == j->o->base)) h->kept[h->n++] = i;
  for (size_t c = 0; c < h->n; c++) {
    for (size_t r = 0; r < h->n; r++) {
      size_t from = h->kept[r] + h->kept[c] * size;
      h->k[r + c * h->n] = j->e->k[from];
      h->m[r + c * h->n] = j->e->m[from];
    }
    if (is_tip(j, h->kept[c])) h->m[c + c * h->n] += j->o->payload;
  }
  return PB_OK;
}

// ---- results ------------------------------------------------------------------------------------

static int by_magnitude(const void *a, const void *b) {
  double x = cabs(*(const double complex *)a), y = cabs(*(const double complex *)b);
  return (x > y) - (x < y);
}

// Adds the eigenvalues λ up to the top; takes them over (count numbers of square radians).
static pb_status add_group(const proof_job *j, bool base, const char *what, bool zeros,
                           const double complex *lambda, size_t count) {
  pb_proof_group *g = &j->out->group[j->out->groups];
  *g = (pb_proof_group){.boundary = base ? "held" : "free", .what = what, .zeros = zeros};
  g->hz = malloc((count + 1) * sizeof *g->hz);
  if (!g->hz) return pb_fail_memory(j->err, j->name);
  j->out->groups++;
  for (size_t i = 0; i < count; i++) {
    double complex hz = csqrt(lambda[i]) / two_pi;
    if (cabs(hz) <= j->top) g->hz[g->count++] = hz;
  }
  qsort(g->hz, g->count, sizeof *g->hz, by_magnitude);
  return PB_OK;
}

// ---- eigenvalues --------------------------------------------------------------------------------

// Poles of what is left: also the zeros of the held coordinate's own force to its motion.
static pb_status add_symmetric(const proof_job *j, bool base, size_t coordinate, const char *what) {
  held h;
  pb_status st = hold(j, base, coordinate, &h);
  if (st) return st;
  int n = (int)h.n, itype = 1, lwork = 2 * n + 1, liwork = 1, iwork[1], info = 0;
  double *w = malloc((h.n + 1) * sizeof *w), *work = malloc((size_t)lwork * sizeof *work);
  double complex *lambda = malloc((h.n + 1) * sizeof *lambda);
  if (!w || !work || !lambda) st = pb_fail_memory(j->err, j->name);
  if (!st && n > 0)
    dsygvd_(&itype, "N", "U", &n, h.k, &n, h.m, &n, w, work, &lwork, iwork, &liwork, &info);
  if (info > n) st = pb_fail(j->err, PB_ERR_ELEMENT, j->name, "M is not positive definite");
  if (info && info <= n)
    st = pb_fail(j->err, PB_ERR_NUMERIC, j->name, "the eigenvalues did not converge");
  for (size_t i = 0; !st && i < h.n; i++) lambda[i] = w[i];
  if (!st) st = add_group(j, base, what, coordinate < j->e->size, lambda, h.n);
  free(w);
  free(work);
  free(lambda);
  clear_held(&h);
  return st;
}

// The pencil [[K, b], [cᵀ, 0]] − λ [[M, 0], [0, 0]], coordinates scaled so that K has a unit
// diagonal and λ measured in the band's.
static void make_pencil(const held *h, const double *b, const double *c, double unit, double *left,
                        double *right) {
  size_t n = h->n, m = n + 1;
  memset(left, 0, m * m * sizeof *left);
  memset(right, 0, m * m * sizeof *right);
  double bmax = 0, cmax = 0;
  for (size_t i = 0; i < n; i++) {
    double d = h->k[i + i * n] > 0 ? 1 / sqrt(h->k[i + i * n]) : 1;
    bmax = fmax(bmax, fabs(b[h->kept[i]] * d));
    cmax = fmax(cmax, fabs(c[h->kept[i]] * d));
  }
  for (size_t col = 0; col < n; col++) {
    double dc = h->k[col + col * n] > 0 ? 1 / sqrt(h->k[col + col * n]) : 1;
    for (size_t row = 0; row < n; row++) {
      double dr = h->k[row + row * n] > 0 ? 1 / sqrt(h->k[row + row * n]) : 1;
      left[row + col * m] = dr * h->k[row + col * n] * dc;
      right[row + col * m] = unit * dr * h->m[row + col * n] * dc;
    }
    left[col + n * m] = b[h->kept[col]] * dc / bmax;
    left[n + col * m] = c[h->kept[col]] * dc / cmax;
  }
}

static pb_status add_pencil(const proof_job *j, bool base, const double *b, const double *c,
                            const char *what) {
  held h;
  pb_status st = hold(j, base, j->e->size, &h);
  if (st) return st;
  size_t m = h.n + 1;
  int n = (int)m, one = 1, lwork = 16 * n, info = 0;
  double unit = pow(two_pi * j->o->high_hz, 2), none;
  double *left = malloc(m * m * sizeof *left), *right = malloc(m * m * sizeof *right);
  double *real = malloc(3 * m * sizeof *real), *work = malloc((size_t)lwork * sizeof *work);
  double complex *lambda = malloc(m * sizeof *lambda);
  if (!left || !right || !real || !work || !lambda) st = pb_fail_memory(j->err, j->name);
  if (!st) {
    make_pencil(&h, b, c, unit, left, right);
    dggev_("N", "N", &n, left, &n, right, &n, real, real + m, real + 2 * m, &none, &one, &none,
           &one, work, &lwork, &info);
    if (info) st = pb_fail(j->err, PB_ERR_NUMERIC, j->name, "the zeros did not converge");
  }
  size_t count = 0;
  for (size_t i = 0; !st && i < m; i++) {
    double over = fabs(real[2 * m + i]), size = hypot(real[i], real[m + i]);
    if (over > 1e-12 * size) lambda[count++] = unit * (real[i] + I * real[m + i]) / real[2 * m + i];
  }
  if (!st) st = add_group(j, base, what, true, lambda, count);
  free(left);
  free(right);
  free(real);
  free(work);
  free(lambda);
  clear_held(&h);
  return st;
}

// ---- channels -----------------------------------------------------------------------------------

// Unit forces ± along the line between two frames.
static void pair_vector(const pb_element_data *e, const size_t pair[2], double *v) {
  double axis[3], norm = 0;
  memset(v, 0, e->size * sizeof *v);
  for (size_t a = 0; a < 3; a++) {
    axis[a] = e->position[3 * pair[1] + a] - e->position[3 * pair[0] + a];
    norm += axis[a] * axis[a];
  }
  for (size_t a = 0; a < 3; a++) {
    v[6 * pair[0] + a] -= axis[a] / sqrt(norm);
    v[6 * pair[1] + a] += axis[a] / sqrt(norm);
  }
}

static pb_status add_stacks(const proof_job *j, bool base) {
  const pb_element_data *e = j->e;
  const size_t ends[2] = {j->o->base, j->o->tip};
  double *b = calloc(3 * e->size, sizeof *b), *c = b ? b + e->size : NULL;
  if (!b) return pb_fail_memory(j->err, j->name);
  pair_vector(e, j->o->actuator, b);
  pair_vector(e, j->o->sensor, c);
  pair_vector(e, ends, c + e->size);
  if (base)
    for (size_t a = 0; a < 3; a++) c[e->size + 6 * ends[0] + a] = 0;
  pb_status st = add_pencil(j, base, b, c, "zero actuator → sensor");
  if (!st) st = add_pencil(j, base, b, c + e->size, "zero actuator → tip");
  free(b);
  return st;
}

pb_status pb_proof_make(const char *name, const pb_element_data *e, const pb_truncate_options *o,
                        pb_proof *out, pb_error *err) {
  static const char *const channel[6] = {"zero tip fx → x",  "zero tip fy → y",
                                         "zero tip fz → z",  "zero tip mx → rx",
                                         "zero tip my → ry", "zero tip mz → rz"};
  const proof_job j = {name, e, o, 1.5 * o->high_hz, out, err};
  *out = (pb_proof){0};
  pb_status st = PB_OK;
  for (int base = 0; !st && base < 2; base++) {
    st = add_symmetric(&j, base, e->size, "pole");
    for (size_t a = 0; !st && a < 6; a++) st = add_symmetric(&j, base, 6 * o->tip + a, channel[a]);
    if (!st && o->stacks) st = add_stacks(&j, base);
  }
  if (st) pb_proof_clear(out);
  return st;
}

void pb_proof_clear(pb_proof *proof) {
  for (size_t g = 0; g < proof->groups; g++) free(proof->group[g].hz);
  *proof = (pb_proof){0};
}
