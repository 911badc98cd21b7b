// Zeros that coincide: see zeros_finder.h.
//
// At a zero of order k the slope of H vanishes with H, so that Newton's method has nothing to hold
// on to, and the candidates of the eigenvalue method lie ε^{1/k} beside it. How many there are is
// counted on a circle around them; their mean is as exact as H is on that circle.
#include <math.h>
#include <stdlib.h>

#include "base/lapack.h"
#include "model/zeros_finder.h"

enum { POINTS = 32 };

static const double pi = 3.14159265358979323846;
static const double noise = 1e-13;  // of H, relative to the sum of its terms
static const double clear = 1e4;    // times that: H by which anything is counted
static const double alike = 1e-5;   // relative: nearer than what rounding makes of one zero

// ---- the count on a circle ----------------------------------------------------------------------

// tr(H⁻¹ H′) at s; *doubt: rounding relative to H, at most. False: H is noise.
static bool logarithmic_slope(pb_zero_finder *f, double complex s, double complex *out,
                              double *doubt) {
  double size;
  int m = (int)f->channel->m, info = 0;
  pb_channel_evaluate(f->channel, s, f->h, f->dh, &size);
  if (!isfinite(size) || !pb_zero_decompose(f)) return false;
  if (!(f->sigma[m - 1] > clear * noise * size)) return false;
  *doubt = fmax(*doubt, noise * size / f->sigma[m - 1]);
  int *pivot = (int *)f->rwork;
  zgesv_(&m, &m, f->h, &m, pivot, f->dh, &m, &info);
  *out = 0;
  for (int k = 0; k < m; k++) *out += f->dh[k * (m + 1)];
  return info == 0 && isfinite(cabs(*out));
}

// moment[k] = p_k / r^k, k = 0 … PB_ZEROS_INSIDE.
static bool moments(pb_zero_finder *f, double complex centre, double radius, double complex *moment,
                    double *doubt) {
  *doubt = 0;
  for (int k = 0; k <= PB_ZEROS_INSIDE; k++) moment[k] = 0;
  for (int j = 0; j < POINTS; j++) {
    const double complex turn = cexp(I * (2 * pi * (j + 0.5) / POINTS));
    double complex slope, term;
    if (!logarithmic_slope(f, centre + radius * turn, &slope, doubt)) return false;
    term = slope * radius / POINTS;
    for (int k = 0; k <= PB_ZEROS_INSIDE; k++) moment[k] += term *= turn;
  }
  return true;
}

// Monic polynomial with these power sums, by Newton's identities: e[k], signs taken in.
static void from_power_sums(const double complex *p, size_t n, double complex *e) {
  e[0] = 1;
  for (size_t k = 1; k <= n; k++) {
    e[k] = 0;
    for (size_t i = 1; i <= k; i++) e[k] -= e[k - i] * p[i];
    e[k] /= (double)k;
  }
}

// Roots of x^n + e_1 x^(n−1) + … by the Durand-Kerner iteration.
static void polynomial_roots(const double complex *e, size_t n, double complex *root) {
  for (size_t k = 0; k < n; k++) root[k] = 0.5 * cexp(I * (0.4 + 2 * pi * (double)k / (double)n));
  for (int turn = 0; turn < 200; turn++) {
    double moved = 0;
    for (size_t k = 0; k < n; k++) {
      double complex value = 1, others = 1;
      for (size_t i = 1; i <= n; i++) value = value * root[k] + e[i];
      for (size_t i = 0; i < n; i++) others *= i == k ? 1 : root[k] - root[i];
      if (others == 0) continue;
      root[k] -= value / others;
      moved = fmax(moved, cabs(value / others));
    }
    if (moved < 1e-15) return;
  }
}

size_t pb_zeros_inside(pb_zero_finder *f, double complex centre, double radius,
                       double complex *root) {
  double complex p[PB_ZEROS_INSIDE + 1], e[PB_ZEROS_INSIDE + 1];
  double doubt;
  if (!(radius > 0) || !moments(f, centre, radius, p, &doubt)) return 0;
  const double count = round(creal(p[0]));
  if (cabs(p[0] - count) > 1e-3 || count < 1 || count > PB_ZEROS_INSIDE) return 0;
  const size_t n = (size_t)count;
  const double complex mean = p[1] / count;
  from_power_sums(p, n, e);
  polynomial_roots(e, n, root);
  double spread = 0;
  for (size_t k = 0; k < n; k++) spread = fmax(spread, cabs(root[k] - mean));
  // A zero of order n splits by the n-th root of what H is wrong by.
  const bool one =
      spread * radius <= alike * pb_zero_scale(f, centre) || spread <= pow(doubt, 1 / count);
  for (size_t k = 0; k < n; k++) root[k] = centre + radius * (one ? mean : root[k]);
  return n;
}

// ---- clusters among the candidates --------------------------------------------------------------

// How far candidates of one zero may lie apart, and the largest circle around them, both relative;
// the wider, the higher the order.
typedef struct extent {
  double near, wide;
} extent;

static const extent extents[] = {{3e-3, 2e-2}, {1e-2, 8e-2}, {4e-2, 0.3}};

