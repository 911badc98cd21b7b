// Figures as gnuplot scripts: see plot.h.
//
// Margins are set in screen units, so that panels align whatever the width of their tick labels.
// The legend stands above the first panel; entries that only later panels have are added there.
#include "plot.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "plot_gnuplot.h"

enum { WIDTH = 1200, HEIGHT = 900, LEFT = 110, RIGHT = 30, LEGEND_ROW = 25, PALETTE = 7 };

// Okabe and Ito's colours, told apart with every form of colour blindness.
static const char *const palette[PALETTE] = {"#0072b2", "#d55e00", "#009e73", "#cc79a7",
                                             "#e69f00", "#56b4e9", "#000000"};

// The vertical layout in points, from the top.
typedef struct layout {
  int height, top, legend_rows, legend_columns;
  double first;  // top of the first panel
} layout;

// ---- texts and data -----------------------------------------------------------------------------

// A text in single quotes, which gnuplot takes literally; '' stands for one of them.
static void put_quoted(FILE *script, const char *text) {
  fputc('\'', script);
  for (; text && *text; text++) {
    if (*text == '\'') fputc('\'', script);
    fputc(*text == '\n' ? ' ' : *text, script);
  }
  fputc('\'', script);
}

static void put_data(FILE *script, const pb_plot_figure *figure) {
  for (size_t p = 0; p < figure->count; p++) {
    for (size_t k = 0; k < figure->panel[p].count; k++) {
      const pb_plot_curve *c = &figure->panel[p].curve[k];
      fprintf(script, "$d%zu_%zu << EOD\n", p, k);
      for (size_t i = 0; i < c->count; i++) {
        if (isfinite(c->x[i]) && isfinite(c->y[i])) {
          fprintf(script, "%.9g %.9g\n", c->x[i], c->y[i]);
        } else {
          fputc('\n', script);
        }
      }
      fputs("EOD\n", script);
    }
  }
}

// ---- curves -------------------------------------------------------------------------------------

static void put_color(FILE *script, int color) {
  const char *name = color == PB_PLOT_GREY    ? "#b0b0b0"
                     : color == PB_PLOT_BLACK ? "#000000"
                                              : palette[(color - 1) % PALETTE];
  fprintf(script, " lc rgb '%s'", name);
}

static void put_style(FILE *script, const pb_plot_curve *curve, size_t position) {
  static const char *const text[] = {
      [PB_PLOT_LINE] = "lines lw 2.2",
      [PB_PLOT_DASHED] = "lines lw 2.2",
      [PB_PLOT_THIN] = "lines lw 1.1",
      [PB_PLOT_POINTS] = "points pt 7 ps 0.6",
      [PB_PLOT_STEPS] = "steps lw 1.8",
      [PB_PLOT_CROSS] = "points pt 2 ps 1.9 lw 2.4",
      [PB_PLOT_CIRCLE] = "points pt 6 ps 1.9 lw 2.4",
      [PB_PLOT_SQUARE] = "points pt 4 ps 1.7 lw 2",
      [PB_PLOT_PLUS] = "points pt 1 ps 2.1 lw 2.8",
  };
  int color = curve->color ? curve->color : (int)position + 1;
  static const char *const dash[] = {"", " dt '-'", " dt '.'", " dt '-.'"};
  int turn = color > 0 ? (color - 1) / PALETTE % 4 : 0;
  if (curve->style == PB_PLOT_DASHED && !turn) turn = 1;
  fprintf(script, " with %s%s", text[curve->style], curve->style <= PB_PLOT_THIN ? dash[turn] : "");
  put_color(script, color);
}

// ---- legend -------------------------------------------------------------------------------------

// True when an earlier curve of the figure has the same label.
static bool label_seen(const pb_plot_figure *figure, size_t panel, size_t curve) {
  const char *label = figure->panel[panel].curve[curve].label;
  for (size_t p = 0; p <= panel; p++) {
    for (size_t k = 0; k < figure->panel[p].count; k++) {
      if (p == panel && k == curve) return false;
      const char *other = figure->panel[p].curve[k].label;
      if (other && !strcmp(other, label)) return true;
    }
  }
  return false;
}

