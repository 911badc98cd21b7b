// Files of a study: CSV tables and one MAT file.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "csv.h"
#include "frf_files.h"
#include "matfile.h"
#include "study.h"

enum { N = PB_STUDY_STRUTS };

static pb_status open_csv(const study *s, const char *dir, const char *what, pb_csv *csv,
                          pb_error *err) {
  char name[64], path[1024];
  snprintf(name, sizeof name, "study-%s%s.csv", pb_study_kind_of(s->options->kind)->name, what);
  pb_status status = pb_output_path(dir, name, path, sizeof path, err);
  if (!status) status = pb_csv_open(path, csv, err);
  if (status) return status;
  const pb_study_kind_facts *facts = pb_study_kind_of(s->options->kind);
  pb_csv_column(csv, facts->quantity, facts->unit);
  return PB_OK;
}

// ---- scalars ------------------------------------------------------------------------------------

static const struct scalar {
  const char *name, *unit;
} scalars[] = {{"states", NULL},
               {"iff_zero", "Hz"},
               {"iff_zero_alone", "Hz"},
               {"smallest_attainable_damping", NULL},
               {"best_gain", NULL},
               {"smallest_damping", NULL},
               {"stable_to_gain", NULL},
               {"best_stable_gain", NULL},
               {"smallest_damping_stable", NULL},
               {"rga_undamped", NULL},
               {"rga_damped", NULL},
               {"strut_stiffness", "N/m"},
               {"strut_length", "m"},
               {"k_l2", "Nm/rad"},
               {"k_r", "Nm/rad"},
               {"margin", NULL}};
enum { SCALARS = sizeof scalars / sizeof *scalars };

static void list_scalars(const pb_study_point *p, double out[SCALARS]) {
  const double value[SCALARS] = {
      (double)p->states,  p->zero_hz,       p->zero_alone_hz,  p->smallest_attainable,
      p->best.gain,       p->best.smallest, p->stable_to,      p->stable.gain,
      p->stable.smallest, p->rga_undamped,  p->rga_damped,     p->struts.k,
      p->struts.length,   p->struts.limit,  p->struts.bending, p->struts.margin};
  for (size_t i = 0; i < SCALARS; i++) out[i] = value[i];
}

// A row a value: scalars, then frequency, damping and attainable damping of the modes.
static pb_status save_table(const study *s, const char *dir, pb_error *err) {
  pb_csv csv = {0};
  size_t modes = 0;
  pb_status status = open_csv(s, dir, "", &csv, err);
  if (status) return status;
  for (size_t i = 0; i < SCALARS; i++) pb_csv_column(&csv, scalars[i].name, scalars[i].unit);
  for (size_t k = 0; k < s->count; k++)
    if (s->point[k].size.modes > modes) modes = s->point[k].size.modes;
  for (size_t m = 0; m < modes; m++) {
    char name[48];
    snprintf(name, sizeof name, "mode_%zu", m + 1);
    pb_csv_column(&csv, name, "Hz");
    snprintf(name, sizeof name, "damping_%zu", m + 1);
    pb_csv_column(&csv, name, NULL);
    snprintf(name, sizeof name, "attainable_damping_%zu", m + 1);
    pb_csv_column(&csv, name, NULL);
  }
  for (size_t k = 0; k < s->count; k++) {
    const pb_study_point *p = &s->point[k];
    double value[SCALARS];
    list_scalars(p, value);
    pb_csv_text(&csv, s->label[k]);
    for (size_t i = 0; i < SCALARS; i++) pb_csv_number(&csv, value[i]);
    for (size_t m = 0; m < modes; m++) {
      pb_csv_number(&csv, m < p->size.modes ? p->mode_hz[m] : NAN);
      pb_csv_number(&csv, m < p->size.modes ? p->mode_damping[m] : NAN);
      pb_csv_number(&csv, m < p->size.modes ? p->attainable[m] : NAN);
    }
  }
  return pb_csv_close(&csv, err);
}

// ---- against frequency, along the locus ---------------------------------------------------------

static void complex_columns(pb_csv *csv, const char *name, const char *unit) {
  char head[48];
  snprintf(head, sizeof head, "%s_real", name);
  pb_csv_column(csv, head, unit);
  snprintf(head, sizeof head, "%s_imag", name);
  pb_csv_column(csv, head, unit);
}

// A row a value and frequency: responses of the first strut to the first actuator, RGA numbers.
static pb_status save_responses(const study *s, const char *dir, pb_error *err) {
  pb_csv csv = {0};
  pb_status status = open_csv(s, dir, "-frf", &csv, err);
  if (status) return status;
  pb_csv_column(&csv, "frequency", "Hz");
  complex_columns(&csv, "hac", NULL);
  complex_columns(&csv, "hac_damped", NULL);
  complex_columns(&csv, "iff", NULL);
  pb_csv_column(&csv, "rga_undamped", NULL);
  pb_csv_column(&csv, "rga_damped", NULL);
  for (size_t k = 0; k < s->count; k++) {
    const pb_study_point *p = &s->point[k];
    for (size_t f = 0; f < p->size.lines; f++) {
      const double complex h[3] = {p->hac[f * N * N], p->hac_damped[f * N * N], p->iff[f * N * N]};
      pb_csv_text(&csv, s->label[k]);
      pb_csv_number(&csv, p->hz[f]);
      for (int i = 0; i < 3; i++) {
        pb_csv_number(&csv, creal(h[i]));
        pb_csv_number(&csv, cimag(h[i]));
      }
      pb_csv_number(&csv, p->rga_open[f]);
      pb_csv_number(&csv, p->rga[f]);
    }
  }
  return pb_csv_close(&csv, err);
}

