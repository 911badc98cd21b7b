// Poles of sampled systems as frequency and damping: see poles.h.
#include "control/poles.h"

#include <math.h>
#include <stdlib.h>

double complex pb_pole_s(double complex z, double sample_rate) {
  return clog(z) * sample_rate;
}

pb_pole pb_pole_from_z(double complex z, double sample_rate) {
  double complex s = pb_pole_s(z, sample_rate);
  double size = cabs(s);
  return (pb_pole){.z = z, .hz = size / (2 * M_PI), .damping = size > 0 ? -creal(s) / size : 0};
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
