// Data files of an IFF experiment.
#include <stdlib.h>

#include "csv.h"
#include "frf_files.h"
#include "iff_tool.h"

static pb_frf_record record_of(const iff_result *r, const iff_measurement *m) {
  return (pb_frf_record){r->model, r->channels, &m->frf, m->expected};
}

static pb_status save_response(const iff_result *r, const iff_measurement *m, const char *dir,
                               const char *name, pb_error *err) {
  if (m->frf.nf == 0) return PB_OK;
  char path[1024];
  pb_frf_record record = record_of(r, m);
  pb_status status = pb_output_path(dir, name, path, sizeof path, err);
  return status == PB_OK ? pb_frf_write_csv(&record, path, err) : status;
}

// One row a gain and branch.
static pb_status save_locus(const iff_result *r, const char *dir, pb_error *err) {
  char path[1024];
  pb_csv csv = {0};
  pb_status status = pb_output_path(dir, "iff-root-locus.csv", path, sizeof path, err);
  if (status == PB_OK) status = pb_csv_open(path, &csv, err);
  if (status != PB_OK) return status;
  pb_csv_column(&csv, "branch", NULL);
  pb_csv_column(&csv, "gain", NULL);
  pb_csv_column(&csv, "real", "rad/s");
  pb_csv_column(&csv, "imag", "rad/s");
  pb_csv_column(&csv, "frequency", "Hz");
  pb_csv_column(&csv, "damping", NULL);
  for (size_t b = 0; b < r->locus.branches; b++) {
    for (size_t k = 0; k < r->locus.gains; k++) {
      const pb_pole *p = &r->locus.pole[b * r->locus.gains + k];
      double complex s = pb_pole_s(p->z, r->model->sample_rate);
      pb_csv_number(&csv, (double)(b + 1));
      pb_csv_number(&csv, r->locus.gain[k]);
      pb_csv_number(&csv, creal(s));
      pb_csv_number(&csv, cimag(s));
      pb_csv_number(&csv, p->hz);
      pb_csv_number(&csv, p->damping);
    }
  }
  return pb_csv_close(&csv, err);
}

// Columns: open exact hz, damping; open measured; closed predicted; closed measured.
static pb_status write_modes(const iff_result *r, pb_matfile *mat, pb_error *err) {
  double *m = malloc((8 * r->modes + 1) * sizeof *m);
  if (!m) return pb_fail_memory(err, "iff.mat");
  for (size_t k = 0; k < r->modes; k++) {
    const pb_pole *p[4] = {&r->mode[k].open_exact, &r->mode[k].open_measured,
                           &r->mode[k].closed_predicted, &r->mode[k].closed_measured};
    for (size_t c = 0; c < 4; c++) {
      m[k + 2 * c * r->modes] = p[c]->hz;
      m[k + (2 * c + 1) * r->modes] = p[c]->damping;
    }
  }
  pb_matfile_real(mat, "modes", r->modes, 8, m);
  free(m);
  return PB_OK;
}

// gains × branches, in rad/s.
static pb_status write_locus(const iff_result *r, pb_matfile *mat, pb_error *err) {
  size_t count = r->locus.branches * r->locus.gains;
  double complex *s = malloc((count + 1) * sizeof *s);
  if (!s) return pb_fail_memory(err, "iff.mat");
  for (size_t k = 0; k < count; k++) s[k] = pb_pole_s(r->locus.pole[k].z, r->model->sample_rate);
  pb_matfile_complex(mat, "locus", r->locus.gains, r->locus.branches, s);
  pb_matfile_real(mat, "locus_gain", r->locus.gains, 1, r->locus.gain);
  free(s);
  return PB_OK;
}

static pb_status save_mat(const iff_result *r, const char *dir, pb_error *err) {
  char path[1024];
  pb_matfile *mat;
  pb_status status = pb_output_path(dir, "iff.mat", path, sizeof path, err);
  if (status == PB_OK) status = pb_matfile_open(path, &mat, err);
  if (status != PB_OK) return status;
  pb_frf_record open = record_of(r, &r->open), closed = record_of(r, &r->closed);
  pb_matfile_text(mat, "plant", r->bench->description->name);
  pb_matfile_text(mat, "plant_sha256", r->bench->description->plant_sha256);
  pb_matfile_scalar(mat, "revision", r->bench->description->revision);
  pb_matfile_scalar(mat, "sample_rate", r->model->sample_rate);
  pb_matfile_scalar(mat, "gain", r->law.gain);
  pb_matfile_scalar(mat, "delay", r->loop.delay);
  pb_frf_write_names(&closed, mat);
  if (r->open.frf.nf > 0) pb_frf_write_mat(&open, "undamped", mat);
  if (r->closed.frf.nf > 0) pb_frf_write_mat(&closed, "damped", mat);
  status = write_modes(r, mat, err);
  if (status == PB_OK) status = write_locus(r, mat, err);
  if (status == PB_OK) return pb_matfile_close(mat, err);
  pb_matfile_discard(mat);
  return status;
}

pb_status iff_save(const iff_result *r, const char *dir, pb_error *err) {
  pb_status status = save_mat(r, dir, err);
  if (status == PB_OK) status = save_response(r, &r->open, dir, "iff-undamped.csv", err);
  if (status == PB_OK) status = save_response(r, &r->closed, dir, "iff-damped.csv", err);
  if (status == PB_OK) status = save_locus(r, dir, err);
  return status;
}

pb_status iff_present(const iff_result *r, pb_error *err) {
  const pb_result_options *o = &r->options->result;
  pb_status status = o->json ? iff_print_json(r, err) : iff_print(r, err);
  if (status == PB_OK && o->dir) status = iff_save(r, o->dir, err);
  if (status == PB_OK && o->plot) status = iff_plot(r, pb_result_dir(o), err);
  return status;
}
