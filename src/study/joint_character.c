// A flexible joint in six stiffnesses: see joint_character.h.
#include "study/joint_character.h"

#include <math.h>
#include <stdlib.h>

static const double body_mass = 1e-6;  // kg: the stiffnesses are static, the body only carries them

static double stiffness_of(double gain) {
  if (gain == 0) return INFINITY;
  return isfinite(gain) ? 1 / gain : 0;
}

static double largest_coupling(const double *g) {
  double worst = 0;
  for (size_t i = 0; i < 6; i++)
    for (size_t j = 0; j < 6; j++) {
      const double size = sqrt(fabs(g[7 * i] * g[7 * j]));
      if (i != j && isfinite(size) && size > 0) worst = fmax(worst, fabs(g[i * 6 + j]) / size);
    }
  return worst;
}

// The first mode is of the element alone where the body is light beside it.
static double first_mode(const pb_bench_model *b, double mass) {
  if (!(mass > 100 * body_mass)) return NAN;
  for (size_t i = 0; i < b->model->modes; i++)
    if (b->model->mode_hz[i] > 0) return b->model->mode_hz[i];
  return NAN;
}

pb_status pb_joint_characterize(const pb_element_source *source, pb_warnings *warnings,
                                pb_bench_model *bench, pb_joint_character *out, pb_error *err) {
  double gain[36];
  *out = (pb_joint_character){.resonance = NAN};
  pb_status st = pb_joint_bench_build(source, body_mass, warnings, bench, err);
  if (st) return st;
  st = pb_model_dc(bench->model, gain, err);
  if (st) {
    pb_bench_model_clear(bench);
    return st;
  }
  const pb_joint *joint = &bench->plant->connection[0].joint;
  if (joint->type == PB_JOINT_ELEMENT) out->mass = joint->super.element->health.mass;
  for (size_t i = 0; i < 6; i++) out->k[i] = stiffness_of(gain[7 * i]);
  out->coupling = largest_coupling(gain);
  out->resonance = first_mode(bench, out->mass);
  return PB_OK;
}
