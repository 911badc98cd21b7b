// Roots of det(I − L(z)) on the whole plant, from starting values: see loop.h.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "control/loop.h"
#include "control/loop_internal.h"
#include "control/lti_ops.h"
#include "signal/small_solve.h"

enum { MAX_ITERATIONS = 60 };
// A root counts as found when its s stands still to this part: a double root cannot do much better.
static const double good_enough = 1e-4;
static const double doubtful_z = 0.8;  // starts below may be the reduction's own

// κ(z) and κ'(z) from K and K', in place.
static void delay_controller(const pb_loop_solver *s, double gain, double complex z) {
  size_t n = s->loop.controller->ny * s->loop.controller->nu;
  double complex factor = gain * s->loop.sign * cpow(z, -(double)s->loop.delay);
  for (size_t i = 0; i < n; i++) {
    s->dk[i] = factor * (s->dk[i] - s->loop.delay * s->k[i] / z);
    s->k[i] *= factor;
  }
}

// p'/p at z; false where it cannot be evaluated (on an open-loop pole, or a converged root).
static bool log_derivative(pb_loop_solver *s, double gain, double complex z,
                           double complex *value) {
  size_t n = s->loop.controller->ny, nk = s->loop.controller->nu;
  double complex sum = 0;
  for (size_t j = 0; j < s->open_count; j++) sum += 1 / (z - s->open[j]);
  if (s->loop.delay + s->delays > 0) sum += (double)(n * s->loop.delay + s->delays) / z;
  pb_model_evaluate(&s->channels, PB_SAMPLED, z, s->h, s->dh);
  if (pb_lti_evaluate(s->loop.controller, z, s->k, s->dk, NULL) != PB_OK) return false;
  delay_controller(s, gain, z);
  for (size_t c = 0; c < n; c++) {
    for (size_t r = 0; r < n; r++) {
      double complex l = 0, dl = 0;
      for (size_t k = 0; k < nk; k++) {
        l += s->k[r * nk + k] * s->h[k * n + c];
        dl += s->dk[r * nk + k] * s->h[k * n + c] + s->k[r * nk + k] * s->dh[k * n + c];
      }
      s->m[r + c * n] = (r == c) - l;
      s->rhs[r + c * n] = dl;
    }
  }
  if (!pb_small_solve(n, n, s->m, s->rhs)) return false;
  for (size_t r = 0; r < n; r++) sum -= s->rhs[r + r * n];
  *value = sum;
  return isfinite(creal(sum)) && isfinite(cimag(sum));
}

// Far from the root a correction is only a direction: a fraction of |s| T ≈ |z − 1| is enough.
static double complex limited(double complex step, double complex z) {
  double size = cabs(step), limit = 0.1 * cabs(z - 1);
  return size > limit ? step * (limit / size) : step;
}

// One correction of root i, pushed away from the others (Aberth); returns its size relative to |z|,
// 0 when it stays where it is.
static double correct(pb_loop_solver *s, double gain, double complex *z, size_t count, size_t i) {
  double complex ratio, others = 0;
  if (!log_derivative(s, gain, z[i], &ratio)) return 0;
  for (size_t j = 0; j < count; j++) {
    if (j != i && z[j] != z[i]) others += 1 / (z[i] - z[j]);
  }
  double complex step = 1 / (ratio - others);
  double size = cabs(step);
  if (!isfinite(size)) return 0;
  z[i] -= limited(step, z[i]);
  return size / cabs(z[i]);
}

// Off an open-loop pole that the loop does not move, where the determinant has no value; each start
// in its own direction, or the starts of a double pole would push each other away.
static void spread_starts(double complex *z, size_t count) {
  for (size_t i = 0; i < count; i++) {
    double angle = 2.4 * (double)i;
    z[i] += 1e-4 * cabs(z[i] - 1) * CMPLX(cos(angle), cimag(z[i]) == 0 ? 0 : sin(angle));
  }
}

// Makes the roots z[count] exact on the whole plant; last[count]: size of each last correction.
static void iterate(pb_loop_solver *s, double gain, double complex *z, size_t count, double *last) {
  for (size_t i = 0; i < count; i++) last[i] = INFINITY;
  spread_starts(z, count);
  for (int it = 0; it < MAX_ITERATIONS; it++) {
    size_t moving = 0;
    for (size_t i = 0; i < count; i++) {
      if (last[i] < 1e-12) continue;
      last[i] = correct(s, gain, z, count, i);
      moving += last[i] >= 1e-12;
    }
    if (moving == 0) return;
  }
}

static bool has_converged(double complex z, double last) {
  return last * cabs(z) < good_enough * cabs(z - 1);
}

// Takes out what did not converge, and counts it. The static terms of the reduced plant act a
// sample late and add a state a loop: as many starts belong to nothing. Well inside the circle any
// may.
static size_t drop_unconverged(const pb_loop_solver *s, double complex *z, size_t *count,
                               const double complex *start, const double *last) {
  size_t kept = 0, lost = 0;
  for (size_t i = 0; i < *count; i++) {
    bool converged = has_converged(z[i], last[i]);
    if (converged) z[kept++] = z[i];
    lost += !converged && cabs(start[i]) >= doubtful_z;
  }
  *count = kept;
  size_t spurious = s->loop.controller->ny;
  return lost > spurious ? lost - spurious : 0;
}

pb_status pb_loop_make_exact(pb_loop_solver *s, double gain, double complex *z, size_t *count,
                             size_t *lost, pb_error *err) {
  double complex *start = malloc((*count + 1) * sizeof *start);
  double *last = malloc((*count + 1) * sizeof *last);
  pb_status status = start && last ? PB_OK : pb_fail_memory(err, "loop");
  if (status == PB_OK) {
    memcpy(start, z, *count * sizeof *start);
    iterate(s, gain, z, *count, last);
    *lost = drop_unconverged(s, z, count, start, last);
  }
  free(start);
  free(last);
  return status;
}

pb_status pb_loop_refine_roots(pb_loop_solver *s, double gain, double complex *z, size_t count,
                               bool *lost, pb_error *err) {
  double *last = malloc((count + 1) * sizeof *last);
  if (!last) return pb_fail_memory(err, "loop");
  iterate(s, gain, z, count, last);
  for (size_t i = 0; i < count; i++) lost[i] = !has_converged(z[i], last[i]);
  free(last);
  return PB_OK;
}
