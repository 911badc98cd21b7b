// plantbus-model frf: exact frequency responses from command to measured output.
#include <complex.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "csv.h"
#include "matfile.h"
#include "plot.h"
#include "table.h"
#include "tool.h"

enum { MOST_CURVES = 64 };

typedef struct frf {
  const tool *t;
  const pb_model *model;
  channels ch;
  size_t count;
  double *hz;         // [count]
  double complex *h;  // [count][outputs][inputs]: the chosen ones
} frf;

static double complex value_of(const frf *f, size_t k, size_t o, size_t i) {
  return f->h[(k * f->ch.outputs + o) * f->ch.inputs + i];
}

// ---- computing ----------------------------------------------------------------------------------

// The frequencies asked for: a list, or a grid from 1 Hz to half the sample rate.
static bool make_grid(const tool *t, frf *f) {
  f->count = t->frequencies ? t->frequency_count : t->points;
  size_t usual = wants_table(t) ? 25 : t->out_format == FORMAT_PNG ? 3000 : 500;
  if (!f->count) f->count = usual;
  f->hz = malloc(f->count * sizeof *f->hz);
  if (!f->hz) return false;
  if (t->frequencies) {
    memcpy(f->hz, t->frequencies, f->count * sizeof *f->hz);
    return true;
  }
  double to = t->to > 0 ? t->to : 0.5 * f->model->sample_rate;
  double from = t->from > 0 ? t->from : fmin(1, 1e-3 * to);
  for (size_t k = 0; k < f->count; k++) {
    double part = f->count > 1 ? (double)k / (double)(f->count - 1) : 0;
    f->hz[k] = t->linear ? from + part * (to - from) : from * pow(to / from, part);
  }
  if (f->count > 1) f->hz[f->count - 1] = to;  // not one rounding error beyond
  return true;
}

static pb_status compute(frf *f, pb_error *err) {
  const pb_model *m = f->model;
  size_t chosen = f->ch.outputs * f->ch.inputs;
  if (!make_grid(f->t, f)) return pb_fail_memory(err, f->t->file);
  double complex *all = malloc((f->count * m->ny * m->nu + 1) * sizeof *all);
  f->h = malloc((f->count * chosen + 1) * sizeof *f->h);
  pb_status status = all && f->h ? PB_OK : pb_fail_memory(err, f->t->file);
  if (!status) {
    status = pb_model_frf(m, f->t->sampled ? PB_SAMPLED : PB_CONTINUOUS, f->hz, f->count, all, err);
  }
  for (size_t k = 0; !status && k < f->count; k++) {
    for (size_t c = 0; c < chosen; c++) {
      size_t o = f->ch.output[c / f->ch.inputs], i = f->ch.input[c % f->ch.inputs];
      f->h[k * chosen + c] = all[(k * m->ny + o) * m->nu + i];
    }
  }
  free(all);
  return status;
}

// ---- writing ------------------------------------------------------------------------------------

static void frf_part(pb_jsonout *json, const char *key, const frf *f, bool imaginary) {
  pb_jsonout_array(json, key);
  for (size_t k = 0; k < f->count; k++) {
    pb_jsonout_row(json, NULL);
    for (size_t o = 0; o < f->ch.outputs; o++) {
      pb_jsonout_row(json, NULL);
      for (size_t i = 0; i < f->ch.inputs; i++) {
        double complex value = value_of(f, k, o, i);
        pb_jsonout_number(json, NULL, imaginary ? cimag(value) : creal(value));
      }
      pb_jsonout_array_end(json);
    }
    pb_jsonout_array_end(json);
  }
  pb_jsonout_array_end(json);
}

static void frf_json(pb_jsonout *json, const void *context) {
  const frf *f = context;
  pb_jsonout_object(json, NULL);
  pb_jsonout_boolean(json, "sampled", f->t->sampled);
  pb_jsonout_numbers(json, "frequency_hz", f->hz, f->count);
  emit_channels_json(json, &f->ch);
  frf_part(json, "real", f, false);
  frf_part(json, "imag", f, true);
  pb_jsonout_object_end(json);
}

// One table per pair: readable for any number of signals.
static pb_status frf_table(const frf *f, pb_error *err) {
  pb_status status = PB_OK;
  for (size_t c = 0; !status && c < f->ch.outputs * f->ch.inputs; c++) {
    size_t o = c / f->ch.inputs, i = c % f->ch.inputs;
    char unit[64];
    channels_unit(&f->ch, o, i, unit, sizeof unit);
    pb_table table = {0};
    pb_table_number_column(&table, "frequency", "Hz", 6);
    pb_table_number_column(&table, "magnitude", unit, 6);
    pb_table_number_column(&table, "magnitude", "dB", 5);
    pb_table_number_column(&table, "phase", "°", 5);
    for (size_t k = 0; k < f->count; k++) {
      double complex value = value_of(f, k, o, i);
      pb_table_number(&table, f->hz[k]);
      pb_table_number(&table, cabs(value));
      pb_table_number(&table, 20 * log10(cabs(value)));
      pb_table_number(&table, carg(value) * 180 / acos(-1));
    }
    printf("%s%s → %s\n", c ? "\n" : "", f->ch.input_name[i], f->ch.output_name[o]);
    status = pb_table_print(&table, stdout, 2, err);
    pb_table_free(&table);
  }
  return status;
}

