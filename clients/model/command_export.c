// plantbus-model export: the state space, for other programs.
//
//   ẋ = A x + B u, y = C x + D u;  x(k+1) = A_d x(k) + B_d u(k), y(k) = C x(k) + D u(k−1)
//
// u is what acts and y what the plant does; the electronics between command and u, and between y
// and the measured value, stand beside as numbers a signal.
#include <stdio.h>
#include <stdlib.h>

#include "csv.h"
#include "matfile.h"
#include "tool.h"

typedef struct export {
  const tool *t;
  const pb_model *model;
  channels ch;  // all of the model's
}
export;

// ---- MAT: dense matrices ------------------------------------------------------------------------

static double *dense(const pb_model *m, const double *blocks) {
  double *full = calloc(m->nx * m->nx + 1, sizeof *full);
  for (size_t k = 0; full && k < m->blocks; k++) {
    size_t first = m->block_start[k], size = m->block_start[k + 1] - first;
    for (size_t i = 0; i < size * size; i++) {
      full[(first + i / size) * m->nx + first + i % size] = blocks[m->block_value[k] + i];
    }
  }
  return full;
}

static void electronics_mat(void *context, const char *name, const double *value, size_t count) {
  pb_matfile_real(context, name, count, 1, value);
}

static pb_status export_mat(const export *e, pb_error *err) {
  const pb_model *m = e->model;
  double *a = dense(m, m->a), *ad = dense(m, m->ad);
  pb_matfile *mat = NULL;
  pb_status status = a && ad ? PB_OK : pb_fail_memory(err, e->t->out);
  if (!status) status = pb_matfile_open(e->t->out, &mat, err);
  if (!status) {
    pb_matfile_text(mat, "name", m->name);
    pb_matfile_real(mat, "A", m->nx, m->nx, a);
    pb_matfile_real(mat, "B", m->nx, m->nu, m->b);
    pb_matfile_real(mat, "C", m->ny, m->nx, m->c);
    pb_matfile_real(mat, "D", m->ny, m->nu, m->d);
    pb_matfile_real(mat, "A_d", m->nx, m->nx, ad);
    pb_matfile_real(mat, "B_d", m->nx, m->nu, m->bd);
    pb_matfile_scalar(mat, "Ts", 1 / m->sample_rate);
    pb_matfile_real(mat, "modes_hz", m->modes, 1, m->mode_hz);
    pb_matfile_real(mat, "damping", m->modes, 1, m->mode_damping);
    pb_matfile_names(mat, "inputs", e->ch.input_name, m->nu);
    pb_matfile_names(mat, "input_units", e->ch.input_unit, m->nu);
    pb_matfile_names(mat, "outputs", e->ch.output_name, m->ny);
    pb_matfile_names(mat, "output_units", e->ch.output_unit, m->ny);
    electronics_each(m, electronics_mat, mat);
    status = pb_matfile_close(mat, err);
  }
  free(a);
  free(ad);
  return status;
}

// ---- JSON: rows; A and A_d as their diagonal blocks --------------------------------------------

static void rows_json(pb_jsonout *json, const char *key, const double *x, size_t rows,
                      size_t cols) {
  pb_jsonout_array(json, key);
  for (size_t i = 0; i < rows; i++) {
    pb_jsonout_row(json, NULL);
    for (size_t j = 0; j < cols; j++) pb_jsonout_number(json, NULL, x[j * rows + i]);
    pb_jsonout_array_end(json);
  }
  pb_jsonout_array_end(json);
}

static void blocks_json(pb_jsonout *json, const char *key, const pb_model *m, const double *x) {
  pb_jsonout_array(json, key);
  for (size_t k = 0; k < m->blocks; k++) {
    size_t size = m->block_start[k + 1] - m->block_start[k];
    rows_json(json, NULL, x + m->block_value[k], size, size);
  }
  pb_jsonout_array_end(json);
}

