// plantbus-actuator characterize: an actuator in the figures of its data sheet.
#include "characterize.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { KEY_SHEET = 0x100, KEY_STROKE, KEY_LENGTH, KEY_COUNT, KEY_LOAD, KEY_BAND };

static const struct argp_option option_table[] = {
    {"datasheet", KEY_SHEET, "NAME", 0,
     "Beside the data sheet NAME of the built-in list (config/actuators), of FILE:NAME, or of a "
     "FILE with one",
     2},
    {"stack-stroke", KEY_STROKE, "M", 0, "Nominal stroke of one stack (default 20e-6)", 3},
    {"stack-length", KEY_LENGTH, "M", 0, "Length of one stack, to count them (default 0.02)", 3},
    {"stacks", KEY_COUNT, "N", 0,
     "Stacks that actuate (default: as many as lie between the frames of the element's stacks)", 3},
    {"load", KEY_LOAD, "KG", 0, "--live: what moves with the top (default 5.056)", 3},
    {"range", KEY_BAND, "F1,F2", 0, "Of the compliance, Hz (default 10,10000)", 3},
    {0},
};

static error_t parse(int key, char *text, struct argp_state *state) {
  characterize_options *o = state->input;
  switch (key) {
  case ARGP_KEY_INIT:
    state->child_inputs[0] = &o->subject;
    return 0;
  case KEY_SHEET:
    o->datasheet = text;
    return 0;
  case KEY_STROKE:
    o->nominal.stroke = pb_option_double(state, "--stack-stroke", text, 1e-12, 1);
    return 0;
  case KEY_LENGTH:
    o->nominal.length = pb_option_double(state, "--stack-length", text, 1e-9, 1e3);
    return 0;
  case KEY_COUNT:
    o->nominal.count = (size_t)pb_option_uint64(state, "--stacks", text, 1, 10000);
    return 0;
  case KEY_LOAD:
    o->load = pb_option_double(state, "--load", text, 1e-9, 1e9);
    return 0;
  case KEY_BAND:
    pb_option_band(state, "--range", text, &o->f1, &o->f2);
    return 0;
  case ARGP_KEY_END:
    if (o->subject.live.live && o->subject.result.plot)
      argp_error(state, "--plot: the responses of an experiment are drawn by plantbus-identify");
    return 0;
  default:
    return ARGP_ERR_UNKNOWN;
  }
}

void characterize_add(characterize_result *r, const char *key, const char *name, const char *unit,
                      double scale, double value) {
  r->figure[r->figures++] = (part_figure){key, name, unit, scale, value, NAN, NAN};
}

// ---- data sheet ---------------------------------------------------------------------------------

// FILE[:NAME] or NAME into a file (NULL: shipped) and a name (NULL: its only one).
static void split_sheet(const char *text, char *file, size_t size, const char **name) {
  const char *json = strstr(text, ".json");
  file[0] = 0;
  *name = text;
  if (!json) return;
  snprintf(file, size, "%.*s", (int)(json + 5 - text), text);
  *name = json[5] == ':' ? json + 6 : NULL;
}

// The sheet that --datasheet names, in *file (cJSON_Delete); NULL: none is asked for.
static pb_status find_sheet(const characterize_options *o, cJSON **file, const cJSON **sheet,
                            pb_error *err) {
  char path[1024];
  const char *name;
  const cJSON *sheets = NULL;
  *file = NULL;
  *sheet = NULL;
  if (!o->datasheet) return PB_OK;
  split_sheet(o->datasheet, path, sizeof path, &name);
  pb_status st = pb_shipped_sheets(path[0] ? path : NULL, actuator_quantities, file, &sheets, err);
  if (!st && !name && cJSON_GetArraySize(sheets) == 1) name = sheets->child->string;
  if (!st && name) *sheet = pb_json_member(sheets, name);
  if (!st && !*sheet)
    st = pb_fail(err, PB_ERR_REFERENCE, "--datasheet",
                 name ? "there is no data sheet of %s" : "%s has several: name one",
                 name ? name : path);
  return st;
}

static pb_status put_sheet(const cJSON *sheet, characterize_result *r, pb_error *err) {
  pb_status st = PB_OK;
  r->sheet_stiffness = NAN;
  for (size_t i = 0; i < r->figures && sheet && !st; i++) {
    pb_sheet_value v;
    part_figure *f = &r->figure[i];
    st = pb_sheet_read(sheet, sheet->string, f->key, &v, err);
    f->low = v.low;
    f->high = v.high;
    if (!strcmp(f->key, "stiffness")) r->sheet_stiffness = v.low;
  }
  return st;
}