static pb_status frf_csv(const frf *f, pb_error *err) {
  pb_csv csv;
  pb_status status = pb_csv_open(f->t->out, &csv, err);
  if (status) return status;
  pb_csv_column(&csv, "frequency", "Hz");
  for (size_t c = 0; c < f->ch.outputs * f->ch.inputs; c++) {
    size_t o = c / f->ch.inputs, i = c % f->ch.inputs;
    char unit[64], name[160];
    channels_unit(&f->ch, o, i, unit, sizeof unit);
    for (int part = 0; part < 2; part++) {
      snprintf(name, sizeof name, "%s→%s %s", f->ch.input_name[i], f->ch.output_name[o],
               part ? "imag" : "real");
      pb_csv_column(&csv, name, unit);
    }
  }
  for (size_t k = 0; k < f->count; k++) {
    pb_csv_number(&csv, f->hz[k]);
    for (size_t c = 0; c < f->ch.outputs * f->ch.inputs; c++) {
      double complex value = f->h[k * f->ch.outputs * f->ch.inputs + c];
      pb_csv_number(&csv, creal(value));
      pb_csv_number(&csv, cimag(value));
    }
  }
  return pb_csv_close(&csv, err);
}

static pb_status frf_mat(const frf *f, pb_error *err) {
  pb_matfile *mat;
  pb_status status = pb_matfile_open(f->t->out, &mat, err);
  if (status) return status;
  pb_matfile_text(mat, "plant", f->model->name);
  pb_matfile_real(mat, "frequency_hz", f->count, 1, f->hz);
  pb_matfile_frf(mat, "H", f->count, f->ch.outputs, f->ch.inputs, f->h);
  pb_matfile_scalar(mat, "Ts", f->t->sampled ? 1 / f->model->sample_rate : 0);
  pb_matfile_names(mat, "inputs", f->ch.input_name, f->ch.inputs);
  pb_matfile_names(mat, "outputs", f->ch.output_name, f->ch.outputs);
  pb_matfile_names(mat, "input_units", f->ch.input_unit, f->ch.inputs);
  pb_matfile_names(mat, "output_units", f->ch.output_unit, f->ch.outputs);
  return pb_matfile_close(mat, err);
}

// ---- plotting -----------------------------------------------------------------------------------

// The unit all pairs share, or NULL.
static const char *common_unit(const frf *f, char text[64]) {
  channels_unit(&f->ch, 0, 0, text, 64);
  for (size_t c = 1; c < f->ch.outputs * f->ch.inputs; c++) {
    char other[64];
    channels_unit(&f->ch, c / f->ch.inputs, c % f->ch.inputs, other, sizeof other);
    if (strcmp(text, other)) return NULL;
  }
  return text;
}

typedef struct bode_memory {
  pb_bode_curve *curve;
  double complex *h;   // [pairs][count]
  char (*label)[160];  // [pairs]
} bode_memory;

static void fill_curves(const frf *f, bool with_units, bode_memory *b) {
  for (size_t c = 0; c < f->ch.outputs * f->ch.inputs; c++) {
    size_t o = c / f->ch.inputs, i = c % f->ch.inputs;
    char unit[64];
    channels_unit(&f->ch, o, i, unit, sizeof unit);
    int length = snprintf(b->label[c], sizeof b->label[c], "%s → %s", f->ch.input_name[i],
                          f->ch.output_name[o]);
    if (with_units && length > 0 && (size_t)length < sizeof b->label[c]) {
      snprintf(b->label[c] + length, sizeof b->label[c] - (size_t)length, " (%s)", unit);
    }
    double complex *h = b->h + c * f->count;
    for (size_t k = 0; k < f->count; k++) h[k] = value_of(f, k, o, i);
    b->curve[c] = (pb_bode_curve){.label = b->label[c], .count = f->count, .hz = f->hz, .h = h};
  }
}

static pb_status frf_plot(const frf *f, pb_error *err) {
  size_t pairs = f->ch.outputs * f->ch.inputs;
  if (pairs > MOST_CURVES) {
    return pb_fail(err, PB_ERR_ARGUMENT, f->t->out,
                   "%zu curves are too many for one plot; choose with --input and --output", pairs);
  }
  char unit[64], title[256];
  bode_memory b = {.curve = calloc(pairs + 1, sizeof *b.curve),
                   .h = calloc(pairs * f->count + 1, sizeof *b.h),
                   .label = calloc(pairs + 1, sizeof *b.label)};
  pb_status status = b.curve && b.h && b.label ? PB_OK : pb_fail_memory(err, f->t->out);
  if (!status) {
    const char *shared = common_unit(f, unit);
    fill_curves(f, !shared, &b);
    snprintf(title, sizeof title, f->t->sampled ? "%s, sampled at %g Hz" : "%s", f->model->name,
             f->model->sample_rate);
    pb_bode_plot plot = {.title = title,
                         .unit = shared ? shared : "SI units",
                         .decibel = f->t->decibel,
                         .count = pairs,
                         .curve = b.curve};
    status = pb_plot_bode(f->t->out, &plot, err);
  }
  free(b.curve);
  free(b.h);
  free(b.label);
  return status;
}

// ---- together -----------------------------------------------------------------------------------

static int emit(const frf *f) {
  pb_error err = {0};
  if (wants_table(f->t)) return tool_end(frf_table(f, &err), &err);
  int code = emit_json(f->t, frf_json, f);
  if (code) return code;
  switch (f->t->out_format) {
  case FORMAT_CSV:
    return emit_done(f->t, frf_csv(f, &err), &err);
  case FORMAT_MAT:
    return emit_done(f->t, frf_mat(f, &err), &err);
  case FORMAT_PNG:
    return emit_done(f->t, frf_plot(f, &err), &err);
  default:
    return PB_EXIT_DONE;
  }
}

int command_frf(const tool *t, const pb_model *model) {
  frf f = {.t = t, .model = model};
  int code = channels_choose(t, model, false, &f.ch);
  if (code) return code;
  pb_error err = {0};
  code = tool_end(compute(&f, &err), &err);
  if (!code) code = emit(&f);
  free(f.hz);
  free(f.h);
  channels_free(&f.ch);
  return code;
}
