// Welch's estimates: see spectrum.h.
#include "signal/spectrum.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "signal/excitation.h"
#include "signal/fft.h"
#include "signal/small_solve.h"

struct pb_welch {
  pb_welch_options options;
  size_t nu, ny, signals;  // signals = nu + ny, inputs first
  size_t hop;              // samples from one segment to the next
  size_t first, lines;     // lines kept
  size_t fill, segments;
  double *record;  // [signals][length] the segment under way
  double *window;  // [length]
  double *column;  // [length]
  pb_fft fft;
  double complex *work;      // [length]
  double complex *spectrum;  // [signals][lines] of one segment
  double complex *suu;       // [lines][nu × nu] column-major
  double complex *syu;       // [lines][ny × nu] column-major
  double *syy;               // [lines][ny]
};

static pb_status check_options(const pb_welch_options *o, size_t nu, size_t ny, pb_error *err) {
  if (!(isfinite(o->sample_rate) && o->sample_rate > 0)) {
    return pb_fail(err, PB_ERR_ARGUMENT, "welch", "sample rate %g Hz is not positive",
                   o->sample_rate);
  }
  if (o->length < 4 || o->length > PB_FFT_MAX_LENGTH || nu == 0 || ny == 0) {
    return pb_fail(err, PB_ERR_ARGUMENT, "welch",
                   "segments of %zu samples, %zu inputs, %zu outputs", o->length, nu, ny);
  }
  if (!(o->overlap >= 0 && o->overlap <= 0.95)) {
    return pb_fail(err, PB_ERR_ARGUMENT, "welch", "overlap %g is not within 0 … 0.95", o->overlap);
  }
  if (!(o->f1 >= 0 && o->f2 >= o->f1)) {
    return pb_fail(err, PB_ERR_ARGUMENT, "welch", "band %g … %g Hz", o->f1, o->f2);
  }
  return PB_OK;
}

static bool allocate(pb_welch *w) {
  size_t n = w->options.length, nu = w->nu, ny = w->ny;
  w->record = malloc(w->signals * n * sizeof *w->record);
  w->window = malloc(n * sizeof *w->window);
  w->column = malloc(n * sizeof *w->column);
  w->work = malloc(n * sizeof *w->work);
  w->spectrum = malloc(w->signals * w->lines * sizeof *w->spectrum);
  w->suu = calloc(w->lines * nu * nu, sizeof *w->suu);
  w->syu = calloc(w->lines * ny * nu, sizeof *w->syu);
  w->syy = calloc(w->lines * ny, sizeof *w->syy);
  return w->record && w->window && w->column && w->work && w->spectrum && w->suu && w->syu &&
         w->syy;
}

pb_status pb_welch_new(const pb_welch_options *options, size_t nu, size_t ny, pb_welch **out,
                       pb_error *err) {
  *out = NULL;
  pb_status status = check_options(options, nu, ny, err);
  if (status != PB_OK) return status;
  double f2 = options->f2 > 0 ? options->f2 : options->sample_rate / 2;
  size_t first, last;
  if (!pb_multisine_lines(options->sample_rate, options->f1, f2, options->length, &first, &last)) {
    return pb_fail(err, PB_ERR_ARGUMENT, "welch",
                   "segments of %zu samples have no line in %g … %g Hz", options->length,
                   options->f1, f2);
  }
  pb_welch *w = calloc(1, sizeof *w);
  if (!w) return pb_fail_memory(err, "welch");
  w->options = *options;
  w->nu = nu;
  w->ny = ny;
  w->signals = nu + ny;
  w->first = first;
  w->lines = last - first + 1;
  w->hop = (size_t)lround((double)options->length * (1 - options->overlap));
  if (w->hop == 0) w->hop = 1;
  status = allocate(w) ? pb_fft_init(options->length, &w->fft, err) : pb_fail_memory(err, "welch");
  if (status != PB_OK) {
    pb_welch_free(w);
    return status;
  }
  pb_window_fill(options->window, options->length, w->window);
  *out = w;
  return PB_OK;
}

void pb_welch_free(pb_welch *w) {
  if (!w) return;
  pb_fft_clear(&w->fft);
  free(w->record);
  free(w->window);
  free(w->column);
  free(w->work);
  free(w->spectrum);
  free(w->suu);
  free(w->syu);
  free(w->syy);
  free(w);
}

size_t pb_welch_segments(const pb_welch *w) {
  return w->segments;
}

void pb_welch_break(pb_welch *w) {
  w->fill = 0;
}

