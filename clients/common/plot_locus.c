// Root loci: see plot.h.
#include "plot.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static const double hertz = 1 / (2 * 3.14159265358979323846);
static const double damping[] = {0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7};
enum { RAYS = sizeof damping / sizeof *damping, MARKERS = 4 };

typedef struct frame {
  double left, right, top;
} frame;

// real: points on the real axis count too; a controller's pole may run far out along it.
static void enclose(frame *f, const double complex *point, size_t count, bool grow_top, bool real) {
  for (size_t i = 0; i < count; i++) {
    double re = creal(point[i]), im = fabs(cimag(point[i]));
    if (!isfinite(re) || !isfinite(im) || (!real && im < 1e-6 * fabs(re))) continue;
    if (grow_top && im > f->top) f->top = im;
    if (im > 1.1 * f->top) continue;
    if (re < f->left) f->left = re;
    // Not a real zero far out on the right: it may be one at infinity but for rounding.
    if (re > f->right && re <= f->top) f->right = re;
  }
}

// The picture's borders: all marked points, and what of the branches lies beside them.
static frame choose_frame(const pb_locus_plot *plot) {
  frame f = {0, 0, plot->max_imag};
  bool grow = plot->max_imag <= 0;
  enclose(&f, plot->pole, plot->poles, grow, true);
  enclose(&f, plot->zero, plot->zeros, grow, true);
  enclose(&f, plot->closed, plot->chosen, grow, true);
  if (grow) f.top = f.top > 0 ? 1.15 * f.top : 1;
  enclose(&f, plot->measured, plot->measured_count, false, true);
  enclose(&f, plot->branch, plot->branches * plot->gains, false, false);
  if (f.left < -1.2 * f.top) f.left = -1.2 * f.top;
  if (plot->min_real < 0) f.left = plot->min_real;
  if (f.left == 0) f.left = -0.1 * f.top;
  f.left *= 1.06;
  f.right = fmax(1.1 * f.right, -0.08 * f.left);
  return f;
}

// Points into x, y; those below the real axis mirror others and are left out.
static pb_plot_curve split(const double complex *point, size_t count, double *x, double *y) {
  for (size_t i = 0; i < count; i++) {
    x[i] = creal(point[i]);
    y[i] = cimag(point[i]) >= -1e-9 * cabs(point[i]) ? cimag(point[i]) : NAN;
  }
  return (pb_plot_curve){.count = count, .x = x, .y = y};
}

typedef struct locus_work {
  pb_plot_curve *curve;  // rays, branches, markers
  size_t curves;
  double *data, *next;
  double ray[RAYS][4];  // x then y of the two ends
  pb_plot_text text[RAYS];
  char label[RAYS][24];
  size_t rays;
} locus_work;

// Rays ζ = const from the origin to the border of the picture; only those that leave room between
// the one before and the left border.
static void add_rays(locus_work *work, const frame *f) {
  double last = 0;
  for (size_t k = 0; k < RAYS; k++) {
    double slope = damping[k] / sqrt(1 - damping[k] * damping[k]);
    double x = -f->top * slope, y = f->top;
    if (x < f->left) {
      x = f->left;
      y = -f->left / slope;
    }
    // Distance from the last ray along the border, as a part of the picture.
    double place = -x / (f->right - f->left) + (f->top - y) / f->top;
    if (place - last < 0.06 || y < 0.08 * f->top) continue;
    last = place;
    double *ray = work->ray[work->rays];
    ray[0] = ray[2] = 0;
    ray[1] = x;
    ray[3] = y;
    work->curve[work->curves++] = (pb_plot_curve){
        .style = PB_PLOT_THIN, .color = PB_PLOT_GREY, .count = 2, .x = ray, .y = ray + 2};
    snprintf(work->label[work->rays], sizeof work->label[0], "ζ = %g", damping[k]);
    work->text[work->rays] =
        (pb_plot_text){0.97 * x + 0.005 * (f->right - f->left), 0.97 * y, work->label[work->rays]};
    work->rays++;
  }
}

static void add_points(locus_work *work, const double complex *point, size_t count,
                       const char *label, pb_plot_style style, int color) {
  if (!count) return;
  pb_plot_curve curve = split(point, count, work->next, work->next + count);
  work->next += 2 * count;
  curve.label = label;
  curve.style = style;
  curve.color = color;
  work->curve[work->curves++] = curve;
}

static pb_status draw(const char *path, const pb_locus_plot *plot, locus_work *work,
                      pb_error *err) {
  frame f = choose_frame(plot);
  add_rays(work, &f);
  for (size_t b = 0; b < plot->branches; b++) {
    add_points(work, plot->branch + b * plot->gains, plot->gains, "closed loop, gain from 0",
               PB_PLOT_LINE, 1);
  }
  bool loop = plot->branches || plot->chosen;
  const char *chosen = plot->chosen_label ? plot->chosen_label : "chosen gain";
  add_points(work, plot->pole, plot->poles, loop ? "open-loop poles" : "poles", PB_PLOT_CROSS,
             PB_PLOT_BLACK);
  add_points(work, plot->zero, plot->zeros, "zeros", PB_PLOT_CIRCLE, 3);
  add_points(work, plot->closed, plot->chosen, chosen, PB_PLOT_PLUS, 2);
  add_points(work, plot->measured, plot->measured_count, "measured", PB_PLOT_SQUARE, 4);
  pb_plot_panel panel = {
      .x = {.label = "Real part (rad/s)", .min = f.left, .max = f.right},
      .y = {.label = "Imaginary part (rad/s)", .min = 0, .max = f.top},
      .right_label = "Imaginary part (Hz)",
      .right_scale = hertz,
      .texts = work->rays,
      .text = work->text,
      .count = work->curves,
      .curve = work->curve,
  };
  pb_plot_figure figure = {.title = plot->title, .count = 1, .panel = &panel};
  return pb_plot(path, &figure, err);
}

pb_status pb_plot_locus(const char *path, const pb_locus_plot *plot, pb_error *err) {
  size_t points = plot->poles + plot->zeros + plot->chosen + plot->measured_count +
                  plot->branches * plot->gains;
  locus_work work = {0};
  work.curve = calloc(RAYS + MARKERS + plot->branches, sizeof *work.curve);
  work.data = work.next = malloc((2 * points + 1) * sizeof *work.data);
  pb_status status =
      work.curve && work.data ? draw(path, plot, &work, err) : pb_fail_memory(err, path);
  free(work.curve);
  free(work.data);
  return status;
}
