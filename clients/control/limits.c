// What limits the bandwidth that is reached: see control_tool.h.
#include <math.h>
#include <stdlib.h>

#include "control_tool.h"

static const double meant = 0.1;  // relative: a crossover so near to the one asked for is it

// Where, from the bandwidth on, the loop comes nearest to 1: the gains are made so that it touches.
static double touching_hz(const control_design *d, const control_judgement *j, size_t loop) {
  double largest = 0, hz = NAN;
  for (size_t f = 0; f < j->nf; f++) {
    const double size = cabs(j->l[(f * d->n + loop) * d->n + loop]);
    if (j->hz[f] < d->shape.bandwidth_hz || size <= largest) continue;
    largest = size;
    hz = j->hz[f];
  }
  return hz;
}

static double size_near(const control_design *d, const control_judgement *j, size_t loop,
                        double hz) {
  size_t f = 0;
  while (f + 1 < j->nf && j->hz[f] < hz) f++;
  return cabs(j->l[(f * d->n + loop) * d->n + loop]);
}

pb_status control_limits_find(const control_design *d, const control_judgement *j,
                              control_limit **out, pb_error *err) {
  pb_pole_list poles = {0};
  control_limit *limit = *out = calloc(d->n, sizeof *limit);
  if (!limit) return pb_fail_memory(err, "limits");
  pb_status status = control_near_poles(d, &poles, err);
  for (size_t i = 0; i < d->n && status == PB_OK; i++) {
    const double asked = d->shape.bandwidth_hz, reached = j->margins[i].crossover_hz;
    limit[i] = (control_limit){.hz = NAN, .missed = !(fabs(reached / asked - 1) < meant)};
    if (!limit[i].missed) continue;
    limit[i].hz = touching_hz(d, j, i);
    limit[i].short_db = -20 * log10(size_near(d, j, i, asked));
    for (size_t k = 0; k < poles.count; k++) {
      const pb_pole *p = &poles.item[k];
      const bool nearer = fabs(p->hz - limit[i].hz) < fabs(limit[i].mode.hz - limit[i].hz);
      if (k == 0 || nearer) limit[i].mode = *p;
    }
  }
  pb_pole_list_clear(&poles);
  if (status != PB_OK) {
    free(limit);
    *out = NULL;
  }
  return status;
}
