// Writing measured frequency responses: see frf_files.h.
#include "frf_files.h"

#include <stdlib.h>
#include <string.h>

#include "csv.h"

void pb_channel_unit(const pb_model *model, size_t output, size_t input, char *text, size_t size) {
  const char *y = model->output[output].unit, *u = model->input[input].unit;
  bool compound = strchr(y, '/') != NULL;
  snprintf(text, size, compound ? "(%s)/%s" : "%s/%s", y, u);
}

static void column(pb_csv *csv, const char *what, const char *output, const char *input,
                   const char *unit) {
  char name[256];
  snprintf(name, sizeof name, input ? "%s %s from %s" : "%s %s", what, output, input);
  pb_csv_column(csv, name, unit);
}

static void write_header(const pb_frf_record *r, pb_csv *csv) {
  static const char *const part[] = {"real", "imag", "variance", "exact real", "exact imag"};
  pb_csv_column(csv, "frequency", "Hz");
  for (size_t o = 0; o < r->channels.outputs; o++) {
    size_t output = r->channels.output[o];
    const char *name = r->model->output[output].name;
    for (size_t i = 0; i < r->channels.inputs; i++) {
      char unit[80], square[96];
      pb_channel_unit(r->model, output, r->channels.input[i], unit, sizeof unit);
      snprintf(square, sizeof square, "(%s)^2", unit);
      for (int k = 0; k < 5; k++) {
        column(csv, part[k], name, r->model->input[r->channels.input[i]].name,
               k == 2 ? square : unit);
      }
    }
    column(csv, "coherence", name, NULL, NULL);
  }
}

pb_status pb_frf_write_csv(const pb_frf_record *r, const char *path, pb_error *err) {
  pb_csv csv = {0};
  pb_status status = pb_csv_open(path, &csv, err);
  if (status != PB_OK) return status;
  const pb_frf *m = r->measured;
  write_header(r, &csv);
  for (size_t f = 0; f < m->nf; f++) {
    pb_csv_number(&csv, m->frequency_hz[f]);
    for (size_t o = 0; o < m->ny; o++) {
      for (size_t i = 0; i < m->nu; i++) {
        size_t k = (f * m->ny + o) * m->nu + i;
        pb_csv_number(&csv, creal(m->h[k]));
        pb_csv_number(&csv, cimag(m->h[k]));
        pb_csv_number(&csv, m->variance[k]);
        pb_csv_number(&csv, creal(r->exact[k]));
        pb_csv_number(&csv, cimag(r->exact[k]));
      }
      pb_csv_number(&csv, m->coherence[f * m->ny + o]);
    }
  }
  return pb_csv_close(&csv, err);
}

static const char *variable(const char *prefix, const char *name, char text[64]) {
  snprintf(text, 64, "%s_%s", prefix, name);
  return text;
}

void pb_frf_write_mat(const pb_frf_record *r, const char *prefix, pb_matfile *mat) {
  const pb_frf *m = r->measured;
  char name[64];
  pb_matfile_real(mat, variable(prefix, "frequency_hz", name), m->nf, 1, m->frequency_hz);
  pb_matfile_frf(mat, variable(prefix, "h", name), m->nf, m->ny, m->nu, m->h);
  pb_matfile_frf(mat, variable(prefix, "exact", name), m->nf, m->ny, m->nu, r->exact);
  pb_matfile_real(mat, variable(prefix, "coherence", name), m->ny, m->nf, m->coherence);
  // [nf][ny][nu] row-major is nu × (ny nf) column-major.
  pb_matfile_real(mat, variable(prefix, "variance", name), m->nu, m->ny * m->nf, m->variance);
}

static void write_list(pb_matfile *mat, const char *name, const pb_signal *signal,
                       const size_t *index, size_t count) {
  const char *text[128];
  for (size_t k = 0; k < count && k < 128; k++) text[k] = signal[index[k]].name;
  pb_matfile_names(mat, name, text, count < 128 ? count : 128);
}

void pb_frf_write_names(const pb_frf_record *r, pb_matfile *mat) {
  write_list(mat, "input_names", r->model->input, r->channels.input, r->channels.inputs);
  write_list(mat, "output_names", r->model->output, r->channels.output, r->channels.outputs);
}
