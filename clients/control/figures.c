// Figures of a design: plant, loop gain, Nyquist plane, sensitivity, transmission, root locus.
#include <math.h>
#include <stdlib.h>

#include "control_tool.h"
#include "plot.h"

enum { MOST_CURVES = 24, MOST_LABEL = 96 };

// Curves of one figure with the memory behind them.
typedef struct sheet {
  const control_design *d;
  const control_judgement *j;
  size_t curves, nf;  // nf: frequencies drawn
  pb_bode_curve bode[MOST_CURVES];
  pb_plot_curve plain[MOST_CURVES];
  char label[MOST_CURVES][MOST_LABEL];
  double complex *h;  // [MOST_CURVES][nf]
  double *x, *y;      // [MOST_CURVES][nf]
} sheet;

static pb_status sheet_new(const control_design *d, const control_judgement *j, sheet **out,
                           pb_error *err) {
  sheet *s = *out = calloc(1, sizeof *s);
  if (!s) return pb_fail_memory(err, "plot");
  s->d = d;
  s->j = j;
  // At half the sample rate itself a sampled low-pass has a zero: nothing to look at.
  while (s->nf < j->nf && j->hz[s->nf] < 0.45 * d->model->sample_rate) s->nf++;
  s->h = malloc(MOST_CURVES * j->nf * sizeof *s->h);
  s->x = malloc(MOST_CURVES * j->nf * sizeof *s->x);
  s->y = malloc(MOST_CURVES * j->nf * sizeof *s->y);
  return s->h && s->x && s->y ? PB_OK : pb_fail_memory(err, "plot");
}

static void sheet_free(sheet *s) {
  if (!s) return;
  free(s->h);
  free(s->x);
  free(s->y);
  free(s);
}

// Adds h[f · stride]; its label is set by the caller (room for MOST_LABEL), NULL when full.
static char *add_bode(sheet *s, pb_plot_style style, int color, const double complex *h,
                      size_t stride) {
  if (s->curves == MOST_CURVES) return NULL;
  size_t k = s->curves++;
  double complex *to = s->h + k * s->j->nf;
  for (size_t f = 0; f < s->nf; f++) to[f] = h[f * stride];
  s->bode[k] = (pb_bode_curve){s->label[k], style, color, s->nf, s->j->hz, to, NULL};
  return s->label[k];
}

static pb_status draw_bode(sheet *s, const char *dir, const char *name, const char *what,
                           const char *unit, pb_error *err) {
  char path[1024], title[300];
  pb_status status = pb_output_path(dir, name, path, sizeof path, err);
  if (status != PB_OK) return status;
  snprintf(title, sizeof title, "%s: %s", s->d->plant->bench.description->name, what);
  pb_bode_plot plot = {
      .title = title, .unit = unit, .decibel = unit == NULL, .count = s->curves, .curve = s->bode};
  return pb_plot_bode(path, &plot, err);
}

// Equal loops of a strut frame look alike: the first stands for them.
static size_t distinct(const control_design *d) {
  return d->frame.cartesian ? (d->n < 6 ? d->n : 6) : 1;
}

static pb_status plot_plant(const control_design *d, const control_judgement *j, const char *dir,
                            pb_error *err) {
  sheet *s;
  size_t n = d->n;
  pb_status status = sheet_new(d, j, &s, err);
  for (size_t i = 0; i < distinct(d) && status == PB_OK; i++) {
    const char *name = control_loop_name(d, i);
    char *label = add_bode(s, PB_PLOT_THIN, PB_PLOT_GREY, j->plant[0] + i * (n + 1), n * n);
    if (label) snprintf(label, MOST_LABEL, "undamped");
    label = add_bode(s, PB_PLOT_LINE, (int)i + 1, j->plant[1] + i * (n + 1), n * n);
    if (label) snprintf(label, MOST_LABEL, "%s%s", name, d->damped ? " damped" : "");
  }
  if (status == PB_OK && n > 1 && !d->frame.cartesian) {
    char *label = add_bode(s, PB_PLOT_DASHED, 2, j->plant[1] + n, n * n);
    if (label) snprintf(label, MOST_LABEL, "coupling to %s", control_loop_name(d, 1));
  }
  if (status == PB_OK) {
    char unit[80];
    pb_channel_unit(d->model, d->metrology[0], d->channels.input[0], unit, sizeof unit);
    status = draw_bode(s, dir, "hac-plant.png",
                       d->frame.cartesian ? "plant in the Cartesian frame" : "plant along a strut",
                       d->frame.cartesian ? "SI units" : unit, err);
  }
  sheet_free(s);
  return status;
}

