// Where K itself says that the frames are.
//
// The null space of a free element's K is its six rigid motions. Normalised to a unit motion (v, θ)
// of frame 0, frame i moves by u = Q_i (v + θ × d_i), θ_i = Q_i θ: Q_i tells how its axes are
// turned and d_i where it is, both seen from frame 0. The null space is taken from K φ = ω² M φ, in
// which rounded matrices still keep it apart from the flexible modes.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"
#include "plant/element_doctor_internal.h"

// ---- null space ---------------------------------------------------------------------------------

// Columns of the six smallest eigenvalues by magnitude among ascending signed frequencies: they are
// neighbours. Returns the first; *gap: the largest of them against the next one.
static size_t lowest_six(const double *hz, size_t n, double *gap) {
  size_t first = 0;
  while (first + 6 < n && fabs(hz[first]) > fabs(hz[first + 6])) first++;
  double within = fmax(fabs(hz[first]), fabs(hz[first + 5])), next = INFINITY;
  if (first + 6 < n) next = fabs(hz[first + 6]);
  if (first > 0) next = fmin(next, fabs(hz[first - 1]));
  *gap = next > 0 ? within / next : 1;
  return first;
}

// The motion of every frame for unit motions of frame 0: v (n × 6) ← v A⁻¹, A its first six rows.
static bool normalise(double *v, size_t n) {
  int six = 6, pivot[6], info;
  double a[36], inverse[36] = {0};
  for (size_t j = 0; j < 6; j++) {
    inverse[7 * j] = 1;
    for (size_t i = 0; i < 6; i++) a[i + 6 * j] = v[i + j * n];
  }
  dgesv_(&six, &six, a, &six, pivot, inverse, &six, &info);
  if (info) return false;
  for (size_t i = 0; i < n; i++) {
    double row[6];
    for (size_t j = 0; j < 6; j++) {
      row[j] = 0;
      for (size_t l = 0; l < 6; l++) row[j] += v[i + l * n] * inverse[l + 6 * j];
    }
    for (size_t j = 0; j < 6; j++) v[i + j * n] = row[j];
  }
  return true;
}

// One frame's rotation and place out of its 6 × 6 block. What is left over is its misfit: *turn of
// the rotations, *skew (m) of the arms.
static void read_block(const double *v, size_t n, size_t frame, double *d, double *q, double *turn,
                       double *skew) {
  const double *b = v + 6 * frame;
  double s[9];
  for (size_t j = 0; j < 3; j++)
    for (size_t i = 0; i < 3; i++) q[i + 3 * j] = b[i + j * n];
  for (size_t j = 0; j < 3; j++) {
    for (size_t i = 0; i < 3; i++) {
      double product = 0, unit = 0;
      for (size_t l = 0; l < 3; l++) {
        product += q[l + 3 * i] * b[l + (3 + j) * n];
        unit += q[l + 3 * i] * q[l + 3 * j];
      }
      s[i + 3 * j] = product;
      *turn = fmax(*turn, fabs(unit - (i == j)));
      *turn = fmax(*turn, fabs(b[3 + i + (3 + j) * n] - q[i + 3 * j]));
    }
  }
  d[0] = 0.5 * (s[1 + 6] - s[2 + 3]);
  d[1] = 0.5 * (s[2] - s[0 + 6]);
  d[2] = 0.5 * (s[0 + 3] - s[1]);
  for (size_t j = 0; j < 3; j++)
    for (size_t i = 0; i <= j; i++) *skew = fmax(*skew, 0.5 * fabs(s[i + 3 * j] + s[j + 3 * i]));
}

static double reach(const double *p, size_t frames) {
  double most = 0;
  for (size_t i = 0; i < 3 * frames; i++) most = fmax(most, fabs(p[i]));
  return most;
}

pb_status pb_placement_solve(const char *name, const pb_element_data *e, pb_placement *out,
                             pb_error *err) {
  *out = (pb_placement){0};
  size_t n = e->size;
  double *hz = malloc(n * sizeof *hz), *shape = malloc(n * n * sizeof *shape), gap;
  out->position = malloc(3 * e->frames * sizeof *out->position);
  out->rotation = malloc(9 * e->frames * sizeof *out->rotation);
  bool ok = hz && shape && out->position && out->rotation;
  pb_status st = ok ? PB_OK : pb_fail_memory(err, name);
  if (!st) st = pb_measure_modes(name, n, e->k, e->m, hz, shape, err);
  if (!st) {
    double *v = shape + lowest_six(hz, n, &gap) * n;
    out->found = gap < 0.3 && normalise(v, n);
    double turn = gap * gap, skew = 0;
    for (size_t f = 0; out->found && f < e->frames; f++)
      read_block(v, n, f, out->position + 3 * f, out->rotation + 9 * f, &turn, &skew);
    double arm = fmax(reach(out->position, out->found ? e->frames : 0), 1e-6);
    out->misfit = fmax(turn, skew / arm);
  }
  free(hz);
  free(shape);
  if (st) pb_placement_clear(out);
  return st;
}

void pb_placement_clear(pb_placement *placement) {
  free(placement->position);
  free(placement->rotation);
  *placement = (pb_placement){0};
}
