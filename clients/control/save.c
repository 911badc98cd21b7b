// Data files of a design.
#include <math.h>
#include <stdlib.h>

#include "control_tool.h"
#include "csv.h"

// One row a frequency: L_ii, loci, singular values.
static pb_status save_loops(const control_design *d, const control_judgement *j, const char *dir,
                            pb_error *err) {
  size_t n = d->n;
  char path[1024];
  pb_csv csv = {0};
  pb_status status = pb_output_path(dir, "hac-loops.csv", path, sizeof path, err);
  if (status == PB_OK) status = pb_csv_open(path, &csv, err);
  if (status != PB_OK) return status;
  pb_csv_column(&csv, "frequency", "Hz");
  for (size_t i = 0; i < 2 * n; i++) {
    char name[200];
    for (int part = 0; part < 2; part++) {
      if (i < n) {
        snprintf(name, sizeof name, "L %s %s", control_loop_name(d, i), part ? "imag" : "real");
      } else {
        snprintf(name, sizeof name, "locus %zu %s", i - n + 1, part ? "imag" : "real");
      }
      pb_csv_column(&csv, name, NULL);
    }
  }
  pb_csv_column(&csv, "largest singular value of S", NULL);
  pb_csv_column(&csv, "largest singular value of T", NULL);
  for (size_t f = 0; f < j->nf; f++) {
    pb_csv_number(&csv, j->hz[f]);
    for (size_t i = 0; i < 2 * n; i++) {
      double complex v = i < n ? j->l[f * n * n + i * (n + 1)] : j->mimo.locus[f * n + i - n];
      pb_csv_number(&csv, creal(v));
      pb_csv_number(&csv, cimag(v));
    }
    pb_csv_number(&csv, j->mimo.s[f]);
    pb_csv_number(&csv, j->mimo.t[f]);
  }
  return pb_csv_close(&csv, err);
}

static pb_status save_transmission(const control_design *d, const control_judgement *j,
                                   const char *dir, pb_error *err) {
  size_t some = d->motions * d->disturbances;
  char path[1024];
  pb_csv csv = {0};
  pb_status status = pb_output_path(dir, "hac-transmission.csv", path, sizeof path, err);
  if (status == PB_OK) status = pb_csv_open(path, &csv, err);
  if (status != PB_OK) return status;
  pb_csv_column(&csv, "frequency", "Hz");
  for (size_t k = 0; k < STAGES * some; k++) {
    size_t motion = d->motion[k % some / d->disturbances],
           force = d->disturbance[k % some % d->disturbances];
    char name[300], unit[80];
    pb_channel_unit(d->model, motion, force, unit, sizeof unit);
    for (int part = 0; part < 2; part++) {
      snprintf(name, sizeof name, "%s %s→%s %s", control_stage_key[k / some],
               d->model->input[force].name, d->model->output[motion].name, part ? "imag" : "real");
      pb_csv_column(&csv, name, unit);
    }
  }
  for (size_t f = 0; f < j->nf; f++) {
    pb_csv_number(&csv, j->hz[f]);
    for (size_t k = 0; k < STAGES * some; k++) {
      double complex h = j->transmission[k / some][f * some + k % some];
      pb_csv_number(&csv, creal(h));
      pb_csv_number(&csv, cimag(h));
    }
  }
  return pb_csv_close(&csv, err);
}

static void mat_names(pb_matfile *mat, const char *name, const pb_signal *signal,
                      const size_t *index, size_t count, const char **scratch) {
  for (size_t k = 0; k < count; k++) scratch[k] = signal[index[k]].name;
  pb_matfile_names(mat, name, scratch, count);
}

static void mat_loops(const control_design *d, const control_judgement *j, pb_matfile *mat) {
  pb_matfile_real(mat, "frequency_hz", j->nf, 1, j->hz);
  pb_matfile_frf(mat, "undamped_plant", j->nf, d->n, d->n, j->plant[0]);
  pb_matfile_frf(mat, "damped_plant", j->nf, d->n, d->n, j->plant[1]);
  pb_matfile_frf(mat, "loop_gain", j->nf, d->n, d->n, j->l);
  pb_matfile_frf(mat, "loci", j->nf, d->n, 1, j->mimo.locus);
  pb_matfile_real(mat, "sensitivity", j->nf, 1, j->mimo.s);
  pb_matfile_real(mat, "complementary_sensitivity", j->nf, 1, j->mimo.t);
  for (int s = 0; s < STAGES; s++) {
    char name[64];
    snprintf(name, sizeof name, "transmission_%s", control_stage_key[s]);
    pb_matfile_frf(mat, name, j->nf, d->motions, d->disturbances, j->transmission[s]);
  }
}

static pb_status save_mat(const control_design *d, const control_judgement *j, const char *dir,
                          pb_error *err) {
  char path[1024];
  pb_matfile *mat;
  const char **scratch = malloc((d->model->nu + d->model->ny + 1) * sizeof *scratch);
  if (!scratch) return pb_fail_memory(err, "hac.mat");
  pb_status status = pb_output_path(dir, "hac.mat", path, sizeof path, err);
  if (status == PB_OK) status = pb_matfile_open(path, &mat, err);
  if (status == PB_OK) {
    pb_matfile_text(mat, "plant", d->plant->bench.description->name);
    pb_matfile_scalar(mat, "Ts", 1 / d->model->sample_rate);
    mat_names(mat, "actuators", d->model->input, d->channels.input, d->n, scratch);
    mat_names(mat, "metrology", d->model->output, d->metrology, d->n, scratch);
    mat_names(mat, "motion", d->model->output, d->motion, d->motions, scratch);
    mat_names(mat, "disturbance", d->model->input, d->disturbance, d->disturbances, scratch);
    if (d->damped) control_mat_lti(mat, "iff", &d->iff.controller_used);
    control_mat_lti(mat, "hac", &d->hac);
    pb_matfile_real(mat, "gains", d->n, 1, d->gain);
    if (d->frame.j) pb_matfile_real(mat, "jacobian", d->n, d->n, d->frame.j);
    mat_loops(d, j, mat);
    status = pb_matfile_close(mat, err);
  }
  free(scratch);
  return status;
}

pb_status control_save(const control_design *d, const control_judgement *j, const char *dir,
                       pb_error *err) {
  pb_status status = save_mat(d, j, dir, err);
  if (status == PB_OK) status = save_loops(d, j, dir, err);
  if (status == PB_OK) status = save_transmission(d, j, dir, err);
  bool allowed = d->stable || d->options->iff.force;
  if (status == PB_OK && allowed) status = control_export(d->damped ? &d->iff : NULL, d, dir, err);
  return status;
}
