// Plots of a study: a curve a value.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "alike.h"
#include "frf_files.h"
#include "plot.h"

enum { N = PB_STUDY_STRUTS };

static void label_of(const study *s, size_t k, char *text, size_t size) {
  const pb_study_kind_facts *facts = pb_study_kind_of(s->options->kind);
  if (facts->unit)
    snprintf(text, size, "%s = %s %s", facts->quantity, s->label[k], facts->unit);
  else
    snprintf(text, size, "%s", s->label[k]);
}

static pb_status path_of(const study *s, const char *dir, const char *what, char *path, size_t size,
                         pb_error *err) {
  char name[64];
  snprintf(name, sizeof name, "study-%s-%s.png", pb_study_kind_of(s->options->kind)->name, what);
  return pb_output_path(dir, name, path, size, err);
}

// Labels and work space of a figure with a curve a value.
typedef struct canvas {
  study_label *label;    // [count]
  size_t *shown;         // [count] values that have curves of their own
  double complex *h;     // responses
  double *x, *y;         // points of curves
  pb_bode_curve *bode;   // [count]
  pb_plot_curve *curve;  // [curves]
} canvas;

static void canvas_clear(canvas *c) {
  free(c->label);
  free(c->shown);
  free(c->h);
  free(c->x);
  free(c->y);
  free(c->bode);
  free(c->curve);
}

static pb_status canvas_make(const study *s, size_t responses, size_t points, size_t curves,
                             canvas *c, pb_error *err) {
  *c = (canvas){0};
  c->label = malloc((s->count + 1) * sizeof *c->label);
  c->shown = malloc((s->count + 1) * sizeof *c->shown);
  c->h = malloc((responses + 1) * sizeof *c->h);
  c->x = malloc((points + 1) * sizeof *c->x);
  c->y = malloc((points + 1) * sizeof *c->y);
  c->bode = calloc(s->count + 1, sizeof *c->bode);
  c->curve = calloc(curves + 1, sizeof *c->curve);
  if (!c->label || !c->shown || !c->h || !c->x || !c->y || !c->bode || !c->curve) {
    canvas_clear(c);
    return pb_fail_memory(err, "plot");
  }
  for (size_t k = 0; k < s->count; k++) label_of(s, k, c->label[k], sizeof c->label[k]);
  return PB_OK;
}

static size_t lines_of(const study *s) {
  size_t lines = 0;
  for (size_t k = 0; k < s->count; k++) lines += s->point[k].size.lines;
  return lines;
}

// Whether all values have actuators of the same kind; else responses are drawn over their value at
// the lowest frequency.
static bool same_units(const study *s) {
  for (size_t k = 1; k < s->count; k++)
    if (s->point[k].input_unit[0] != s->point[0].input_unit[0]) return false;
  return true;
}

// The first strut's response to its actuator, for each value.
static pb_status plot_response(const study *s, bool hac, const char *dir, pb_error *err) {
  char path[1024], title[256], unit[64];
  canvas c;
  bool absolute = same_units(s);
  pb_status status = path_of(s, dir, hac ? "hac" : "iff", path, sizeof path, err);
  if (!status) status = canvas_make(s, lines_of(s), 0, 0, &c, err);
  if (status) return status;
  double complex *h = c.h;
  const size_t count = study_alike(s, hac ? study_hac_alike : study_iff_alike, c.label, c.shown);
  for (size_t j = 0; j < count; j++) {
    const size_t k = c.shown[j];
    const pb_study_point *p = &s->point[k];
    const double complex *from = hac ? p->hac : p->iff;
    double scale = absolute ? 1 : 1 / cabs(from[0]);
    for (size_t f = 0; f < p->size.lines; f++) h[f] = scale * from[f * N * N];
    c.bode[j] =
        (pb_bode_curve){c.label[k], PB_PLOT_LINE, (int)k + 1, p->size.lines, p->hz, h, NULL};
    h += p->size.lines;
  }
  const pb_study_point *p = &s->point[0];
  snprintf(unit, sizeof unit, "%s/%s", hac ? "m" : p->sensor_unit, p->input_unit);
  snprintf(title, sizeof title, "%s: %s → %s", s->plant, absolute ? p->input : "actuator 1",
           hac        ? "dL1"
           : absolute ? p->sensor
                      : "force sensor 1");
  pb_bode_plot plot = {.title = title,
                       .unit = absolute ? unit : "over its lowest-frequency value",
                       .count = count,
                       .curve = c.bode};
  status = pb_plot_bode(path, &plot, err);
  canvas_clear(&c);
  return status;
}

