// Growth of a cost with its size: y ≈ a·x^p, p the slope of the least-squares line through
// (log x, log y); as a plot on log axes.
#include <math.h>
#include <stdlib.h>

#include "internal.h"
#include "plot.h"

static bool point(const bench_trend *t, size_t row, double *x, double *y) {
  const double *value = t->table->value + row * t->table->columns;
  *x = value[t->x];
  *y = value[t->y];
  return *x > 0 && *y > 0 && isfinite(*x) && isfinite(*y);
}

void bench_trend_fit(bench_trend *t) {
  double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0, x, y;
  for (size_t r = 0; r < t->table->rows; r++) {
    if (!point(t, r, &x, &y) || x < t->from) continue;
    x = log(x), y = log(y);
    n++, sx += x, sy += y, sxx += x * x, sxy += x * y;
  }
  double spread = n * sxx - sx * sx;
  bool fits = n >= 2 && spread > 1e-12 * n * sxx;
  t->exponent = fits ? (n * sxy - sx * sy) / spread : NAN;
  t->factor = fits ? exp((sy - t->exponent * sx) / n) : NAN;
}

// One trend's curves: its points, and its line over the span that was fitted.
typedef struct drawing {
  pb_plot_curve curve[2];
  double *x, *y;  // [rows]
  double line_x[2], line_y[2];
  char label[160];
} drawing;

static void draw(const bench_trend *t, int color, drawing *d) {
  size_t count = 0;
  d->x = bench_memory(t->table->rows, sizeof *d->x);
  d->y = bench_memory(t->table->rows, sizeof *d->y);
  d->line_x[0] = INFINITY, d->line_x[1] = 0;
  for (size_t r = 0; r < t->table->rows; r++) {
    if (!point(t, r, &d->x[count], &d->y[count])) continue;
    if (d->x[count] >= t->from) {
      d->line_x[0] = fmin(d->line_x[0], d->x[count]);
      d->line_x[1] = fmax(d->line_x[1], d->x[count]);
    }
    count++;
  }
  for (int k = 0; k < 2; k++) d->line_y[k] = t->factor * pow(d->line_x[k], t->exponent);
  const bench_column *y = &t->table->column[t->y];
  snprintf(d->label, sizeof d->label, "%s: exponent %.2f", y->name, t->exponent);
  d->curve[0] = (pb_plot_curve){NULL, PB_PLOT_SQUARE, color, count, d->x, d->y};
  d->curve[1] = (pb_plot_curve){d->label, PB_PLOT_LINE, color, 2, d->line_x, d->line_y};
}

// Trends of one table and unit share a panel.
static bool same_panel(const bench_trend *a, const bench_trend *b) {
  return a->table == b->table && a->x == b->x &&
         a->table->column[a->y].unit == b->table->column[b->y].unit;
}

static void axis_label(char *text, size_t size, const char *prefix, const bench_column *c) {
  snprintf(text, size, c->unit ? "%s%s (%s)" : "%s%s", prefix, c->name, c->unit);
}

pb_status bench_plot(const bench *b, pb_error *err) {
  char path[4096];
  snprintf(path, sizeof path, "%s/performance-%s.png", b->plots, b->name);
  drawing *d = bench_memory(b->trends, sizeof *d);
  pb_plot_curve *curve = bench_memory(2 * b->trends, sizeof *curve);
  pb_plot_panel *panel = bench_memory(b->trends, sizeof *panel);
  char(*label)[2][160] = bench_memory(b->trends, sizeof *label);
  size_t panels = 0;
  for (size_t k = 0; k < b->trends; k++) {
    const bench_trend *t = &b->trend[k];
    const bench_column *x = &t->table->column[t->x], *y = &t->table->column[t->y];
    if (!k || !same_panel(t, t - 1)) {
      axis_label(label[panels][0], sizeof label[panels][0], "", x);
      snprintf(label[panels][1], sizeof label[panels][1], "%s%s%s%s", t->table->title,
               y->unit ? " (" : "", y->unit ? y->unit : "", y->unit ? ")" : "");
      panel[panels] = (pb_plot_panel){.x = {.label = label[panels][0], .log = true},
                                      .y = {.label = label[panels][1], .log = true},
                                      .curve = curve + 2 * k};
      panels++;
    }
    draw(t, (int)panel[panels - 1].count / 2 + 1, &d[k]);
    curve[2 * k] = d[k].curve[0];
    curve[2 * k + 1] = d[k].curve[1];
    panel[panels - 1].count += 2;
  }
  pb_status st = pb_plot(path, &(pb_plot_figure){b->question, false, panels, panel}, err);
  for (size_t k = 0; k < b->trends; k++) {
    free(d[k].x);
    free(d[k].y);
  }
  free(d);
  free(curve);
  free(panel);
  free(label);
  return st;
}