// ---- the figures --------------------------------------------------------------------------------

static void put_figures(const pb_actuator_character *c, characterize_result *r) {
  r->stiffness = c->stiffness;
  characterize_add(r, "stiffness", "axial stiffness", "N/µm", 1e-6, c->stiffness);
  characterize_add(r, "resonance", "first axial resonance, blocked-free", "Hz", 1, c->resonance);
  characterize_add(r, "damping", "its damping", "%", 100, c->damping);
  characterize_add(r, "amplification", "vertical / stack elongation", "", 1, c->amplification);
  characterize_add(r, "stack_stiffness", "stiffness of one stack", "N/µm", 1e-6,
                   c->stack_stiffness);
  characterize_add(r, "stacks", "stacks", "", 1, c->stacks ? (double)c->stacks : NAN);
  characterize_add(r, "stroke", "stroke", "µm", 1e6, c->stroke);
  characterize_add(r, "blocked_force", "blocked force", "N", 1, c->blocked_force);
  characterize_add(r, "mass", "mass", "g", 1e3, c->mass);
  characterize_add(r, "height", "height between its ends", "mm", 1e3, c->height);
  characterize_add(r, "voltage_gain", "y/V_a at 0 Hz, free", "µm/V", 1e6, c->voltage_gain);
  characterize_add(r, "sensor_gain", "V_s/V_a at 0 Hz, free", "V/V", 1, c->sensor_gain);
  characterize_add(r, "sensor_of_force", "V_s/F at 0 Hz", "V/N", 1, c->sensor_of_force);
}

static pb_status from_file(const characterize_options *o, characterize_result *r, pb_error *err) {
  pb_element_source source;
  pb_actuator_character character;
  pb_bench_model bench = {0};
  pb_warnings warnings = {0};
  pb_status st = source_open(&o->subject.source, &source, err);
  if (st) return st;
  snprintf(r->name, sizeof r->name, "%s", source.name);
  st = pb_actuator_characterize(&source, &o->nominal, &warnings, &bench, &character, err);
  pb_print_warnings(stderr, &warnings);
  if (!st) {
    put_figures(&character, r);
    r->hz = log_frequencies(o->f1, o->f2, CHARACTERIZE_POINTS);
    if (!r->hz) st = pb_fail_memory(err, "compliance");
  }
  if (!st)
    st = channel_response(bench.model, "F", "y", r->hz, CHARACTERIZE_POINTS, &r->compliance, err);
  pb_bench_model_clear(&bench);
  pb_warnings_clear(&warnings);
  pb_element_source_clear(&source);
  return st;
}

int command_characterize(int argc, char **argv) {
  static const struct argp_child children[] = {{&subject_argp, 0, NULL, 0}, {0}};
  static const struct argp argp = {
      option_table,
      parse,
      "[FILE]",
      "Characterises an actuator: an element file (.mat), or a model of a plant file.\v"
      "Stiffness, resonance and gains: bottom fixed, top free. Amplification: under a force "
      "between "
      "the ends of all stacks. Blocked force: stroke times stiffness. With --live: what an "
      "experiment on a running bench tells.\n\n"
      "Exit codes: 0 done, 1 failed, 2 wrong command line.\n\n"
      "Examples:\n"
      "  plantbus-actuator characterize APA300ML.mat --datasheet APA300ML --plot --output-dir out\n"
      "  plantbus-actuator characterize config/plants/nano-hexapod.json --length 0.03\n",
      children,
      NULL,
      NULL};
  characterize_options o = {
      .nominal = {.stroke = 20e-6, .length = 0.02}, .load = 5.056, .f1 = 10, .f2 = 1e4};
  characterize_result r = {0};
  cJSON *file = NULL;
  const cJSON *sheet = NULL;
  pb_error err = {0};
  subject_defaults(&o.subject);
  pb_options_parse(&argp, argc, argv, &o);
  pb_status st = pb_result_check(&o.subject.result, &err);
  if (!st) st = find_sheet(&o, &file, &sheet, &err);
  if (!st) st = o.subject.live.live ? characterize_live(&o, &r, &err) : from_file(&o, &r, &err);
  if (!st) st = put_sheet(sheet, &r, &err);
  if (!st) st = characterize_present(&o, &r, &err);
  free(r.hz);
  free(r.compliance);
  cJSON_Delete(file);
  return pb_result_end(st, &err);
}