static void export_json(pb_jsonout *json, const void *context) {
  const export *e = context;
  const pb_model *m = e->model;
  pb_jsonout_object(json, NULL);
  pb_jsonout_text(json, "name", m->name);
  pb_jsonout_number(json, "sample_rate", m->sample_rate);
  emit_channels_json(json, &e->ch);
  pb_jsonout_texts(json, "input_units", e->ch.input_unit, m->nu);
  pb_jsonout_texts(json, "output_units", e->ch.output_unit, m->ny);
  pb_jsonout_numbers(json, "modes_hz", m->mode_hz, m->modes);
  pb_jsonout_numbers(json, "damping", m->mode_damping, m->modes);
  blocks_json(json, "A_blocks", m, m->a);
  rows_json(json, "B", m->b, m->nx, m->nu);
  rows_json(json, "C", m->c, m->ny, m->nx);
  rows_json(json, "D", m->d, m->ny, m->nu);
  blocks_json(json, "A_d_blocks", m, m->ad);
  rows_json(json, "B_d", m->bd, m->nx, m->nu);
  electronics_json(json, m);
  pb_jsonout_object_end(json);
}

// ---- CSV: one entry a row, without the zeros outside the blocks --------------------------------

static void entry_csv(pb_csv *csv, const char *item, size_t row, size_t col, double value,
                      const char *name) {
  pb_csv_text(csv, item);
  pb_csv_number(csv, (double)(row + 1));
  pb_csv_number(csv, (double)(col + 1));
  pb_csv_number(csv, value);
  pb_csv_text(csv, name);
}

static void matrix_csv(pb_csv *csv, const char *item, const double *x, size_t rows, size_t cols,
                       size_t first) {
  for (size_t j = 0; j < cols; j++) {
    for (size_t i = 0; i < rows; i++) {
      entry_csv(csv, item, first + i, first + j, x[j * rows + i], "");
    }
  }
}

static void signals_csv(pb_csv *csv, const char *item, const pb_signal *signal, size_t count) {
  char name[256];
  for (size_t k = 0; k < count; k++) {
    snprintf(name, sizeof name, "%s [%s]", signal[k].name, signal[k].unit);
    entry_csv(csv, item, k, 0, 0, name);
  }
}

static void electronics_csv(void *context, const char *name, const double *value, size_t count) {
  matrix_csv(context, name, value, count, 1, 0);
}

static pb_status export_csv(const export *e, pb_error *err) {
  const pb_model *m = e->model;
  pb_csv csv;
  pb_status status = pb_csv_open(e->t->out, &csv, err);
  if (status) return status;
  static const char *const head[] = {"item", "row", "column", "value", "name"};
  for (size_t k = 0; k < 5; k++) pb_csv_column(&csv, head[k], NULL);
  entry_csv(&csv, "Ts", 0, 0, 1 / m->sample_rate, "s");
  signals_csv(&csv, "input", m->input, m->nu);
  signals_csv(&csv, "output", m->output, m->ny);
  matrix_csv(&csv, "modes_hz", m->mode_hz, m->modes, 1, 0);
  matrix_csv(&csv, "damping", m->mode_damping, m->modes, 1, 0);
  for (int sampled = 0; sampled < 2; sampled++) {
    const double *a = sampled ? m->ad : m->a;
    for (size_t k = 0; k < m->blocks; k++) {
      size_t first = m->block_start[k], size = m->block_start[k + 1] - first;
      matrix_csv(&csv, sampled ? "A_d" : "A", a + m->block_value[k], size, size, first);
    }
    matrix_csv(&csv, sampled ? "B_d" : "B", sampled ? m->bd : m->b, m->nx, m->nu, 0);
  }
  matrix_csv(&csv, "C", m->c, m->ny, m->nx, 0);
  matrix_csv(&csv, "D", m->d, m->ny, m->nu, 0);
  electronics_each(m, electronics_csv, &csv);
  return pb_csv_close(&csv, err);
}

int command_export(const tool *t, const pb_model *model) {
  export e = {.t = t, .model = model};
  int code = channels_choose(t, model, false, &e.ch);
  if (code) return code;
  pb_error err = {0};
  code = emit_json(t, export_json, &e);
  if (!code && t->out_format == FORMAT_CSV) code = emit_done(t, export_csv(&e, &err), &err);
  if (!code && t->out_format == FORMAT_MAT) code = emit_done(t, export_mat(&e, &err), &err);
  channels_free(&e.ch);
  return code;
}
