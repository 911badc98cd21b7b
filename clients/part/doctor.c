// plantbus-part doctor: what is wrong with an element, and its repair.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "doctor.h"
#include "element_out.h"
#include "options.h"
#include "part.h"

enum { KEY_JSON = 0x100, KEY_REPAIR, KEY_WEIGHTED, KEY_SI, KEY_ENDS, KEY_AXIS };

static const struct argp_option option_table[] = {
    {"repair", KEY_REPAIR, NULL, 0, "Cure what can be cured and write the element to -o", 1},
    {NULL, 'o', "FILE", 0, "Where the repaired element goes: MAT v5, or Matrix Market (.mtx)", 1},
    {"weighted", KEY_WEIGHTED, NULL, 0,
     "Measure the change of each entry of K by the scale of rounding, √(K_ii K_jj)", 1},
    {"si", KEY_SI, NULL, 0, "The units are SI, however light or large the part may seem", 1},
    {"json", KEY_JSON, NULL, 0, "Print JSON instead of text", 1},
    {"ends", KEY_ENDS, "A,B", 0, "Frame that is held and frame that is free (default 1,2)", 2},
    {"axis", KEY_AXIS, "X,Y,Z", 0, "Direction of the axial mode (default from A to B)", 2},
    {0},
};

static void parse_axis(doctor_options *o, const char *arg, struct argp_state *state) {
  double value[3];
  pb_option_direction(state, "--axis", arg, value);
  double norm = sqrt(value[0] * value[0] + value[1] * value[1] + value[2] * value[2]);
  for (int a = 0; a < 3; a++) o->axis[a] = value[a] / norm;
  o->has_axis = true;
}

static error_t parse_option(int key, char *arg, struct argp_state *state) {
  doctor_options *o = state->input;
  switch (key) {
  case ARGP_KEY_INIT:
    state->child_inputs[0] = &o->in;
    break;
  case KEY_REPAIR:
    o->repair = true;
    break;
  case 'o':
    o->out = arg;
    break;
  case KEY_WEIGHTED:
    o->doctor.weighted = true;
    break;
  case KEY_SI:
    o->doctor.trust_units = true;
    break;
  case KEY_JSON:
    o->json = true;
    break;
  case KEY_ENDS:
    source_frame_pair("--ends", arg, &o->base, &o->tip, state);
    break;
  case KEY_AXIS:
    parse_axis(o, arg, state);
    break;
  case ARGP_KEY_END:
    if (o->repair != (o->out != NULL)) argp_error(state, "--repair and -o belong together");
    break;
  default:
    return ARGP_ERR_UNKNOWN;
  }
  return 0;
}

static const struct argp_child children[] = {{&source_argp, 0, NULL, 0}, {0}};
static const struct argp argp = {
    option_table,
    parse_option,
    "ELEMENT.mat\nK-FILE M-FILE [NODES]\nBOTH-FILE [NODES]",
    "Examines an element: digits, symmetry, rigid motions, places of the frames, units, mass.\v"
    "Exit code 0: it is sound, or has been repaired; 1: it is not. Repairs are in "
    "docs/parts-import.md; nothing is changed without --repair.",
    children,
    NULL,
    NULL};

// ---- states of the element ----------------------------------------------------------------------

static void default_axis(const doctor_options *o, const pb_element_data *e, double axis[3]) {
  double norm = 0;
  memcpy(axis, o->axis, 3 * sizeof *axis);
  if (o->has_axis) return;
  for (size_t a = 0; a < 3; a++) {
    axis[a] = e->position[3 * o->tip + a] - e->position[3 * o->base + a];
    norm += axis[a] * axis[a];
  }
  norm = sqrt(norm);
  for (size_t a = 0; a < 3; a++) axis[a] = norm > 0 ? axis[a] / norm : a == 2;
}

