// Removing the decay of the start from averaged periods: see periodic.h.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"
#include "signal/periodic_internal.h"

static pb_status check(const pb_periodic *p, pb_error *err) {
  for (size_t e = 0; e < p->options.experiments; e++) {
    if (p->count[e] < 2 || p->broken[e]) {
      return pb_fail(err, PB_ERR_STATE, "periodic", "experiment %zu has no two periods in a row",
                     e + 1);
    }
  }
  return PB_OK;
}

pb_status pb_periodic_difference(const pb_periodic *p, pb_frf *out, pb_error *err) {
  *out = (pb_frf){0};
  pb_status status = check(p, err);
  size_t ne = p->options.experiments;
  if (status == PB_OK) status = pb_frf_new(p->lines, p->ny, ne, out, err);
  if (status != PB_OK) return status;
  for (size_t l = 0; l < p->lines; l++) {
    out->frequency_hz[l] =
        (double)(p->first + l) * p->options.sample_rate / (double)p->options.period;
    for (size_t o = 0; o < p->ny; o++) {
      for (size_t e = 0; e < ne; e++) {
        size_t k = (e * p->ny + o) * p->lines + l;
        out->h[(l * p->ny + o) * ne + e] = p->last_period[k] - p->first_period[k];
      }
    }
  }
  return PB_OK;
}

// Real unknowns of the decays: two a pair (real and imaginary part of c), one a real pole, and two
// for a background that is constant over the band.
static size_t unknowns(const double complex *pole, size_t poles) {
  size_t n = 2;
  for (size_t k = 0; k < poles; k++) n += cimag(pole[k]) != 0 ? 2 : 1;
  return n;
}

// Lines of one decay λᵗ over a period, g(f), times a factor that depends on the pole only.
static double complex decay_line(const pb_periodic *p, size_t l, double complex lambda,
                                 double complex factor) {
  double angle = -2 * M_PI * (double)(p->first + l) / (double)p->options.period;
  return factor * 2 / (double)p->options.period / (1 - lambda * CMPLX(cos(angle), sin(angle)));
}

// Which factor of 1/(1 − λ e^{−iω}): of D = T_{P−1} − T_0, or of the mean of all T_p.
typedef enum part { PART_DIFFERENCE, PART_MEAN } part;

static double complex factor_of(const pb_periodic *p, double complex lambda, part which) {
  double n = (double)p->options.period, count = (double)p->count[0];
  double complex turn = clog(lambda) * n;
  if (which == PART_MEAN) return (1 - cexp(turn * count)) / count;
  return (cexp(turn * (count - 1)) - 1) * (1 - cexp(turn));
}

// Rows: real parts of the lines, then imaginary parts. m is 2 lines × n column-major.
static void fill_basis(const pb_periodic *p, const double complex *pole, size_t poles, part which,
                       double *m) {
  size_t rows = 2 * p->lines, column = 0;
  for (size_t k = 0; k < poles; k++) {
    bool pair = cimag(pole[k]) != 0;
    double complex a = factor_of(p, pole[k], which), b = factor_of(p, conj(pole[k]), which);
    for (size_t l = 0; l < p->lines; l++) {
      double complex g = decay_line(p, l, pole[k], a);
      double complex c = pair ? decay_line(p, l, conj(pole[k]), b) : 0;
      double complex even = g + c, odd = CMPLX(-cimag(g - c), creal(g - c));
      m[l + column * rows] = creal(even);
      m[p->lines + l + column * rows] = cimag(even);
      if (!pair) continue;
      m[l + (column + 1) * rows] = creal(odd);
      m[p->lines + l + (column + 1) * rows] = cimag(odd);
    }
    column += pair ? 2 : 1;
  }
  // The background belongs to decays long gone: it has no part in the mean.
  for (size_t l = 0; l < p->lines; l++) {
    double one = which == PART_DIFFERENCE;
    m[l + column * rows] = one;
    m[p->lines + l + column * rows] = 0;
    m[l + (column + 1) * rows] = 0;
    m[p->lines + l + (column + 1) * rows] = one;
  }
}

// D of one output and experiment into d[2 lines].
static void fill_difference(const pb_periodic *p, size_t series, double *d) {
  for (size_t l = 0; l < p->lines; l++) {
    double complex v =
        p->last_period[series * p->lines + l] - p->first_period[series * p->lines + l];
    d[l] = creal(v);
    d[p->lines + l] = cimag(v);
  }
}

