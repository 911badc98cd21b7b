// Sensitivity at the metrology as the bus shows it, S = H_HAC H⁻¹ with H from the disturbances to
// the metrology without HAC, beside (I + L)⁻¹. See run.h.
#include <math.h>
#include <stdlib.h>

#include "run.h"
#include "signal/small_solve.h"

// The metrology's rows of one frequency, transposed: column-major as pb_small_solve wants it.
static void rows_of(const control_design *d, const pb_frf *frf, size_t f, double complex *out) {
  size_t n = d->n;
  for (size_t k = 0; k < n * n; k++) {
    out[k] = frf->h[(f * frf->ny + d->metrology[k / n]) * frf->nu + k % n];
  }
}

// Sᵀ solves Hᵀ Sᵀ = H_HACᵀ.
static pb_status measured(const control_design *d, const pb_frf *without, const pb_frf *with,
                          size_t f, double complex *work, double *out, pb_error *err) {
  size_t n = d->n;
  double complex *a = work, *b = work + n * n;
  // Row-major rows are the transpose in columns.
  rows_of(d, without, f, a);
  rows_of(d, with, f, b);
  *out = NAN;
  return pb_small_solve(n, n, a, b) ? pb_largest_gain(n, b, out, err) : PB_OK;
}

static pb_status predicted(const control_design *d, double hz, double complex *work, double *out,
                           pb_error *err) {
  size_t n = d->n;
  double complex *plant = work, *l = work + n * n, *scratch = work + 2 * n * n;
  const pb_lti *iff = d->damped ? &d->iff.controller_used : NULL;
  pb_status status = pb_hac_plant(d->model, &d->channels, &d->frame.transform, iff, d->iff_delay,
                                  &hz, 1, plant, err);
  if (status == PB_OK) {
    status = pb_hac_loop_gain(&d->shape_lti, d->gain, d->hac_delay, &hz, 1, n, plant, l, err);
  }
  if (status != PB_OK) return status;
  pb_hac_transform(n, d->frame.j, d->frame.inverse, l, plant);
  *out = INFINITY;
  return pb_sensitivity_of(n, plant, l, scratch) ? pb_largest_gain(n, l, out, err) : PB_OK;
}

static bool coherent(const control_design *d, const pb_frf *frf, size_t f) {
  for (size_t k = 0; k < d->n; k++) {
    if (!(frf->coherence[f * frf->ny + d->metrology[k]] > 0.99)) return false;
  }
  return true;
}

pb_status run_sensitivity(run_result *r, pb_error *err) {
  const control_design *d = r->design;
  const pb_frf *with = &r->stage[STAGE_HAC].response.frf;
  const pb_frf *without = &r->stage[d->damped ? STAGE_IFF : STAGE_UNDAMPED].response.frf;
  if (d->disturbances != d->n || without->nf != with->nf) return PB_OK;
  double complex *work = malloc(4 * d->n * d->n * sizeof *work);
  r->coherent = malloc(with->nf * sizeof *r->coherent);
  for (int k = 0; k < 2; k++) r->sensitivity[k] = malloc(with->nf * sizeof(double));
  pb_status status = work && r->coherent && r->sensitivity[0] && r->sensitivity[1]
                         ? PB_OK
                         : pb_fail_memory(err, "sensitivity");
  r->sensitivity_percent = 0;
  r->sensitivity_hz = NAN;
  for (size_t f = 0; f < with->nf && status == PB_OK; f++) {
    double *m = &r->sensitivity[0][f], *p = &r->sensitivity[1][f];
    status = measured(d, without, with, f, work, m, err);
    if (status == PB_OK) status = predicted(d, with->frequency_hz[f], work, p, err);
    r->coherent[f] = coherent(d, with, f) && coherent(d, without, f) && isfinite(*m);
    double percent = 100 * fabs(*m / *p - 1);
    if (status != PB_OK || !r->coherent[f] || !(percent > r->sensitivity_percent)) continue;
    r->sensitivity_percent = percent;
    r->sensitivity_hz = with->frequency_hz[f];
  }
  free(work);
  if (status == PB_OK) r->nf = with->nf;
  return status;
}