// ---- root loci ----------------------------------------------------------------------------------

static void add_points(canvas *c, size_t *curves, size_t *points, const char *label,
                       pb_plot_style style, int color, const double complex *at, size_t count,
                       size_t stride) {
  double *x = c->x + *points, *y = c->y + *points;
  for (size_t i = 0; i < count; i++) {
    double complex s = at[i * stride];
    bool upper = cimag(s) >= 0;
    x[i] = upper ? creal(s) : NAN;
    y[i] = upper ? cimag(s) : NAN;
  }
  c->curve[(*curves)++] = (pb_plot_curve){label, style, color, count, x, y};
  *points += count;
}

static bool shown(const pb_study_point *p, size_t branch) {
  return p->is_mode[branch] > 0 || cimag(p->locus[branch * p->size.gains]) == 0;
}

static void draw_locus(const study *s, size_t k, canvas *c, size_t *curves, size_t *points) {
  const pb_study_point *p = &s->point[k];
  const size_t gains = p->size.gains;
  const int color = (int)k + 1;
  for (size_t b = 0; b < p->size.branches; b++) {
    const double complex *branch = p->locus + b * gains;
    if (!shown(p, b)) continue;
    add_points(c, curves, points, c->label[k], PB_PLOT_LINE, color, branch, gains, 1);
    add_points(c, curves, points, NULL, PB_PLOT_CROSS, color, branch, 1, 1);
    add_points(c, curves, points, NULL, PB_PLOT_PLUS, color, branch + p->chosen, 1, 1);
  }
  if (p->size.zeros > 0)
    add_points(c, curves, points, NULL, PB_PLOT_CIRCLE, color, p->zero, p->size.zeros, 1);
}

static pb_status plot_locus(const study *s, const char *dir, pb_error *err) {
  char path[1024], title[256];
  canvas c;
  size_t points = 0, curves = 0;
  double highest = 0;
  for (size_t k = 0; k < s->count; k++) {
    const pb_study_point *p = &s->point[k];
    points += p->size.branches * (p->size.gains + 2) + p->size.zeros;
    curves += 3 * p->size.branches + 1;
    for (size_t m = 0; m < p->size.modes; m++) highest = fmax(highest, p->mode_hz[m]);
  }
  pb_status status = path_of(s, dir, "locus", path, sizeof path, err);
  if (!status) status = canvas_make(s, 0, points, curves, &c, err);
  if (status) return status;
  points = curves = 0;
  const size_t count = study_alike(s, study_iff_alike, c.label, c.shown);
  for (size_t j = 0; j < count; j++) draw_locus(s, c.shown[j], &c, &curves, &points);
  const double top = 1.15 * 2 * M_PI * highest;
  snprintf(title, sizeof title, "%s: IFF root loci; × poles, ○ zeros, + best gain", s->plant);
  pb_plot_panel panel = {.x = {"Real part (rad/s)", false, -top, 0.05 * top, 0},
                         .y = {"Imaginary part (rad/s)", false, 0, top, 0},
                         .count = curves,
                         .curve = c.curve};
  pb_plot_figure figure = {.title = title, .count = 1, .panel = &panel};
  status = pb_plot(path, &figure, err);
  canvas_clear(&c);
  return status;
}

// ---- coupling, attainable damping ---------------------------------------------------------------

