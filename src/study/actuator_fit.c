// The 2-DoF model by its landmarks: see actuator_fit.h.
#include "study/actuator_fit.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "control/fit.h"
#include "model/zeros.h"
#include "study/element_bench.h"

static const double two_pi = 6.283185307179586476925286766559;
static const double most_damping = 0.5;  // of a landmark: what is damped more does not ring

void pb_apa_data_clear(pb_apa_data *d) {
  pb_frf_clear(&d->frf);
  *d = (pb_apa_data){0};
}

static const char *const output_names[PB_APA_OUTPUTS] = {"y", "Vs"};

static pb_status find_signals(const pb_model *m, size_t *input, size_t output[PB_APA_OUTPUTS],
                              pb_error *err) {
  const int va = pb_model_input(m, "Va");
  if (va < 0) return pb_fail(err, PB_ERR_REFERENCE, "Va", "the actuator takes no voltage (g_a)");
  *input = (size_t)va;
  for (int k = 0; k < PB_APA_OUTPUTS; k++) {
    const int o = pb_model_output(m, output_names[k]);
    if (o < 0)
      return pb_fail(err, PB_ERR_REFERENCE, output_names[k], "the actuator has no such output");
    output[k] = (size_t)o;
  }
  return PB_OK;
}

pb_status pb_apa_data_of_model(const pb_model *m, const double *hz, size_t nf, pb_apa_data *out,
                               pb_error *err) {
  size_t input = 0, output[PB_APA_OUTPUTS] = {0};
  double complex *h = NULL;
  *out = (pb_apa_data){0};
  pb_status st = find_signals(m, &input, output, err);
  if (!st) st = pb_frf_new(nf, PB_APA_OUTPUTS, 1, &out->frf, err);
  if (!st && !(h = malloc(nf * m->ny * m->nu * sizeof *h))) st = pb_fail_memory(err, "frf");
  if (!st) st = pb_model_frf(m, PB_CONTINUOUS, hz, nf, h, err);
  for (size_t f = 0; f < nf && !st; f++) {
    out->frf.frequency_hz[f] = hz[f];
    for (size_t k = 0; k < PB_APA_OUTPUTS; k++) {
      out->frf.h[f * PB_APA_OUTPUTS + k] = h[(f * m->ny + output[k]) * m->nu + input];
      out->frf.coherence[f * PB_APA_OUTPUTS + k] = 1;
    }
  }
  free(h);
  if (st) pb_apa_data_clear(out);
  return st;
}

// ---- landmarks ----------------------------------------------------------------------------------

static pb_status first_zero(const pb_model *m, size_t input, size_t output, pb_apa_landmarks *out,
                            pb_error *err) {
  double complex *zero = NULL;
  size_t count = 0;
  const double limit = 0.5 * m->sample_rate;
  pb_status st = pb_model_zeros(m, &input, &output, 1, limit, &zero, &count, err);
  double best = INFINITY;
  for (size_t i = 0; i < count && !st; i++) {
    const double size = cabs(zero[i]), damping = -creal(zero[i]) / size;
    if (!(cimag(zero[i]) > 0) || !(fabs(damping) < most_damping) || size >= best) continue;
    best = size;
    out->zero_hz = size / two_pi;
    out->zero_damping = damping;
  }
  free(zero);
  if (!st && !isfinite(best))
    st = pb_fail(err, PB_ERR_NUMERIC, "Va to Vs", "has no zero that rings below %g Hz", limit);
  return st;
}

pb_status pb_apa_landmarks_of_model(const pb_model *m, pb_apa_landmarks *out, pb_error *err) {
  size_t input = 0, output[PB_APA_OUTPUTS] = {0};
  const pb_bench_model bench = {.model = (pb_model *)m};
  *out = (pb_apa_landmarks){0};
  pb_status st = find_signals(m, &input, output, err);
  if (!st) st = first_zero(m, input, output[PB_APA_VS], out, err);
  if (!st) st = pb_bench_gain(&bench, "Va", "y", &out->gain_y, err);
  if (!st) st = pb_bench_gain(&bench, "Va", "Vs", &out->gain_vs, err);
  if (st) return st;
  pb_bench_first_mode(&bench, "Va", "y", 0.2, &out->pole_hz, &out->pole_damping);
  if (isfinite(out->pole_hz)) return PB_OK;
  return pb_fail(err, PB_ERR_NUMERIC, "Va to y", "has no pole that rings");
}

