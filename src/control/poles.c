// Poles of sampled systems as frequency and damping: see poles.h.
#include "control/poles.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>

double complex pb_pole_s(double complex z, double sample_rate) {
  return clog(z) * sample_rate;
}

pb_pole pb_pole_from_z(double complex z, double sample_rate) {
  double complex s = pb_pole_s(z, sample_rate);
  double size = cabs(s);
  return (pb_pole){.z = z, .hz = size / (2 * M_PI), .damping = size > 0 ? -creal(s) / size : 0};
}

double pb_pole_damped_hz(pb_pole p) {
  return fabs(p.damping) < 1 ? p.hz * sqrt(1 - p.damping * p.damping) : NAN;
}

void pb_pole_format(pb_pole p, double sample_rate, char *text, size_t size) {
  const bool oscillates = fabs(p.damping) < 0.999 && p.hz <= sample_rate / 2;
  if (oscillates)
    snprintf(text, size, "%.6g Hz with damping %.3g %%", p.hz, 100 * p.damping);
  else if (fabs(cimag(p.z)) > 1e-12 * cabs(p.z))
    snprintf(text, size, "z = %.6g%+.6gi", creal(p.z), cimag(p.z));
  else
    snprintf(text, size, "z = %.6g", creal(p.z));
}

static int by_frequency(const void *a, const void *b) {
  const pb_pole *p = a, *q = b;
  if (p->hz != q->hz) return p->hz < q->hz ? -1 : 1;
  return (p->damping > q->damping) - (p->damping < q->damping);
}

void pb_pole_sort(pb_pole *pole, size_t count) {
  if (count > 0) qsort(pole, count, sizeof *pole, by_frequency);
}

void pb_pole_list_clear(pb_pole_list *list) {
  if (!list) return;
  free(list->item);
  *list = (pb_pole_list){0};
}