// Windowed column `signal` of the segment into w->column.
static void window_column(pb_welch *w, size_t signal) {
  size_t n = w->options.length;
  memcpy(w->column, w->record + signal * n, n * sizeof *w->column);
  pb_detrend_apply(w->options.detrend, w->column, n);
  for (size_t k = 0; k < n; k++) w->column[k] *= w->window[k];
}

// Two real signals share one complex transform: Z = A + iB, A = (Z(k) + Z(−k)*)/2.
static void transform_segment(pb_welch *w) {
  size_t n = w->options.length;
  for (size_t s = 0; s < w->signals; s += 2) {
    bool pair = s + 1 < w->signals;
    window_column(w, s);
    for (size_t k = 0; k < n; k++) w->work[k] = w->column[k];
    if (pair) {
      window_column(w, s + 1);
      for (size_t k = 0; k < n; k++) w->work[k] += CMPLX(0, w->column[k]);
    }
    pb_fft_forward(&w->fft, w->work, w->work);
    for (size_t l = 0; l < w->lines; l++) {
      double complex z = w->work[w->first + l], m = conj(w->work[n - w->first - l]);
      w->spectrum[s * w->lines + l] = 0.5 * (z + m);
      if (pair) {
        double complex d = 0.5 * (z - m);
        w->spectrum[(s + 1) * w->lines + l] = CMPLX(cimag(d), -creal(d));
      }
    }
  }
}

static inline double complex times_conj(double complex a, double complex b) {
  return CMPLX(creal(a) * creal(b) + cimag(a) * cimag(b),
               cimag(a) * creal(b) - creal(a) * cimag(b));
}

static void accumulate(pb_welch *w) {
  size_t nu = w->nu, ny = w->ny;
  for (size_t l = 0; l < w->lines; l++) {
    const double complex *u = w->spectrum + l, *y = w->spectrum + nu * w->lines + l;
    double complex *suu = w->suu + l * nu * nu, *syu = w->syu + l * ny * nu;
    for (size_t j = 0; j < nu; j++) {
      double complex uj = u[j * w->lines];
      for (size_t i = 0; i < nu; i++) suu[i + j * nu] += times_conj(u[i * w->lines], uj);
      for (size_t o = 0; o < ny; o++) syu[o + j * ny] += times_conj(y[o * w->lines], uj);
    }
    for (size_t o = 0; o < ny; o++) {
      w->syy[l * ny + o] += creal(times_conj(y[o * w->lines], y[o * w->lines]));
    }
  }
  w->segments++;
}

bool pb_welch_push(pb_welch *w, const double *u, const double *y) {
  size_t n = w->options.length;
  for (size_t i = 0; i < w->nu; i++) w->record[i * n + w->fill] = u[i];
  for (size_t o = 0; o < w->ny; o++) w->record[(w->nu + o) * n + w->fill] = y[o];
  if (++w->fill < n) return false;
  transform_segment(w);
  accumulate(w);
  for (size_t s = 0; s < w->signals; s++) {
    memmove(w->record + s * n, w->record + s * n + w->hop, (n - w->hop) * sizeof *w->record);
  }
  w->fill = n - w->hop;
  return true;
}

// Segments that overlap are correlated: n / (1 + 2 Σ_m (1 − m/n) ρ(m)²), ρ the window's own
// correlation at m hops (Welch 1967, eq. 14).
static double effective_averages(const pb_welch *w) {
  size_t n = w->options.length;
  double power = 0, sum = 0, count = (double)w->segments;
  for (size_t k = 0; k < n; k++) power += w->window[k] * w->window[k];
  for (size_t m = 1; m * w->hop < n && m < w->segments; m++) {
    double r = 0;
    for (size_t k = 0; k + m * w->hop < n; k++) r += w->window[k] * w->window[k + m * w->hop];
    sum += (1 - (double)m / count) * (r / power) * (r / power);
  }
  return count / (1 + 2 * sum);
}

typedef struct line_work {
  double complex *a;  // nu × nu
  double complex *b;  // nu × (ny + nu): conj(S_yu)ᵀ, then the identity
  double *scale;      // [nu]
} line_work;

