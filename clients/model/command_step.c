// plantbus-model step: the response of the sampled plant to a constant command, by the very kernel
// that the daemon steps with: the outputs as measured, all that the electronics do (noise too) in
// them. Row k: the outputs after that many steps.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "csv.h"
#include "matfile.h"
#include "plot.h"
#include "table.h"
#include "tool.h"

enum { DEFAULT_STEPS = 1000, TABLE_STEPS = 20, PANELS = 4 };

typedef struct step {
  const tool *t;
  const pb_model *model;
  channels ch;     // inputs: the one that steps
  size_t count;    // rows
  double *number;  // [count] step numbers, ascending
  double *time;    // [count] s
  double *output;  // [outputs][count], column by column
} step;

// ---- computing ----------------------------------------------------------------------------------

static bool make_rows(const tool *t, step *s) {
  size_t steps = t->steps ? t->steps : wants_table(t) ? TABLE_STEPS : DEFAULT_STEPS;
  s->count = t->at ? t->at_count : steps;
  s->number = malloc(s->count * sizeof *s->number);
  s->time = malloc(s->count * sizeof *s->time);
  s->output = malloc((s->ch.outputs * s->count + 1) * sizeof *s->output);
  if (!s->number || !s->time || !s->output) return false;
  for (size_t k = 0; k < s->count; k++) {
    s->number[k] = t->at ? t->at[k] : (double)(k + 1);
    s->time[k] = s->number[k] / s->model->sample_rate;
  }
  return true;
}

static void simulate(step *s, pb_state *state, double *u, double *y) {
  u[s->ch.input[0]] = s->t->amplitude;
  for (size_t k = 0; k < s->count; k++) {
    while ((double)state->step < s->number[k]) pb_step_advance(s->model, state, u);
    pb_step_output(s->model, state, y);
    for (size_t o = 0; o < s->ch.outputs; o++) s->output[o * s->count + k] = y[s->ch.output[o]];
  }
}

static pb_status compute(step *s, pb_error *err) {
  pb_status status = PB_OK;
  pb_state *state = pb_state_new(s->model);
  double *u = calloc(s->model->nu + 1, sizeof *u), *y = calloc(s->model->ny + 1, sizeof *y);
  if (make_rows(s->t, s) && state && u && y) {
    simulate(s, state, u, y);
  } else {
    status = pb_fail_memory(err, s->t->file);
  }
  free(state);
  free(u);
  free(y);
  return status;
}

// In the files themselves.
static const char convention[] =
    "output at step k is y(k) = C x(k) + D u(k-1), sampled before u(k) acts; the input has its "
    "amplitude over [k, k+1) from k = 0 on, and is 0 before: y(0) = 0.";

// ---- writing ------------------------------------------------------------------------------------

static void step_json(pb_jsonout *json, const void *context) {
  const step *s = context;
  pb_jsonout_object(json, NULL);
  pb_jsonout_text(json, "input", s->ch.input_name[0]);
  pb_jsonout_number(json, "amplitude", s->t->amplitude);
  pb_jsonout_number(json, "sample_rate", s->model->sample_rate);
  pb_jsonout_text(json, "convention", convention);
  pb_jsonout_texts(json, "outputs", s->ch.output_name, s->ch.outputs);
  pb_jsonout_numbers(json, "step", s->number, s->count);
  pb_jsonout_array(json, "output");
  for (size_t k = 0; k < s->count; k++) {
    pb_jsonout_row(json, NULL);
    for (size_t o = 0; o < s->ch.outputs; o++) {
      pb_jsonout_number(json, NULL, s->output[o * s->count + k]);
    }
    pb_jsonout_array_end(json);
  }
  pb_jsonout_array_end(json);
  pb_jsonout_object_end(json);
}

