// PNG plots drawn by gnuplot: stacks of panels with a common legend above them.
//
// Every function runs one gnuplot process and replaces the file at path only when it succeeded.
// Failures: PB_ERR_IO (gnuplot not installed, its message, a file), PB_ERR_MEMORY, PB_ERR_ARGUMENT
// (nothing to draw). Labels may hold any UTF-8 text; NaN points leave a gap.
#ifndef PB_CLIENTS_PLOT_H
#define PB_CLIENTS_PLOT_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

#include "base/status.h"

typedef enum pb_plot_style {
  PB_PLOT_LINE,
  PB_PLOT_DASHED,
  PB_PLOT_THIN,    // a light line, for measured curves under a model
  PB_PLOT_POINTS,  // small dots
  PB_PLOT_STEPS,   // zero-order hold
  PB_PLOT_CROSS,   // markers: × (poles)
  PB_PLOT_CIRCLE,  // ○ (zeros)
  PB_PLOT_SQUARE,  // □ (measured)
  PB_PLOT_PLUS,    // + (chosen gain)
} pb_plot_style;

enum { PB_PLOT_GREY = -1, PB_PLOT_BLACK = -2 };

typedef struct pb_plot_curve {
  const char *label;  // NULL: not in the legend; equal labels share one entry
  pb_plot_style style;
  int color;  // 1… of the palette (7 colours, then again dashed); 0: by position in the panel;
              // or PB_PLOT_GREY, PB_PLOT_BLACK
  size_t count;
  const double *x, *y;  // [count]
} pb_plot_curve;

typedef struct pb_plot_axis {
  const char *label;  // with the unit: "Frequency (Hz)"
  bool log;
  double min, max;  // both 0: from the data
  double tick;      // distance of the ticks; 0: automatic
} pb_plot_axis;

typedef struct pb_plot_text {
  double x, y;  // position in axis units
  const char *text;
} pb_plot_text;

typedef struct pb_plot_panel {
  pb_plot_axis x, y;
  const char *right_label;  // second scale on the right, right = right_scale × y (y.min and y.max
                            // given); or NULL
  double right_scale;
  size_t texts;
  const pb_plot_text *text;  // small grey remarks
  double height;             // relative to the other panels; 0: 1
  size_t count;
  const pb_plot_curve *curve;
} pb_plot_panel;

typedef struct pb_plot_figure {
  const char *title;  // may be NULL
  bool shared_x;      // the panels share the x axis of the last one: ticks only there
  size_t count;
  const pb_plot_panel *panel;
} pb_plot_figure;

// Any figure; 1200 × 900 points, and higher when there are more than three panels.
pb_status pb_plot(const char *path, const pb_plot_figure *figure, pb_error *err);

// ---- Bode and coherence -------------------------------------------------------------------------

typedef struct pb_bode_curve {
  const char *label;
  pb_plot_style style;
  int color;
  size_t count;
  const double *hz;         // [count], > 0
  const double complex *h;  // [count]
  const double *coherence;  // [count] or NULL
} pb_bode_curve;

typedef struct pb_bode_plot {
  const char *title;
  const char *unit;  // of the magnitude: "µm/V"; NULL with decibel
  bool decibel;      // magnitude in dB instead of the unit, log–log
  size_t count;
  const pb_bode_curve *curve;
} pb_bode_plot;

// Magnitude over phase (degrees, wrapped where it tears the curves least), and a coherence panel
// when a curve has one.
pb_status pb_plot_bode(const char *path, const pb_bode_plot *plot, pb_error *err);

// ---- root locus ---------------------------------------------------------------------------------

// Upper half of the complex plane, in rad/s.
typedef struct pb_locus_plot {
  const char *title;
  size_t poles, zeros, chosen;
  const double complex *pole, *zero;  // open loop: × and ○
  const double complex *closed;       // [chosen] closed-loop poles at the chosen gain: +
  const char *chosen_label;           // "g = 100"; NULL: "chosen gain"
  size_t branches, gains;
  const double complex *branch;  // [branches][gains], row-major; each row one branch
  const double complex *measured;
  size_t measured_count;  // identified closed-loop poles; drawn as □; 0: none
  double max_imag;        // top of the picture in rad/s; 0: from the poles, zeros and closed poles
  double min_real;        // left edge, < 0; 0: from the data
} pb_locus_plot;

// Rays of constant damping are drawn and labelled where they fit.
pb_status pb_plot_locus(const char *path, const pb_locus_plot *plot, pb_error *err);

#endif
