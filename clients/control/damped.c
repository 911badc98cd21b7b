// The plant that IFF damps, as predicted: responses from the loops' inputs to all outputs, undamped
// and damped, as files and figures.
#include <math.h>
#include <stdlib.h>

#include "control_tool.h"
#include "csv.h"
#include "plot.h"

typedef struct damped_plant {
  const iff_result *iff;
  size_t nf;
  double *hz;            // [nf] of the band, fine at the undamped modes
  double complex *h[2];  // [nf][ny][loops] undamped, damped
} damped_plant;

static const char *const key_of[2] = {"undamped", "damped"};

static pb_status compute(const iff_result *r, damped_plant *p, pb_error *err) {
  const pb_model *m = r->model;
  size_t some = m->ny * r->loops.count;
  double complex *full = malloc(m->ny * m->nu * sizeof *full);
  for (int k = 0; k < 2; k++) p->h[k] = malloc(p->nf * some * sizeof *p->h[k]);
  pb_status status = full && p->h[0] && p->h[1] ? PB_OK : pb_fail_memory(err, "damped plant");
  for (size_t f = 0; f < 2 * p->nf && status == PB_OK; f++) {
    const double *hz = &p->hz[f / 2];
    status = f % 2 ? pb_loop_frf(&r->loop, r->law.gain, hz, 1, full, err)
                   : pb_model_frf(m, PB_SAMPLED, hz, 1, full, err);
    for (size_t k = 0; k < some && status == PB_OK; k++) {
      size_t input = r->loops.input[k % r->loops.count];
      p->h[f % 2][f / 2 * some + k] = full[k / r->loops.count * m->nu + input];
    }
  }
  free(full);
  return status;
}

static pb_status damped_plant_make(const iff_result *r, damped_plant *p, pb_error *err) {
  enum { POINTS = 500 };
  const pb_experiment_options *e = &r->experiment;
  pb_pole_list modes = {0};
  *p = (damped_plant){.iff = r};
  pb_status status = pb_exact_modes(r->model, e->f1, e->f2, &modes, err);
  if (status == PB_OK) status = pb_margins_grid(e->f1, e->f2, POINTS, &modes, &p->hz, &p->nf, err);
  pb_pole_list_clear(&modes);
  return status == PB_OK ? compute(r, p, err) : status;
}

static void damped_plant_clear(damped_plant *p) {
  free(p->hz);
  for (int k = 0; k < 2; k++) free(p->h[k]);
}

static pb_status save_csv(const damped_plant *p, const char *dir, pb_error *err) {
  const iff_result *r = p->iff;
  size_t loops = r->loops.count, some = r->model->ny * loops;
  char path[1024];
  pb_csv csv = {0};
  pb_status status = pb_output_path(dir, "iff-predicted.csv", path, sizeof path, err);
  if (status == PB_OK) status = pb_csv_open(path, &csv, err);
  if (status != PB_OK) return status;
  pb_csv_column(&csv, "frequency", "Hz");
  for (size_t k = 0; k < 4 * some; k++) {
    size_t output = k / 4 / loops, input = r->loops.input[k / 4 % loops];
    char name[300], unit[80];
    pb_channel_unit(r->model, output, input, unit, sizeof unit);
    snprintf(name, sizeof name, "%s %s→%s %s", key_of[k / 2 % 2], r->model->input[input].name,
             r->model->output[output].name, k % 2 ? "imag" : "real");
    pb_csv_column(&csv, name, unit);
  }
  for (size_t f = 0; f < p->nf; f++) {
    pb_csv_number(&csv, p->hz[f]);
    for (size_t k = 0; k < 2 * some; k++) {
      double complex h = p->h[k % 2][f * some + k / 2];
      pb_csv_number(&csv, creal(h));
      pb_csv_number(&csv, cimag(h));
    }
  }
  return pb_csv_close(&csv, err);
}

static pb_status save_mat(const damped_plant *p, const char *dir, pb_error *err) {
  const iff_result *r = p->iff;
  const pb_frf_record names = {.model = r->model, .channels = r->channels};
  char path[1024];
  pb_matfile *mat;
  pb_status status = pb_output_path(dir, "iff-predicted.mat", path, sizeof path, err);
  if (status == PB_OK) status = pb_matfile_open(path, &mat, err);
  if (status != PB_OK) return status;
  pb_matfile_scalar(mat, "Ts", 1 / r->model->sample_rate);
  pb_frf_write_names(&names, mat);
  pb_matfile_real(mat, "frequency_hz", p->nf, 1, p->hz);
  for (int k = 0; k < 2; k++) {
    pb_matfile_frf(mat, key_of[k], p->nf, r->model->ny, r->loops.count, p->h[k]);
  }
  control_mat_lti(mat, "iff", &r->controller_used);
  return pb_matfile_close(mat, err);
}

static pb_status plot_channel(const damped_plant *p, size_t output, size_t loop, const char *dir,
                              double complex *work, pb_error *err) {
  const iff_result *r = p->iff;
  size_t loops = r->loops.count, some = r->model->ny * loops;
  const char *in = r->model->input[r->loops.input[loop]].name, *out = r->model->output[output].name;
  char name[300], path[1024], title[300], unit[80];
  pb_bode_curve curve[2];
  for (size_t k = 0; k < 2; k++) {
    double complex *to = work + k * p->nf;
    for (size_t f = 0; f < p->nf; f++) to[f] = p->h[k][f * some + output * loops + loop];
    curve[k] =
        (pb_bode_curve){key_of[k], PB_PLOT_LINE, k ? 1 : PB_PLOT_GREY, p->nf, p->hz, to, NULL};
  }
  pb_channel_unit(r->model, output, r->loops.input[loop], unit, sizeof unit);
  snprintf(name, sizeof name, "iff-predicted-%s-%s.png", in, out);
  for (char *c = name; *c; c++) {
    if (*c == '/') *c = '_';
  }
  snprintf(title, sizeof title, "%s: %s → %s, g = %.4g", r->bench->description->name, in, out,
           r->law.gain);
  pb_bode_plot plot = {.title = title, .unit = unit, .count = 2, .curve = curve};
  pb_status status = pb_output_path(dir, name, path, sizeof path, err);
  return status == PB_OK ? pb_plot_bode(path, &plot, err) : status;
}

// The first loop's force sensor and its metrology, where it has one.
static pb_status plot_channels(const damped_plant *p, const char *dir, pb_error *err) {
  const iff_result *r = p->iff;
  double complex *work = malloc(2 * p->nf * sizeof *work);
  if (!work) return pb_fail_memory(err, "plot");
  int metrology = control_metrology_of(r->model, r->loops.input[0]);
  pb_status status = plot_channel(p, r->loops.output[0], 0, dir, work, err);
  if (status == PB_OK && metrology >= 0)
    status = plot_channel(p, (size_t)metrology, 0, dir, work, err);
  free(work);
  return status;
}

pb_status control_damped_plant(const iff_result *iff, pb_error *err) {
  const pb_result_options *o = &iff->options->result;
  const char *dir = pb_result_dir(o);
  damped_plant p;
  pb_status status = damped_plant_make(iff, &p, err);
  if (status == PB_OK && o->dir) status = save_csv(&p, dir, err);
  if (status == PB_OK && o->dir) status = save_mat(&p, dir, err);
  if (status == PB_OK && o->plot) status = plot_channels(&p, dir, err);
  damped_plant_clear(&p);
  return status;
}