// H1 and its variance at line l. S_uu is scaled to a unit diagonal, for inputs of any units.
static void estimate_line(const pb_welch *w, size_t l, double averages, const line_work *work,
                          pb_frf *frf) {
  size_t nu = w->nu, ny = w->ny;
  const double complex *suu = w->suu + l * nu * nu, *syu = w->syu + l * ny * nu;
  for (size_t i = 0; i < nu; i++) {
    double p = creal(suu[i + i * nu]);
    work->scale[i] = p > 0 ? 1 / sqrt(p) : 0;
  }
  // S_uu is Hermitian, so S_uu X = S_yuᴴ gives X = H1ᴴ.
  for (size_t j = 0; j < nu; j++) {
    for (size_t i = 0; i < nu; i++) {
      work->a[i + j * nu] = suu[i + j * nu] * work->scale[i] * work->scale[j];
      work->b[i + (ny + j) * nu] = i == j;
    }
    for (size_t o = 0; o < ny; o++) work->b[j + o * nu] = conj(syu[o + j * ny]) * work->scale[j];
  }
  bool excited = pb_small_solve(nu, ny + nu, work->a, work->b);
  for (size_t o = 0; o < ny; o++) {
    double explained = 0, syy = w->syy[l * ny + o];
    for (size_t i = 0; excited && i < nu; i++) {
      double complex h = conj(work->b[i + o * nu]) * work->scale[i];
      frf->h[(l * ny + o) * nu + i] = h;
      explained += creal(h * conj(syu[o + i * ny]));
    }
    double coherence = syy > 0 ? fmax(0, fmin(1, explained / syy)) : 0;
    frf->coherence[l * ny + o] = coherence;
    for (size_t i = 0; i < nu; i++) {
      double inverse = creal(work->b[i + (ny + i) * nu]) * work->scale[i] * work->scale[i];
      double freedom = averages - (double)nu;
      frf->variance[(l * ny + o) * nu + i] =
          excited && freedom > 0 ? syy * (1 - coherence) * inverse / freedom : INFINITY;
    }
  }
}

// H2 = S_yy / S_uy = H1 / γ² for one input.
static void turn_into_h2(pb_frf *frf) {
  for (size_t k = 0; k < frf->nf * frf->ny; k++) {
    double c = frf->coherence[k];
    frf->h[k] = c > 0 ? frf->h[k] / c : 0;
    frf->variance[k] = c > 0 ? frf->variance[k] / (c * c) : INFINITY;
  }
}

static bool is_finite(const pb_welch *w) {
  for (size_t k = 0; k < w->lines * w->ny; k++) {
    if (!isfinite(w->syy[k])) return false;
  }
  for (size_t k = 0; k < w->lines * w->nu * w->nu; k++) {
    if (!isfinite(creal(w->suu[k]))) return false;
  }
  return true;
}

pb_status pb_welch_estimate(const pb_welch *w, pb_estimator estimator, pb_frf *out, pb_error *err) {
  *out = (pb_frf){0};
  size_t nu = w->nu, ny = w->ny;
  if (estimator == PB_ESTIMATE_H2 && nu != 1) {
    return pb_fail(err, PB_ERR_ARGUMENT, "welch", "H2 is defined for one input, here are %zu", nu);
  }
  if (w->segments < nu + 1) {
    return pb_fail(err, PB_ERR_STATE, "welch", "%zu segments are too few for %zu inputs",
                   w->segments, nu);
  }
  if (!is_finite(w)) return pb_fail(err, PB_ERR_NUMERIC, "welch", "the record is not finite");
  pb_frf frf = {0};
  line_work work = {malloc(nu * nu * sizeof *work.a), malloc(nu * (ny + nu) * sizeof *work.b),
                    malloc(nu * sizeof *work.scale)};
  pb_status status = work.a && work.b && work.scale ? pb_frf_new(w->lines, ny, nu, &frf, err)
                                                    : pb_fail_memory(err, "welch");
  if (status != PB_OK) goto done;
  frf.averages = effective_averages(w);
  for (size_t l = 0; l < w->lines; l++) {
    frf.frequency_hz[l] =
        (double)(w->first + l) * w->options.sample_rate / (double)w->options.length;
    estimate_line(w, l, frf.averages, &work, &frf);
  }
  if (estimator == PB_ESTIMATE_H2) turn_into_h2(&frf);
  *out = frf;
done:
  free(work.a);
  free(work.b);
  free(work.scale);
  return status;
}

pb_status pb_welch_record(const pb_welch_options *options, const double *u, size_t nu,
                          const double *y, size_t ny, size_t n, pb_estimator estimator, pb_frf *out,
                          pb_error *err) {
  *out = (pb_frf){0};
  pb_welch *w = NULL;
  pb_status status = pb_welch_new(options, nu, ny, &w, err);
  if (status != PB_OK) return status;
  for (size_t k = 0; k < n; k++) pb_welch_push(w, u + k * nu, y + k * ny);
  status = pb_welch_estimate(w, estimator, out, err);
  pb_welch_free(w);
  return status;
}