static bool in_legend(const pb_plot_figure *figure, size_t panel, size_t curve) {
  return figure->panel[panel].curve[curve].label && !label_seen(figure, panel, curve);
}

static layout make_layout(const pb_plot_figure *figure) {
  size_t entries = 0, longest = 1;
  for (size_t p = 0; p < figure->count; p++) {
    for (size_t k = 0; k < figure->panel[p].count; k++) {
      if (!in_legend(figure, p, k)) continue;
      size_t length = strlen(figure->panel[p].curve[k].label);
      entries++;
      if (length > longest) longest = length;
    }
  }
  int columns = (WIDTH - 100) / (int)(9 * longest + 75);
  if (columns < 1) columns = 1;
  layout l = {.top = figure->title ? 46 : 12, .legend_columns = columns};
  l.legend_rows = ((int)entries + columns - 1) / columns;
  l.first = l.top + l.legend_rows * LEGEND_ROW + 16;
  int extra_rows = l.legend_rows > 3 ? l.legend_rows - 3 : 0;
  int extra_panels = figure->count > 3 ? (int)figure->count - 3 : 0;
  l.height = HEIGHT + extra_rows * LEGEND_ROW + extra_panels * 260;
  return l;
}

static void put_legend(FILE *script, const layout *l) {
  fprintf(script,
          "set key at screen %.5f, screen %.5f center top horizontal Left reverse noenhanced "
          "samplen 2.4 spacing 1.15 width 1 maxcols %d\n",
          0.5 * (LEFT + WIDTH - RIGHT) / WIDTH, 1 - (double)l->top / l->height, l->legend_columns);
}

// ---- axes ---------------------------------------------------------------------------------------

static bool usable(double value, bool log) {
  return isfinite(value) && (!log || value > 0);
}

static void data_range(const pb_plot_panel *panel, bool y, bool log, double *low, double *high) {
  *low = INFINITY;
  *high = -INFINITY;
  for (size_t k = 0; k < panel->count; k++) {
    const double *value = y ? panel->curve[k].y : panel->curve[k].x;
    for (size_t i = 0; i < panel->curve[k].count; i++) {
      if (!usable(value[i], log)) continue;
      if (value[i] < *low) *low = value[i];
      if (value[i] > *high) *high = value[i];
    }
  }
}

static void put_tick(FILE *script, int digit, int power, bool hide) {
  double tick = digit * pow(10, power);
  if (hide) {
    fputs("''", script);
  } else if (power >= -3 && power <= 4) {
    fprintf(script, "'%g'", tick);
  } else if (digit == 1) {
    fprintf(script, "'10^{%d}'", power);
  } else {
    fprintf(script, "'%d·10^{%d}'", digit, power);
  }
  fprintf(script, " %.9g", tick);
}

// Ticks at 1, 2, 5 × 10ⁿ, or all digits on a short axis: gnuplot itself labels decades only, which
// may leave an axis bare.
static void put_log_ticks(FILE *script, char axis, double low, double high, bool hide) {
  const char *separator = "(";
  bool all = high / low < 8;
  fprintf(script, "set %ctics ", axis);
  for (int n = (int)floor(log10(low)); n <= (int)ceil(log10(high)); n++) {
    for (int m = 1; m <= 9; m++) {
      double tick = m * pow(10, n);
      if (tick < 0.999 * low || tick > 1.001 * high) continue;
      if (!all && m != 1 && m != 2 && m != 5) continue;
      fputs(separator, script);
      put_tick(script, m, n, hide);
      separator = ", ";
    }
  }
  fputs(")\n", script);
}