typedef struct clusters {
  pb_zero_finder *f;
  const double complex *lost;
  size_t count;
  double complex *pole;  // [channel->n]
  double band;
} clusters;

static const double apart = 0.4;  // of the distance to what must stay outside: the circle

// Mean and spread of the candidates and of the listed zeros near `seed`; conjugates count where
// they are near, too.
static double complex middle_of(const clusters *c, double complex seed, double near,
                                double *spread) {
  const double reach = near * pb_zero_scale(c->f, seed);
  const size_t total = c->count + c->f->count;
  double complex sum = 0;
  size_t members = 0;
  *spread = 0;
  if (cimag(seed) < reach) seed = creal(seed);
  for (size_t k = 0; k < total; k++) {
    double complex s = k < c->count ? c->lost[k] : c->f->zero[k - c->count];
    if (cimag(seed) == 0 && cimag(s) < reach) s = creal(s);
    if (cabs(s - seed) > reach) continue;
    sum += s;
    members++;
    *spread = fmax(*spread, cabs(s - seed));
  }
  return members ? sum / (double)members : seed;
}

// The nearest pole or zero that is not of the cluster.
static double clearance(const clusters *c, double complex centre, double near) {
  const double reach = near * pb_zero_scale(c->f, centre);
  double distance = INFINITY;
  for (size_t k = 0; k < c->f->channel->n; k++)
    distance = fmin(distance, cabs(c->pole[k] - centre));
  for (size_t k = 0; k < c->f->count; k++) {
    const double complex s = c->f->zero[k];
    const double both[2] = {cabs(s - centre), cabs(conj(s) - centre)};
    for (int i = 0; i < 2; i++)
      if (both[i] > 2 * reach) distance = fmin(distance, both[i]);
  }
  return distance;
}

// What is listed inside the circle gives way to what was counted there.
static void replace(clusters *c, double complex centre, double radius, const double complex *root,
                    size_t count) {
  pb_zero_finder *f = c->f;
  const double flat = alike * pb_zero_scale(f, centre);
  size_t left = 0;
  for (size_t k = 0; k < f->count; k++)
    if (cabs(f->zero[k] - centre) > radius) f->zero[left++] = f->zero[k];
  for (size_t k = 0; k < count; k++) {
    const double im = cimag(root[k]);
    if (im < -flat || (c->band > 0 && im > c->band)) continue;  // its conjugate stands for it
    f->zero[left++] = im <= flat ? creal(root[k]) : root[k];
  }
  f->count = left;
}

static size_t listed_inside(const pb_zero_finder *f, double complex centre, double radius) {
  size_t count = 0;
  for (size_t k = 0; k < f->count; k++) {
    const double complex s = f->zero[k];
    count += cabs(s - centre) <= radius;
    if (cimag(s) > 0) count += cabs(conj(s) - centre) <= radius;
  }
  return count;
}

// False: nothing was counted there.
static bool recover_within(clusters *c, double complex seed, const extent *e) {
  double complex root[PB_ZEROS_INSIDE];
  double spread;
  const double complex centre = middle_of(c, seed, e->near, &spread);
  const double scale = pb_zero_scale(c->f, centre);
  const double radius = fmin(e->wide * scale, apart * clearance(c, centre, e->near));
  // The origin, where H may vanish to any order, is judged by zeros.c.
  if (cabs(centre) < radius || radius < 3 * spread || radius < 10 * alike * scale) return false;
  const size_t listed = listed_inside(c->f, centre, radius);
  const size_t count = pb_zeros_inside(c->f, centre, radius, root);
  const bool equal = count > 1 && root[0] == root[1];
  if (count > listed || (count == listed && equal)) replace(c, centre, radius, root, count);
  return count > 0;
}

static void recover(clusters *c, double complex seed) {
  const size_t extent_count = sizeof extents / sizeof *extents;
  for (size_t k = 0; k < extent_count; k++)
    if (recover_within(c, seed, &extents[k])) return;
}

// Two that are listed apart, but so near to one another that they may be one of order two.
static bool has_neighbour(const pb_zero_finder *f, size_t at) {
  const double complex s = f->zero[at];
  for (size_t k = 0; k < f->count; k++) {
    const double distance = cabs(f->zero[k] - s);
    if (distance > 0 && distance < extents[0].near * pb_zero_scale(f, s)) return true;
  }
  const double twin = 2 * cimag(s);
  return twin > 0 && twin < extents[0].near * pb_zero_scale(f, s);
}

pb_status pb_zeros_recover(pb_zero_finder *f, const double complex *lost, size_t count, double band,
                           pb_error *err) {
  clusters c = {.f = f, .lost = lost, .count = count, .band = band};
  c.pole = malloc((f->channel->n + 1) * sizeof *c.pole);
  pb_status st = c.pole ? pb_channel_poles(f->channel, c.pole, err) : pb_fail_memory(err, "zeros");
  for (size_t k = 0; k < count && !st; k++) recover(&c, lost[k]);
  for (size_t k = 0; k < f->count && !st; k++)
    if (has_neighbour(f, k)) recover(&c, f->zero[k]);
  free(c.pole);
  return st;
}
