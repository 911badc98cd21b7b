// Averaged periods of periodic experiments: see periodic.h.
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "signal/excitation.h"
#include "signal/periodic_internal.h"
#include "signal/small_solve.h"

static bool allocate(pb_periodic *p) {
  size_t n = p->options.period, ne = p->options.experiments, ns = p->signals, lines = p->lines;
  p->count = calloc(ne, sizeof *p->count);
  p->runs = calloc(3 * ne, sizeof *p->runs);
  p->uneven = calloc(ne, sizeof *p->uneven);
  p->record = malloc(ns * n * sizeof *p->record);
  p->work = malloc(n * sizeof *p->work);
  p->line = malloc(ns * p->all * sizeof *p->line);
  p->previous = malloc(ns * p->all * sizeof *p->previous);
  p->mean = calloc(ne * ns * lines, sizeof *p->mean);
  p->peak = calloc(ne * ns, sizeof *p->peak);
  p->scatter = calloc(ne * p->ny * lines, sizeof *p->scatter);
  p->cross = calloc(ne * p->ny * p->nu * lines, sizeof *p->cross);
  p->input = calloc(ne * p->nu * p->nu * lines, sizeof *p->input);
  p->before = malloc(2 * ns * sizeof *p->before);
  p->difference = calloc(ne * ns * p->all, sizeof *p->difference);
  if (!p->count || !p->runs || !p->uneven || !p->record || !p->work || !p->line || !p->previous)
    return false;
  p->run = p->runs + ne;
  p->length = p->run + ne;
  if (!p->before) return false;
  p->after = p->before + ns;
  return p->mean && p->peak && p->scatter && p->cross && p->input && p->difference;
}

pb_status pb_periodic_new(const pb_periodic_options *o, size_t nu, size_t ny, pb_periodic **out,
                          pb_error *err) {
  *out = NULL;
  if (!(isfinite(o->sample_rate) && o->sample_rate > 0)) {
    return pb_fail(err, PB_ERR_ARGUMENT, "periodic", "sample rate %g Hz is not positive",
                   o->sample_rate);
  }
  if (nu == 0 || ny == 0 || o->experiments < nu) {
    return pb_fail(err, PB_ERR_ARGUMENT, "periodic",
                   "%zu experiments for %zu inputs and %zu outputs", o->experiments, nu, ny);
  }
  size_t first, last;
  if (o->period < 4 || o->period > PB_FFT_MAX_LENGTH || !(o->f1 >= 0 && o->f2 > o->f1) ||
      !pb_multisine_lines(o->sample_rate, o->f1, o->f2, o->period, &first, &last)) {
    return pb_fail(err, PB_ERR_ARGUMENT, "periodic",
                   "a period of %zu samples has no line in %g … %g Hz", o->period, o->f1, o->f2);
  }
  pb_periodic *p = calloc(1, sizeof *p);
  if (!p) return pb_fail_memory(err, "periodic");
  p->options = *o;
  p->nu = nu;
  p->ny = ny;
  p->signals = nu + ny;
  p->first = first;
  p->lines = last - first + 1;
  p->all = p->lines + 1;
  p->gap = true;
  pb_status status =
      allocate(p) ? pb_fft_init(o->period, &p->fft, err) : pb_fail_memory(err, "periodic");
  if (status != PB_OK) {
    pb_periodic_free(p);
    return status;
  }
  *out = p;
  return PB_OK;
}

void pb_periodic_free(pb_periodic *p) {
  if (!p) return;
  pb_fft_clear(&p->fft);
  free(p->count);
  free(p->runs);
  free(p->uneven);
  free(p->record);
  free(p->work);
  free(p->line);
  free(p->previous);
  free(p->mean);
  free(p->peak);
  free(p->scatter);
  free(p->cross);
  free(p->input);
  free(p->before);
  free(p->difference);
  free(p->shift);
  free(p->remainder);
  free(p->excess);
  free(p->moved);
  free(p);
}

size_t pb_periodic_count(const pb_periodic *p, size_t experiment) {
  return experiment < p->options.experiments ? p->count[experiment] : 0;
}

