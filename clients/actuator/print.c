// Figures and responses as tables, JSON, CSV and MAT: see print.h.
#include "print.h"

#include <ctype.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "csv.h"
#include "table.h"

double *log_frequencies(double f1, double f2, size_t nf) {
  double *hz = malloc(nf * sizeof *hz);
  for (size_t i = 0; hz && i < nf; i++)
    hz[i] = f1 * pow(f2 / f1, nf > 1 ? (double)i / (double)(nf - 1) : 0);
  return hz;
}

pb_status channel_response(const pb_model *m, const char *input, const char *output,
                           const double *hz, size_t nf, double complex **h, pb_error *err) {
  const int i = pb_model_input(m, input), o = pb_model_output(m, output);
  *h = NULL;
  if (i < 0 || o < 0)
    return pb_fail(err, PB_ERR_REFERENCE, i < 0 ? input : output, "the part has no such signal");
  double complex *all = malloc(nf * m->nu * m->ny * sizeof *all), *out = malloc(nf * sizeof *out);
  pb_status st = all && out ? PB_OK : pb_fail_memory(err, output);
  if (!st) st = pb_model_frf(m, PB_CONTINUOUS, hz, nf, all, err);
  for (size_t f = 0; f < nf && !st; f++) out[f] = all[(f * m->ny + (size_t)o) * m->nu + (size_t)i];
  free(all);
  if (st)
    free(out);
  else
    *h = out;
  return st;
}

// ---- figures ------------------------------------------------------------------------------------

// In percent of the nearest end of the data sheet's range; 0 inside.
static double difference(const part_figure *f) {
  if (isnan(f->low) || isnan(f->value)) return NAN;
  if (f->value < f->low) return 100 * (f->value / f->low - 1);
  return f->value > f->high ? 100 * (f->value / f->high - 1) : 0;
}

static void sheet_text(const part_figure *f, char *text, size_t size) {
  if (isnan(f->low))
    snprintf(text, size, "–");
  else if (f->low == f->high)
    snprintf(text, size, "%.4g", f->low * f->scale);
  else
    snprintf(text, size, "%.4g … %.4g", f->low * f->scale, f->high * f->scale);
}

pb_status figures_print(const part_figure *f, size_t count, bool sheet, pb_error *err) {
  pb_table t = {0};
  char text[64];
  pb_table_text_column(&t, "figure");
  pb_table_number_column(&t, "value", NULL, 5);
  pb_table_text_column(&t, "unit");
  if (sheet) pb_table_text_column(&t, "data sheet");
  if (sheet) pb_table_number_column(&t, "diff", "%", 3);
  for (size_t i = 0; i < count; i++) {
    pb_table_text(&t, f[i].name);
    pb_table_number(&t, f[i].value * f[i].scale);
    pb_table_text(&t, f[i].unit);
    if (!sheet) continue;
    sheet_text(&f[i], text, sizeof text);
    pb_table_text(&t, text);
    pb_table_number(&t, difference(&f[i]));
  }
  pb_status st = pb_table_print(&t, stdout, 2, err);
  pb_table_free(&t);
  return st;
}

void figures_json(pb_jsonout *j, const part_figure *f, size_t count) {
  for (size_t i = 0; i < count; i++) pb_jsonout_number(j, f[i].key, f[i].value);
  pb_jsonout_object(j, "data_sheet");
  for (size_t i = 0; i < count; i++) {
    if (isnan(f[i].low)) continue;
    pb_jsonout_object(j, f[i].key);
    pb_jsonout_number(j, "low", f[i].low);
    pb_jsonout_number(j, "high", f[i].high);
    pb_jsonout_number(j, "difference_percent", difference(&f[i]));
    pb_jsonout_object_end(j);
  }
  pb_jsonout_object_end(j);
}

pb_status figures_csv(const char *path, const part_figure *f, size_t count, pb_error *err) {
  pb_csv csv = {0};
  pb_status st = pb_csv_open(path, &csv, err);
  if (st) return st;
  for (size_t i = 0; i < count; i++) pb_csv_column(&csv, f[i].key, NULL);
  for (size_t i = 0; i < count; i++) pb_csv_number(&csv, f[i].value);
  return pb_csv_close(&csv, err);
}

void figures_mat(pb_matfile *mat, const part_figure *f, size_t count) {
  for (size_t i = 0; i < count; i++) pb_matfile_scalar(mat, f[i].key, f[i].value);
}

// ---- responses ----------------------------------------------------------------------------------

pb_status responses_csv(const char *path, const double *hz, size_t nf, const response *r,
                        size_t count, pb_error *err) {
  pb_csv csv = {0};
  char name[128];
  pb_status st = pb_csv_open(path, &csv, err);
  if (st) return st;
  pb_csv_column(&csv, "frequency", "Hz");
  for (size_t i = 0; i < count; i++) {
    snprintf(name, sizeof name, "real %s", r[i].name);
    pb_csv_column(&csv, name, r[i].unit);
    snprintf(name, sizeof name, "imag %s", r[i].name);
    pb_csv_column(&csv, name, r[i].unit);
  }
  for (size_t f = 0; f < nf; f++) {
    pb_csv_number(&csv, hz[f]);
    for (size_t i = 0; i < count; i++) {
      pb_csv_number(&csv, creal(r[i].h[f]));
      pb_csv_number(&csv, cimag(r[i].h[f]));
    }
  }
  return pb_csv_close(&csv, err);
}

void responses_mat(pb_matfile *mat, const double *hz, size_t nf, const response *r, size_t count) {
  pb_matfile_real(mat, "frequency_hz", nf, 1, hz);
  for (size_t i = 0; i < count; i++) {
    char name[64];
    snprintf(name, sizeof name, "h_%.60s", r[i].name);
    for (char *c = name; *c; c++)
      if (!isalnum((unsigned char)*c)) *c = '_';
    pb_matfile_complex(mat, name, nf, 1, r[i].h);
  }
}