static pb_status plot_loop(const control_design *d, const control_judgement *j, const char *dir,
                           pb_error *err) {
  sheet *s;
  size_t n = d->n;
  pb_status status = sheet_new(d, j, &s, err);
  for (size_t i = 0; n > 1 && i < n && i < 12 && status == PB_OK; i++) {
    char *label = add_bode(s, PB_PLOT_THIN, PB_PLOT_GREY, j->mimo.locus + i, n);
    if (label) snprintf(label, MOST_LABEL, "characteristic loci");
  }
  for (size_t i = 0; i < distinct(d) && status == PB_OK; i++) {
    char *label = add_bode(s, PB_PLOT_LINE, (int)i + 1, j->l + i * (n + 1), n * n);
    if (label) snprintf(label, MOST_LABEL, "L %s", control_loop_name(d, i));
  }
  if (status == PB_OK) status = draw_bode(s, dir, "hac-loop.png", "loop gain", NULL, err);
  sheet_free(s);
  return status;
}

static void add_locus(sheet *s, size_t i, const char *label, int color) {
  size_t k = s->curves++, nf = s->j->nf, n = s->d->n;
  double *x = s->x + k * nf, *y = s->y + k * nf;
  for (size_t f = 0; f < nf; f++) {
    x[f] = creal(s->j->mimo.locus[f * n + i]);
    y[f] = cimag(s->j->mimo.locus[f * n + i]);
    if (hypot(x[f], y[f]) > 20) x[f] = y[f] = NAN;
  }
  s->plain[k] = (pb_plot_curve){label, PB_PLOT_LINE, color, nf, x, y};
}

static pb_status plot_nyquist(const control_design *d, const control_judgement *j, const char *dir,
                              pb_error *err) {
  enum { CIRCLE = 181 };
  static const double minus_one = -1, zero = 0;
  double cx[CIRCLE], cy[CIRCLE], mx[CIRCLE], my[CIRCLE];
  char path[1024], title[300];
  sheet *s;
  for (int k = 0; k < CIRCLE; k++) {
    double angle = 2 * M_PI * k / (CIRCLE - 1);
    cx[k] = cos(angle);
    cy[k] = sin(angle);
    mx[k] = -1 + 0.5 * cos(angle);
    my[k] = 0.5 * sin(angle);
  }
  pb_status status = sheet_new(d, j, &s, err);
  for (size_t i = 0; i < d->n && i < MOST_CURVES - 3 && status == PB_OK; i++) {
    snprintf(s->label[i], MOST_LABEL, d->n > 1 ? "λ%zu" : "L", i + 1);
    add_locus(s, i, s->label[i], (int)(i % 7) + 1);
  }
  if (status == PB_OK) status = pb_output_path(dir, "hac-nyquist.png", path, sizeof path, err);
  if (status == PB_OK) {
    s->plain[s->curves++] =
        (pb_plot_curve){"|L| = 1", PB_PLOT_DASHED, PB_PLOT_GREY, CIRCLE, cx, cy};
    s->plain[s->curves++] =
        (pb_plot_curve){"|S| = 2", PB_PLOT_DASHED, PB_PLOT_BLACK, CIRCLE, mx, my};
    s->plain[s->curves++] =
        (pb_plot_curve){"−1", PB_PLOT_CROSS, PB_PLOT_BLACK, 1, &minus_one, &zero};
    snprintf(title, sizeof title, "%s: characteristic loci", d->plant->bench.description->name);
    pb_plot_panel panel = {.x = {"Re λ", false, -3, 2, 0},
                           .y = {"Im λ", false, -2.5, 1.25, 0},
                           .count = s->curves,
                           .curve = s->plain};
    status = pb_plot(path, &(pb_plot_figure){title, false, 1, &panel}, err);
  }
  sheet_free(s);
  return status;
}

static void add_magnitude(sheet *s, const char *label, pb_plot_style style, int color,
                          const double *value) {
  size_t k = s->curves++;
  s->plain[k] = (pb_plot_curve){label, style, color, s->nf, s->j->hz, value};
}