void pb_periodic_break(pb_periodic *p) {
  p->fill = 0;
  p->gap = true;
}

// Lines of all signals, scaled to amplitudes; two real signals share one transform.
static void transform_period(pb_periodic *p) {
  size_t n = p->options.period;
  double scale = 1 / (double)n;
  for (size_t s = 0; s < p->signals; s += 2) {
    bool pair = s + 1 < p->signals;
    const double *a = p->record + s * n, *b = a + n;
    for (size_t k = 0; k < n; k++) p->work[k] = CMPLX(a[k], pair ? b[k] : 0);
    pb_fft_forward(&p->fft, p->work, p->work);
    for (size_t l = 0; l < p->all; l++) {
      size_t at = l < p->lines ? p->first + l : 0;
      double complex z = p->work[at], m = conj(p->work[at ? n - at : 0]), d = z - m;
      p->line[s * p->all + l] = scale * (z + m);
      if (pair) p->line[(s + 1) * p->all + l] = scale * CMPLX(cimag(d), -creal(d));
    }
  }
}

// Sums over runs the change from one period to the next, which is that from the first to the last.
static void follow_run(pb_periodic *p) {
  size_t e = p->current, size = p->signals * p->all;
  bool begins = p->gap;
  p->gap = false;
  if (begins) {
    p->runs[e]++;
    if (p->run[e] > 0) {
      p->uneven[e] = p->uneven[e] || (p->length[e] > 0 && p->length[e] != p->run[e]);
      p->length[e] = p->run[e];
    }
    p->run[e] = 0;
  }
  p->run[e]++;
  double complex *sum = p->difference + e * size;
  for (size_t k = 0; k < size && !begins; k++) sum[k] += p->line[k] - p->previous[k];
  double complex *swap = p->previous;
  p->previous = p->line;
  p->line = swap;
}

static double complex times_conj(double complex a, double complex b) {
  return pb_product(a, conj(b));
}

// B. Welford's running mean and scatter (1962): no cancellation however small the scatter is.
static void average_line(pb_periodic *p, size_t e, size_t l, double count) {
  size_t nu = p->nu, ny = p->ny, lines = p->lines;
  for (size_t s = 0; s < p->signals; s++) {
    double complex *mean = &p->mean[pb_periodic_series(p, e, s) * lines + l];
    double complex value = p->line[s * p->all + l];
    p->before[s] = value - *mean;
    *mean += p->before[s] / count;
    p->after[s] = value - *mean;
  }
  for (size_t o = 0; o < ny; o++) {
    double complex dy = p->before[nu + o];
    p->scatter[(e * ny + o) * lines + l] += creal(times_conj(dy, p->after[nu + o]));
    for (size_t i = 0; i < nu; i++)
      p->cross[((e * ny + o) * nu + i) * lines + l] += times_conj(dy, p->after[i]);
  }
  for (size_t i = 0; i < nu; i++) {
    for (size_t j = 0; j < nu; j++)
      p->input[((e * nu + i) * nu + j) * lines + l] += times_conj(p->before[i], p->after[j]);
  }
}

static void average_period(pb_periodic *p) {
  size_t e = p->current, n = p->options.period;
  double count = (double)++p->count[e];
  for (size_t l = 0; l < p->lines; l++) average_line(p, e, l, count);
  for (size_t s = 0; s < p->signals; s++) {
    double *peak = &p->peak[pb_periodic_series(p, e, s)];
    for (size_t k = 0; k < n; k++) *peak = fmax(*peak, fabs(p->record[s * n + k]));
  }
  p->settled = false;
}

bool pb_periodic_push(pb_periodic *p, size_t experiment, const double *u, const double *y) {
  size_t n = p->options.period;
  if (experiment >= p->options.experiments) return false;
  if (experiment != p->current) {
    p->current = experiment;
    pb_periodic_break(p);
  }
  for (size_t i = 0; i < p->nu; i++) p->record[i * n + p->fill] = u[i];
  for (size_t o = 0; o < p->ny; o++) p->record[(p->nu + o) * n + p->fill] = y[o];
  if (++p->fill < n) return false;
  p->fill = 0;
  transform_period(p);
  average_period(p);
  follow_run(p);
  return true;
}