static bool rings(const pb_pole *p, const pb_frf *frf) {
  return p->damping > -0.05 && p->damping < most_damping && p->hz >= frf->frequency_hz[0] &&
         p->hz <= frf->frequency_hz[frf->nf - 1];
}

// The lowest pole that is not a small one, and the lowest zero.
static pb_status landmarks_of_fit(const pb_fit *fit, const pb_frf *frf, pb_apa_landmarks *out,
                                  pb_error *err) {
  pb_pole_list zeros = {0};
  double strongest = 0;
  out->pole_hz = out->zero_hz = INFINITY;
  for (size_t i = 0; i < fit->poles; i++)
    if (rings(&fit->pole[i], frf)) strongest = fmax(strongest, fit->strength[i]);
  for (size_t i = 0; i < fit->poles; i++)
    if (rings(&fit->pole[i], frf) && fit->strength[i] > 0.05 * strongest &&
        fit->pole[i].hz < out->pole_hz) {
      out->pole_hz = fit->pole[i].hz;
      out->pole_damping = fit->pole[i].damping;
    }
  pb_status st = pb_fit_zeros(fit, PB_APA_VS, &zeros, err);
  for (size_t i = 0; i < zeros.count && !st; i++)
    if (rings(&zeros.item[i], frf) && zeros.item[i].hz < out->zero_hz) {
      out->zero_hz = zeros.item[i].hz;
      out->zero_damping = zeros.item[i].damping;
    }
  pb_pole_list_clear(&zeros);
  if (!st && !isfinite(out->pole_hz))
    st = pb_fail(err, PB_ERR_NUMERIC, "Va to y", "no pole rings within the data");
  if (!st && !isfinite(out->zero_hz))
    st = pb_fail(err, PB_ERR_NUMERIC, "Va to Vs", "no zero rings within the data");
  out->gain_y = creal(pb_fit_evaluate(fit, PB_APA_Y, 0));
  out->gain_vs = creal(pb_fit_evaluate(fit, PB_APA_VS, 0));
  return st;
}

pb_status pb_apa_landmarks_of_data(const pb_apa_data *d, pb_apa_landmarks *out, pb_error *err) {
  static const pb_fit_channel channel[PB_APA_OUTPUTS] = {{PB_APA_Y, 0}, {PB_APA_VS, 0}};
  pb_fit fit = {0};
  bool noisy = false;
  *out = (pb_apa_landmarks){0};
  if (!(d->sample_rate > 0))
    return pb_fail(err, PB_ERR_ARGUMENT, "sample rate", "a measured response needs one");
  for (size_t k = 0; k < d->frf.nf * PB_APA_OUTPUTS; k++) noisy = noisy || d->frf.variance[k] > 0;
  const pb_fit_options options = {.sample_rate = d->sample_rate,
                                  .weight = noisy ? PB_FIT_NOISE : PB_FIT_RELATIVE};
  pb_status st = pb_fit_frf(&d->frf, channel, PB_APA_OUTPUTS, &options, &fit, err);
  if (!st) st = landmarks_of_fit(&fit, &d->frf, out, err);
  pb_fit_clear(&fit);
  return st;
}

// ---- the three steps ----------------------------------------------------------------------------

// Steps 1 and 2; dampings as they come, below zero too.
static pb_apa_2dof tune(const pb_apa_landmarks *l, double moving, double inner, double ratio) {
  pb_apa_2dof p = {.moving = moving, .inner = inner};
  const double zero = two_pi * l->zero_hz, pole = two_pi * l->pole_hz;
  const double series = ratio / (1 + ratio);
  p.k_1 = moving * zero * zero;
  p.c_1 = 2 * l->zero_damping * zero * moving;
  p.k_a = (moving * pole * pole - p.k_1) / series;
  p.c_a = (2 * l->pole_damping * pole * moving - p.c_1) / series;
  p.k_e = ratio * p.k_a;
  p.c_e = ratio * p.c_a;
  p.g_a = p.g_s = 1;
  return p;
}

