// Noise, chirp and multisine generators: see excitation.h.
#include "signal/excitation.h"

#include <complex.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "signal/fft.h"
#include "signal/random.h"

static pb_status check_band(double sample_rate, double f1, double f2, double rms, pb_error *err) {
  if (!(isfinite(sample_rate) && sample_rate > 0)) {
    return pb_fail(err, PB_ERR_ARGUMENT, "excitation", "sample rate %g Hz is not positive",
                   sample_rate);
  }
  if (!(isfinite(f1) && isfinite(f2) && f1 >= 0 && f1 < f2 && f2 <= sample_rate / 2)) {
    return pb_fail(err, PB_ERR_ARGUMENT, "excitation",
                   "band %g … %g Hz is not within 0 … %g Hz (half the sample rate)", f1, f2,
                   sample_rate / 2);
  }
  if (!(isfinite(rms) && rms > 0)) {
    return pb_fail(err, PB_ERR_ARGUMENT, "excitation", "rms %g is not positive", rms);
  }
  return PB_OK;
}

bool pb_multisine_lines(double sample_rate, double f1, double f2, size_t n, size_t *first,
                        size_t *last) {
  double df = sample_rate / (double)n, slack = 1e-9;
  double low = ceil(f1 / df - slack), high = floor(f2 / df + slack);
  if (low < 1) low = 1;
  double nyquist = (double)((n - 1) / 2);
  if (high > nyquist) high = nyquist;
  if (!(low <= high)) return false;
  *first = (size_t)low;
  *last = (size_t)high;
  return true;
}

double pb_crest_factor(const double *u, size_t n, size_t nu, size_t i) {
  double peak = 0, power = 0;
  for (size_t k = 0; k < n; k++) {
    peak = fmax(peak, fabs(u[k * nu + i]));
    power += u[k * nu + i] * u[k * nu + i];
  }
  return peak / sqrt(power / (double)n);
}

// Scales column i of u[n][nu] to the exact rms.
static void scale_to_rms(double *u, size_t n, size_t nu, size_t i, double rms) {
  double power = 0;
  for (size_t k = 0; k < n; k++) power += u[k * nu + i] * u[k * nu + i];
  double gain = power > 0 ? rms / sqrt(power / (double)n) : 0;
  for (size_t k = 0; k < n; k++) u[k * nu + i] *= gain;
}

// Real signal of period fft->n with the spectrum given on lines first..last, into column i of u.
// work is [fft->n]; count samples are written.
static void synthesise(pb_fft *fft, const double complex *line, size_t first, size_t last,
                       double complex *work, size_t count, size_t nu, size_t i, double *u) {
  size_t n = fft->n;
  for (size_t k = 0; k < n; k++) work[k] = 0;
  for (size_t k = first; k <= last; k++) {
    work[k] = line[k - first];
    work[n - k] = conj(line[k - first]);
  }
  pb_fft_inverse(fft, work, work);
  for (size_t k = 0; k < count; k++) u[k * nu + i] = creal(work[k]);
}

// The next length from n on that the transform does without a convolution.
static size_t quick_length(size_t n) {
  static const size_t prime[] = {2, 3, 5, 7};
  for (;; n++) {
    size_t rest = n;
    for (size_t k = 0; k < sizeof prime / sizeof *prime; k++) {
      while (rest % prime[k] == 0) rest /= prime[k];
    }
    if (rest == 1) return n;
  }
}

pb_status pb_excite_noise(const pb_noise_spec *spec, size_t n, size_t nu, double *u,
                          pb_error *err) {
  pb_status status = check_band(spec->sample_rate, spec->f1, spec->f2, spec->rms, err);
  if (status != PB_OK) return status;
  if (n == 0 || nu == 0 || n > PB_FFT_MAX_LENGTH / 2) {
    return pb_fail(err, PB_ERR_ARGUMENT, "excitation", "%zu samples of %zu inputs", n, nu);
  }
  // Twice the samples asked for: the half that is kept does not meet its own start again.
  size_t period = spec->periodic ? n : quick_length(2 * n), first, last;
  if (!pb_multisine_lines(spec->sample_rate, spec->f1, spec->f2, period, &first, &last)) {
    return pb_fail(err, PB_ERR_ARGUMENT, "excitation",
                   "%zu samples are too few for a line in %g … %g Hz", n, spec->f1, spec->f2);
  }
  pb_fft fft = {0};
  double complex *line = malloc((last - first + 1) * sizeof *line);
  double complex *work = malloc(period * sizeof *work);
  status = line && work ? pb_fft_init(period, &fft, err) : pb_fail_memory(err, "excitation");
  if (status != PB_OK) goto done;
  for (size_t i = 0; i < nu; i++) {
    pb_random random;
    pb_random_seed(&random, spec->seed, i);
    for (size_t k = first; k <= last; k++) {
      double re = pb_random_gaussian(&random), im = pb_random_gaussian(&random);
      line[k - first] = CMPLX(re, im);
    }
    synthesise(&fft, line, first, last, work, n, nu, i, u);
    scale_to_rms(u, n, nu, i, spec->rms);
  }
done:
  pb_fft_clear(&fft);
  free(line);
  free(work);
  return status;
}

