// Data files and figures of a run.
#include <math.h>
#include <stdlib.h>

#include "csv.h"
#include "plot.h"
#include "run.h"

static pb_status save_spectra(const run_result *r, const char *dir, pb_error *err) {
  const control_design *d = r->design;
  static const char *const what[2] = {"measured", "predicted"};
  char path[1024], name[200], unit[80];
  pb_csv csv = {0};
  pb_status status = pb_output_path(dir, "run-spectra.csv", path, sizeof path, err);
  if (status == PB_OK) status = pb_csv_open(path, &csv, err);
  if (status != PB_OK) return status;
  pb_csv_column(&csv, "frequency", "Hz");
  for (size_t k = 0; k < STAGES * d->motions * 2; k++) {
    const pb_signal *motion = &d->model->output[d->motion[k / 2 % d->motions]];
    size_t stage = k / 2 / d->motions;
    if (!r->stage[stage].done) continue;
    snprintf(name, sizeof name, "%s %s density %s", control_stage_key[stage], motion->name,
             what[k % 2]);
    snprintf(unit, sizeof unit, "%s^2/Hz", motion->unit);
    pb_csv_column(&csv, name, unit);
    snprintf(name, sizeof name, "%s %s cumulative %s", control_stage_key[stage], motion->name,
             what[k % 2]);
    pb_csv_column(&csv, name, motion->unit);
  }
  for (size_t f = 1; f < r->lines; f++) {
    if ((double)f * r->df > r->experiment.f2 * (1 + 1e-9)) break;
    pb_csv_number(&csv, (double)f * r->df);
    for (size_t k = 0; k < STAGES * d->motions * 2; k++) {
      const run_stage *s = &r->stage[k / 2 / d->motions];
      size_t at = k / 2 % d->motions * r->lines + f;
      if (!s->done) continue;
      pb_csv_number(&csv, s->density[k % 2][at]);
      pb_csv_number(&csv, s->amplitude[k % 2][at]);
    }
  }
  return pb_csv_close(&csv, err);
}

static void write_stage(const run_result *r, int stage, pb_matfile *mat) {
  const run_stage *s = &r->stage[stage];
  const pb_frf_record record = {r->design->model, r->channels, &s->response.frf,
                                s->response.expected};
  static const char *const what[2] = {"measured", "predicted"};
  if (!s->done) return;
  pb_frf_write_mat(&record, control_stage_key[stage], mat);
  for (int k = 0; k < 2; k++) {
    char name[64];
    snprintf(name, sizeof name, "%s_density_%s", control_stage_key[stage], what[k]);
    pb_matfile_real(mat, name, r->lines, r->design->motions, s->density[k]);
  }
}

static pb_status save_mat(const run_result *r, const char *dir, pb_error *err) {
  char path[1024];
  pb_matfile *mat;
  pb_status status = pb_output_path(dir, "run.mat", path, sizeof path, err);
  if (status == PB_OK) status = pb_matfile_open(path, &mat, err);
  if (status != PB_OK) return status;
  const pb_frf_record record = {r->design->model, r->channels, NULL, NULL};
  pb_matfile_text(mat, "plant", r->bench->description->name);
  pb_matfile_text(mat, "plant_sha256", r->bench->description->plant_sha256);
  pb_matfile_scalar(mat, "spectrum_resolution", r->df);
  pb_frf_write_names(&record, mat);
  for (int k = 0; k < STAGES; k++) write_stage(r, k, mat);
  if (r->nf > 0) {
    pb_matfile_real(mat, "sensitivity_measured", r->nf, 1, r->sensitivity[0]);
    pb_matfile_real(mat, "sensitivity_predicted", r->nf, 1, r->sensitivity[1]);
  }
  return pb_matfile_close(mat, err);
}

pb_status run_save(const run_result *r, const char *dir, pb_error *err) {
  pb_status status = save_mat(r, dir, err);
  if (status == PB_OK) status = save_spectra(r, dir, err);
  for (int k = 0; k < STAGES && status == PB_OK; k++) {
    const iff_measurement *m = &r->stage[k].response;
    const pb_frf_record record = {r->design->model, r->channels, &m->frf, m->expected};
    char path[1024], name[64];
    if (!r->stage[k].done) continue;
    snprintf(name, sizeof name, "run-%s.csv", control_stage_key[k]);
    status = pb_output_path(dir, name, path, sizeof path, err);
    if (status == PB_OK) status = pb_frf_write_csv(&record, path, err);
  }
  const control_design *d = r->design;
  return status == PB_OK ? control_export(d->damped ? &d->iff : NULL, d, dir, err) : status;
}

// ---- figures ------------------------------------------------------------------------------------

enum { PANELS = 6, CURVES = 2 * STAGES };

static const char *const label_of[STAGES][2] = {{"undamped", "undamped, predicted"},
                                                {"IFF", "IFF, predicted"},
                                                {"HAC-LAC", "HAC-LAC, predicted"}};

// Panels of one figure: measured and predicted curves of each stage over frequency.
typedef struct panels {
  double *memory;  // [PANELS][CURVES][most] magnitudes, then [most] frequencies
  size_t most, count;
  pb_plot_curve curve[PANELS][CURVES];
  pb_plot_panel panel[PANELS];
  char text[PANELS][300];
} panels;

static panels *panels_new(size_t most) {
  panels *p = calloc(1, sizeof *p);
  if (p) p->memory = malloc((PANELS * CURVES + 1) * (most + 1) * sizeof *p->memory);
  if (p) p->most = most;
  if (p && !p->memory) {
    free(p);
    return NULL;
  }
  return p;
}