static pb_status plot_sensitivity(const control_design *d, const control_judgement *j,
                                  const char *dir, pb_error *err) {
  char path[1024], title[300];
  sheet *s;
  pb_status status = sheet_new(d, j, &s, err);
  for (size_t i = 0; i < distinct(d) && status == PB_OK; i++) {
    double *y = s->y + i * j->nf;
    for (size_t f = 0; f < j->nf; f++) y[f] = 1 / cabs(1 + j->l[f * d->n * d->n + i * (d->n + 1)]);
    snprintf(s->label[i], MOST_LABEL, "1/|1 + L| %s", control_loop_name(d, i));
    add_magnitude(s, s->label[i], PB_PLOT_THIN, (int)i + 3, y);
  }
  if (status == PB_OK) {
    add_magnitude(s, "largest σ(S)", PB_PLOT_LINE, 1, j->mimo.s);
    add_magnitude(s, "largest σ(T)", PB_PLOT_DASHED, 2, j->mimo.t);
    status = pb_output_path(dir, "hac-sensitivity.png", path, sizeof path, err);
  }
  if (status == PB_OK) {
    snprintf(title, sizeof title, "%s: sensitivity", d->plant->bench.description->name);
    pb_plot_panel panel = {.x = {"Frequency (Hz)", true, 0, 0, 0},
                           .y = {"Singular values, magnitudes", true, 1e-3, 10, 0},
                           .count = s->curves,
                           .curve = s->plain};
    status = pb_plot(path, &(pb_plot_figure){title, false, 1, &panel}, err);
  }
  sheet_free(s);
  return status;
}

// One panel a pair of disturbance and motion.
static pb_status plot_transmission(const control_design *d, const control_judgement *j,
                                   const char *dir, pb_error *err) {
  enum { PANELS = 6 };
  size_t pairs = d->motions < d->disturbances ? d->motions : d->disturbances;
  size_t some = d->motions * d->disturbances;
  pb_plot_panel panel[PANELS];
  char text[PANELS][300], path[1024], title[300];
  sheet *s;
  if (pairs > PANELS) pairs = PANELS;
  pb_status status = sheet_new(d, j, &s, err);
  for (size_t p = 0; p < pairs && status == PB_OK; p++) {
    size_t first = s->curves;
    char unit[80];
    for (int stage = 0; stage < STAGES; stage++) {
      if (stage == STAGE_IFF && !d->damped) continue;
      double *y = s->y + s->curves * j->nf;
      for (size_t f = 0; f < j->nf; f++)
        y[f] = cabs(j->transmission[stage][f * some + p * d->disturbances + p]);
      add_magnitude(s, control_stage_name[stage], PB_PLOT_LINE,
                    stage == STAGE_UNDAMPED ? PB_PLOT_GREY : stage, y);
    }
    pb_channel_unit(d->model, d->motion[p], d->disturbance[p], unit, sizeof unit);
    snprintf(text[p], sizeof text[p], "%s → %s (%s)", d->model->input[d->disturbance[p]].name,
             d->model->output[d->motion[p]].name, unit);
    panel[p] = (pb_plot_panel){.x = {"Frequency (Hz)", true, 0, 0, 0},
                               .y = {text[p], true, 0, 0, 0},
                               .count = s->curves - first,
                               .curve = s->plain + first};
  }
  if (status == PB_OK) status = pb_output_path(dir, "hac-transmission.png", path, sizeof path, err);
  if (status == PB_OK) {
    snprintf(title, sizeof title, "%s: from disturbance to motion",
             d->plant->bench.description->name);
    status = pb_plot(path, &(pb_plot_figure){title, true, pairs, panel}, err);
  }
  sheet_free(s);
  return status;
}

pb_status control_plot(const control_design *d, const control_judgement *j, const char *dir,
                       pb_error *err) {
  pb_status status = d->damped ? iff_plot(&d->iff, dir, err) : PB_OK;
  if (status == PB_OK) status = plot_plant(d, j, dir, err);
  if (status == PB_OK) status = plot_loop(d, j, dir, err);
  if (status == PB_OK) status = plot_nyquist(d, j, dir, err);
  if (status == PB_OK) status = plot_sensitivity(d, j, dir, err);
  if (status == PB_OK) status = plot_transmission(d, j, dir, err);
  return status;
}
