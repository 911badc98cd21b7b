// plantbus-part import: other programs' matrices → element.
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "element_out.h"
#include "jsonout.h"
#include "options.h"
#include "part.h"
#include "plant/element_doctor.h"
#include "source.h"
#include "table.h"

enum { KEY_JSON = 0x100, KEY_FORMAT };

typedef struct options {
  source in;
  const char *out;
  pb_element_format format;
  bool json;
} options;

static const struct argp_option option_table[] = {
    {NULL, 'o', "FILE", 0, "Write the element: MAT v5, or Matrix Market where FILE ends in .mtx",
     1},
    {"format", KEY_FORMAT, "mat|mtx", 0, "Write this format whatever the name of the file", 1},
    {"json", KEY_JSON, NULL, 0, "Print JSON instead of text", 1},
    {0},
};

static error_t parse_option(int key, char *arg, struct argp_state *state) {
  options *o = state->input;
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
  case KEY_FORMAT:
    if (!pb_element_format_parse(arg, &o->format))
      argp_error(state, "--format: '%s' is neither mat nor mtx", arg);
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
    "K-FILE M-FILE [NODES]\nBOTH-FILE [NODES]",
    "Makes an element of matrices from Ansys (*PRINT, MMF), NASTRAN (DMIG), Abaqus, CalculiX, "
    "Matrix Market, CSV or MAT files.\v"
    "Formats are recognised by content. docs/parts-import.md tells what each holds and what the "
    "options add. Nothing is repaired: plantbus-part doctor does that.",
    children,
    NULL,
    NULL};

// ---- report -------------------------------------------------------------------------------------

typedef struct result {
  const options *o;
  loaded from;
  pb_diagnosis health;
} result;

static size_t modes_of(const pb_element_data *e) {
  return e->size - 6 * e->frames;
}

static void print_matrix(const char *name, const pb_matrix_file *f) {
  printf("%s          %s, %zu × %zu, %s\n", name, pb_matrix_format_name(f->format), f->rows,
         f->cols, f->half ? "one triangle of a symmetric matrix, mirrored" : "both triangles");
}

static pb_status print_text(const result *r, pb_error *err) {
  const pb_import *i = &r->from.import;
  char summary[1024];
  if (!r->from.own) {
    print_matrix("K", &i->k);
    print_matrix("M", &i->m);
    printf("nodes      %zu in the list, %zu are frames\n", i->listed, i->element.frames);
    printf("rows       by %s: %zu frames × 6 and %zu modes\n", i->rows_by, i->element.frames,
           modes_of(&i->element));
  } else {
    printf("element    %zu frames × 6 and %zu modes\n", i->element.frames, modes_of(&i->element));
  }
  printf("units      %s\n",
         r->o->in.units ? r->o->in.units : "m, kg, N, s (as no --units say else)");
  pb_table table = {0};
  pb_table_number_column(&table, "frame", NULL, 3);
  pb_table_text_column(&table, "node");
  static const char *const axis[] = {"x", "y", "z"};
  for (int a = 0; a < 3; a++) pb_table_number_column(&table, axis[a], "mm", 6);
  for (size_t f = 0; f < i->element.frames; f++) {
    char node[24];
    snprintf(node, sizeof node, "%" PRId64, i->node ? i->node[f] : (int64_t)f + 1);
    pb_table_count(&table, f + 1);
    pb_table_text(&table, node);
    for (size_t a = 0; a < 3; a++) pb_table_number(&table, 1e3 * i->element.position[3 * f + a]);
  }
  pb_status st = pb_table_print(&table, stdout, 0, err);
  pb_table_free(&table);
  pb_diagnosis_summary(&r->health, summary, sizeof summary);
  printf("doctor     %s\n", summary);
  return st;
}

static void print_json(const result *r) {
  const pb_import *i = &r->from.import;
  pb_jsonout json;
  char summary[1024];
  pb_diagnosis_summary(&r->health, summary, sizeof summary);
  pb_jsonout_begin(&json, stdout);
  pb_jsonout_object(&json, NULL);
  if (!r->from.own) {
    pb_jsonout_text(&json, "format_k", pb_matrix_format_name(i->k.format));
    pb_jsonout_text(&json, "format_m", pb_matrix_format_name(i->m.format));
    pb_jsonout_boolean(&json, "half_k", i->k.half);
    pb_jsonout_boolean(&json, "half_m", i->m.half);
    pb_jsonout_text(&json, "rows_by", i->rows_by);
    pb_jsonout_integer(&json, "nodes_listed", i->listed);
  }
  pb_jsonout_integer(&json, "frames", i->element.frames);
  pb_jsonout_integer(&json, "modes", modes_of(&i->element));
  if (i->node) {
    pb_jsonout_row(&json, "nodes");
    for (size_t f = 0; f < i->element.frames; f++)
      pb_jsonout_integer(&json, NULL, (uint64_t)i->node[f]);
    pb_jsonout_array_end(&json);
  }
  pb_jsonout_array(&json, "positions");
  for (size_t f = 0; f < i->element.frames; f++)
    pb_jsonout_numbers(&json, NULL, i->element.position + 3 * f, 3);
  pb_jsonout_array_end(&json);
  pb_jsonout_text(&json, "units", r->o->in.units ? r->o->in.units : "m,kg,N,s");
  pb_jsonout_boolean(&json, "sound", !r->health.findings);
  pb_jsonout_text(&json, "doctor", summary);
  pb_jsonout_object_end(&json);
  pb_jsonout_end(&json);
}

// ---- writing ------------------------------------------------------------------------------------

static pb_status write_element(const options *o, const loaded *from, pb_error *err) {
  const pb_element_data *d = &from->import.element;
  pb_element *e = NULL;
  char *provenance = source_provenance(&o->in, from);
  char(*number)[24] = calloc(d->frames, sizeof *number);
  const char **name = calloc(d->frames, sizeof *name);
  bool ok = provenance && number && name;
  pb_status st = ok ? PB_OK : pb_fail_memory(err, o->out);
  for (size_t f = 0; !st && f < d->frames; f++) {
    snprintf(number[f], sizeof *number, "%" PRId64,
             from->import.node ? from->import.node[f] : (int64_t)f + 1);
    name[f] = number[f];
  }
  // The loader's own judgement: what it would refuse is not written.
  if (!st)
    st = pb_element_new(o->in.file[0], d->frames, d->size, d->position, d->k, d->m, NULL, &e, err);
  if (!st) {
    const pb_element_out out = {.name = "imported element",
                                .frames = e->frames,
                                .size = e->size,
                                .position = e->position,
                                .k = e->k,
                                .m = e->m,
                                .frame_name = name,
                                .provenance = provenance};
    st = pb_element_write(&out, o->out, o->format, err);
  }
  pb_element_free(e);
  free(provenance);
  free(number);
  free(name);
  return st;
}

int part_import(int argc, char **argv) {
  options o = {0};
  pb_error err = {0};
  source_begin(&o.in);
  pb_options_parse(&argp, argc, argv, &o);
  result r = {.o = &o};
  pb_status st = source_load(&o.in, &r.from, &err);
  if (!st)
    st = pb_element_diagnose(o.in.file[0], &r.from.import.element, NULL, &r.health, NULL, &err);
  if (!st && o.json) print_json(&r);
  if (!st && !o.json) st = print_text(&r, &err);
  if (!st && o.out) st = write_element(&o, &r.from, &err);
  if (st) pb_print_error(stderr, &err);
  source_unload(&r.from);
  source_clear(&o.in);
  return st ? PB_EXIT_FAILED : PB_EXIT_DONE;
}
