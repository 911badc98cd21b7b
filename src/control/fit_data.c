// The lines and channels that a rational fit uses, and their weights: see fit.h.
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "control/fit_internal.h"

void pb_fit_data_clear(pb_fit_data *d) {
  free(d->x);
  free(d->h);
  free(d->weight);
  *d = (pb_fit_data){0};
}

static pb_status check(const pb_frf *frf, const pb_fit_channel *channel, size_t channels,
                       const pb_fit_options *o, pb_error *err) {
  if (!(isfinite(o->sample_rate) && o->sample_rate > 0) || !(o->f1 >= 0 && o->f2 >= o->f1) ||
      !(o->tolerance >= 0) || !(o->floor >= 0) || channels == 0 || o->poles > 400 ||
      o->max_poles > 400) {
    return pb_fail(err, PB_ERR_ARGUMENT, "fit", "sample rate %g Hz, band %g … %g Hz, %zu channels",
                   o->sample_rate, o->f1, o->f2, channels);
  }
  for (size_t c = 0; c < channels; c++) {
    if (channel[c].output >= frf->ny || channel[c].input >= frf->nu) {
      return pb_fail(err, PB_ERR_ARGUMENT, "fit", "no channel (%zu, %zu)", channel[c].output,
                     channel[c].input);
    }
  }
  return PB_OK;
}

// A line is used when it is in the band, below Nyquist, and every channel has it.
static bool usable(const pb_frf *frf, const pb_fit_channel *channel, size_t channels,
                   const pb_fit_options *o, size_t f) {
  double hz = frf->frequency_hz[f];
  bool in = o->f2 > 0 ? hz >= o->f1 && hz <= o->f2 : true;
  if (!in || !(hz > 0) || hz >= 0.499 * o->sample_rate) return false;
  for (size_t c = 0; c < channels; c++) {
    if (isinf(frf->variance[(f * frf->ny + channel[c].output) * frf->nu + channel[c].input]))
      return false;
  }
  return true;
}

static int by_value(const void *a, const void *b) {
  double p = *(const double *)a, q = *(const double *)b;
  return (p > q) - (p < q);
}

double pb_fit_median_size(const double complex *h, size_t n, double *work) {
  for (size_t k = 0; k < n; k++) work[k] = cabs(h[k]);
  qsort(work, n, sizeof *work, by_value);
  return work[n / 2];
}

// h[lines] and weight[lines] of one channel from the lines listed; false if not finite or all zero.
static bool fill_channel(const pb_frf *frf, pb_fit_channel channel, const pb_fit_options *o,
                         const size_t *line, size_t lines, double complex *h, double *weight) {
  for (size_t l = 0; l < lines; l++) {
    h[l] = frf->h[(line[l] * frf->ny + channel.output) * frf->nu + channel.input];
    if (!isfinite(creal(h[l])) || !isfinite(cimag(h[l]))) return false;
  }
  double median = pb_fit_median_size(h, lines, weight), floor = o->floor > 0 ? o->floor : 1e-4;
  if (!(median > 0)) return false;
  for (size_t l = 0; l < lines; l++) {
    double size = cabs(h[l]);
    double variance = frf->variance[(line[l] * frf->ny + channel.output) * frf->nu + channel.input];
    // A valley without damping would otherwise count more than everything else.
    double relative = size + 1e-3 * median;
    weight[l] = o->weight == PB_FIT_NOISE ? 1 / sqrt(variance + floor * floor * relative * relative)
                                          : 1 / relative;
  }
  return true;
}

static pb_status fill(const pb_frf *frf, const pb_fit_channel *channel, size_t channels,
                      const pb_fit_options *o, pb_fit_data *d, pb_error *err) {
  *d = (pb_fit_data){.channels = channels};
  size_t *line = malloc((frf->nf + 1) * sizeof *line);
  if (!line) return pb_fail_memory(err, "fit");
  for (size_t f = 0; f < frf->nf; f++) {
    if (usable(frf, channel, channels, o, f)) line[d->lines++] = f;
  }
  size_t n = d->lines;
  d->x = malloc((n + 1) * sizeof *d->x);
  d->h = malloc((channels * n + 1) * sizeof *d->h);
  d->weight = malloc((channels * n + 1) * sizeof *d->weight);
  pb_status status = d->x && d->h && d->weight ? PB_OK : pb_fail_memory(err, "fit");
  if (status == PB_OK && n < 8) {
    status = pb_fail(err, PB_ERR_ARGUMENT, "fit", "%zu lines in the band are too few", n);
  }
  for (size_t l = 0; l < n && status == PB_OK; l++) {
    d->x[l] = 2 * o->sample_rate * tan(M_PI * frf->frequency_hz[line[l]] / o->sample_rate);
  }
  for (size_t c = 0; c < channels && status == PB_OK; c++) {
    if (!fill_channel(frf, channel[c], o, line, n, d->h + c * n, d->weight + c * n)) {
      status = pb_fail(err, PB_ERR_NUMERIC, "fit", "channel (%zu, %zu) is zero or not finite",
                       channel[c].output, channel[c].input);
    }
  }
  free(line);
  if (status == PB_OK) {
    d->scale = sqrt(d->x[0] * d->x[n - 1]);
    for (size_t l = 0; l < n; l++) d->x[l] /= d->scale;
  }
  return status;
}

pb_status pb_fit_data_new(const pb_frf *frf, const pb_fit_channel *channel, size_t channels,
                          const pb_fit_options *o, pb_fit_data *out, pb_error *err) {
  *out = (pb_fit_data){0};
  pb_status status = check(frf, channel, channels, o, err);
  if (status == PB_OK) status = fill(frf, channel, channels, o, out, err);
  if (status != PB_OK) pb_fit_data_clear(out);
  return status;
}