static void panels_free(panels *p) {
  if (p) free(p->memory);
  free(p);
}

static double *add_curve(panels *p, int stage, int which, size_t count, const double *x) {
  pb_plot_panel *panel = &p->panel[p->count];
  double *y = p->memory + (p->count * CURVES + panel->count) * p->most;
  p->curve[p->count][panel->count++] =
      (pb_plot_curve){label_of[stage][which],
                      which ? PB_PLOT_DASHED : PB_PLOT_POINTS,
                      which ? PB_PLOT_BLACK : (stage ? stage : PB_PLOT_GREY),
                      count,
                      x,
                      y};
  return y;
}

static void end_panel(panels *p) {
  pb_plot_panel *panel = &p->panel[p->count];
  panel->x = (pb_plot_axis){"Frequency (Hz)", true, 0, 0, 0};
  panel->y = (pb_plot_axis){p->text[p->count], true, 0, 0, 0};
  panel->curve = p->curve[p->count++];
}

static pb_status draw(const run_result *r, const panels *p, const char *dir, const char *name,
                      const char *what, pb_error *err) {
  char path[1024], title[300];
  pb_status status = pb_output_path(dir, name, path, sizeof path, err);
  if (status != PB_OK) return status;
  snprintf(title, sizeof title, "%s: %s", r->bench->description->name, what);
  return pb_plot(path, &(pb_plot_figure){title, true, p->count, p->panel}, err);
}

static pb_status plot_transmission(const run_result *r, const char *dir, pb_error *err) {
  const control_design *d = r->design;
  size_t nd = d->disturbances, pairs = d->motions < nd ? d->motions : nd;
  panels *p = panels_new(r->stage[STAGE_HAC].response.frf.nf);
  if (!p) return pb_fail_memory(err, "plot");
  for (size_t k = 0; k < pairs && k < PANELS; k++) {
    char unit[80];
    for (int c = 0; c < CURVES; c++) {
      const run_stage *s = &r->stage[c / 2];
      const pb_frf *frf = &s->response.frf;
      if (!s->done || frf->nf > p->most) continue;
      const double complex *h = c % 2 ? s->response.expected : frf->h;
      double *y = add_curve(p, c / 2, c % 2, frf->nf, frf->frequency_hz);
      for (size_t f = 0; f < frf->nf; f++) y[f] = cabs(h[(f * frf->ny + d->motion[k]) * nd + k]);
    }
    pb_channel_unit(d->model, d->motion[k], d->disturbance[k], unit, sizeof unit);
    snprintf(p->text[k], sizeof p->text[k], "%s → %s (%s)", d->model->input[d->disturbance[k]].name,
             d->model->output[d->motion[k]].name, unit);
    end_panel(p);
  }
  pb_status status = draw(r, p, dir, "run-transmission.png", "from disturbance to motion", err);
  panels_free(p);
  return status;
}

static pb_status plot_spectra(const run_result *r, const char *dir, pb_error *err) {
  const control_design *d = r->design;
  const pb_experiment_options *e = &r->experiment;
  panels *p = panels_new(r->lines);
  if (!p) return pb_fail_memory(err, "plot");
  size_t from = (size_t)ceil(e->f1 / r->df), to = (size_t)floor(e->f2 / r->df * (1 + 1e-9));
  if (from == 0) from = 1;
  if (to >= r->lines) to = r->lines - 1;
  size_t count = to >= from ? to - from + 1 : 0;
  double *x = p->memory + PANELS * CURVES * p->most;
  for (size_t f = 0; f < count; f++) x[f] = (double)(from + f) * r->df;
  for (size_t k = 0; k < d->motions && k < PANELS; k++) {
    const pb_signal *motion = &d->model->output[d->motion[k]];
    for (int c = 0; c < CURVES; c++) {
      const run_stage *s = &r->stage[c / 2];
      if (!s->done) continue;
      double *y = add_curve(p, c / 2, c % 2, count, x);
      for (size_t f = 0; f < count; f++) y[f] = s->amplitude[c % 2][k * r->lines + from + f];
    }
    snprintf(p->text[k], sizeof p->text[k], "%s, rms above (%s)", motion->name, motion->unit);
    end_panel(p);
  }
  pb_status status =
      draw(r, p, dir, "run-spectra.png", "cumulative amplitude, from high frequency down", err);
  panels_free(p);
  return status;
}

static pb_status plot_sensitivity(const run_result *r, const char *dir, pb_error *err) {
  const pb_frf *frf = &r->stage[STAGE_HAC].response.frf;
  if (r->nf == 0) return PB_OK;
  panels *p = panels_new(r->nf);
  if (!p) return pb_fail_memory(err, "plot");
  for (int c = 0; c < 2; c++) {
    double *y = add_curve(p, STAGE_HAC, c, r->nf, frf->frequency_hz);
    for (size_t f = 0; f < r->nf; f++) y[f] = c || r->coherent[f] ? r->sensitivity[c][f] : NAN;
  }
  snprintf(p->text[0], sizeof p->text[0], "Largest σ(S) at the metrology");
  end_panel(p);
  pb_status status = draw(r, p, dir, "run-sensitivity.png", "sensitivity", err);
  panels_free(p);
  return status;
}

pb_status run_plot(const run_result *r, const char *dir, pb_error *err) {
  pb_status status = plot_transmission(r, dir, err);
  if (status == PB_OK) status = plot_spectra(r, dir, err);
  if (status == PB_OK) status = plot_sensitivity(r, dir, err);
  return status;
}