static pb_status plot_rga(const study *s, const char *dir, pb_error *err) {
  char path[1024], title[256];
  canvas c;
  pb_status status = path_of(s, dir, "rga", path, sizeof path, err);
  if (!status) status = canvas_make(s, 0, 0, 2 * s->count, &c, err);
  if (status) return status;
  const size_t count = study_alike(s, study_rga_alike, c.label, c.shown);
  for (size_t j = 0; j < count; j++) {
    const size_t k = c.shown[j];
    const pb_study_point *p = &s->point[k];
    c.curve[2 * j] =
        (pb_plot_curve){NULL, PB_PLOT_THIN, (int)k + 1, p->size.lines, p->hz, p->rga_open};
    c.curve[2 * j + 1] =
        (pb_plot_curve){c.label[k], PB_PLOT_LINE, (int)k + 1, p->size.lines, p->hz, p->rga};
  }
  snprintf(title, sizeof title, "%s: RGA number of the HAC plant, undamped (thin) and with IFF",
           s->plant);
  pb_plot_panel panel = {.x = {.label = "Frequency (Hz)", .log = true},
                         .y = {.label = "RGA number", .log = true},
                         .count = 2 * count,
                         .curve = c.curve};
  pb_plot_figure figure = {.title = title, .count = 1, .panel = &panel};
  status = pb_plot(path, &figure, err);
  canvas_clear(&c);
  return status;
}

// A curve a mode over the finite values; on a logarithmic axis those above zero.
static pb_status plot_damping(const study *s, const char *dir, pb_error *err) {
  const pb_study_kind_facts *facts = pb_study_kind_of(s->options->kind);
  char path[1024], title[256], axis[64], name[N][64];
  canvas c;
  double least = INFINITY, most = 0;
  size_t finite = 0;
  for (size_t k = 0; k < s->count; k++) {
    if (!isfinite(s->value[k])) continue;
    finite++;
    if (s->value[k] > 0) least = fmin(least, s->value[k]);
    most = fmax(most, s->value[k]);
  }
  if (finite < 2) return PB_OK;
  bool log = most > 20 * least && s->options->kind == PB_STUDY_AXIAL;
  pb_status status = path_of(s, dir, "damping", path, sizeof path, err);
  if (!status) status = canvas_make(s, 0, N * s->count, N, &c, err);
  if (status) return status;
  size_t curves = 0;
  for (size_t m = 0; m < N; m++) {
    double *x = c.x + m * s->count, *y = c.y + m * s->count;
    bool any = false;
    for (size_t k = 0; k < s->count; k++) {
      const pb_study_point *p = &s->point[k];
      bool there = isfinite(s->value[k]) && (!log || s->value[k] > 0) && m < p->size.modes;
      x[k] = there ? s->value[k] : NAN;
      y[k] = there ? 100 * p->attainable[m] : NAN;
      any = any || there;
    }
    size_t j = 0;
    while (j < curves && !study_same(c.curve[j].y, y, s->count)) j++;
    if (j < curves) {
      const size_t length = strlen(name[j]);
      snprintf(name[j] + length, sizeof name[j] - length, ", %zu", m + 1);
    } else if (any) {
      snprintf(name[curves], sizeof name[0], "mode %zu", m + 1);
      c.curve[curves] = (pb_plot_curve){name[curves], PB_PLOT_LINE, (int)m + 1, s->count, x, y};
      curves++;
    }
  }
  snprintf(axis, sizeof axis, "%s (%s)", facts->quantity, facts->unit);
  snprintf(title, sizeof title, "%s: attainable damping with IFF", s->plant);
  pb_plot_panel panel = {.x = {.label = axis, .log = log},
                         .y = {.label = "Attainable damping (%)", .min = 0, .max = 105},
                         .count = curves,
                         .curve = c.curve};
  pb_plot_figure figure = {.title = title, .count = 1, .panel = &panel};
  status = pb_plot(path, &figure, err);
  canvas_clear(&c);
  return status;
}

pb_status study_plot(const study *s, const char *dir, pb_error *err) {
  pb_status status = plot_response(s, true, dir, err);
  if (!status) status = plot_response(s, false, dir, err);
  if (!status) status = plot_locus(s, dir, err);
  if (!status) status = plot_rga(s, dir, err);
  return status ? status : plot_damping(s, dir, err);
}
