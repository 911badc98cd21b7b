// What the files of the periodic estimator share.
#ifndef PB_SIGNAL_PERIODIC_INTERNAL_H
#define PB_SIGNAL_PERIODIC_INTERNAL_H

#include "signal/fft.h"
#include "signal/periodic.h"

struct pb_periodic {
  pb_periodic_options options;
  size_t nu, ny, signals;  // signals = nu + ny, inputs first
  size_t first, lines;
  size_t fill, current;  // of the period under way, and its experiment
  size_t *count;         // [experiments]
  double *record;        // [signals][period]
  pb_fft fft;
  double complex *work;          // [period]
  double complex *line;          // [signals][lines] of one period
  double complex *mean;          // [experiments][signals][lines]
  double *scatter;               // [experiments][ny][lines] Σ_p |Y_p − Ȳ|²
  double complex *first_period;  // [experiments][ny][lines]
  double complex *last_period;   // [experiments][ny][lines]
  bool *broken;                  // [experiments] its periods do not follow one another
  bool gap;                      // the next sample does not follow the last
  bool settled;                  // means and scatter have been corrected
};

#endif
