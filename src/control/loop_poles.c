// Closed-loop poles of small and large plants: see loop.h.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "control/loop.h"
#include "control/loop_internal.h"
#include "control/lti_ops.h"

static const double smallest_z = 0.3;  // poles below vanish within a few samples

pb_status pb_loop_all_poles(pb_loop_solver *s, double gain, double complex **z, size_t *count,
                            pb_error *err) {
  pb_lti controller = {0}, closed = {0};
  *z = NULL;
  pb_status status = pb_loop_check(&s->loop, gain, err);
  if (status == PB_OK) status = pb_loop_delayed_controller(&s->loop, gain, &controller, err);
  controller.dt = s->plant.dt;
  if (status == PB_OK) status = pb_lti_feedback(&s->plant, &controller, 1, &closed, err);
  if (status == PB_OK) {
    *count = closed.nx;
    *z = malloc((closed.nx + s->far_count + 1) * sizeof **z);
    status = *z ? pb_lti_poles(&closed, *z, err) : pb_fail_memory(err, "loop");
  }
  if (status != PB_OK) {
    free(*z);
    *z = NULL;
  }
  pb_lti_free(&controller);
  pb_lti_free(&closed);
  return status;
}

// Keeps the upper half plane within the band widened by `slack`; returns how many are left.
static size_t keep_band(double complex *z, size_t count, double rate, double f1, double f2,
                        double slack) {
  size_t kept = 0;
  for (size_t i = 0; i < count; i++) {
    if (fabs(cimag(z[i])) < 1e-12 * cabs(z[i])) z[i] = creal(z[i]);  // real but for rounding
    if (cimag(z[i]) < 0 || cabs(z[i]) < smallest_z) continue;
    double hz = cabs(pb_pole_s(z[i], rate)) / (2 * M_PI);
    if (hz >= f1 / slack && hz <= f2 * slack) z[kept++] = z[i];
  }
  return kept;
}

pb_status pb_loop_solver_poles(pb_loop_solver *s, double gain, double f1, double f2,
                               pb_pole_list *out, pb_error *err) {
  double complex *z;
  size_t count;
  double rate = s->loop.model->sample_rate;
  *out = (pb_pole_list){0};
  pb_status status = pb_loop_all_poles(s, gain, &z, &count, err);
  if (status != PB_OK) return status;
  if (!s->exact) {
    memcpy(z + count, s->far, s->far_count * sizeof *z);
    count = keep_band(z, count + s->far_count, rate, f1, f2, 1.25);
    status = pb_loop_make_exact(s, gain, z, &count, &out->lost, err);
  }
  if (status == PB_OK) {
    count = keep_band(z, count, rate, f1, f2, 1);
    out->item = malloc((count + 1) * sizeof *out->item);
    if (!out->item) status = pb_fail_memory(err, "loop");
  }
  for (size_t i = 0; status == PB_OK && i < count; i++) out->item[i] = pb_pole_from_z(z[i], rate);
  if (status == PB_OK) {
    out->count = count;
    pb_pole_sort(out->item, count);
  }
  free(z);
  return status;
}
