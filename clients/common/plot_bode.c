// Bode plots, with coherence where there is one: see plot.h.
#include "plot.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

static const double degree = 180 / 3.14159265358979323846;

// Magnitude in the unit of h or in dB into y [count].
static void magnitudes(const pb_bode_curve *curve, bool decibel, double *y) {
  for (size_t i = 0; i < curve->count; i++) {
    double size = cabs(curve->h[i]);
    y[i] = decibel ? 20 * log10(size) : size;
    if (size == 0) y[i] = NAN;
  }
}

// Phase in degrees in [from, from + 360).
static double phase_of(double complex h, double from) {
  double phase = degree * carg(h);
  return phase - 360 * floor((phase - from) / 360);
}

// Phases into x, y [2 × count − 1]: between two points that lie more than half a turn apart a gap
// takes the place of a vertical line across the panel. Returns the number of points.
static size_t phases(const pb_bode_curve *curve, double from, double *x, double *y) {
  size_t n = 0;
  for (size_t i = 0; i < curve->count; i++) {
    double phase = phase_of(curve->h[i], from);
    if (i && fabs(phase - y[n - 1]) > 180) {
      x[n] = curve->hz[i];
      y[n++] = NAN;
    }
    x[n] = curve->hz[i];
    y[n++] = phase;
  }
  return n;
}

// The start of the phase window that tears the curves least; noise around ±180° hardly shows then.
static double choose_window(const pb_bode_plot *plot) {
  static const double start[] = {-180, -270, -90, -360, 0};
  size_t best = 0, least = SIZE_MAX;
  for (size_t w = 0; w < sizeof start / sizeof *start; w++) {
    size_t tears = 0;
    for (size_t k = 0; k < plot->count; k++) {
      const pb_bode_curve *c = &plot->curve[k];
      for (size_t i = 1; i < c->count; i++) {
        tears += fabs(phase_of(c->h[i], start[w]) - phase_of(c->h[i - 1], start[w])) > 180;
      }
    }
    if (tears >= least) continue;
    least = tears;
    best = w;
  }
  return start[best];
}

// The three panels' curves and the memory behind them.
typedef struct bode_work {
  pb_plot_curve *magnitude, *phase, *coherence;  // [plot->count] each
  size_t coherences;
  double *data;  // 5 numbers a point: magnitude, phase x and y twice
} bode_work;

static bool allocate(const pb_bode_plot *plot, bode_work *work) {
  size_t points = 1;
  for (size_t k = 0; k < plot->count; k++) points += plot->curve[k].count;
  work->magnitude = calloc(3 * plot->count + 1, sizeof *work->magnitude);
  work->data = malloc(5 * points * sizeof *work->data);
  if (!work->magnitude || !work->data) return false;
  work->phase = work->magnitude + plot->count;
  work->coherence = work->phase + plot->count;
  return true;
}

static void fill(const pb_bode_plot *plot, double window, bode_work *work) {
  double *free_data = work->data;
  for (size_t k = 0; k < plot->count; k++) {
    const pb_bode_curve *c = &plot->curve[k];
    int color = c->color ? c->color : (int)k + 1;
    pb_plot_curve curve = {.style = c->style, .color = color, .count = c->count, .x = c->hz};
    double *y = free_data, *px = y + c->count, *py = px + 2 * c->count;
    free_data = py + 2 * c->count;
    magnitudes(c, plot->decibel, y);
    curve.y = y;
    curve.label = c->label;
    work->magnitude[k] = curve;
    curve.label = NULL;
    work->phase[k] = curve;
    work->phase[k].count = phases(c, window, px, py);
    work->phase[k].x = px;
    work->phase[k].y = py;
    if (!c->coherence) continue;
    curve.y = c->coherence;
    work->coherence[work->coherences++] = curve;
  }
}

pb_status pb_plot_bode(const char *path, const pb_bode_plot *plot, pb_error *err) {
  bode_work work = {0};
  if (!allocate(plot, &work)) {
    free(work.magnitude);
    free(work.data);
    return pb_fail_memory(err, path);
  }
  double window = choose_window(plot);
  fill(plot, window, &work);
  char label[96] = "Magnitude (dB)";
  if (!plot->decibel) {
    snprintf(label, sizeof label, plot->unit ? "Magnitude (%s)" : "Magnitude", plot->unit);
  }
  pb_plot_axis hz = {.label = "Frequency (Hz)", .log = true};
  pb_plot_panel panel[3] = {
      {.x = hz,
       .y = {.label = label, .log = !plot->decibel},
       .height = 1.5,
       .count = plot->count,
       .curve = work.magnitude},
      {.x = hz,
       .y = {.label = "Phase (°)", .min = window - 10, .max = window + 370, .tick = 90},
       .count = plot->count,
       .curve = work.phase},
      {.x = hz,
       .y = {.label = "Coherence", .min = 0, .max = 1.02, .tick = 0.25},
       .height = 0.6,
       .count = work.coherences,
       .curve = work.coherence},
  };
  pb_plot_figure figure = {
      .title = plot->title, .shared_x = true, .count = work.coherences ? 3 : 2, .panel = panel};
  pb_status status = pb_plot(path, &figure, err);
  free(work.magnitude);
  free(work.data);
  return status;
}
