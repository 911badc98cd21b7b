// plantbus-part truncate: an element with as few modes as its poles and zeros in a band need.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "element_out.h"
#include "jsonout.h"
#include "options.h"
#include "part.h"
#include "part/truncate.h"
#include "source.h"
#include "table.h"

enum {
  KEY_JSON = 0x100,
  KEY_BAND,
  KEY_ZERO,
  KEY_POLE,
  KEY_MODES,
  KEY_ENDS,
  KEY_ACTUATOR,
  KEY_SENSOR,
  KEY_PAYLOAD,
  KEY_ALL
};

typedef struct options {
  source in;
  const char *out;
  bool json, all;
  bool has_band, has_pole, has_actuator, has_sensor;
  pb_truncate_options truncate;
} options;

static const struct argp_option option_table[] = {
    {NULL, 'o', "FILE", 0, "Write the element: MAT v5, or Matrix Market where FILE ends in .mtx",
     1},
    {"band", KEY_BAND, "LOW,HIGH", 0, "Band in Hz in which poles and zeros have to stay", 1},
    {"zero-error", KEY_ZERO, "PERCENT", 0, "Largest change of a zero (default 0.1)", 1},
    {"pole-error", KEY_POLE, "PERCENT", 0, "Largest change of a pole (default as --zero-error)", 1},
    {"modes", KEY_MODES, "P", 0, "Keep P modes, whatever the errors", 1},
    {"json", KEY_JSON, NULL, 0, "Print JSON instead of tables", 1},
    {"all", KEY_ALL, NULL, 0, "List every pole and zero, not the worst of each kind", 1},
    {"ends", KEY_ENDS, "A,B", 0, "Frame that is held and frame that is free (default 1,2)", 2},
    {"actuator", KEY_ACTUATOR, "A,B", 0,
     "Frames of the actuator's stacks (default 5,7 of seven frames)", 2},
    {"sensor", KEY_SENSOR, "A,B", 0, "Frames of the sensor's stack (default 3,4 of seven frames)",
     2},
    {"payload", KEY_PAYLOAD, "KG", 0, "Mass that moves with the free end (default 0)", 2},
    {0},
};

static void parse_band(options *o, const char *arg, struct argp_state *state) {
  static const char expected[] = "two frequencies 0 <= LOW < HIGH";
  double hz[2];
  pb_option_numbers(state, "--band", arg, hz, 2, expected);
  if (!(hz[0] >= 0 && hz[1] > hz[0])) argp_error(state, "--band: '%s' is not %s", arg, expected);
  o->truncate.low_hz = hz[0];
  o->truncate.high_hz = hz[1];
  o->has_band = true;
}

static void check_line(options *o, struct argp_state *state) {
  if (!o->has_band) argp_error(state, "expected --band LOW,HIGH");
  if (o->has_actuator != o->has_sensor)
    argp_error(state, "--actuator and --sensor belong together");
  if (!o->has_pole) o->truncate.pole_error = o->truncate.zero_error;
}

