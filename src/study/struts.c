// McInroy's condition: see struts.h. Stiffnesses are static gains of the single part on its bench,
// so that parameters and elements are judged alike.
#include "study/struts.h"

#include <math.h>
#include <string.h>

#include "plant/template.h"
#include "study/template_part.h"

pb_strut_condition pb_strut_condition_make(double k, double length, double bending) {
  pb_strut_condition c = {.k = k, .length = length, .bending = bending};
  c.limit = k * length * length;
  c.margin = bending > 0 ? c.limit / bending : INFINITY;
  c.held = c.margin >= PB_STRUT_MARGIN;
  return c;
}

// Of the actuator: bottom fixed, force on top.
static pb_status axial_stiffness(const cJSON *file, const char *directory, double length, double *k,
                                 pb_error *err) {
  pb_element_source source;
  pb_bench_model bench = {0};
  double gain = NAN;
  pb_status status = pb_template_source(file, "actuator", directory, &source, err);
  if (status) return status;
  bool lumped = strcmp(pb_part_type(source.model), "super_element") != 0;
  if (lumped && !cJSON_AddNumberToObject(source.model, "length", length))
    status = pb_fail_memory(err, "actuator");
  if (!status)
    status = pb_actuator_bench_build(&source, &(pb_actuator_bench){0}, NULL, &bench, err);
  if (!status) status = pb_bench_gain(&bench, "F", "y", &gain, err);
  *k = 1 / gain;
  pb_bench_model_clear(&bench);
  pb_element_source_clear(&source);
  return status;
}

// Of a joint, about its stiffer axis.
static pb_status bending_stiffness(const cJSON *file, const char *key, const char *directory,
                                   double *k, pb_error *err) {
  double all[6];
  pb_status status = pb_template_joint(file, key, directory, all, err);
  if (!status) *k = fmax(all[3], all[4]);
  return status;
}

pb_status pb_strut_condition_find(const cJSON *file, const char *directory, pb_strut_condition *out,
                                  pb_error *err) {
  pb_hexapod h = {0};
  double k = 0, bottom = 0, top = 0;
  *out = (pb_strut_condition){0};
  pb_status status = pb_hexapod_read(file, &h, err);
  if (!status) status = axial_stiffness(file, directory, h.strut[0].length, &k, err);
  if (!status) status = bending_stiffness(file, "bottom_joint", directory, &bottom, err);
  if (!status) status = bending_stiffness(file, "top_joint", directory, &top, err);
  if (!status) *out = pb_strut_condition_make(k, h.strut[0].length, fmax(bottom, top));
  return status;
}
