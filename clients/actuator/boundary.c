// plantbus-actuator boundary: the sensor stack short-circuited, open, or with a resistor
// (figure 2.6 of the report), by the plant file's key "boundary".
#include "boundary.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "interrupt.h"
#include "plant/boundary.h"
#include "progress.h"
#include "study/actuator_piezo.h"
#include "study/element_bench.h"

enum { KEY_LOAD = 0x100, KEY_COUPLING, KEY_CAPACITANCE, KEY_RESISTANCE, KEY_BAND };
static const double two_pi = 6.283185307179586476925286766559;

static const struct argp_option option_table[] = {
    {"load", KEY_LOAD, "KG", 0, "Mass on the actuator (default 5; not with --live)", 2},
    {"coupling", KEY_COUPLING, "K33", 0,
     "Of the sensor stack (default: of the model's boundary, else of 'constants')", 2},
    {"capacitance", KEY_CAPACITANCE, "F", 0,
     "Of the free sensor stack (default: of the model's boundary, else 4.4e-6)", 2},
    {"resistance", KEY_RESISTANCE, "OHMS", 0,
     "Resistors, comma-separated (default: from 1/30 to 30 times 1/(ω C), ω of the resonance; with "
     "--live none)",
     2},
    {"range", KEY_BAND, "F1,F2", 0,
     "Of the responses, Hz (default: a third to three times the resonance; not with --live)", 2},
    {0},
};

