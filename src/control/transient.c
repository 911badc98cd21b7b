// Fitting and removing the decay of the start: see transient.h.
#include "control/transient.h"

#include <math.h>
#include <stdlib.h>

#include "control/fit.h"

enum { MOST_CHANNELS = 8 };

static double rms_of(const pb_frf *frf, size_t o, size_t i) {
  double sum = 0;
  for (size_t f = 0; f < frf->nf; f++) {
    double complex h = frf->h[(f * frf->ny + o) * frf->nu + i];
    sum += creal(h * conj(h));
  }
  return sqrt(sum / (double)frf->nf);
}

// Channels spread over outputs and experiments; those without any difference are left out.
static size_t choose(const pb_frf *d, pb_fit_channel *channel) {
  size_t count = 0, all = d->ny * d->nu;
  // A stride without a factor in common with the columns comes past all of them.
  size_t stride = all > MOST_CHANNELS ? all / MOST_CHANNELS + 1 : 1;
  while (d->nu > 1 && stride % d->nu != 1) stride++;
  for (size_t k = 0; k < all && count < MOST_CHANNELS; k += stride) {
    pb_fit_channel at = {k / d->nu, k % d->nu};
    if (rms_of(d, at.output, at.input) > 0) channel[count++] = at;
  }
  return count;
}

pb_status pb_transient_remove(pb_periodic *periodic, double sample_rate, double *explained,
                              pb_error *err) {
  pb_frf difference;
  pb_fit fit = {0};
  double part = 0;
  if (explained) *explained = 0;
  pb_status status = pb_periodic_difference(periodic, &difference, err);
  if (status != PB_OK) return status;
  pb_fit_channel channel[MOST_CHANNELS];
  size_t channels = choose(&difference, channel);
  pb_fit_options options = {.sample_rate = sample_rate, .max_poles = 40, .tolerance = 1e-6};
  double complex *pole = NULL;
  if (channels > 0) status = pb_fit_frf(&difference, channel, channels, &options, &fit, err);
  // A difference that no poles fit is not a decay.
  if (status == PB_ERR_NUMERIC || status == PB_ERR_ARGUMENT) status = PB_OK;
  if (status == PB_OK) {
    pole = malloc((fit.poles + 1) * sizeof *pole);
    if (!pole) status = pb_fail_memory(err, "transient");
    for (size_t k = 0; pole && k < fit.poles; k++) pole[k] = fit.pole[k].z;
    if (pole) status = pb_periodic_settle(periodic, pole, fit.poles, &part, err);
  }
  if (explained) *explained = part;
  free(pole);
  pb_fit_clear(&fit);
  pb_frf_clear(&difference);
  return status;
}
