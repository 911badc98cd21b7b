// What plantbus-part doctor says of an element: a table of its states, or one JSON object.
#include <math.h>
#include <stdio.h>

#include "doctor.h"
#include "jsonout.h"
#include "table.h"

// ---- text ---------------------------------------------------------------------------------------

static void row_of_counts(pb_table *t, const doctor_visit *v, const char *name,
                          double (*of)(const doctor_stage *)) {
  pb_table_text(t, name);
  for (size_t k = 0; k < v->stages; k++) pb_table_count(t, (size_t)of(&v->stage[k]));
}

static void row(pb_table *t, const doctor_visit *v, const char *name,
                double (*of)(const doctor_stage *)) {
  pb_table_text(t, name);
  for (size_t k = 0; k < v->stages; k++) pb_table_number(t, of(&v->stage[k]));
}

static double digits_k(const doctor_stage *s) {
  return s->d.digits_k;
}
static double digits_m(const doctor_stage *s) {
  return s->d.digits_m;
}
static double asymmetry(const doctor_stage *s) {
  return fmax(s->d.asymmetry_k, s->d.asymmetry_m);
}
static double translation(const doctor_stage *s) {
  return s->d.translation_residual;
}
static double rotation(const doctor_stage *s) {
  return s->d.rotation_residual;
}
static double rigid(const doctor_stage *s) {
  return s->d.rigid_hz[5];
}
static double flexible(const doctor_stage *s) {
  return s->d.flexible_hz;
}
static double mass(const doctor_stage *s) {
  return s->d.mass;
}
static double held_1(const doctor_stage *s) {
  return s->held.hz[0];
}
static double held_2(const doctor_stage *s) {
  return s->held.hz[1];
}
static double axial(const doctor_stage *s) {
  return s->held.axial_hz;
}

static double lowest(const doctor_stage *s) {
  double least = s->d.rigid_hz[0];
  for (int k = 1; k < 6; k++) least = fmin(least, s->d.rigid_hz[k]);
  return least;
}

static pb_status print_table(const doctor_visit *v, pb_error *err) {
  pb_table t = {0};
  char held[64];
  pb_table_text_column(&t, "");
  for (size_t k = 0; k < v->stages; k++) pb_table_number_column(&t, v->stage[k].name, NULL, 5);
  row_of_counts(&t, v, "significant digits of K", digits_k);
  row_of_counts(&t, v, "significant digits of M", digits_m);
  row(&t, v, "asymmetry", asymmetry);
  row(&t, v, "K against translations", translation);
  row(&t, v, "K against rotations", rotation);
  row(&t, v, "rigid motions, largest [Hz]", rigid);
  row(&t, v, "rigid motions, lowest [Hz]", lowest);
  row(&t, v, "first flexible mode, free [Hz]", flexible);
  snprintf(held, sizeof held, "frame %zu held: mode 1 [Hz]", v->o->base + 1);
  row(&t, v, held, held_1);
  snprintf(held, sizeof held, "frame %zu held: mode 2 [Hz]", v->o->base + 1);
  row(&t, v, held, held_2);
  row(&t, v, "axial mode [Hz]", axial);
  row(&t, v, "mass [kg]", mass);
  pb_status st = pb_table_print(&t, stdout, 0, err);
  pb_table_free(&t);
  return st;
}

static pb_status print_text(const doctor_visit *v, pb_error *err) {
  const pb_diagnosis *d = &v->stage[0].d;
  printf("%s: %zu frames, %zu modes\n\n", v->o->in.file[0], d->frames, d->size - 6 * d->frames);
  pb_status st = print_table(v, err);
  putchar('\n');
  for (size_t k = 0; k < d->findings; k++)
    printf("%s: %s\n    %s%s\n", pb_finding_name(d->finding[k].code), d->finding[k].saw,
           !d->finding[k].curable ? ""
           : v->o->repair         ? "repair "
                                  : "--repair ",
           d->finding[k].would);
  if (!d->findings) puts("sound: nothing to repair");
  if (v->stages == 3 && !v->o->doctor.weighted)
    puts("'weighted' is what --weighted would make of it.");
  if (v->written) printf("written to %s\n", v->o->out);
  return st;
}

// ---- JSON ---------------------------------------------------------------------------------------

static void stage_json(pb_jsonout *json, const doctor_stage *s) {
  pb_jsonout_object(json, NULL);
  pb_jsonout_text(json, "state", s->name);
  pb_jsonout_integer(json, "digits_k", (uint64_t)s->d.digits_k);
  pb_jsonout_integer(json, "digits_m", (uint64_t)s->d.digits_m);
  pb_jsonout_number(json, "asymmetry_k", s->d.asymmetry_k);
  pb_jsonout_number(json, "asymmetry_m", s->d.asymmetry_m);
  pb_jsonout_number(json, "translation_residual", s->d.translation_residual);
  pb_jsonout_number(json, "rotation_residual", s->d.rotation_residual);
  pb_jsonout_number(json, "mass_smallest_eigenvalue", s->d.mass_smallest);
  pb_jsonout_numbers(json, "rigid_hz", s->d.rigid_hz, 6);
  pb_jsonout_number(json, "flexible_hz", s->d.flexible_hz);
  pb_jsonout_numbers(json, "held_hz", s->held.hz, 4);
  pb_jsonout_number(json, "axial_hz", s->held.axial_hz);
  pb_jsonout_number(json, "mass", s->d.mass);
  pb_jsonout_object_end(json);
}

static void print_json(const doctor_visit *v) {
  const pb_diagnosis *d = &v->stage[0].d;
  pb_jsonout json;
  pb_jsonout_begin(&json, stdout);
  pb_jsonout_object(&json, NULL);
  pb_jsonout_text(&json, "file", v->o->in.file[0]);
  pb_jsonout_boolean(&json, "sound", !d->findings);
  pb_jsonout_boolean(&json, "curable", doctor_all_curable(d));
  pb_jsonout_boolean(&json, "repaired", v->written && v->cured.k);
  pb_jsonout_number(&json, "change", d->change);
  pb_jsonout_array(&json, "findings");
  for (size_t k = 0; k < d->findings; k++) {
    pb_jsonout_object(&json, NULL);
    pb_jsonout_text(&json, "finding", pb_finding_name(d->finding[k].code));
    pb_jsonout_boolean(&json, "curable", d->finding[k].curable);
    pb_jsonout_text(&json, "saw", d->finding[k].saw);
    pb_jsonout_text(&json, "would", d->finding[k].would);
    pb_jsonout_object_end(&json);
  }
  pb_jsonout_array_end(&json);
  pb_jsonout_array(&json, "states");
  for (size_t k = 0; k < v->stages; k++) stage_json(&json, &v->stage[k]);
  pb_jsonout_array_end(&json);
  pb_jsonout_object_end(&json);
  pb_jsonout_end(&json);
}

pb_status doctor_report(const doctor_visit *v, pb_error *err) {
  if (!v->o->json) return print_text(v, err);
  print_json(v);
  return PB_OK;
}