static pb_status step_table(const step *s, pb_error *err) {
  pb_table table = {0};
  size_t shown = s->ch.outputs < PB_TABLE_COLUMNS - 2 ? s->ch.outputs : PB_TABLE_COLUMNS - 2;
  pb_table_number_column(&table, "step", NULL, 15);
  pb_table_number_column(&table, "time", "s", 6);
  for (size_t o = 0; o < shown; o++) {
    pb_table_number_column(&table, s->ch.output_name[o], s->ch.output_unit[o], 6);
  }
  for (size_t k = 0; k < s->count; k++) {
    char number[32];
    snprintf(number, sizeof number, "%.0f", s->number[k]);
    pb_table_text(&table, number);
    pb_table_number(&table, s->time[k]);
    for (size_t o = 0; o < shown; o++) pb_table_number(&table, s->output[o * s->count + k]);
  }
  printf("%s = %g %s from step 0\n", s->ch.input_name[0], s->t->amplitude, s->ch.input_unit[0]);
  pb_status status = pb_table_print(&table, stdout, 2, err);
  if (shown < s->ch.outputs) {
    printf("  (%zu more outputs with --output, --json or -o)\n", s->ch.outputs - shown);
  }
  pb_table_free(&table);
  return status;
}

static pb_status step_csv(const step *s, pb_error *err) {
  pb_csv csv;
  pb_status status = pb_csv_open(s->t->out, &csv, err);
  if (status) return status;
  pb_csv_column(&csv, "step", NULL);
  pb_csv_column(&csv, "time", "s");
  for (size_t o = 0; o < s->ch.outputs; o++) {
    pb_csv_column(&csv, s->ch.output_name[o], s->ch.output_unit[o]);
  }
  for (size_t k = 0; k < s->count; k++) {
    pb_csv_number(&csv, s->number[k]);
    pb_csv_number(&csv, s->time[k]);
    for (size_t o = 0; o < s->ch.outputs; o++) {
      pb_csv_number(&csv, s->output[o * s->count + k]);
    }
  }
  return pb_csv_close(&csv, err);
}

static pb_status step_mat(const step *s, pb_error *err) {
  pb_matfile *mat;
  pb_status status = pb_matfile_open(s->t->out, &mat, err);
  if (status) return status;
  pb_matfile_text(mat, "plant", s->model->name);
  pb_matfile_text(mat, "convention", convention);
  pb_matfile_text(mat, "input", s->ch.input_name[0]);
  pb_matfile_scalar(mat, "amplitude", s->t->amplitude);
  pb_matfile_scalar(mat, "Ts", 1 / s->model->sample_rate);
  pb_matfile_real(mat, "step", s->count, 1, s->number);
  pb_matfile_real(mat, "time", s->count, 1, s->time);
  pb_matfile_real(mat, "output", s->count, s->ch.outputs, s->output);
  pb_matfile_names(mat, "outputs", s->ch.output_name, s->ch.outputs);
  pb_matfile_names(mat, "output_units", s->ch.output_unit, s->ch.outputs);
  return pb_matfile_close(mat, err);
}

// ---- plotting: a panel for each unit ------------------------------------------------------------

typedef struct step_plot {
  pb_plot_panel panel[PANELS];
  char label[PANELS][64];
  const char *unit[PANELS];
  size_t panels;
  pb_plot_curve *curve;  // [PANELS][outputs]
  double *scaled;        // [outputs][count]
} step_plot;

// A prefix that brings lengths, angles and voltages to readable numbers.
static double choose_prefix(const char *unit, double largest, const char **prefix) {
  static const char *const name[] = {"", "m", "µ", "n"};
  size_t k = 0;
  bool takes_one = !strcmp(unit, "m") || !strcmp(unit, "rad") || !strcmp(unit, "V");
  while (takes_one && k < 3 && largest > 0 && largest * pow(1e3, (double)k) < 1) k++;
  *prefix = name[k];
  return pow(1e3, (double)k);
}

