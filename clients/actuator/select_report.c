// The report of plantbus-actuator select: table, JSON, files, and stroke over stiffness.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "csv.h"
#include "plot.h"
#include "select.h"
#include "table.h"

static const char *verdict_of(const select_candidate *c) {
  if (c->missed == 0) return c->unknown ? "meets what is known" : "meets";
  return c->missed == c->near ? "near miss" : "misses";
}

// "misses resolution by 50 %, …; unknown: …"
static void remark(const select_result *j, const select_candidate *c, pb_text *text) {
  size_t told = 0;
  for (size_t k = 0; k < j->limits.count; k++) {
    if (c->entry[k].verdict != PB_MISSED) continue;
    pb_text_format(text, "%s%s by %.3g %%", told++ ? ", " : "", j->limits.limit[k].quantity->name,
                   fabs(100 * c->entry[k].margin));
  }
  for (size_t k = 0, first = 1; k < j->limits.count; k++) {
    if (c->entry[k].verdict != PB_UNKNOWN) continue;
    pb_text_format(text, "%s%s%s", first && told ? "; " : "", first ? "unknown: " : ", ",
                   j->limits.limit[k].quantity->name);
    first = 0;
  }
}

static pb_status print(const select_result *j, pb_error *err) {
  pb_table t = {0};
  char head[96], text[96];
  printf("%s\n\n", j->limits.name);
  pb_table_text_column(&t, "actuator");
  for (size_t k = 0; k < j->limits.count; k++) {
    const pb_limit *l = &j->limits.limit[k];
    snprintf(head, sizeof head, "%s", l->quantity->name);
    pb_table_number_column(&t, head, l->quantity->unit, 4);
  }
  pb_table_text_column(&t, "verdict");
  pb_table_text_column(&t, "by how much");
  pb_table_text(&t, "limit");
  for (size_t k = 0; k < j->limits.count; k++) {
    pb_limit_text(&j->limits.limit[k], text, sizeof text);
    pb_table_text(&t, text);
  }
  pb_table_text(&t, "");
  pb_table_text(&t, "");
  pb_status st = PB_OK;
  for (size_t i = 0; i < j->count && !st; i++) {
    const select_candidate *c = &j->candidate[i];
    pb_text why = {0};
    pb_table_text(&t, c->name);
    for (size_t k = 0; k < j->limits.count; k++)
      pb_table_number(&t, c->entry[k].value * j->limits.limit[k].quantity->scale);
    pb_table_text(&t, verdict_of(c));
    remark(j, c, &why);
    pb_table_text(&t, why.text);
    if (why.failed) st = pb_fail_memory(err, c->name);
    free(why.text);
  }
  if (!st) st = pb_table_print(&t, stdout, 2, err);
  pb_table_free(&t);
  return st;
}

static const char *const verdict_names[] = {
    [PB_UNKNOWN] = "unknown", [PB_MET] = "met", [PB_MISSED] = "missed"};

static void print_json(const select_result *j) {
  pb_jsonout out;
  pb_jsonout_begin(&out, stdout);
  pb_jsonout_object(&out, NULL);
  pb_jsonout_text(&out, "specification", j->limits.name);
  pb_jsonout_integer(&out, "meeting", j->meeting);
  pb_jsonout_array(&out, "actuators");
  for (size_t i = 0; i < j->count; i++) {
    const select_candidate *c = &j->candidate[i];
    pb_jsonout_object(&out, NULL);
    pb_jsonout_text(&out, "name", c->name);
    pb_jsonout_text(&out, "verdict", verdict_of(c));
    pb_jsonout_boolean(&out, "meets", c->meets);
    pb_jsonout_object(&out, "limits");
    for (size_t k = 0; k < j->limits.count; k++) {
      pb_jsonout_object(&out, j->limits.limit[k].quantity->key);
      pb_jsonout_number(&out, "value", c->entry[k].value);
      pb_jsonout_text(&out, "verdict", verdict_names[c->entry[k].verdict]);
      pb_jsonout_number(&out, "margin", c->entry[k].margin);
      pb_jsonout_object_end(&out);
    }
    pb_jsonout_object_end(&out);
    pb_jsonout_object_end(&out);
  }
  pb_jsonout_array_end(&out);
  pb_jsonout_object_end(&out);
  pb_jsonout_end(&out);
}

