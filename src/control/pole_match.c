// See pole_match.h.
#include "control/pole_match.h"

#include <math.h>

#include "control/assign.h"

static double reach_of(pb_pole wanted, double complex s) {
  return (0.005 + 0.3 * fabs(wanted.damping)) * cabs(s);
}

// In units of the reach; none at all costs 1, so that what is out of reach is never taken.
static double cost_of(pb_pole wanted, pb_pole found, double rate) {
  const double complex s = pb_pole_s(wanted.z, rate);
  const double distance = cabs(pb_pole_s(found.z, rate) - s), reach = reach_of(wanted, s);
  return distance < reach ? distance / reach : 2;
}

pb_status pb_pole_match(const pb_pole *wanted, size_t count, const pb_pole *found,
                        size_t found_count, double rate, pb_pole *of, pb_error *err) {
  static const pb_pole unknown = {.z = NAN, .hz = NAN, .damping = NAN};
  pb_assignment a = {0};
  for (size_t k = 0; k < count; k++) of[k] = unknown;
  if (count == 0 || found_count == 0) return PB_OK;
  const size_t columns = found_count + count;  // and one for each that has none
  pb_status status = pb_assignment_new(count, columns, &a, err);
  if (status != PB_OK) return status;
  for (size_t k = 0; k < count; k++)
    for (size_t j = 0; j < columns; j++)
      a.cost[k * columns + j] = j >= found_count      ? 1
                                : isnan(wanted[k].hz) ? 2
                                                      : cost_of(wanted[k], found[j], rate);
  pb_assignment_solve(&a);
  for (size_t k = 0; k < count; k++)
    if (a.column[k] < found_count) of[k] = found[a.column[k]];
  pb_assignment_clear(&a);
  return PB_OK;
}

size_t pb_pole_clusters(const pb_pole *pole, size_t count, double rate, double resolution,
                        size_t *cluster) {
  size_t clusters = 0;
  for (size_t k = 0; k < count; k++) cluster[k] = 0;
  for (size_t k = 0; k + 1 < count; k++) {
    const double distance = cabs(pb_pole_s(pole[k + 1].z, rate) - pb_pole_s(pole[k].z, rate));
    if (!(distance < 2 * M_PI * resolution)) continue;
    if (cluster[k] == 0) cluster[k] = ++clusters;
    cluster[k + 1] = cluster[k];
  }
  return clusters;
}