static pb_status save_locus(const study *s, const char *dir, pb_error *err) {
  pb_csv csv = {0};
  pb_status status = open_csv(s, dir, "-locus", &csv, err);
  if (status) return status;
  pb_csv_column(&csv, "branch", NULL);
  pb_csv_column(&csv, "mode", NULL);
  pb_csv_column(&csv, "gain", NULL);
  complex_columns(&csv, "pole", "rad/s");
  for (size_t k = 0; k < s->count; k++) {
    const pb_study_point *p = &s->point[k];
    for (size_t i = 0; i < p->size.branches * p->size.gains; i++) {
      pb_csv_text(&csv, s->label[k]);
      pb_csv_number(&csv, (double)(i / p->size.gains + 1));
      pb_csv_number(&csv, p->is_mode[i / p->size.gains]);
      pb_csv_number(&csv, p->gain[i % p->size.gains]);
      pb_csv_number(&csv, creal(p->locus[i]));
      pb_csv_number(&csv, cimag(p->locus[i]));
    }
  }
  return pb_csv_close(&csv, err);
}

// ---- MAT ----------------------------------------------------------------------------------------

// Variables of one point, numbered from 1: hac_1 (6 × 6 × lines), locus_1 (gains × branches) ….
static void write_point(const pb_study_point *p, size_t number, pb_matfile *mat) {
  char name[48];
  const struct {
    const char *name;
    const double complex *h;
  } responses[3] = {{"hac", p->hac}, {"hac_damped", p->hac_damped}, {"iff", p->iff}};
  for (int i = 0; i < 3; i++) {
    snprintf(name, sizeof name, "%s_%zu", responses[i].name, number);
    pb_matfile_frf(mat, name, p->size.lines, N, N, responses[i].h);
  }
  snprintf(name, sizeof name, "rga_%zu", number);
  pb_matfile_real(mat, name, p->size.lines, 1, p->rga);
  snprintf(name, sizeof name, "rga_undamped_%zu", number);
  pb_matfile_real(mat, name, p->size.lines, 1, p->rga_open);
  snprintf(name, sizeof name, "mode_hz_%zu", number);
  pb_matfile_real(mat, name, p->size.modes, 1, p->mode_hz);
  snprintf(name, sizeof name, "attainable_damping_%zu", number);
  pb_matfile_real(mat, name, p->size.modes, 1, p->attainable);
  snprintf(name, sizeof name, "locus_gain_%zu", number);
  pb_matfile_real(mat, name, p->size.gains, 1, p->gain);
  snprintf(name, sizeof name, "locus_%zu", number);
  pb_matfile_complex(mat, name, p->size.gains, p->size.branches, p->locus);
  snprintf(name, sizeof name, "iff_zeros_%zu", number);
  pb_matfile_complex(mat, name, p->size.zeros, 1, p->zero);
}

static pb_status save_mat(const study *s, const char *dir, pb_error *err) {
  char name[64], path[1024];
  pb_matfile *mat;
  snprintf(name, sizeof name, "study-%s.mat", pb_study_kind_of(s->options->kind)->name);
  pb_status status = pb_output_path(dir, name, path, sizeof path, err);
  if (!status) status = pb_matfile_open(path, &mat, err);
  if (status) return status;
  pb_matfile_text(mat, "plant", s->plant);
  pb_matfile_text(mat, "study", pb_study_kind_of(s->options->kind)->name);
  pb_matfile_names(mat, "value_names", (const char *const *)s->label, s->count);
  pb_matfile_real(mat, "value", s->count, 1, s->value);
  pb_matfile_real(mat, "frequency_hz", s->point[0].size.lines, 1, s->point[0].hz);
  double *table = malloc(s->count * SCALARS * sizeof *table);
  for (size_t k = 0; k < s->count && table; k++) {
    double value[SCALARS];
    list_scalars(&s->point[k], value);
    for (size_t i = 0; i < SCALARS; i++) table[k + i * s->count] = value[i];
    write_point(&s->point[k], k + 1, mat);
  }
  for (size_t i = 0; i < SCALARS && table; i++)
    pb_matfile_real(mat, scalars[i].name, s->count, 1, table + i * s->count);
  if (table) {
    free(table);
    return pb_matfile_close(mat, err);
  }
  pb_matfile_discard(mat);
  return pb_fail_memory(err, path);
}

pb_status study_save(const study *s, const char *dir, pb_error *err) {
  pb_status status = save_table(s, dir, err);
  if (!status) status = save_responses(s, dir, err);
  if (!status) status = save_locus(s, dir, err);
  return status ? status : save_mat(s, dir, err);
}
