// Margins of one loop, and the frequencies to look at: see margins.h.
#include "control/margins.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

// arg L + π in −π … π: the angle to the point −1 as seen from 0.
static double angle_to_minus_one(double complex l) {
  return carg(-l);
}

static void at_unit_gain(pb_margins *m, double hz, double complex l) {
  double phase = fabs(angle_to_minus_one(l)) * 180 / M_PI;
  m->crossover_hz = hz;
  if (phase < m->phase_degree) {
    m->phase_degree = phase;
    m->phase_hz = hz;
  }
}

static void at_real_axis(pb_margins *m, double hz, double re) {
  double factor = -1 / re;
  if (!(re < 0)) return;
  if (factor >= 1 && factor < m->gain_up) {
    m->gain_up = factor;
    m->gain_up_hz = hz;
  } else if (factor < 1 && factor > m->gain_down) {
    m->gain_down = factor;
    m->gain_down_hz = hz;
  }
}

// A peak that just touches 1, to rounding, is no crossing.
static bool above_unity(double log_gain) {
  return log_gain > 1e-6;
}

// Crossings between two neighbours: |L| by its logarithm, the angle linearly.
static void between(pb_margins *m, double f0, double f1, double complex l0, double complex l1) {
  double g0 = log(cabs(l0)), g1 = log(cabs(l1));
  if (above_unity(g0) != above_unity(g1)) {
    double part = fmin(fmax(g0 / (g0 - g1), 0), 1);
    double turn = carg(l1 / l0);
    at_unit_gain(m, f0 + part * (f1 - f0), l0 / cabs(l0) * cexp(CMPLX(0, part * turn)));
  }
  double a0 = angle_to_minus_one(l0), a1 = angle_to_minus_one(l1);
  // The same turn once more: from one side of the negative axis to the other, not through the
  // positive one.
  if ((a0 > 0) != (a1 > 0) && fabs(a1 - a0) < M_PI) {
    double part = a0 / (a0 - a1);
    at_real_axis(m, f0 + part * (f1 - f0), -exp(g0 + part * (g1 - g0)));
  }
}

pb_margins pb_margins_of(const double *hz, size_t nf, const double complex *l, size_t stride) {
  pb_margins m = {.crossover_hz = NAN,
                  .phase_degree = INFINITY,
                  .phase_hz = NAN,
                  .gain_up = INFINITY,
                  .gain_up_hz = NAN,
                  .gain_down_hz = NAN,
                  .modulus = INFINITY,
                  .modulus_hz = NAN};
  for (size_t f = 0; f < nf; f++) {
    double complex here = l[f * stride];
    double distance = cabs(1 + here);
    if (distance < m.modulus) {
      m.modulus = distance;
      m.modulus_hz = hz[f];
    }
    if (f > 0) between(&m, hz[f - 1], hz[f], l[(f - 1) * stride], here);
  }
  // At half the sample rate a sampled loop is real: it reaches the axis there without crossing it.
  double complex last = nf > 0 ? l[(nf - 1) * stride] : 0;
  if (fabs(cimag(last)) < 1e-9 * cabs(last)) at_real_axis(&m, hz[nf - 1], creal(last));
  return m;
}

static int ascending(const void *a, const void *b) {
  double p = *(const double *)a, q = *(const double *)b;
  return (p > q) - (p < q);
}

pb_status pb_margins_grid(double f1, double f2, size_t points, const pb_pole_list *poles,
                          double **hz, size_t *count, pb_error *err) {
  enum { AROUND = 13 };
  *count = 0;
  if (!(f1 > 0 && f1 < f2 && isfinite(f2)) || points < 2) {
    *hz = NULL;
    return pb_fail(err, PB_ERR_ARGUMENT, "margins", "%zu points in %g … %g Hz", points, f1, f2);
  }
  *hz = malloc((points + poles->count * AROUND) * sizeof **hz);
  if (!*hz) return pb_fail_memory(err, "margins");
  for (size_t k = 0; k < points; k++) {
    (*hz)[(*count)++] = f1 * pow(f2 / f1, (double)k / (double)(points - 1));
  }
  (*hz)[points - 1] = f2;
  for (size_t j = 0; j < poles->count; j++) {
    double center = poles->item[j].hz, width = fabs(poles->item[j].damping) * center;
    for (int k = -AROUND / 2; k <= AROUND / 2; k++) {
      double at = center + (k < 0 ? -width : width) * (k == 0 ? 0 : ldexp(1, abs(k) - 3));
      if (at > f1 && at < f2) (*hz)[(*count)++] = at;
    }
  }
  qsort(*hz, *count, sizeof **hz, ascending);
  size_t kept = 1;
  for (size_t k = 1; k < *count; k++) {
    if ((*hz)[k] > (*hz)[kept - 1] * (1 + 1e-12)) (*hz)[kept++] = (*hz)[k];
  }
  *count = kept;
  return PB_OK;
}