static size_t panel_of(step_plot *p, const char *unit) {
  for (size_t k = 0; k < p->panels; k++) {
    if (!strcmp(p->unit[k], unit)) return k;
  }
  if (p->panels == PANELS) return PANELS;
  p->unit[p->panels] = unit;
  return p->panels++;
}

static void fill_panel(const step *s, step_plot *p, size_t k) {
  double largest = 0;
  const char *prefix;
  for (size_t o = 0; o < s->ch.outputs; o++) {
    if (strcmp(s->ch.output_unit[o], p->unit[k])) continue;
    for (size_t i = 0; i < s->count; i++) {
      largest = fmax(largest, fabs(s->output[o * s->count + i]));
    }
  }
  double scale = choose_prefix(p->unit[k], largest, &prefix);
  pb_plot_curve *curve = p->curve + k * s->ch.outputs;
  size_t curves = 0;
  for (size_t o = 0; o < s->ch.outputs; o++) {
    if (strcmp(s->ch.output_unit[o], p->unit[k])) continue;
    double *y = p->scaled + o * s->count;
    for (size_t i = 0; i < s->count; i++) y[i] = scale * s->output[o * s->count + i];
    curve[curves++] = (pb_plot_curve){.label = s->ch.output_name[o],
                                      .color = (int)o + 1,
                                      .count = s->count,
                                      .x = s->time,
                                      .y = y};
  }
  snprintf(p->label[k], sizeof p->label[k], "Output (%s%s)", prefix, p->unit[k]);
  p->panel[k] = (pb_plot_panel){
      .x = {.label = "Time (s)"}, .y = {.label = p->label[k]}, .count = curves, .curve = curve};
}

static pb_status step_draw(const step *s, pb_error *err) {
  step_plot p = {.curve = calloc(PANELS * s->ch.outputs + 1, sizeof *p.curve),
                 .scaled = calloc(s->ch.outputs * s->count + 1, sizeof *p.scaled)};
  pb_status status = p.curve && p.scaled ? PB_OK : pb_fail_memory(err, s->t->out);
  for (size_t o = 0; !status && o < s->ch.outputs; o++) {
    if (panel_of(&p, s->ch.output_unit[o]) == PANELS) {
      status = pb_fail(err, PB_ERR_ARGUMENT, s->t->out,
                       "more than %d different units in one plot; choose with --output", PANELS);
    }
  }
  if (!status) {
    char title[256];
    for (size_t k = 0; k < p.panels; k++) fill_panel(s, &p, k);
    snprintf(title, sizeof title, "%s: step of %s, %g %s", s->model->name, s->ch.input_name[0],
             s->t->amplitude, s->ch.input_unit[0]);
    pb_plot_figure figure = {.title = title, .shared_x = true, .count = p.panels, .panel = p.panel};
    status = pb_plot(s->t->out, &figure, err);
  }
  free(p.curve);
  free(p.scaled);
  return status;
}

// ---- together -----------------------------------------------------------------------------------

static int emit(const step *s) {
  pb_error err = {0};
  if (wants_table(s->t)) return tool_end(step_table(s, &err), &err);
  int code = emit_json(s->t, step_json, s);
  if (code) return code;
  switch (s->t->out_format) {
  case FORMAT_CSV:
    return emit_done(s->t, step_csv(s, &err), &err);
  case FORMAT_MAT:
    return emit_done(s->t, step_mat(s, &err), &err);
  case FORMAT_PNG:
    return emit_done(s->t, step_draw(s, &err), &err);
  default:
    return PB_EXIT_DONE;
  }
}

int command_step(const tool *t, const pb_model *model) {
  step s = {.t = t, .model = model};
  int code = channels_choose(t, model, false, &s.ch);
  if (code) return code;
  pb_error err = {0};
  code = tool_end(compute(&s, &err), &err);
  if (!code) code = emit(&s);
  free(s.number);
  free(s.time);
  free(s.output);
  channels_free(&s.ch);
  return code;
}
