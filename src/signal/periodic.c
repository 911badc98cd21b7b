// Averaged periods of periodic experiments: see periodic.h.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "signal/excitation.h"
#include "signal/periodic_internal.h"
#include "signal/small_solve.h"

static bool allocate(pb_periodic *p) {
  size_t n = p->options.period, experiments = p->options.experiments;
  p->count = calloc(experiments, sizeof *p->count);
  p->record = malloc(p->signals * n * sizeof *p->record);
  p->work = malloc(n * sizeof *p->work);
  p->line = malloc(p->signals * p->lines * sizeof *p->line);
  p->mean = calloc(experiments * p->signals * p->lines, sizeof *p->mean);
  p->scatter = calloc(experiments * p->ny * p->lines, sizeof *p->scatter);
  p->first_period = calloc(experiments * p->ny * p->lines, sizeof *p->first_period);
  p->last_period = calloc(experiments * p->ny * p->lines, sizeof *p->last_period);
  p->broken = calloc(experiments, sizeof *p->broken);
  if (!p->first_period || !p->last_period || !p->broken) return false;
  return p->count && p->record && p->work && p->line && p->mean && p->scatter;
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
  free(p->record);
  free(p->work);
  free(p->line);
  free(p->mean);
  free(p->scatter);
  free(p->first_period);
  free(p->last_period);
  free(p->broken);
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
    for (size_t l = 0; l < p->lines; l++) {
      double complex z = p->work[p->first + l], m = conj(p->work[n - p->first - l]), d = z - m;
      p->line[s * p->lines + l] = scale * (z + m);
      if (pair) p->line[(s + 1) * p->lines + l] = scale * CMPLX(cimag(d), -creal(d));
    }
  }
}

// B. Welford's running mean and scatter (1962): no cancellation however small the scatter is.
static void average_period(pb_periodic *p) {
  size_t e = p->current, lines = p->lines;
  double complex *mean = p->mean + e * p->signals * lines;
  double count = (double)++p->count[e];
  for (size_t s = 0; s < p->signals; s++) {
    for (size_t l = 0; l < lines; l++) {
      size_t k = s * lines + l;
      double complex before = p->line[k] - mean[k];
      mean[k] += before / count;
      if (s < p->nu) continue;
      double complex after = p->line[k] - mean[k];
      size_t at = (e * p->ny + s - p->nu) * lines + l;
      p->scatter[at] += creal(before * conj(after));
      p->last_period[at] = p->line[k];
      if (p->count[e] == 1) p->first_period[at] = p->line[k];
    }
  }
}

bool pb_periodic_push(pb_periodic *p, size_t experiment, const double *u, const double *y) {
  size_t n = p->options.period;
  if (experiment >= p->options.experiments || p->settled) return false;
  if (experiment != p->current || p->gap) {
    p->current = experiment;
    p->fill = 0;
    p->gap = false;
    if (p->count[experiment] > 0) p->broken[experiment] = true;  // later than right after the last
  }
  for (size_t i = 0; i < p->nu; i++) p->record[i * n + p->fill] = u[i];
  for (size_t o = 0; o < p->ny; o++) p->record[(p->nu + o) * n + p->fill] = y[o];
  if (++p->fill < n) return false;
  p->fill = 0;
  transform_period(p);
  average_period(p);
  return true;
}

// W = Ū⁻¹ of line l into b [e × nu] (column i at b + i e); a is [nu × nu]. With more experiments
// than inputs W = Ūᴴ (Ū Ūᴴ)⁻¹. Inputs are scaled to unit power, for any units.
static bool invert_inputs(const pb_periodic *p, size_t l, double complex *a, double complex *b,
                          double *scale) {
  size_t nu = p->nu, ne = p->options.experiments, stride = p->signals * p->lines;
  const double complex *mean = p->mean + l;
  for (size_t i = 0; i < nu; i++) {
    double power = 0;
    for (size_t e = 0; e < ne; e++) {
      double size = cabs(mean[e * stride + i * p->lines]);
      power += size * size;
    }
    if (!(power > 0)) return false;
    scale[i] = 1 / sqrt(power);
  }
  // Rows of the small system are inputs: (Ū Ūᴴ) Z = Ū, W = Zᴴ, with orthogonal inputs Ū Ūᴴ = I.
  for (size_t i = 0; i < nu; i++) {
    for (size_t j = 0; j < nu; j++) {
      double complex sum = 0;
      for (size_t e = 0; e < ne; e++) {
        sum += mean[e * stride + i * p->lines] * conj(mean[e * stride + j * p->lines]);
      }
      a[i + j * nu] = sum * scale[i] * scale[j];
    }
    for (size_t e = 0; e < ne; e++) b[i + e * nu] = mean[e * stride + i * p->lines] * scale[i];
  }
  return pb_small_solve(nu, ne, a, b);
}

// Coherence of output o at line l, and its σ² of the mean of each experiment into sigma2[e].
static double scatter_of(const pb_periodic *p, size_t o, size_t l, double *sigma2) {
  double power = 0, noise = 0;
  for (size_t e = 0; e < p->options.experiments; e++) {
    double count = (double)p->count[e];
    double size = cabs(p->mean[(e * p->signals + p->nu + o) * p->lines + l]);
    double one = p->scatter[(e * p->ny + o) * p->lines + l] / (count - 1);
    sigma2[e] = one / count;
    power += size * size;
    noise += one;
  }
  return power > 0 ? power / (power + noise) : 0;
}

static void estimate_line(const pb_periodic *p, size_t l, double complex *a, double complex *b,
                          double *scale, double *sigma2, pb_frf *frf) {
  size_t nu = p->nu, ne = p->options.experiments;
  bool excited = invert_inputs(p, l, a, b, scale);
  for (size_t o = 0; o < p->ny; o++) {
    double coherence = scatter_of(p, o, l, sigma2);
    frf->coherence[l * p->ny + o] = excited ? coherence : 0;
    for (size_t i = 0; i < nu; i++) {
      double complex h = 0;
      double variance = 0;
      for (size_t e = 0; excited && e < ne; e++) {
        double complex w = conj(b[i + e * nu]) * scale[i];
        h += p->mean[(e * p->signals + nu + o) * p->lines + l] * w;
        variance += creal(w * conj(w)) * sigma2[e];
      }
      frf->h[(l * p->ny + o) * nu + i] = h;
      frf->variance[(l * p->ny + o) * nu + i] = excited ? variance : INFINITY;
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