static void put_log_axis(FILE *script, char axis, double low, double high, bool hide) {
  fprintf(script, "set logscale %c 10\nset m%ctics 10\n", axis, axis);
  if (isfinite(low) && high / low < 31) {
    put_log_ticks(script, axis, low, high, hide);
    fprintf(script, "set %crange [%.9g:%.9g]\n", axis, low, high);
  } else {
    bool plain = isfinite(low) && low >= 1e-3 && high <= 1e6;
    fprintf(script, "set %ctics autofreq\n", axis);
    fprintf(script, "set format %c '%s'\n", axis, plain ? "%g" : "10^{%T}");
  }
}

// A range a little wider than the data, so that the frame does not cut the curve.
static void widen_log(double *low, double *high) {
  if (!isfinite(*low)) return;
  *low = pow(10, floor(log10(*low) * 3) / 3) * 0.95;
  *high = pow(10, ceil(log10(*high) * 3) / 3) * 1.05;
}

static void put_axis(FILE *script, char axis, const pb_plot_panel *panel, const pb_plot_axis *a,
                     bool hide) {
  double low, high;
  bool given = a->min != a->max;
  data_range(panel, axis == 'y', a->log, &low, &high);
  if (given) {
    low = a->min;
    high = a->max;
  }
  fprintf(script, "unset logscale %c\nset m%ctics default\nset %ctics autofreq\n", axis, axis,
          axis);
  fprintf(script, "set format %c '%%h'\nset autoscale %c\n", axis, axis);
  if (given || (axis == 'x' && high > low)) {
    fprintf(script, "set %crange [%.9g:%.9g]\n", axis, low, high);
  }
  if (a->log && high > 2 * low) {  // a shorter axis reads better with equal distances
    if (axis == 'y' && !given) widen_log(&low, &high);
    put_log_axis(script, axis, low, high, hide);
  } else if (a->tick > 0) {
    fprintf(script, "set %ctics %.9g\n", axis, a->tick);
  }
  fprintf(script, "set %clabel ", axis);
  put_quoted(script, hide ? "" : a->label);
  fputs(" noenhanced\n", script);
  if (hide) fprintf(script, "set format %c ''\nset %ctics format ''\n", axis, axis);
}

// gnuplot's "link" refuses logarithmic axes, so the second scale needs a given range.
static void put_right_axis(FILE *script, const pb_plot_panel *panel) {
  if (!panel->right_label) {
    fputs("unset y2tics\nunset y2label\nset ytics mirror\n", script);
    return;
  }
  fprintf(script, "set ytics nomirror\nset y2tics\nset y2range [%.9g:%.9g]\nset y2label ",
          panel->right_scale * panel->y.min, panel->right_scale * panel->y.max);
  put_quoted(script, panel->right_label);
  fputs(" noenhanced\n", script);
}

// ---- panels and figure --------------------------------------------------------------------------

static void put_margins(FILE *script, const pb_plot_figure *figure, const layout *l, size_t p) {
  double total = 0, above = 0;
  bool right = false;
  for (size_t k = 0; k < figure->count; k++) {
    double h = figure->panel[k].height > 0 ? figure->panel[k].height : 1;
    if (k < p) above += h;
    total += h;
    right = right || figure->panel[k].right_label;
  }
  double own = figure->panel[p].height > 0 ? figure->panel[p].height : 1;
  double gap = figure->shared_x ? 24 : 66, bottom = 68;
  double room = l->height - l->first - bottom - gap * (double)(figure->count - 1);
  double top = l->first + room * above / total + gap * (double)p;
  double end = top + room * own / total;
  fprintf(script, "set lmargin at screen %.5f\nset rmargin at screen %.5f\n", (double)LEFT / WIDTH,
          1 - (double)(right ? 90 : RIGHT) / WIDTH);
  fprintf(script, "set tmargin at screen %.5f\nset bmargin at screen %.5f\n", 1 - top / l->height,
          1 - end / l->height);
}