double pb_periodic_rounding(const pb_periodic *p, size_t series) {
  // Of the samples (2^-53 of the largest), of the transform, and of the plant's own state.
  return 8 * DBL_EPSILON * p->peak[series];
}

// The mean of a signal at a line, without what pb_periodic_settle found in it.
static double complex mean_of(const pb_periodic *p, size_t e, size_t signal, size_t l) {
  size_t k = pb_periodic_series(p, e, signal) * p->lines + l;
  return p->settled ? p->mean[k] - p->shift[k] : p->mean[k];
}

// W = Ū⁻¹ of line l into b [e × nu] (column i at b + i e); a is [nu × nu]. With more experiments
// than inputs W = Ūᴴ (Ū Ūᴴ)⁻¹. Inputs are scaled to unit power, for any units.
static bool invert_inputs(const pb_periodic *p, size_t l, double complex *a, double complex *b,
                          double *scale) {
  size_t nu = p->nu, ne = p->options.experiments;
  for (size_t i = 0; i < nu; i++) {
    double power = 0;
    for (size_t e = 0; e < ne; e++) power += pow(cabs(mean_of(p, e, i, l)), 2);
    if (!(power > 0)) return false;
    scale[i] = 1 / sqrt(power);
  }
  // Rows of the small system are inputs: (Ū Ūᴴ) Z = Ū, W = Zᴴ, with orthogonal inputs Ū Ūᴴ = I.
  for (size_t i = 0; i < nu; i++) {
    for (size_t j = 0; j < nu; j++) {
      double complex sum = 0;
      for (size_t e = 0; e < ne; e++) sum += mean_of(p, e, i, l) * conj(mean_of(p, e, j, l));
      a[i + j * nu] = sum * scale[i] * scale[j];
    }
    for (size_t e = 0; e < ne; e++) b[i + e * nu] = mean_of(p, e, i, l) * scale[i];
  }
  return pb_small_solve(nu, ne, a, b);
}

// Σ_p |δY − Σ_i h_i δU_i|² over the periods of experiment e, δ the deviations from the means.
static double residual_scatter(const pb_periodic *p, size_t e, size_t o, size_t l,
                               const double complex *h) {
  size_t nu = p->nu;
  double sum = p->scatter[(e * p->ny + o) * p->lines + l];
  for (size_t i = 0; i < nu; i++) {
    sum -= 2 * creal(conj(h[i]) * p->cross[((e * p->ny + o) * nu + i) * p->lines + l]);
    for (size_t j = 0; j < nu; j++)
      sum += creal(h[i] * conj(h[j]) * p->input[((e * nu + i) * nu + j) * p->lines + l]);
  }
  return fmax(sum, 0);
}

// The same of one period. Where free motion was taken out that makes up more than a tenth of the
// scatter it is that of what is left of the difference of two periods; but those between must bear
// the motion out: by the triangle inequality they leave at least (√S − √M)² of their scatter S, M
// that of the motion. *excess: what the taking out adds to the variance of the mean.
static double residual_variance(const pb_periodic *p, size_t e, size_t o, size_t l,
                                const double complex *h, double *excess) {
  double all = residual_scatter(p, e, o, l, h), freedom = (double)p->count[e] - 1;
  *excess = 0;
  if (!p->settled) return all / freedom;
  size_t at = pb_periodic_series(p, e, p->nu + o) * p->lines + l;
  double complex left = p->remainder[at];
  double moved = sqrt(p->moved[at]);
  *excess = p->excess[at];
  for (size_t i = 0; i < p->nu; i++) {
    size_t k = pb_periodic_series(p, e, i) * p->lines + l;
    left -= h[i] * p->remainder[k];
    *excess += creal(h[i] * conj(h[i])) * p->excess[k];
    moved += cabs(h[i]) * sqrt(p->moved[k]);
  }
  double between = pow(sqrt(all) - moved, 2) / freedom;
  if (p->count[e] > 2 && moved * moved < 0.1 * all) return all / freedom;
  double ends = creal(left * conj(left)) / (2 * p->freedom * (double)p->runs[e]);
  if (p->count[e] > 2) *excess += fmax(0, between - ends);
  return ends;
}