static error_t parse_option(int key, char *arg, struct argp_state *state) {
  options *o = state->input;
  pb_truncate_options *t = &o->truncate;
  switch (key) {
  case ARGP_KEY_INIT:
    state->child_inputs[0] = &o->in;
    break;
  case 'o':
    o->out = arg;
    break;
  case KEY_JSON:
    o->json = true;
    break;
  case KEY_ALL:
    o->all = true;
    break;
  case KEY_BAND:
    parse_band(o, arg, state);
    break;
  case KEY_ZERO:
    t->zero_error = pb_option_double(state, "--zero-error", arg, 1e-9, 100) / 100;
    break;
  case KEY_POLE:
    t->pole_error = pb_option_double(state, "--pole-error", arg, 1e-9, 100) / 100;
    o->has_pole = true;
    break;
  case KEY_MODES:
    t->modes = (size_t)pb_option_uint64(state, "--modes", arg, 1, 20000);
    break;
  case KEY_ENDS:
    source_frame_pair("--ends", arg, &t->base, &t->tip, state);
    break;
  case KEY_ACTUATOR:
    source_frame_pair("--actuator", arg, &t->actuator[0], &t->actuator[1], state);
    o->has_actuator = true;
    break;
  case KEY_SENSOR:
    source_frame_pair("--sensor", arg, &t->sensor[0], &t->sensor[1], state);
    o->has_sensor = true;
    break;
  case KEY_PAYLOAD:
    t->payload = pb_option_double(state, "--payload", arg, 0, 1e9);
    break;
  case ARGP_KEY_END:
    check_line(o, state);
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
    "ELEMENT.mat --band LOW,HIGH",
    "Drops the modes of an element that a band does not need, against their static answer, and "
    "proves it by comparing poles and zeros before and after.\v"
    "Exit code 1: with --modes, the budget is not met (the element is written all the same).",
    children,
    NULL,
    NULL};

// Common layout of amplified actuators: 1 bottom, 2 top, 3–4 sensor stack, 5–6–7 actuator stacks.
static void default_stacks(const options *o, const pb_element_data *e, pb_truncate_options *t) {
  t->stacks = o->has_actuator || e->frames == 7;
  if (o->has_actuator || e->frames != 7) return;
  t->sensor[0] = 2, t->sensor[1] = 3;
  t->actuator[0] = 4, t->actuator[1] = 6;
}

// ---- report -------------------------------------------------------------------------------------

static bool same_kind(const pb_truncate_row *a, const pb_truncate_row *b) {
  return !strcmp(a->boundary, b->boundary) && !strcmp(a->what, b->what);
}

// The worst row of the kind that begins at `first`; *next: where the next kind begins.
static size_t worst_of_kind(const pb_truncation *t, size_t first, size_t *next) {
  size_t worst = first;
  for (*next = first; *next < t->rows && same_kind(&t->row[first], &t->row[*next]); ++*next)
    if (t->row[*next].error > t->row[worst].error) worst = *next;
  return worst;
}

static void add_row(pb_table *table, const pb_truncate_row *r, size_t count) {
  pb_table_text(table, r->boundary);
  pb_table_text(table, r->what);
  if (count) pb_table_count(table, count);
  pb_table_number(table, r->before);
  pb_table_number(table, r->after);
  pb_table_number(table, 100 * r->error);
}

static pb_status print_text(const options *o, const pb_truncation *t, pb_error *err) {
  pb_table table = {0};
  pb_table_text_column(&table, "boundary");
  pb_table_text_column(&table, o->all ? "pole or zero" : "worst of");
  if (!o->all) pb_table_number_column(&table, "in band", NULL, 3);
  pb_table_number_column(&table, "before", "Hz", 6);
  pb_table_number_column(&table, "after", "Hz", 6);
  pb_table_number_column(&table, "change", "%", 2);
  for (size_t k = 0, next; k < t->rows; k = next) {
    size_t worst = worst_of_kind(t, k, &next);
    if (o->all)
      for (size_t i = k; i < next; i++) add_row(&table, &t->row[i], 0);
    else
      add_row(&table, &t->row[worst], next - k);
  }
  pb_status st = pb_table_print(&table, stdout, 0, err);
  pb_table_free(&table);
  printf("\n%zu of %zu modes kept", t->modes, t->modes_before);
  if (t->modes) printf(" (up to %.5g Hz, frames held)", t->fixed_hz[t->modes - 1]);
  printf("; largest change in %g … %g Hz: zeros %.2g %%, poles %.2g %%\n", o->truncate.low_hz,
         o->truncate.high_hz, 100 * t->worst_zero, 100 * t->worst_pole);
  return st;
}

static void print_json(const options *o, const pb_truncation *t, bool met) {
  pb_jsonout json;
  pb_jsonout_begin(&json, stdout);
  pb_jsonout_object(&json, NULL);
  pb_jsonout_integer(&json, "modes_before", t->modes_before);
  pb_jsonout_integer(&json, "modes", t->modes);
  pb_jsonout_number(&json, "low_hz", o->truncate.low_hz);
  pb_jsonout_number(&json, "high_hz", o->truncate.high_hz);
  pb_jsonout_number(&json, "zero_error", t->worst_zero);
  pb_jsonout_number(&json, "pole_error", t->worst_pole);
  pb_jsonout_boolean(&json, "within_budget", met);
  pb_jsonout_array(&json, "compared");
  for (size_t k = 0; k < t->rows; k++) {
    pb_jsonout_object(&json, NULL);
    pb_jsonout_text(&json, "boundary", t->row[k].boundary);
    pb_jsonout_text(&json, "what", t->row[k].what);
    pb_jsonout_number(&json, "before_hz", t->row[k].before);
    pb_jsonout_number(&json, "after_hz", t->row[k].after);
    pb_jsonout_number(&json, "error", t->row[k].error);
    pb_jsonout_object_end(&json);
  }
  pb_jsonout_array_end(&json);
  pb_jsonout_object_end(&json);
  pb_jsonout_end(&json);
}

static pb_status write_element(const options *o, const loaded *from, const pb_truncation *t,
                               pb_error *err) {
  pb_text text = {0};
  char *provenance = source_provenance(&o->in, from);
  pb_text_append(&text, provenance ? provenance : "");
  pb_text_format(&text,
                 "truncated to %zu of %zu modes for %g to %g Hz (zeros %.2g %%, poles %.2g %%)\n",
                 t->modes, t->modes_before, o->truncate.low_hz, o->truncate.high_hz,
                 100 * t->worst_zero, 100 * t->worst_pole);
  pb_status st = provenance && !text.failed ? PB_OK : pb_fail_memory(err, o->out);
  const pb_element_out out = {.name = "truncated element",
                              .frames = t->element.frames,
                              .size = t->element.size,
                              .position = t->element.position,
                              .k = t->element.k,
                              .m = t->element.m,
                              .fixed_hz = t->fixed_hz,
                              .provenance = text.text};
  if (!st) st = pb_element_write(&out, o->out, PB_ELEMENT_BY_SUFFIX, err);
  free(provenance);
  free(text.text);
  return st;
}

int part_truncate(int argc, char **argv) {
  options o = {.truncate = {.zero_error = 1e-3, .base = 0, .tip = 1}};
  pb_error err = {0};
  loaded from;
  pb_truncation t = {0};
  source_begin(&o.in);
  pb_options_parse(&argp, argc, argv, &o);
  pb_status st = source_load(&o.in, &from, &err);
  pb_truncate_options use = o.truncate;
  if (!st) default_stacks(&o, &from.import.element, &use);
  if (!st) st = pb_element_truncate(o.in.file[0], &from.import.element, &use, &t, &err);
  bool met = !st && t.worst_zero <= use.zero_error && t.worst_pole <= use.pole_error;
  if (!st && o.json) print_json(&o, &t, met);
  if (!st && !o.json) st = print_text(&o, &t, &err);
  if (!st && o.out) st = write_element(&o, &from, &t, &err);
  if (st) pb_print_error(stderr, &err);
  pb_truncation_clear(&t);
  source_unload(&from);
  source_clear(&o.in);
  return met && !st ? PB_EXIT_DONE : PB_EXIT_FAILED;
}
