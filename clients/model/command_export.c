// plantbus-model export: the state space, for other programs.
//
//   ẋ = A x + B u, y = C x + D u;  x(k+1) = A_d x(k) + B_d u(k), y(k) = C x(k) + D u(k−1)
//
// Other programs take y(k) = C x(k) + D u(k): for them the same once more in the standard form,
// with the inputs held over the last interval as states h where D sees them:
//
//   ξ = [x; h],  ξ(k+1) = A_ss ξ(k) + B_ss u(k),  y(k) = C_ss ξ(k) + D_ss u(k)
//   A_ss = [[A_d, 0], [0, 0]],  B_ss = [B_d; E],  C_ss = [C, D Eᵀ],  D_ss = 0
//
// u is what acts and y what the plant does; the electronics between command and u, and between y
// and the measured value, stand beside as numbers a signal.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "csv.h"
#include "matfile.h"
#include "tool.h"

// What the reader of a file has to know; in the file itself.
static const char convention[] =
    "Sampled at k Ts, inputs u(k) held over [k, k+1): x(k+1) = A_d x(k) + B_d u(k), "
    "y(k) = C x(k) + D u(k-1), y before u(k) acts. A_d, B_d, C, D are no standard state space "
    "where D is not 0. Standard: ss(A_ss, B_ss, C_ss, D_ss, Ts), whose last states are the "
    "inputs 'held' over the last interval (numbers from 1). Continuous: ss(A, B, C, D). "
    "Without the electronics of the signals. Zeros of the sampled forms are not those of the "
    "plant: sampling adds some and may turn the sign of the damping of others (plantbus-model "
    "zeros).";

typedef struct export {
  const tool *t;
  const pb_model *model;
  channels ch;        // all of the model's
  size_t n, helds;    // states of the standard form, and how many of them are held inputs
  double *held;       // [helds] numbers of these inputs, from 1
  double *b, *c, *d;  // n × nu, ny × n, ny × nu
}
export;

// ---- standard form ------------------------------------------------------------------------------

static bool sees(const pb_model *m, size_t input) {
  for (size_t o = 0; o < m->ny; o++)
    if (m->d[o + input * m->ny] != 0) return true;
  return false;
}

static bool standard_new(export *e) {
  const pb_model *m = e->model;
  e->held = malloc((m->nu + 1) * sizeof *e->held);
  if (!e->held) return false;
  for (size_t i = 0; i < m->nu; i++)
    if (sees(m, i)) e->held[e->helds++] = (double)(i + 1);
  e->n = m->nx + e->helds;
  e->b = calloc(e->n * m->nu + 1, sizeof *e->b);
  e->c = calloc(e->n * m->ny + 1, sizeof *e->c);
  e->d = calloc(m->ny * m->nu + 1, sizeof *e->d);
  return e->b && e->c && e->d;
}

static pb_status standard_fill(export *e, pb_error *err) {
  const pb_model *m = e->model;
  if (!standard_new(e)) return pb_fail_memory(err, e->t->file);
  for (size_t i = 0; i < m->nu; i++)
    memcpy(e->b + i * e->n, m->bd + i * m->nx, m->nx * sizeof *e->b);
  memcpy(e->c, m->c, m->nx * m->ny * sizeof *e->c);
  for (size_t k = 0; k < e->helds; k++) {
    const size_t input = (size_t)e->held[k] - 1;
    e->b[m->nx + k + input * e->n] = 1;
    memcpy(e->c + (m->nx + k) * m->ny, m->d + input * m->ny, m->ny * sizeof *e->c);
  }
  return PB_OK;
}

static void standard_free(export *e) {
  free(e->held);
  free(e->b);
  free(e->c);
  free(e->d);
}

// ---- MAT: dense matrices ------------------------------------------------------------------------

// n × n, n ≥ nx: zero beyond the blocks.
static double *dense(const pb_model *m, const double *blocks, size_t n) {
  double *full = calloc(n * n + 1, sizeof *full);
  for (size_t k = 0; full && k < m->blocks; k++) {
    size_t first = m->block_start[k], size = m->block_start[k + 1] - first;
    for (size_t i = 0; i < size * size; i++) {
      full[(first + i / size) * n + first + i % size] = blocks[m->block_value[k] + i];
    }
  }
  return full;
}

static void electronics_mat(void *context, const char *name, const double *value, size_t count) {
  pb_matfile_real(context, name, count, 1, value);
}