// Step 3: y/V_a = g_a k_e/(k_1 k_a + k_1 k_e + k_a k_e), V_s/V_a = −g_s (k_1/k_e) y/V_a.
static void set_gains(const pb_apa_landmarks *l, pb_apa_2dof *p) {
  p->g_a = l->gain_y * (p->k_1 * p->k_a + p->k_1 * p->k_e + p->k_a * p->k_e) / p->k_e;
  p->g_s = -l->gain_vs / l->gain_y * p->k_e / p->k_1;
}

static double complex root_of(double hz, double damping) {
  return two_pi * hz * (-damping + I * sqrt(fmax(0, 1 - damping * damping)));
}

// The zero that the landmarks' model has when it is sampled, less the wanted one.
static pb_status miss_of(const pb_apa_landmarks *l, double sample_rate, double moving, double inner,
                         double ratio, double complex wanted, double complex *miss, pb_error *err) {
  const pb_apa_2dof p = tune(l, moving, inner, ratio);
  pb_status st = pb_apa_2dof_sampled_zero(&p, sample_rate, wanted, miss, err);
  *miss -= wanted;
  return st;
}

// Newton's method in frequency and damping of the continuous zero. How much the inner mass is
// damped moves the sampled zero more than anything else, so that iterating on the difference
// diverges.
static pb_status unsample(pb_apa_landmarks *l, double sample_rate, double moving, double inner,
                          double ratio, pb_error *err) {
  const double complex wanted = root_of(l->zero_hz, l->zero_damping);
  const double step_hz = 1e-4 * l->zero_hz, step_damping = 1e-5;
  l->zero_damping = l->pole_damping * l->pole_hz / l->zero_hz;  // an inner mass that rings freely
  for (int k = 0; k < 30; k++) {
    double complex miss, by_hz, by_damping;
    pb_apa_landmarks a = *l, b = *l;
    a.zero_hz += step_hz;
    b.zero_damping += step_damping;
    pb_status st = miss_of(l, sample_rate, moving, inner, ratio, wanted, &miss, err);
    if (!st) st = miss_of(&a, sample_rate, moving, inner, ratio, wanted, &by_hz, err);
    if (!st) st = miss_of(&b, sample_rate, moving, inner, ratio, wanted, &by_damping, err);
    if (st) return st;
    if (cabs(miss) < 1e-9 * cabs(wanted)) return PB_OK;
    by_hz = (by_hz - miss) / step_hz;
    by_damping = (by_damping - miss) / step_damping;
    const double det = creal(by_hz) * cimag(by_damping) - cimag(by_hz) * creal(by_damping);
    l->zero_hz -= (creal(miss) * cimag(by_damping) - cimag(miss) * creal(by_damping)) / det;
    l->zero_damping -= (creal(by_hz) * cimag(miss) - cimag(by_hz) * creal(miss)) / det;
    if (!(fabs(l->zero_damping) < most_damping)) break;
  }
  return pb_fail(err, PB_ERR_NUMERIC, "landmarks", "the continuous zero is not found");
}

static pb_status check_landmarks(const pb_apa_landmarks *l, pb_error *err) {
  if (!(l->pole_hz > l->zero_hz))
    return pb_fail(err, PB_ERR_NUMERIC, "landmarks",
                   "the first pole (%.4g Hz) does not lie above the first zero (%.4g Hz)",
                   l->pole_hz, l->zero_hz);
  if (l->gain_y * l->gain_vs < 0) return PB_OK;
  return pb_fail(err, PB_ERR_NUMERIC, "landmarks",
                 "y/V_a (%.4g m/V) and V_s/V_a (%.4g) at 0 Hz do not have opposite signs: a "
                 "positive voltage extends, and positive sensor voltage is tension",
                 l->gain_y, l->gain_vs);
}

pb_status pb_apa_from_landmarks(const pb_apa_landmarks *landmarks, double sample_rate,
                                double moving, double inner, double ratio, pb_apa_2dof *out,
                                pb_error *err) {
  pb_apa_landmarks l = *landmarks;
  pb_status st = check_landmarks(&l, err);
  if (st) return st;
  if (sample_rate > 0 && unsample(&l, sample_rate, moving, inner, ratio, NULL)) l = *landmarks;
  *out = tune(&l, moving, inner, ratio);
  out->c_1 = fmax(0, out->c_1);
  out->c_a = fmax(0, out->c_a);
  out->c_e = ratio * out->c_a;
  set_gains(&l, out);
  return PB_OK;
}
