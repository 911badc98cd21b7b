// Margins of one loop, and the frequencies to look at: see margins.h.
#include "control/margins.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "control/arc.h"

// arg L + π in −π … π: the angle to the point −1 as seen from 0.
static double angle_to_minus_one(double complex l) {
  return carg(-l);
}

static void at_unit_gain(pb_margins *m, double hz, double complex l) {
  const double angle = angle_to_minus_one(l), phase = fabs(angle) * 180 / M_PI;
  // Delay turns L clockwise.
  const double delay = (angle > 0 ? angle : angle + 2 * M_PI) / (2 * M_PI * hz);
  m->crossover_hz = hz;
  if (delay < m->delay) {
    m->delay = delay;
    m->delay_hz = hz;
  }
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

static bool is_above(double complex l) {
  return above_unity(log(cabs(l)));
}

static bool is_beyond(double complex l) {
  return angle_to_minus_one(l) > 0;
}

// Where a side changes between 0 and x1, by bisection.
static double change(const pb_arc *a, double x1, bool side(double complex)) {
  double low = 0, high = x1;
  bool first = side(a->l);
  for (int k = 0; k < 50; k++) {
    double middle = 0.5 * (low + high);
    *(side(pb_arc_at(a, middle)) == first ? &low : &high) = middle;
  }
  return high;
}

// Crossings between points f and f + 1.
static void between(pb_margins *m, const double *hz, size_t nf, const double complex *l,
                    size_t stride, size_t f) {
  double complex l0 = l[f * stride], l1 = l[(f + 1) * stride];
  double x1 = hz[f + 1] - hz[f];
  pb_arc a = pb_arc_of(hz, nf, l, stride, f);
  if (is_above(l0) != is_above(l1)) {
    double x = change(&a, x1, is_above);
    at_unit_gain(m, hz[f] + x, pb_arc_at(&a, x));
  }
  // From one side of the negative axis to the other, not through the positive one.
  double turn = angle_to_minus_one(l1) - angle_to_minus_one(l0);
  if (is_beyond(l0) != is_beyond(l1) && fabs(turn) < M_PI) {
    double x = change(&a, x1, is_beyond);
    at_real_axis(m, hz[f] + x, creal(pb_arc_at(&a, x)));
  }
}

// The least |1 + L| between points f and f + 1, by golden section: there is one turn between
// neighbours at most.
static void nearest(pb_margins *m, const double *hz, size_t nf, const double complex *l,
                    size_t stride, size_t f) {
  static const double ratio = 0.6180339887498949;
  double low = 0, high = hz[f + 1] - hz[f];
  pb_arc a = pb_arc_of(hz, nf, l, stride, f);
  for (int k = 0; k < 60; k++) {
    double left = high - ratio * (high - low), right = low + ratio * (high - low);
    if (cabs(1 + pb_arc_at(&a, left)) < cabs(1 + pb_arc_at(&a, right)))
      high = right;
    else
      low = left;
  }
  double x = 0.5 * (low + high), distance = cabs(1 + pb_arc_at(&a, x));
  if (!(distance < m->modulus)) return;
  m->modulus = distance;
  m->modulus_hz = hz[f] + x;
}

static void refine_modulus(pb_margins *m, const double *hz, size_t nf, const double complex *l,
                           size_t stride) {
  size_t at = 0;
  while (at < nf && hz[at] != m->modulus_hz) at++;
  if (at > 0 && at < nf) nearest(m, hz, nf, l, stride, at - 1);
  if (at + 1 < nf) nearest(m, hz, nf, l, stride, at);
}

// At 0 Hz and at half the sample rate a loop is real: it reaches the axis without crossing it.
static void at_end(pb_margins *m, double hz, double complex l) {
  if (fabs(cimag(l)) < 1e-9 * cabs(l)) at_real_axis(m, hz, creal(l));
}

pb_margins pb_margins_of(const double *hz, size_t nf, const double complex *l, size_t stride) {
  pb_margins m = {.crossover_hz = NAN,
                  .phase_degree = INFINITY,
                  .phase_hz = NAN,
                  .gain_up = INFINITY,
                  .gain_up_hz = NAN,
                  .gain_down_hz = NAN,
                  .delay = INFINITY,
                  .delay_hz = NAN,
                  .modulus = INFINITY,
                  .modulus_hz = NAN};
  for (size_t f = 0; f < nf; f++) {
    double complex here = l[f * stride];
    double distance = cabs(1 + here);
    if (distance < m.modulus) {
      m.modulus = distance;
      m.modulus_hz = hz[f];
    }
    if (f + 1 < nf) between(&m, hz, nf, l, stride, f);
  }
  refine_modulus(&m, hz, nf, l, stride);
  if (nf > 0 && hz[0] == 0) at_end(&m, 0, l[0]);
  if (nf > 0) at_end(&m, hz[nf - 1], l[(nf - 1) * stride]);
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
