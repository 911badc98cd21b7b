// What the files of the fit share: the data of a fit and the basis of partial fractions.
#ifndef PB_CONTROL_FIT_INTERNAL_H
#define PB_CONTROL_FIT_INTERNAL_H

#include "control/fit.h"

// The lines and channels used, scaled: frequency by `scale`, each channel by its weights.
typedef struct pb_fit_data {
  size_t lines, channels;
  double scale;       // rad/s; w is divided by it
  double *x;          // [lines] Im w / scale, ascending
  double complex *h;  // [channels][lines]
  double *weight;     // [channels][lines]
} pb_fit_data;

// The lines of the band that all channels have. Zeroed on failure. PB_ERR_ARGUMENT, PB_ERR_NUMERIC,
// PB_ERR_MEMORY. [init]
pb_status pb_fit_data_new(const pb_frf *frf, const pb_fit_channel *channel, size_t channels,
                          const pb_fit_options *options, pb_fit_data *out, pb_error *err);
void pb_fit_data_clear(pb_fit_data *data);

// Median of |h[n]|; work[n]. [any]
double pb_fit_median_size(const double complex *h, size_t n, double *work);

// A model under way: n real parameters of poles, pairs at (k, k+1) with conjugate p[k+1].
typedef struct pb_fit_poles {
  size_t n;
  double complex *p;  // [capacity] scaled
} pb_fit_poles;

// The basis at one line into phi[n]: 1/(w−p); for a pair 1/(w−p) + 1/(w−p*) and i/(w−p) − i/(w−p*).
void pb_fit_basis(const pb_fit_poles *poles, double x, double complex *phi);

// One relaxed pole relocation. Fails with PB_ERR_NUMERIC, PB_ERR_MEMORY.
pb_status pb_fit_relocate(const pb_fit_data *data, pb_fit_poles *poles, pb_error *err);

// Coefficients for given poles: c[channels][n + 1] (basis, then d) and the relative error of each
// line and channel, error[channels][lines] (complex, weighted).
pb_status pb_fit_residues(const pb_fit_data *data, const pb_fit_poles *poles, double *c,
                          double complex *error, pb_error *err);

#endif
