// Averaged periodograms: see psd.h.
#include "signal/psd.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "signal/fft.h"

struct pb_psd {
  double sample_rate, power;  // power: Σw²
  size_t length, segments;
  double *window, *sum;  // [length], [lines]
  double complex *work;  // [length]
  pb_fft fft;
};

pb_status pb_psd_new(double sample_rate, size_t length, pb_window window, pb_psd **out,
                     pb_error *err) {
  *out = NULL;
  if (!(isfinite(sample_rate) && sample_rate > 0) || length < 4 || length > PB_FFT_MAX_LENGTH) {
    return pb_fail(err, PB_ERR_ARGUMENT, "psd", "segments of %zu samples at %g Hz", length,
                   sample_rate);
  }
  pb_psd *p = calloc(1, sizeof *p);
  if (!p) return pb_fail_memory(err, "psd");
  p->sample_rate = sample_rate;
  p->length = length;
  p->window = malloc(length * sizeof *p->window);
  p->work = malloc(length * sizeof *p->work);
  p->sum = calloc(length / 2 + 1, sizeof *p->sum);
  pb_status status = p->window && p->work && p->sum ? pb_fft_init(length, &p->fft, err)
                                                    : pb_fail_memory(err, "psd");
  if (status != PB_OK) {
    pb_psd_free(p);
    return status;
  }
  pb_window_fill(window, length, p->window);
  for (size_t n = 0; n < length; n++) p->power += p->window[n] * p->window[n];
  *out = p;
  return PB_OK;
}

void pb_psd_free(pb_psd *p) {
  if (!p) return;
  pb_fft_clear(&p->fft);
  free(p->window);
  free(p->work);
  free(p->sum);
  free(p);
}

void pb_psd_add(pb_psd *p, const double *x, size_t stride) {
  for (size_t n = 0; n < p->length; n++) p->work[n] = p->window[n] * x[n * stride];
  pb_fft_forward(&p->fft, p->work, p->work);
  for (size_t k = 0; k <= p->length / 2; k++) {
    double re = creal(p->work[k]), im = cimag(p->work[k]);
    p->sum[k] += re * re + im * im;
  }
  p->segments++;
}

size_t pb_psd_segments(const pb_psd *p) {
  return p->segments;
}

size_t pb_psd_lines(const pb_psd *p) {
  return p->length / 2 + 1;
}

void pb_psd_density(const pb_psd *p, double *density) {
  double scale = p->segments > 0 ? 1 / (p->sample_rate * p->power * (double)p->segments) : NAN;
  for (size_t k = 0; k <= p->length / 2; k++) {
    bool single = k == 0 || 2 * k == p->length;
    density[k] = (single ? 1 : 2) * scale * p->sum[k];
  }
}

void pb_cumulative_amplitude(const double *density, size_t lines, double df, double f1, double f2,
                             double *amplitude) {
  double sum = 0;
  for (size_t k = lines; k-- > 0;) {
    double f = (double)k * df;
    if (f >= f1 * (1 - 1e-9) && f <= f2 * (1 + 1e-9)) sum += density[k] * df;
    amplitude[k] = sqrt(sum);
  }
}