static void put_texts(FILE *script, const pb_plot_panel *panel) {
  fputs("unset label\n", script);
  for (size_t k = 0; k < panel->texts; k++) {
    fputs("set label ", script);
    put_quoted(script, panel->text[k].text);
    fprintf(script, " at %.9g, %.9g noenhanced font ',10' textcolor rgb '#808080' front\n",
            panel->text[k].x, panel->text[k].y);
  }
}

static void put_plot(FILE *script, const pb_plot_figure *figure, size_t p) {
  const pb_plot_panel *panel = &figure->panel[p];
  fputs("plot", script);
  for (size_t k = 0; k < panel->count; k++) {
    fprintf(script, "%s $d%zu_%zu using 1:2", k ? ", " : "", p, k);
    put_style(script, &panel->curve[k], k);
    fputs(" title ", script);
    bool listed = p == 0 && in_legend(figure, p, k);
    put_quoted(script, listed ? panel->curve[k].label : "");
  }
  for (size_t q = 1; p == 0 && q < figure->count; q++) {
    for (size_t k = 0; k < figure->panel[q].count; k++) {
      if (!in_legend(figure, q, k)) continue;
      fputs(", keyentry", script);
      put_style(script, &figure->panel[q].curve[k], k);
      fputs(" title ", script);
      put_quoted(script, figure->panel[q].curve[k].label);
    }
  }
  fputc('\n', script);
}

static void put_title(FILE *script, const char *title, int height) {
  fputs("set label ", script);
  put_quoted(script, title);
  fprintf(script, " at screen %.5f, screen %.5f center noenhanced font ',15'\n",
          0.5 * (LEFT + WIDTH - RIGHT) / WIDTH, 1 - 22.0 / height);
}

static void put_panel(FILE *script, const pb_plot_figure *figure, const layout *l, size_t p) {
  const pb_plot_panel *panel = &figure->panel[p];
  put_margins(script, figure, l, p);
  if (p) fputs("unset key\n", script);
  put_axis(script, 'x', panel, &panel->x, figure->shared_x && p + 1 < figure->count);
  put_axis(script, 'y', panel, &panel->y, false);
  put_right_axis(script, panel);
  put_texts(script, panel);
  if (p == 0 && figure->title) put_title(script, figure->title, l->height);
  put_plot(script, figure, p);
}

static void put_figure(FILE *script, const pb_plot_figure *figure) {
  layout l = make_layout(figure);
  fputs("set encoding utf8\n", script);
  fprintf(script,
          "set terminal pngcairo size %d,%d enhanced font 'DejaVu Sans,12' background '#ffffff'\n",
          WIDTH, l.height);
  put_data(script, figure);
  fputs("set border lw 1 lc rgb '#404040'\nset tics textcolor rgb '#202020'\n"
        "set grid xtics ytics mxtics mytics lt 1 lc rgb '#d4d4d4' lw 0.9, lt 1 lc rgb '#ececec' "
        "lw 0.6\nset ylabel offset -1.2,0\n",
        script);
  put_legend(script, &l);
  fputs("set multiplot\n", script);
  for (size_t p = 0; p < figure->count; p++) put_panel(script, figure, &l, p);
  fputs("unset multiplot\n", script);
}

pb_status pb_plot(const char *path, const pb_plot_figure *figure, pb_error *err) {
  size_t curves = 0;
  for (size_t p = 0; p < figure->count; p++) curves += figure->panel[p].count;
  if (!curves) return pb_fail(err, PB_ERR_ARGUMENT, path, "nothing to plot");
  FILE *script = tmpfile();
  if (!script) return pb_fail(err, PB_ERR_IO, path, "no temporary file: %s", strerror(errno));
  put_figure(script, figure);
  pb_status status = PB_OK;
  if (ferror(script)) status = pb_fail(err, PB_ERR_IO, path, "the plot script cannot be written");
  if (!status) status = pb_gnuplot_run(script, path, err);
  fclose(script);
  return status;
}
