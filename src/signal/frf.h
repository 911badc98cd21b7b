// A measured frequency response with its uncertainty: what every estimator returns.
#ifndef PB_SIGNAL_FRF_H
#define PB_SIGNAL_FRF_H

#include <complex.h>
#include <stddef.h>

#include "base/status.h"

// Arrays are row-major as written: h[(f*ny + o)*nu + i]. Zero-initialise; free with pb_frf_clear.
typedef struct pb_frf {
  size_t nf, ny, nu;
  double *frequency_hz;  // [nf] ascending
  double complex *h;     // [nf][ny][nu] output unit per input unit
  double *coherence;     // [nf][ny] multiple coherence, 0 … 1
  double *variance;      // [nf][ny][nu] E|Ĥ − H|²; infinite where a line was not excited
  double averages;       // effective number of independent averages
} pb_frf;

// Allocates zeroed arrays of these sizes. [init] PB_ERR_ARGUMENT for a size of 0, PB_ERR_MEMORY.
pb_status pb_frf_new(size_t nf, size_t ny, size_t nu, pb_frf *out, pb_error *err);

void pb_frf_clear(pb_frf *frf);

#endif
