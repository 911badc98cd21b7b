// Characteristics over a dimension, or over the density of the mesh.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "build.h"
#include "jsonout.h"
#include "plot.h"
#include "table.h"
#include "standard_output.h"

// One row a build. Columns are those of the first one: the type of part stays the same.
typedef struct row {
  double parameter, dof, seconds;
  pb_characteristic value[PB_CHARACTERISTICS];
} row;

typedef struct study {
  const char *parameter;  // what is varied, as the table's first column says it
  size_t count, values;
  row *row;  // [count]
} study;

static pb_status run_row(const cJSON *json, const char *pointer, double value, study *s, row *out,
                         pb_error *err) {
  char text[32];
  cJSON *changed = NULL;
  build b = {0};
  pb_jsonout_format(value, text);
  pb_status st = build_set(json, pointer, text, &changed, err);
  if (!st) st = build_model(changed, &b, err);
  if (!st) st = build_reduce(&b, false, err);
  if (!st) {
    out->parameter = value;
    out->dof = (double)b.element->full_dof;
    out->seconds = b.seconds[0] + b.seconds[1];
    memcpy(out->value, b.value, sizeof out->value);
    s->values = b.values;
  }
  build_clear(&b);
  cJSON_Delete(changed);
  return st;
}

static pb_status print_table(const study *s, pb_error *err) {
  pb_table table = {0};
  pb_table_number_column(&table, s->parameter, NULL, 6);
  pb_table_number_column(&table, "DoF", NULL, 7);
  for (size_t i = 0; i < s->values; i++)
    pb_table_number_column(&table, s->row[0].value[i].name, s->row[0].value[i].unit, 5);
  pb_table_number_column(&table, "time", "s", 3);
  for (size_t r = 0; r < s->count; r++) {
    pb_table_number(&table, s->row[r].parameter);
    pb_table_count(&table, (size_t)s->row[r].dof);
    for (size_t i = 0; i < s->values; i++) pb_table_number(&table, s->row[r].value[i].value);
    pb_table_number(&table, s->row[r].seconds);
  }
  pb_status st = pb_table_print(&table, stdout, 0, err);
  pb_table_free(&table);
  return st;
}

static pb_status print_json(const study *s, pb_error *err) {
  pb_jsonout json;
  pb_jsonout_begin(&json, stdout);
  pb_jsonout_object(&json, NULL);
  pb_jsonout_text(&json, "parameter", s->parameter);
  pb_jsonout_array(&json, "rows");
  for (size_t r = 0; r < s->count; r++) {
    pb_jsonout_object(&json, NULL);
    pb_jsonout_number(&json, "parameter", s->row[r].parameter);
    pb_jsonout_integer(&json, "full_dof", (uint64_t)s->row[r].dof);
    pb_jsonout_number(&json, "seconds", s->row[r].seconds);
    for (size_t i = 0; i < s->values; i++)
      pb_jsonout_number(&json, s->row[r].value[i].name, s->row[r].value[i].value);
    pb_jsonout_object_end(&json);
  }
  pb_jsonout_array_end(&json);
  pb_jsonout_object_end(&json);
  pb_jsonout_end(&json);
  return pb_stdout_flush(err);
}

// ---- plot ---------------------------------------------------------------------------------------

static void column(const study *s, const char *name, double *out) {
  for (size_t r = 0; r < s->count; r++) {
    out[r] = NAN;
    for (size_t i = 0; i < s->values; i++)
      if (!strcmp(s->row[r].value[i].name, name)) out[r] = s->row[r].value[i].value;
  }
}

// A joint is judged by its axial against its bending stiffness, an actuator by its stiffness
// against its amplification: above, over the parameter; below, against each other.
static pb_status plot_sweep(const study *s, const char *path, pb_error *err) {
  bool joint = false;
  for (size_t i = 0; i < s->values; i++)
    joint |= !strcmp(s->row[0].value[i].name, "bending_stiffness");
  double *x = malloc(3 * s->count * sizeof *x), *soft = x + s->count, *stiff = soft + s->count;
  if (!x) return pb_fail_memory(err, path);
  for (size_t r = 0; r < s->count; r++) x[r] = s->row[r].parameter;
  column(s, joint ? "bending_stiffness" : "amplification", soft);
  column(s, "axial_stiffness", stiff);
  for (size_t r = 0; r < s->count; r++) stiff[r] *= 1e-6;
  pb_plot_curve curve[] = {{NULL, PB_PLOT_LINE, 1, s->count, x, stiff},
                           {NULL, PB_PLOT_SQUARE, 1, s->count, x, stiff},
                           {NULL, PB_PLOT_LINE, 2, s->count, x, soft},
                           {NULL, PB_PLOT_SQUARE, 2, s->count, x, soft},
                           {NULL, PB_PLOT_LINE, 3, s->count, soft, stiff},
                           {NULL, PB_PLOT_SQUARE, 3, s->count, soft, stiff}};
  const char *soft_name = joint ? "Bending stiffness (Nm/rad)" : "Amplification";
  pb_plot_panel panel[] = {
      {.x = {.label = s->parameter},
       .y = {.label = "Axial stiffness (N/µm)"},
       .count = 2,
       .curve = curve},
      {.x = {.label = s->parameter}, .y = {.label = soft_name}, .count = 2, .curve = curve + 2},
      {.x = {.label = soft_name},
       .y = {.label = "Axial stiffness (N/µm)"},
       .count = 2,
       .curve = curve + 4}};
  pb_plot_figure figure = {.title = NULL, .count = 3, .panel = panel};
  pb_status st = pb_plot(path, &figure, err);
  free(x);
  return st;
}

static pb_status run_study(const build_options *o, const char *pointer, const char *name,
                           size_t count, const double *value, pb_error *err) {
  study s = {.parameter = name, .count = count, .row = calloc(count, sizeof(row))};
  cJSON *json = NULL;
  pb_status st = s.row ? build_read(o, &json, err) : pb_fail_memory(err, pointer);
  for (size_t r = 0; !st && r < count; r++)
    st = run_row(json, pointer, value[r], &s, s.row + r, err);
  if (!st) st = o->json ? print_json(&s, err) : print_table(&s, err);
  if (!st && o->plot) st = plot_sweep(&s, o->plot, err);
  cJSON_Delete(json);
  free(s.row);
  return st;
}

pb_status build_sweep(const build_options *o, pb_error *err) {
  const char *equal = strchr(o->sweep, '=');
  char *pointer = strndup(o->sweep, (size_t)(equal - o->sweep));
  double *value = NULL;
  size_t count = 0;
  pb_status st = PB_OK;
  if (!pointer) return pb_fail_memory(err, "--sweep");
  if (!pb_parse_double_list(equal + 1, &value, &count)) st = pb_fail_memory(err, "--sweep");
  const char *last = strrchr(pointer, '/');
  if (!st) st = run_study(o, pointer, last[1] ? last + 1 : pointer, count, value, err);
  free(pointer);
  free(value);
  return st;
}

pb_status build_converge(const build_options *o, pb_error *err) {
  return run_study(o, "/mesh/density", "density", o->densities, o->density, err);
}