static int ascending(const void *a, const void *b) {
  const double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

static void parse_resistance(struct argp_state *state, const char *text, boundary_options *o) {
  free(o->resistance);
  o->resistance = NULL;
  pb_option_double_list(state, "--resistance", text, &o->resistance, &o->resistances);
  for (size_t i = 0; i < o->resistances; i++)
    if (!(o->resistance[i] > 0)) argp_error(state, "--resistance: '%s' is not above 0", text);
  if (o->resistance) qsort(o->resistance, o->resistances, sizeof *o->resistance, ascending);
}

static error_t parse(int key, char *text, struct argp_state *state) {
  boundary_options *o = state->input;
  switch (key) {
  case ARGP_KEY_INIT:
    state->child_inputs[0] = &o->subject;
    return 0;
  case KEY_LOAD:
    o->load = pb_option_double(state, "--load", text, 1e-9, 1e9);
    return 0;
  case KEY_COUPLING:
    o->coupling = pb_option_double(state, "--coupling", text, 1e-6, 0.999999);
    return 0;
  case KEY_CAPACITANCE:
    o->capacitance = pb_option_double(state, "--capacitance", text, 1e-18, 1);
    return 0;
  case KEY_RESISTANCE:
    parse_resistance(state, text, o);
    return 0;
  case KEY_BAND:
    pb_option_band(state, "--range", text, &o->f1, &o->f2);
    return 0;
  case ARGP_KEY_END:
    if (o->subject.live.live && (o->load > 0 || o->f2 > 0))
      argp_error(state, "--load and --range do not go with --live");
    if (!(o->load > 0)) o->load = 5;
    return 0;
  default:
    return ARGP_ERR_UNKNOWN;
  }
}

// ---- boundaries ---------------------------------------------------------------------------------

cJSON *boundary_patch(const pb_boundary *b) {
  cJSON *patch = cJSON_CreateObject(), *sensor = NULL;
  cJSON *object = patch ? cJSON_AddObjectToObject(patch, "boundary") : NULL;
  bool ok = object && cJSON_AddNumberToObject(object, "coupling", b->coupling) &&
            cJSON_AddNumberToObject(object, "capacitance", b->capacitance);
  if (ok && b->kind == PB_BOUNDARY_RESISTOR) {
    sensor = cJSON_AddObjectToObject(object, "sensor");
    ok = sensor && cJSON_AddNumberToObject(sensor, "resistance", b->resistance);
  } else if (ok) {
    ok = cJSON_AddStringToObject(object, "sensor",
                                 b->kind == PB_BOUNDARY_OPEN ? "open" : "short") != NULL;
  }
  if (ok) return patch;
  cJSON_Delete(patch);
  return NULL;
}

pb_status boundary_add(boundary_result *r, const boundary_row *row, pb_error *err) {
  boundary_row *list = realloc(r->row, (r->count + 1) * sizeof *list);
  if (!list) return pb_fail_memory(err, "boundary");
  r->row = list;
  boundary_row *to = &list[r->count++];
  *to = *row;
  const pb_boundary *b = &row->boundary;
  if (b->kind == PB_BOUNDARY_RESISTOR)
    snprintf(to->label, sizeof to->label, "%.4g Ω", b->resistance);
  else
    snprintf(to->label, sizeof to->label, b->kind == PB_BOUNDARY_OPEN ? "open" : "short-circuited");
  return PB_OK;
}

// Real part of the stack's stiffness at the resonance.
static double stiffness_at(const pb_boundary *b, double hz) {
  if (b->kind == PB_BOUNDARY_SHORT) return b->stiffness;
  const double dk = pb_boundary_stiffening(b), x = two_pi * hz * pb_boundary_time(b);
  return b->stiffness + (b->kind == PB_BOUNDARY_OPEN ? dk : dk * x * x / (1 + x * x));
}

static pb_status look(const boundary_options *o, const pb_element_source *source,
                      const pb_boundary *b, boundary_result *r, pb_error *err) {
  boundary_row row = {.boundary = *b, .zero_hz = NAN};
  pb_element_source changed = {0};
  pb_bench_model bench = {0};
  pb_apa_landmarks l;
  const pb_actuator_bench options = {.load = o->load};
  cJSON *patch = boundary_patch(b);
  pb_status st = patch ? pb_element_source_patch(source, patch, &changed, err)
                       : pb_fail_memory(err, "boundary");
  cJSON_Delete(patch);
  if (!st) st = pb_actuator_bench_build(&changed, &options, NULL, &bench, err);
  if (!st) st = pb_apa_landmarks_of_model(bench.model, &l, err);
  if (!st && r->hz)
    st = channel_response(bench.model, "Va", "y", r->hz, BOUNDARY_POINTS, &row.response, err);
  if (!st) {
    row.boundary = pb_bench_part(&bench)->boundary;
    row.hz = l.pole_hz;
    row.damping = l.pole_damping;
    row.zero_hz = l.zero_hz;
    row.stiffness = stiffness_at(&row.boundary, row.hz);
    st = boundary_add(r, &row, err);
    if (st) free(row.response);
  }
  pb_bench_model_clear(&bench);
  pb_element_source_clear(&changed);
  return st;
}

pb_boundary boundary_start(const boundary_options *o, const cJSON *model) {
  const pb_piezo piezo = pb_piezo_default();
  const cJSON *own = pb_json_member(model, "boundary");
  const cJSON *coupling = pb_json_member(own, "coupling");
  const cJSON *capacitance = pb_json_member(own, "capacitance");
  pb_boundary b = {.coupling = o->coupling, .capacitance = o->capacitance};
  if (b.coupling == 0 && cJSON_IsNumber(coupling)) b.coupling = coupling->valuedouble;
  if (b.capacitance == 0 && cJSON_IsNumber(capacitance)) b.capacitance = capacitance->valuedouble;
  if (b.coupling == 0) b.coupling = pb_piezo_coupling(&piezo);
  if (b.capacitance == 0) b.capacitance = 4.4e-6;
  return b;
}

// Nine resistors around ω τ = 1 in steps of 30^¼.
static pb_status choose_resistances(boundary_options *o, const pb_boundary *b, double hz,
                                    pb_error *err) {
  enum { COUNT = 9 };
  if (o->resistance) return PB_OK;
  const double held = b->capacitance * (1 - b->coupling * b->coupling);
  o->resistance = malloc(COUNT * sizeof *o->resistance);
  if (!o->resistance) return pb_fail_memory(err, "--resistance");
  for (int i = 0; i < COUNT; i++)
    o->resistance[i] = pow(30, 0.25 * (i - COUNT / 2)) / (two_pi * hz * held);
  o->resistances = COUNT;
  return PB_OK;
}

// The frequencies follow from the short-circuited resonance, which is found first without them.
static pb_status find_range(const boundary_options *o, const pb_element_source *source,
                            const pb_boundary *b, double *resonance, boundary_result *r,
                            pb_error *err) {
  boundary_result probe = {0};
  pb_status st = look(o, source, b, &probe, err);
  if (!st) {
    *resonance = probe.row[0].hz;
    r->hz = log_frequencies(o->f2 > 0 ? o->f1 : *resonance / 3, o->f2 > 0 ? o->f2 : *resonance * 3,
                            BOUNDARY_POINTS);
    if (!r->hz) st = pb_fail_memory(err, "boundary");
  }
  free(probe.row);
  return st;
}

static pb_status from_file(boundary_options *o, boundary_result *r, pb_error *err) {
  pb_element_source source;
  double resonance = 0;
  pb_progress progress;
  pb_status st = source_open(&o->subject.source, &source, err);
  if (st) return st;
  pb_boundary b = boundary_start(o, source.model);
  snprintf(r->subject, sizeof r->subject, "%.100s with %g kg", source.name, o->load);
  st = find_range(o, &source, &b, &resonance, r, err);
  if (!st) st = choose_resistances(o, &b, resonance, err);
  pb_progress_begin(&progress, stderr, "boundary");
  for (size_t i = 0; i < 2 + o->resistances && !st; i++) {
    b.kind = i == 0 ? PB_BOUNDARY_SHORT : i == 1 ? PB_BOUNDARY_OPEN : PB_BOUNDARY_RESISTOR;
    if (i > 1) b.resistance = o->resistance[i - 2];
    st = look(o, &source, &b, r, err);
    pb_progress_update(&progress, (double)(i + 1), (double)(2 + o->resistances), NULL);
    if (!st && pb_interrupted()) st = pb_fail(err, PB_ERR_STATE, "boundary", "interrupted");
  }
  pb_progress_end(&progress);
  pb_element_source_clear(&source);
  return st;
}

int command_boundary(int argc, char **argv) {
  static const struct argp_child children[] = {{&subject_argp, 0, NULL, 0}, {0}};
  static const struct argp argp = {
      option_table,
      parse,
      "[FILE]",
      "The electrical boundary of the sensor stack: short-circuited, open, and with a resistor.\v"
      "An open stack has the stiffness k/(1 - k33^2); a resistor R relaxes the difference with the "
      "time constant R C (1 - k33^2) and damps. With --live the key \"boundary\" of the served "
      "plant's model is switched, the plant identified each time, and put back.\n\n"
      "Exit codes: 0 done, 1 failed, 2 wrong command line.\n",
      children,
      NULL,
      NULL};
  boundary_options o = {0};
  boundary_result r = {0};
  pb_error err = {0};
  subject_defaults(&o.subject);
  pb_options_parse(&argp, argc, argv, &o);
  pb_interrupt_install();
  pb_status st = pb_result_check(&o.subject.result, &err);
  if (!st) st = o.subject.live.live ? boundary_live(&o, &r, &err) : from_file(&o, &r, &err);
  if (!st) st = boundary_present(&o, &r, &err);
  for (size_t i = 0; i < r.count; i++) free(r.row[i].response);
  free(r.row);
  free(r.hz);
  free(o.resistance);
  return pb_result_end(st, &err);
}
