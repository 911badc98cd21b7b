// Root locus: see rootlocus.h.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "control/pole_track.h"
#include "control/rootlocus_internal.h"

void pb_rootlocus_clear(pb_rootlocus *locus) {
  if (!locus) return;
  free(locus->gain);
  free(locus->pole);
  free(locus->is_mode);
  free(locus->smallest);
  *locus = (pb_rootlocus){0};
}

pb_status pb_rootlocus_new(size_t gains, size_t branches, pb_rootlocus *out, pb_error *err) {
  *out = (pb_rootlocus){.gains = gains, .branches = branches};
  out->gain = malloc(gains * sizeof *out->gain);
  out->pole = malloc((branches * gains + 1) * sizeof *out->pole);
  out->is_mode = calloc(branches + 1, sizeof *out->is_mode);
  out->smallest = malloc(gains * sizeof *out->smallest);
  if (out->gain && out->pole && out->is_mode && out->smallest) return PB_OK;
  pb_rootlocus_clear(out);
  return pb_fail_memory(err, "root locus");
}

void pb_rootlocus_find_smallest(pb_rootlocus *l, size_t k) {
  double smallest = INFINITY;
  for (size_t b = 0; b < l->branches; b++) {
    const pb_pole *p = &l->pole[b * l->gains + k];
    if (l->is_mode[b]) smallest = fmin(smallest, isnan(p->hz) ? -1 : p->damping);
  }
  l->smallest[k] = smallest;
}

pb_status pb_rootlocus_follow(pb_loop_solver *s, pb_rootlocus *l, pb_error *err) {
  pb_pole_track track = {0};
  double complex *z = malloc((l->branches + 1) * sizeof *z);
  for (size_t b = 0; z && b < l->branches; b++) z[b] = l->pole[b * l->gains].z;
  pb_status status = z ? pb_pole_track_start(s, l->gain[0], z, l->branches, &track, err)
                       : pb_fail_memory(err, "root locus");
  for (size_t k = 0; k < l->gains && status == PB_OK; k++) {
    if (k > 0) status = pb_pole_track_advance(&track, l->gain[k], err);
    for (size_t b = 0; k > 0 && b < l->branches && status == PB_OK; b++)
      l->pole[b * l->gains + k] = pb_pole_track_get(&track, b);
    if (status == PB_OK) pb_rootlocus_find_smallest(l, k);
  }
  pb_pole_track_clear(&track);
  free(z);
  return status;
}

// Whether z is a lightly damped pole of the plant in the band. Judged by the continuous poles: a
// mode above half the sample rate appears in the band under another mode's frequency.
static bool is_plant_mode(const double complex *pole, size_t count, double rate, double f1,
                          double f2, double complex z) {
  for (size_t k = 0; k < count; k++) {
    double hz = cabs(pole[k]) / (2 * M_PI);
    bool light = cimag(pole[k]) > 0 && -creal(pole[k]) < 0.7 * cabs(pole[k]);
    if (light && hz >= f1 && hz <= f2 && hz < rate / 2 && cabs(cexp(pole[k] / rate) - z) < 1e-8)
      return true;
  }
  return false;
}

// A locus of `gains` points whose branches start at the open-loop poles of the band.
pb_status pb_rootlocus_start(pb_loop_solver *s, size_t gains, double f1, double f2,
                             pb_rootlocus *out, pb_error *err) {
  const pb_model *m = pb_loop_solver_loop(s)->model;
  pb_pole_list list = {0};
  double complex *pole = malloc((m->nx + 1) * sizeof *pole);
  pb_status status =
      pole ? pb_model_poles(m, PB_CONTINUOUS, pole, err) : pb_fail_memory(err, "root locus");
  if (status == PB_OK) status = pb_loop_solver_poles(s, 0, f1, f2, &list, err);
  if (status == PB_OK) status = pb_rootlocus_new(gains, list.count, out, err);
  for (size_t b = 0; status == PB_OK && b < list.count; b++) {
    out->pole[b * gains] = list.item[b];
    out->is_mode[b] = is_plant_mode(pole, m->nx, m->sample_rate, f1, f2, list.item[b].z);
  }
  free(pole);
  pb_pole_list_clear(&list);
  return status;
}

pb_status pb_rootlocus_compute(pb_loop_solver *s, const double *gain, size_t gains, double f1,
                               double f2, pb_rootlocus *out, pb_error *err) {
  *out = (pb_rootlocus){0};
  bool ascending =
      gains > 0 && f1 < f2 && isfinite(f2) && gain[0] >= 0 && isfinite(gain[gains - 1]);
  for (size_t k = 1; k < gains; k++) ascending = ascending && gain[k] > gain[k - 1];
  if (!ascending) {
    return pb_fail(err, PB_ERR_ARGUMENT, "root locus", "gains do not ascend, or band %g … %g Hz",
                   f1, f2);
  }
  // Gain 0 is put in front when it is not there, and taken out again below.
  size_t extra = gain[0] > 0;
  pb_rootlocus l = {0};
  pb_status status = pb_rootlocus_start(s, gains + extra, f1, f2, &l, err);
  if (status == PB_OK) {
    l.gain[0] = 0;
    memcpy(l.gain + extra, gain, gains * sizeof *gain);
    status = pb_rootlocus_follow(s, &l, err);
  }
  if (status == PB_OK) status = pb_rootlocus_new(gains, l.branches, out, err);
  if (status == PB_OK) {
    memcpy(out->gain, gain, gains * sizeof *gain);
    memcpy(out->smallest, l.smallest + extra, gains * sizeof *out->smallest);
    memcpy(out->is_mode, l.is_mode, l.branches * sizeof *out->is_mode);
    for (size_t b = 0; b < l.branches; b++) {
      memcpy(out->pole + b * gains, l.pole + b * l.gains + extra, gains * sizeof *out->pole);
    }
  }
  pb_rootlocus_clear(&l);
  return status;
}
