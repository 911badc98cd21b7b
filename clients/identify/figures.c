// Files of an identification: data and plots.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "frf_files.h"
#include "identify.h"
#include "plot.h"

static pb_frf_record record_of(const pb_analysis *a) {
  return (pb_frf_record){a->model, a->channels, &a->frf, a->exact};
}

// Columns: exact hz, exact damping, measured hz, measured damping.
static pb_status save_modes(const pb_analysis *a, pb_matfile *mat, pb_error *err) {
  double *m = malloc((4 * a->modes + 1) * sizeof *m);
  if (!m) return pb_fail_memory(err, "identify.mat");
  for (size_t k = 0; k < a->modes; k++) {
    m[k] = a->mode[k].exact.hz;
    m[k + a->modes] = a->mode[k].exact.damping;
    m[k + 2 * a->modes] = a->mode[k].measured.hz;
    m[k + 3 * a->modes] = a->mode[k].measured.damping;
  }
  pb_matfile_real(mat, "modes", a->modes, 4, m);
  free(m);
  return PB_OK;
}

static pb_status save_mat(const identify_result *r, const char *path, pb_error *err) {
  pb_matfile *mat;
  pb_frf_record record = record_of(&r->analysis);
  pb_status status = pb_matfile_open(path, &mat, err);
  if (status != PB_OK) return status;
  pb_matfile_text(mat, "plant", r->bench->description->name);
  pb_matfile_text(mat, "plant_sha256", r->bench->description->plant_sha256);
  pb_matfile_scalar(mat, "revision", r->bench->description->revision);
  pb_matfile_scalar(mat, "sample_rate", r->analysis.model->sample_rate);
  pb_frf_write_names(&record, mat);
  pb_frf_write_mat(&record, "identified", mat);
  status = save_modes(&r->analysis, mat, err);
  if (status != PB_OK) {
    pb_matfile_discard(mat);
    return status;
  }
  return pb_matfile_close(mat, err);
}

pb_status identify_save(const identify_result *r, const char *dir, pb_error *err) {
  char path[1024];
  pb_frf_record record = record_of(&r->analysis);
  pb_status status = pb_output_path(dir, "identify.csv", path, sizeof path, err);
  if (status == PB_OK) status = pb_frf_write_csv(&record, path, err);
  if (status == PB_OK) status = pb_output_path(dir, "identify.mat", path, sizeof path, err);
  if (status == PB_OK) status = save_mat(r, path, err);
  return status;
}

// One channel out of [nf][ny][nu].
static void pick(const double complex *h, const pb_frf *m, size_t o, size_t i,
                 double complex *out) {
  for (size_t f = 0; f < m->nf; f++) out[f] = h[(f * m->ny + o) * m->nu + i];
}

// What is rounding is not drawn.
static void leave_out_rounding(const double *floor, const pb_frf *m, size_t o, double complex *h) {
  for (size_t f = 0; f < m->nf; f++)
    if (!(cabs(h[f]) > floor[f * m->ny + o])) h[f] = NAN;
}

static size_t index_of(const size_t *list, size_t count, size_t wanted) {
  size_t k = 0;
  while (k < count && list[k] != wanted) k++;
  return k;
}

static pb_status plot_channel(const identify_result *r, const pb_channel_row *row, const char *dir,
                              double complex *measured, double complex *exact, double *coherence,
                              pb_error *err) {
  const pb_analysis *a = &r->analysis;
  const char *input = a->model->input[row->input].name,
             *output = a->model->output[row->output].name;
  size_t o = index_of(a->channels.output, a->channels.outputs, row->output);
  size_t i = index_of(a->channels.input, a->channels.inputs, row->input);
  pick(a->frf.h, &a->frf, o, i, measured);
  pick(a->exact, &a->frf, o, i, exact);
  leave_out_rounding(a->exact_floor, &a->frf, o, exact);
  for (size_t f = 0; f < a->frf.nf; f++) coherence[f] = a->frf.coherence[f * a->frf.ny + o];
  char name[300], path[1024], title[300], unit[80];
  snprintf(name, sizeof name, "identify-%s-%s.png", input, output);
  for (char *c = name; *c; c++) {
    if (*c == '/') *c = '_';
  }
  snprintf(title, sizeof title, "%s: %s → %s", r->bench->description->name, input, output);
  pb_channel_unit(a->model, row->output, row->input, unit, sizeof unit);
  pb_bode_curve curve[2] = {
      {"identified", PB_PLOT_POINTS, 1, a->frf.nf, a->frf.frequency_hz, measured, coherence},
      {"exact sampled response", PB_PLOT_DASHED, PB_PLOT_BLACK, a->frf.nf, a->frf.frequency_hz,
       exact, NULL},
  };
  pb_bode_plot plot = {.title = title, .unit = unit, .count = 2, .curve = curve};
  pb_status status = pb_output_path(dir, name, path, sizeof path, err);
  return status == PB_OK ? pb_plot_bode(path, &plot, err) : status;
}

pb_status identify_plot(const identify_result *r, const char *dir, pb_error *err) {
  size_t nf = r->analysis.frf.nf;
  double complex *measured = malloc(nf * sizeof *measured), *exact = malloc(nf * sizeof *exact);
  double *coherence = malloc(nf * sizeof *coherence);
  pb_status status = measured && exact && coherence ? PB_OK : pb_fail_memory(err, "plot");
  for (size_t k = 0; k < r->analysis.rows && status == PB_OK; k++) {
    status = plot_channel(r, &r->analysis.row[k], dir, measured, exact, coherence, err);
  }
  free(measured);
  free(exact);
  free(coherence);
  return status;
}