static pb_status add_stage(doctor_visit *v, const char *name, const pb_element_data *e,
                           pb_error *err) {
  doctor_stage *s = &v->stage[v->stages++];
  s->name = name;
  s->held = (pb_element_held){{NAN, NAN, NAN, NAN}, NAN};
  pb_status st = pb_element_diagnose(v->o->in.file[0], e, &v->o->doctor, &s->d, NULL, err);
  if (st || v->o->tip >= e->frames || v->o->base >= e->frames) return st;
  double axis[3];
  default_axis(v->o, e, axis);
  st = pb_element_hold(name, e, v->o->base, v->o->tip, axis, &s->held, err);
  return st == PB_ERR_ELEMENT ? PB_OK : st;  // M is not definite: the findings say so
}

bool doctor_all_curable(const pb_diagnosis *d) {
  for (size_t k = 0; k < d->findings; k++)
    if (!d->finding[k].curable) return false;
  return true;
}

// Cures and looks again; both ways of the projection where one is needed.
static pb_status add_cures(doctor_visit *v, pb_error *err) {
  const pb_element_data *e = &v->from.import.element;
  pb_status st = PB_OK;
  for (int k = 0; !st && k < 2; k++) {
    pb_doctor_options way = v->o->doctor;
    way.weighted = k == 0 ? way.weighted : !way.weighted;
    bool projected = v->stage[0].d.change > 0;
    if (k && !projected) break;
    pb_element_data *cured = k ? &(pb_element_data){0} : &v->cured;
    pb_diagnosis d;
    st = pb_element_diagnose(v->o->in.file[0], e, &way, &d, cured, err);
    const char *name = !projected ? "repaired" : way.weighted ? "weighted" : "projected";
    if (!st) st = add_stage(v, name, cured, err);
    if (k) pb_element_data_clear(cured);
  }
  return st;
}

static pb_status examine(doctor_visit *v, pb_error *err) {
  pb_status st = source_load(&v->o->in, &v->from, err);
  if (!st) st = add_stage(v, "as it is", &v->from.import.element, err);
  const pb_diagnosis *d = &v->stage[0].d;
  if (!st && d->findings && doctor_all_curable(d)) st = add_cures(v, err);
  return st;
}

// ---- writing ------------------------------------------------------------------------------------

static pb_status write_cured(doctor_visit *v, pb_error *err) {
  const pb_diagnosis *d = &v->stage[0].d;
  const pb_element_data *e = v->cured.k ? &v->cured : &v->from.import.element;
  char *from = source_provenance(&v->o->in, &v->from);
  pb_text text = {0};
  if (!doctor_all_curable(d)) {
    free(from);
    return pb_fail(err, PB_ERR_ELEMENT, v->o->in.file[0], "cannot be repaired; nothing is written");
  }
  pb_text_append(&text, from ? from : "");
  for (size_t k = 0; k < d->findings; k++)
    pb_text_format(&text, "repaired: %s (%s)\n", d->finding[k].saw, d->finding[k].would);
  pb_status st = from && !text.failed ? PB_OK : pb_fail_memory(err, v->o->out);
  const pb_element_out out = {.name = "repaired element",
                              .frames = e->frames,
                              .size = e->size,
                              .position = e->position,
                              .k = e->k,
                              .m = e->m,
                              .provenance = text.text};
  if (!st) st = pb_element_write(&out, v->o->out, PB_ELEMENT_BY_SUFFIX, err);
  v->written = !st;
  free(from);
  free(text.text);
  return st;
}

int part_doctor(int argc, char **argv) {
  doctor_options o = {.base = 0, .tip = 1};
  pb_error err = {0};
  source_begin(&o.in);
  pb_options_parse(&argp, argc, argv, &o);
  doctor_visit v = {.o = &o};
  pb_status st = examine(&v, &err);
  if (!st) {
    pb_error late = {0};
    pb_status written = o.repair ? write_cured(&v, &err) : PB_OK;
    st = doctor_report(&v, written ? &late : &err);
    if (written) st = written;
  }
  if (st) pb_print_error(stderr, &err);
  bool sound = !st && (o.repair || !v.stage[0].d.findings);
  pb_element_data_clear(&v.cured);
  source_unload(&v.from);
  source_clear(&o.in);
  return sound ? PB_EXIT_DONE : PB_EXIT_FAILED;
}
