// A response near a few neighbours of a grid: (l + b x)/(1 + c x), x Hz from the first of them.
// Beside one resonance, and far from all, it is very nearly of this form. Not for tools.
#ifndef PB_CONTROL_ARC_H
#define PB_CONTROL_ARC_H

#include <complex.h>
#include <math.h>
#include <stddef.h>

typedef struct pb_arc {
  double complex l, b, c;
} pb_arc;

// Through three points, at 0, x1 and x2; a straight line through the first two where there is none.
static inline pb_arc pb_arc_through(double x1, double x2, double complex l0, double complex l1,
                                    double complex l2) {
  double complex slope1 = (l1 - l0) / x1, slope2 = (l2 - l0) / x2;
  double complex c = (slope1 - slope2) / (l2 - l1);
  if (!isfinite(cabs(c))) c = 0;
  return (pb_arc){l0, slope1 + c * l1, c};
}

static inline double complex pb_arc_at(const pb_arc *a, double x) {
  return (a->l + a->b * x) / (1 + a->c * x);
}

// That of l[f · stride] at hz[nf], from point f to f + 1, with the point after or before them.
static inline pb_arc pb_arc_of(const double *hz, size_t nf, const double complex *l, size_t stride,
                               size_t f) {
  size_t third = f + 2 < nf ? f + 2 : f > 0 ? f - 1 : f + 1;
  return pb_arc_through(hz[f + 1] - hz[f], hz[third] - hz[f], l[f * stride], l[(f + 1) * stride],
                        l[third * stride]);
}

#endif