// Coherence of output o at line l, and its σ² of the mean of each experiment into sigma2[e]. What
// noise adds to the power of the mean by itself is taken off: noise alone has no coherence.
static double scatter_of(const pb_periodic *p, size_t o, size_t l, const double complex *h,
                         double *sigma2) {
  double power = 0, noise = 0;
  for (size_t e = 0; e < p->options.experiments; e++) {
    double count = (double)p->count[e], excess, size = cabs(mean_of(p, e, p->nu + o, l));
    double one = residual_variance(p, e, o, l, h, &excess);
    sigma2[e] = one / count + excess;
    power += size * size - sigma2[e];
    noise += one + count * excess;
  }
  return power > 0 ? power / (power + noise) : 0;
}

static void estimate_line(const pb_periodic *p, size_t l, double complex *a, double complex *b,
                          double *scale, double *sigma2, pb_frf *frf) {
  size_t nu = p->nu, ne = p->options.experiments;
  bool excited = invert_inputs(p, l, a, b, scale);
  for (size_t o = 0; o < p->ny; o++) {
    double complex *h = frf->h + (l * p->ny + o) * nu;
    double *variance = frf->variance + (l * p->ny + o) * nu;
    for (size_t i = 0; excited && i < nu; i++) {
      for (size_t e = 0; e < ne; e++)
        h[i] += mean_of(p, e, nu + o, l) * conj(b[i + e * nu]) * scale[i];
    }
    double coherence = scatter_of(p, o, l, h, sigma2);
    frf->coherence[l * p->ny + o] = excited ? coherence : 0;
    for (size_t i = 0; i < nu; i++) {
      if (!excited) variance[i] = INFINITY;
      for (size_t e = 0; excited && e < ne; e++)
        variance[i] += pow(cabs(b[i + e * nu]) * scale[i], 2) * sigma2[e];
    }
  }
}

static pb_status check_record(const pb_periodic *p, pb_error *err) {
  size_t ne = p->options.experiments;
  for (size_t e = 0; e < ne; e++) {
    if (p->count[e] < 2) {
      return pb_fail(err, PB_ERR_STATE, "periodic",
                     "experiment %zu has %zu periods, two are needed", e + 1, p->count[e]);
    }
  }
  for (size_t k = 0; k < ne * p->signals * p->lines; k++) {
    if (!isfinite(creal(p->mean[k])) || !isfinite(cimag(p->mean[k]))) {
      return pb_fail(err, PB_ERR_NUMERIC, "periodic", "the record is not finite");
    }
  }
  return PB_OK;
}

pb_status pb_periodic_estimate(const pb_periodic *p, pb_frf *out, pb_error *err) {
  *out = (pb_frf){0};
  pb_status status = check_record(p, err);
  if (status != PB_OK) return status;
  size_t nu = p->nu, ne = p->options.experiments;
  pb_frf frf = {0};
  double complex *a = malloc(nu * nu * sizeof *a), *b = malloc(nu * ne * sizeof *b);
  double *scale = malloc(nu * sizeof *scale), *sigma2 = malloc(ne * sizeof *sigma2);
  status = a && b && scale && sigma2 ? pb_frf_new(p->lines, p->ny, nu, &frf, err)
                                     : pb_fail_memory(err, "periodic");
  if (status != PB_OK) goto done;
  size_t fewest = p->count[0];
  for (size_t e = 1; e < ne; e++) fewest = p->count[e] < fewest ? p->count[e] : fewest;
  frf.averages = (double)fewest;
  for (size_t l = 0; l < p->lines; l++) {
    frf.frequency_hz[l] =
        (double)(p->first + l) * p->options.sample_rate / (double)p->options.period;
    estimate_line(p, l, a, b, scale, sigma2, &frf);
  }
  *out = frf;
done:
  free(a);
  free(b);
  free(scale);
  free(sigma2);
  return status;
}