pb_status pb_excite_chirp(double sample_rate, double f1, double f2, double amplitude, size_t n,
                          double *u, pb_error *err) {
  double low = fmin(f1, f2), high = fmax(f1, f2);
  pb_status status = check_band(sample_rate, low, high, amplitude, err);
  if (status != PB_OK) return status;
  if (!(low > 0) || n == 0) {
    return pb_fail(err, PB_ERR_ARGUMENT, "excitation", "a chirp needs f1, f2 > 0 and samples");
  }
  double duration = (double)n / sample_rate, L = duration / log(f2 / f1);
  for (size_t k = 0; k < n; k++) {
    double t = (double)k / sample_rate;
    u[k] = amplitude * sin(2 * M_PI * f1 * L * expm1(t / L));
  }
  return PB_OK;
}

static void draw_phases(const pb_multisine_spec *spec, size_t i, size_t lines,
                        double complex *line) {
  pb_random random;
  pb_random_seed(&random, spec->seed, i);
  double offset = 2 * M_PI * pb_random_uniform(&random);
  for (size_t k = 0; k < lines; k++) {
    double k1 = (double)k;
    double phase = spec->phases == PB_PHASES_RANDOM ? 2 * M_PI * pb_random_uniform(&random)
                                                    : offset - M_PI * k1 * (k1 + 1) / (double)lines;
    line[k] = CMPLX(cos(phase), sin(phase));
  }
}

// Clips the signal at a level that rises slowly towards its own peak and takes only the new phases.
static void lower_crest(pb_fft *fft, unsigned iterations, size_t first, size_t last,
                        double complex *line, double complex *work, double *column) {
  size_t n = fft->n;
  double best = INFINITY;
  double complex *kept = work + n;
  for (unsigned it = 0; it <= iterations; it++) {
    synthesise(fft, line, first, last, work, n, 1, 0, column);
    double crest = pb_crest_factor(column, n, 1, 0), peak = 0;
    if (crest < best) {
      best = crest;
      memcpy(kept, line, (last - first + 1) * sizeof *line);
    }
    for (size_t k = 0; k < n; k++) peak = fmax(peak, fabs(column[k]));
    double level = peak * (0.80 + 0.15 * it / (iterations + 1.0));
    for (size_t k = 0; k < n; k++) work[k] = fmax(-level, fmin(level, column[k]));
    pb_fft_forward(fft, work, work);
    for (size_t k = first; k <= last; k++) {
      double size = cabs(work[k]);
      if (size > 0) line[k - first] = work[k] / size;
    }
  }
  memcpy(line, kept, (last - first + 1) * sizeof *line);
}

// Spectra of the nu inputs, line[i][lines], then the periods of `experiments` experiments.
static void fill_experiments(const pb_multisine_spec *spec, pb_fft *fft, size_t first, size_t last,
                             size_t experiments, size_t nu, double complex *line,
                             double complex *work, double *column, double *u) {
  size_t n = fft->n, lines = last - first + 1;
  for (size_t i = 0; i < nu; i++) {
    draw_phases(spec, i, lines, line);
    if (spec->crest_iterations > 0) {
      lower_crest(fft, spec->crest_iterations, first, last, line, work, column);
    }
    for (size_t e = 0; e < experiments; e++) {
      double angle = 2 * M_PI * (double)(e * i % nu) / (double)nu;
      double complex turn = CMPLX(cos(angle), sin(angle));
      for (size_t k = 0; k < lines; k++) work[n + k] = line[k] * turn;
      synthesise(fft, work + n, first, last, work, n, nu, i, u + e * n * nu);
      scale_to_rms(u + e * n * nu, n, nu, i, spec->rms);
    }
  }
}

static pb_status excite(const pb_multisine_spec *spec, size_t n, size_t nu, size_t experiments,
                        double *u, pb_error *err) {
  pb_status status = check_band(spec->sample_rate, spec->f1, spec->f2, spec->rms, err);
  if (status != PB_OK) return status;
  size_t first, last;
  if (n == 0 || nu == 0 || n > PB_FFT_MAX_LENGTH ||
      !pb_multisine_lines(spec->sample_rate, spec->f1, spec->f2, n, &first, &last)) {
    return pb_fail(err, PB_ERR_ARGUMENT, "excitation",
                   "a period of %zu samples has no line in %g … %g Hz", n, spec->f1, spec->f2);
  }
  pb_fft fft = {0};
  double complex *line = malloc((last - first + 1) * sizeof *line);
  double complex *work = malloc(2 * n * sizeof *work);
  double *column = malloc(n * sizeof *column);
  bool have = line && work && column;
  status = have ? pb_fft_init(n, &fft, err) : pb_fail_memory(err, "excitation");
  if (status == PB_OK) {
    fill_experiments(spec, &fft, first, last, experiments, nu, line, work, column, u);
  }
  pb_fft_clear(&fft);
  free(line);
  free(work);
  free(column);
  return status;
}

pb_status pb_excite_multisine(const pb_multisine_spec *spec, size_t n, size_t nu, double *u,
                              pb_error *err) {
  return excite(spec, n, nu, 1, u, err);
}

pb_status pb_excite_orthogonal(const pb_multisine_spec *spec, size_t n, size_t nu, double *u,
                               pb_error *err) {
  return excite(spec, n, nu, nu, u, err);
}