static pb_status save_csv(const select_result *j, const char *path, pb_error *err) {
  pb_csv csv = {0};
  char head[96];
  pb_status st = pb_csv_open(path, &csv, err);
  if (st) return st;
  pb_csv_column(&csv, "actuator", NULL);
  pb_csv_column(&csv, "verdict", NULL);
  for (size_t k = 0; k < j->limits.count; k++) {
    pb_csv_column(&csv, j->limits.limit[k].quantity->key, NULL);
    snprintf(head, sizeof head, "margin of %s", j->limits.limit[k].quantity->key);
    pb_csv_column(&csv, head, NULL);
  }
  for (size_t i = 0; i < j->count; i++) {
    pb_csv_text(&csv, j->candidate[i].name);
    pb_csv_text(&csv, verdict_of(&j->candidate[i]));
    for (size_t k = 0; k < j->limits.count; k++) {
      pb_csv_number(&csv, j->candidate[i].entry[k].value);
      pb_csv_number(&csv, j->candidate[i].entry[k].margin);
    }
  }
  return pb_csv_close(&csv, err);
}

static pb_status save_mat(const select_result *j, const char *path, pb_error *err) {
  pb_matfile *mat;
  const size_t n = j->count, limits = j->limits.count;
  const char **name = malloc(n * sizeof *name), **key = malloc(limits * sizeof *key);
  double *value = malloc(n * limits * sizeof *value), *margin = malloc(n * limits * sizeof *margin);
  pb_status st =
      name && key && value && margin ? pb_matfile_open(path, &mat, err) : pb_fail_memory(err, path);
  for (size_t i = 0; i < n && !st; i++) {
    name[i] = j->candidate[i].name;
    for (size_t k = 0; k < limits; k++) {
      value[i + k * n] = j->candidate[i].entry[k].value;
      margin[i + k * n] = j->candidate[i].entry[k].margin;
    }
  }
  for (size_t k = 0; k < limits && !st; k++) key[k] = j->limits.limit[k].quantity->key;
  if (!st) {
    pb_matfile_names(mat, "actuators", name, n);
    pb_matfile_names(mat, "quantities", key, limits);
    pb_matfile_real(mat, "value", n, limits, value);
    pb_matfile_real(mat, "margin", n, limits, margin);
    st = pb_matfile_close(mat, err);
  }
  free(name);
  free(key);
  free(value);
  free(margin);
  return st;
}

// Stroke over stiffness, each actuator a named point, as one looks for a compromise.
static pb_status plot(const select_result *j, const char *path, pb_error *err) {
  double x[64], y[64];
  pb_plot_text text[64];
  size_t stroke = j->limits.count, stiffness = j->limits.count, count = 0;
  double right = 0, top = 0;
  for (size_t k = 0; k < j->limits.count; k++) {
    if (!strcmp(j->limits.limit[k].quantity->key, "stroke")) stroke = k;
    if (!strcmp(j->limits.limit[k].quantity->key, "stiffness")) stiffness = k;
  }
  if (stroke == j->limits.count || stiffness == j->limits.count)
    return pb_fail(err, PB_ERR_ARGUMENT, "--plot",
                   "the specification limits no stroke or stiffness");
  for (size_t i = 0; i < j->count && count < 64; i++) {
    x[count] = 1e-6 * j->candidate[i].entry[stiffness].value;
    y[count] = 1e6 * j->candidate[i].entry[stroke].value;
    if (isnan(x[count]) || isnan(y[count])) continue;
    text[count] = (pb_plot_text){x[count], y[count], j->candidate[i].name};
    right = fmax(right, x[count]);
    top = fmax(top, y[count]);
    count++;
  }
  if (count == 0)
    return pb_fail(err, PB_ERR_ARGUMENT, "--plot", "no actuator's stroke and stiffness are known");
  for (size_t i = 0; i < count; i++) text[i].x += 0.012 * right;  // beside its point
  const pb_plot_curve curve = {NULL, PB_PLOT_SQUARE, 1, count, x, y};
  // From zero, and with room for the name of the last one.
  const pb_plot_panel panel = {.x = {.label = "Axial stiffness (N/µm)", .max = 1.15 * right},
                               .y = {.label = "Stroke (µm)", .max = 1.1 * top},
                               .texts = count,
                               .text = text,
                               .count = 1,
                               .curve = &curve};
  const pb_plot_figure figure = {.title = j->limits.name, .count = 1, .panel = &panel};
  return pb_plot(path, &figure, err);
}

pb_status select_present(const select_options *o, const select_result *j, pb_error *err) {
  char path[1024];
  pb_status st = PB_OK;
  if (o->result.json)
    print_json(j);
  else
    st = print(j, err);
  if (!st && o->result.dir) {
    st = pb_result_path(&o->result, "select.csv", path, sizeof path, err);
    if (!st) st = save_csv(j, path, err);
    if (!st) st = pb_result_path(&o->result, "select.mat", path, sizeof path, err);
    if (!st) st = save_mat(j, path, err);
  }
  if (!st && o->result.plot) {
    st = pb_result_path(&o->result, "select.png", path, sizeof path, err);
    if (!st) st = plot(j, path, err);
  }
  return st;
}
