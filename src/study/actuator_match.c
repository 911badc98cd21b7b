// How good a 2-DoF model matches: see actuator_fit.h.
#include <math.h>
#include <stdlib.h>

#include "study/actuator_fit.h"

void pb_apa_match_clear(pb_apa_match *m) {
  free(m->band);
  *m = (pb_apa_match){0};
}

static void fill_band(const pb_frf *frf, const double complex *model, pb_apa_band *band) {
  double difference[PB_APA_OUTPUTS] = {0}, size[PB_APA_OUTPUTS] = {0};
  for (size_t f = 0; f < frf->nf; f++) {
    if (frf->frequency_hz[f] < band->low || frf->frequency_hz[f] >= band->high) continue;
    for (size_t k = 0; k < PB_APA_OUTPUTS; k++) {
      const size_t at = f * PB_APA_OUTPUTS + k;
      if (!isfinite(frf->variance[at])) continue;
      difference[k] += pow(cabs(model[at] - frf->h[at]), 2);
      size[k] += pow(cabs(frf->h[at]), 2);
    }
  }
  for (size_t k = 0; k < PB_APA_OUTPUTS; k++)
    band->error[k] = size[k] > 0 ? sqrt(difference[k] / size[k]) : NAN;
}

static void find_end(const pb_apa_match *m, double pole_hz, double tolerance, size_t k, double *end,
                     double *worst) {
  *end = INFINITY;
  *worst = 0;
  for (size_t b = 0; b < m->bands; b++) {
    const double error = m->band[b].error[k];
    if (isnan(error)) continue;
    if (m->band[b].low > pole_hz && error > tolerance) {
      *end = m->band[b].low;
      return;
    }
    *worst = fmax(*worst, error);
  }
}

pb_status pb_apa_match_find(const pb_apa_data *d, const pb_apa_2dof *apa, double pole_hz,
                            double tolerance, pb_apa_match *out, pb_error *err) {
  const pb_frf *frf = &d->frf;
  const double third = cbrt(2), first = frf->frequency_hz[0], last = frf->frequency_hz[frf->nf - 1];
  *out = (pb_apa_match){0};
  const size_t bands = (size_t)floor(log(last / first) / log(third)) + 1;
  double complex *model = malloc(frf->nf * PB_APA_OUTPUTS * sizeof *model);
  out->band = calloc(bands, sizeof *out->band);
  pb_status st = model && out->band ? PB_OK : pb_fail_memory(err, "match");
  if (!st) st = pb_apa_2dof_response(apa, d->sample_rate, frf->frequency_hz, frf->nf, model, err);
  for (; !st && out->bands < bands; out->bands++) {
    pb_apa_band *band = &out->band[out->bands];
    band->low = first * pow(third, (double)out->bands);
    band->high = band->low * third;
    fill_band(frf, model, band);
  }
  for (size_t k = 0; k < PB_APA_OUTPUTS && !st; k++)
    find_end(out, pole_hz, tolerance, k, &out->end[k], &out->worst[k]);
  free(model);
  if (st) pb_apa_match_clear(out);
  return st;
}
