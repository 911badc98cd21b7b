// What the files of the periodic estimator share.
#ifndef PB_SIGNAL_PERIODIC_INTERNAL_H
#define PB_SIGNAL_PERIODIC_INTERNAL_H

#include "signal/fft.h"
#include "signal/periodic.h"

struct pb_periodic {
  pb_periodic_options options;
  size_t nu, ny, signals;  // signals = nu + ny, inputs first
  size_t first, lines;
  size_t all;            // lines and, after them, the level (twice the mean), as amplitudes
  size_t fill, current;  // of the period under way, and its experiment
  size_t *count;         // [experiments]
  double *record;        // [signals][period]
  pb_fft fft;
  double complex *work;      // [period]
  double complex *line;      // [signals][all] of one period
  double complex *previous;  // [signals][all] of the one before
  double complex *mean;      // [experiments][signals][lines]
  double *peak;              // [experiments][signals] largest |record|
  // Σ_p of products of deviations from the mean: outputs, outputs with inputs, inputs.
  double *scatter;              // [experiments][ny][lines]
  double complex *cross;        // [experiments][ny][nu][lines]
  double complex *input;        // [experiments][nu][nu][lines]
  double complex *before;       // [signals] deviations of one line
  double complex *after;        // [signals]
  double complex *difference;   // [experiments][signals][all] Σ over runs of last − first period
  size_t *runs, *run, *length;  // [experiments] runs of periods that follow one another: how many,
                                // periods of the one under way, and of each before (0: none yet)
  bool *uneven;                 // [experiments] of different lengths
  bool gap;                     // the next sample does not follow the last
  // What pb_periodic_settle found, [experiments][signals][lines]; NULL: nothing.
  bool settled;
  double complex *shift;      // in the means
  double complex *remainder;  // of the difference of one run
  double *excess;             // variance that the shift has
  double *moved;              // Σ_p |T_p − T̄|² of what was taken out
  double freedom;             // of the remainder, as a part of one
};

// Index of the first line of a signal in an experiment, in arrays of lines and of `all`.
static inline size_t pb_periodic_series(const pb_periodic *p, size_t e, size_t signal) {
  return e * p->signals + signal;
}

// The largest rounding that a line of this series has: amplitude. [any]
double pb_periodic_rounding(const pb_periodic *p, size_t series);

#endif