// Least squares with columns of unit norm: c[n × series] into the top of d (2 lines × series).
static pb_status solve(double *m, size_t rows, size_t n, double *d, size_t series, double *norm,
                       pb_error *err) {
  for (size_t c = 0; c < n; c++) {
    double sum = 0;
    for (size_t r = 0; r < rows; r++) sum += m[r + c * rows] * m[r + c * rows];
    norm[c] = sum > 0 ? sqrt(sum) : 1;
    for (size_t r = 0; r < rows; r++) m[r + c * rows] /= norm[c];
  }
  int ir = (int)rows, in = (int)n, is = (int)series, rank, info, query = -1, integers;
  double rcond = 1e-12, size;
  dgelsd_(&ir, &in, &is, m, &ir, d, &ir, norm, &rcond, &rank, &size, &query, &integers, &info);
  int lwork = (int)size;
  double *work = malloc((size_t)lwork * sizeof *work), *singular = malloc(n * sizeof *singular);
  int *iwork = malloc((size_t)integers * sizeof *iwork);
  pb_status status = PB_OK;
  if (!work || !iwork || !singular) {
    status = pb_fail_memory(err, "periodic");
  } else {
    dgelsd_(&ir, &in, &is, m, &ir, d, &ir, singular, &rcond, &rank, work, &lwork, iwork, &info);
    if (info != 0) status = pb_fail(err, PB_ERR_NUMERIC, "periodic", "dgelsd: %d", info);
  }
  for (size_t s = 0; s < series && status == PB_OK; s++) {
    for (size_t c = 0; c < n; c++) d[c + s * rows] /= norm[c];
  }
  free(work);
  free(iwork);
  free(singular);
  return status;
}

static double complex series_line(const pb_periodic *p, const double *m, const double *c, size_t n,
                                  size_t l) {
  double re = 0, im = 0;
  for (size_t k = 0; k < n; k++) {
    re += m[l + k * 2 * p->lines] * c[k];
    im += m[p->lines + l + k * 2 * p->lines] * c[k];
  }
  return CMPLX(re, im);
}

// Power of D and of what the decays leave of it, over all outputs; each output counts alike.
static double explained_part(const pb_periodic *p, const double *m, const double *c, size_t n) {
  double part_left = 0;
  size_t series = p->options.experiments * p->ny, counted = 0;
  for (size_t s = 0; s < series; s++) {
    double power = 0, left = 0;
    for (size_t l = 0; l < p->lines; l++) {
      double complex d = p->last_period[s * p->lines + l] - p->first_period[s * p->lines + l];
      double complex r = d - series_line(p, m, c + s * 2 * p->lines, n, l);
      power += creal(d * conj(d));
      left += creal(r * conj(r));
    }
    if (power > 0) part_left += left / power, counted++;
  }
  return counted ? 1 - part_left / (double)counted : 0;
}

// Takes the decays out of the means, and sets the scatter to that of the remainder of D.
static void correct(pb_periodic *p, const double *difference, const double *mean, const double *c,
                    size_t n) {
  for (size_t e = 0; e < p->options.experiments; e++) {
    double count = (double)p->count[e];
    for (size_t o = 0; o < p->ny; o++) {
      size_t s = e * p->ny + o;
      for (size_t l = 0; l < p->lines; l++) {
        double complex d = p->last_period[s * p->lines + l] - p->first_period[s * p->lines + l];
        double complex r = d - series_line(p, difference, c + s * 2 * p->lines, n, l);
        p->mean[(e * p->signals + p->nu + o) * p->lines + l] -=
            series_line(p, mean, c + s * 2 * p->lines, n, l);
        p->scatter[s * p->lines + l] = (count - 1) * creal(r * conj(r)) / 2;
      }
    }
  }
  p->settled = true;
}

static bool equally_long(const pb_periodic *p) {
  for (size_t e = 1; e < p->options.experiments; e++)
    if (p->count[e] != p->count[0]) return false;
  return true;
}

pb_status pb_periodic_settle(pb_periodic *p, const double complex *pole, size_t poles,
                             double *explained, pb_error *err) {
  *explained = 0;
  pb_status status = check(p, err);
  if (status != PB_OK || poles == 0 || !equally_long(p)) return status;
  size_t n = unknowns(pole, poles), rows = 2 * p->lines, series = p->options.experiments * p->ny;
  if (n >= rows) return PB_OK;
  double *difference = malloc(rows * n * sizeof *difference),
         *mean = malloc(rows * n * sizeof *mean);
  double *c = malloc(rows * series * sizeof *c), *norm = malloc(n * sizeof *norm);
  status = difference && mean && c && norm ? PB_OK : pb_fail_memory(err, "periodic");
  if (status == PB_OK) {
    for (size_t s = 0; s < series; s++) fill_difference(p, s, c + s * rows);
    fill_basis(p, pole, poles, PART_DIFFERENCE, difference);
    status = solve(difference, rows, n, c, series, norm, err);
  }
  if (status == PB_OK) {
    fill_basis(p, pole, poles, PART_DIFFERENCE, difference);  // LAPACK has overwritten it
    fill_basis(p, pole, poles, PART_MEAN, mean);
    *explained = explained_part(p, difference, c, n);
    if (*explained > 0.5) correct(p, difference, mean, c, n);
  }
  free(difference);
  free(mean);
  free(c);
  free(norm);
  return status;
}