static pb_status export_mat(const export *e, pb_error *err) {
  const pb_model *m = e->model;
  double *a = dense(m, m->a, m->nx), *ad = dense(m, m->ad, m->nx), *ss = dense(m, m->ad, e->n);
  pb_matfile *mat = NULL;
  pb_status status = a && ad && ss ? PB_OK : pb_fail_memory(err, e->t->out);
  if (!status) status = pb_matfile_open(e->t->out, &mat, err);
  if (!status) {
    pb_matfile_text(mat, "name", m->name);
    pb_matfile_text(mat, "convention", convention);
    pb_matfile_real(mat, "A", m->nx, m->nx, a);
    pb_matfile_real(mat, "B", m->nx, m->nu, m->b);
    pb_matfile_real(mat, "C", m->ny, m->nx, m->c);
    pb_matfile_real(mat, "D", m->ny, m->nu, m->d);
    pb_matfile_real(mat, "A_d", m->nx, m->nx, ad);
    pb_matfile_real(mat, "B_d", m->nx, m->nu, m->bd);
    pb_matfile_real(mat, "A_ss", e->n, e->n, ss);
    pb_matfile_real(mat, "B_ss", e->n, m->nu, e->b);
    pb_matfile_real(mat, "C_ss", m->ny, e->n, e->c);
    pb_matfile_real(mat, "D_ss", m->ny, m->nu, e->d);
    pb_matfile_real(mat, "held", e->helds, 1, e->held);
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
  free(ss);
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

// zeros: blocks of one state after those of the model.
static void blocks_json(pb_jsonout *json, const char *key, const pb_model *m, const double *x,
                        size_t zeros) {
  static const double zero = 0;
  pb_jsonout_array(json, key);
  for (size_t k = 0; k < m->blocks; k++) {
    size_t size = m->block_start[k + 1] - m->block_start[k];
    rows_json(json, NULL, x + m->block_value[k], size, size);
  }
  for (size_t k = 0; k < zeros; k++) rows_json(json, NULL, &zero, 1, 1);
  pb_jsonout_array_end(json);
}

static void export_json(pb_jsonout *json, const void *context) {
  const export *e = context;
  const pb_model *m = e->model;
  pb_jsonout_object(json, NULL);
  pb_jsonout_text(json, "name", m->name);
  pb_jsonout_text(json, "convention", convention);
  pb_jsonout_number(json, "sample_rate", m->sample_rate);
  emit_channels_json(json, &e->ch);
  pb_jsonout_texts(json, "input_units", e->ch.input_unit, m->nu);
  pb_jsonout_texts(json, "output_units", e->ch.output_unit, m->ny);
  pb_jsonout_numbers(json, "modes_hz", m->mode_hz, m->modes);
  pb_jsonout_numbers(json, "damping", m->mode_damping, m->modes);
  blocks_json(json, "A_blocks", m, m->a, 0);
  rows_json(json, "B", m->b, m->nx, m->nu);
  rows_json(json, "C", m->c, m->ny, m->nx);
  rows_json(json, "D", m->d, m->ny, m->nu);
  blocks_json(json, "A_d_blocks", m, m->ad, 0);
  rows_json(json, "B_d", m->bd, m->nx, m->nu);
  blocks_json(json, "A_ss_blocks", m, m->ad, e->helds);
  rows_json(json, "B_ss", e->b, e->n, m->nu);
  rows_json(json, "C_ss", e->c, m->ny, e->n);
  rows_json(json, "D_ss", e->d, m->ny, m->nu);
  pb_jsonout_numbers(json, "held", e->held, e->helds);
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

static void state_csv(pb_csv *csv, const pb_model *m, const char *item, const double *blocks) {
  for (size_t k = 0; k < m->blocks; k++) {
    size_t first = m->block_start[k], size = m->block_start[k + 1] - first;
    matrix_csv(csv, item, blocks + m->block_value[k], size, size, first);
  }
}

static pb_status export_csv(const export *e, pb_error *err) {
  const pb_model *m = e->model;
  pb_csv csv;
  pb_status status = pb_csv_open(e->t->out, &csv, err);
  if (status) return status;
  static const char *const head[] = {"item", "row", "column", "value", "name"};
  for (size_t k = 0; k < 5; k++) pb_csv_column(&csv, head[k], NULL);
  entry_csv(&csv, "convention", 0, 0, 0, convention);
  entry_csv(&csv, "Ts", 0, 0, 1 / m->sample_rate, "s");
  signals_csv(&csv, "input", m->input, m->nu);
  signals_csv(&csv, "output", m->output, m->ny);
  matrix_csv(&csv, "modes_hz", m->mode_hz, m->modes, 1, 0);
  matrix_csv(&csv, "damping", m->mode_damping, m->modes, 1, 0);
  for (int sampled = 0; sampled < 2; sampled++) {
    state_csv(&csv, m, sampled ? "A_d" : "A", sampled ? m->ad : m->a);
    matrix_csv(&csv, sampled ? "B_d" : "B", sampled ? m->bd : m->b, m->nx, m->nu, 0);
  }
  matrix_csv(&csv, "C", m->c, m->ny, m->nx, 0);
  matrix_csv(&csv, "D", m->d, m->ny, m->nu, 0);
  state_csv(&csv, m, "A_ss", m->ad);
  matrix_csv(&csv, "B_ss", e->b, e->n, m->nu, 0);
  matrix_csv(&csv, "C_ss", e->c, m->ny, e->n, 0);
  matrix_csv(&csv, "D_ss", e->d, m->ny, m->nu, 0);
  matrix_csv(&csv, "held", e->held, e->helds, 1, 0);
  electronics_each(m, electronics_csv, &csv);
  return pb_csv_close(&csv, err);
}

int command_export(const tool *t, const pb_model *model) {
  export e = {.t = t, .model = model};
  int code = channels_choose(t, model, false, &e.ch);
  if (code) return code;
  pb_error err = {0};
  code = tool_end(standard_fill(&e, &err), &err);
  if (!code) code = emit_json(t, export_json, &e);
  if (!code && t->out_format == FORMAT_CSV) code = emit_done(t, export_csv(&e, &err), &err);
  if (!code && t->out_format == FORMAT_MAT) code = emit_done(t, export_mat(&e, &err), &err);
  standard_free(&e);
  channels_free(&e.ch);
  return code;
}
