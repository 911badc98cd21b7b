// Removing decays and trends from averaged periods: see periodic.h.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"
#include "signal/periodic_internal.h"

enum { MOST_DEGREE = 5 };

static pb_status check(const pb_periodic *p, pb_error *err) {
  for (size_t e = 0; e < p->options.experiments; e++) {
    if (p->run[e] < 2 || p->uneven[e] || (p->length[e] > 0 && p->length[e] != p->run[e])) {
      return pb_fail(err, PB_ERR_STATE, "periodic", "experiment %zu has no two periods in a row",
                     e + 1);
    }
  }
  return PB_OK;
}

// D of a series at a line (or the level, the last), mean over its runs.
static double complex difference_of(const pb_periodic *p, size_t series, size_t l) {
  return p->difference[series * p->all + l] / (double)p->runs[series / p->signals];
}

static double largest_difference(const pb_periodic *p, size_t series) {
  double largest = 0;
  for (size_t l = 0; l < p->lines; l++) largest = fmax(largest, cabs(difference_of(p, series, l)));
  return largest;
}

pb_status pb_periodic_difference(const pb_periodic *p, pb_frf *out, pb_error *err) {
  *out = (pb_frf){0};
  pb_status status = check(p, err);
  size_t ne = p->options.experiments;
  if (status == PB_OK) status = pb_frf_new(p->lines, p->ny, ne, out, err);
  if (status != PB_OK) return status;
  for (size_t l = 0; l < p->lines; l++)
    out->frequency_hz[l] =
        (double)(p->first + l) * p->options.sample_rate / (double)p->options.period;
  for (size_t k = 0; k < ne * p->ny; k++) {
    size_t e = k / p->ny, o = k % p->ny, series = pb_periodic_series(p, e, p->nu + o);
    if (largest_difference(p, series) < pb_periodic_rounding(p, series)) continue;
    for (size_t l = 0; l < p->lines; l++)
      out->h[(l * p->ny + o) * ne + e] = difference_of(p, series, l);
  }
  return PB_OK;
}

// ---- columns ------------------------------------------------------------------------------------

// The free motion fitted: decays and trends. Rows of its columns: real parts of the lines and of
// the level, then imaginary parts.
typedef struct basis {
  pb_periodic *p;
  const double complex *pole;  // [poles]
  size_t poles, degree;
  size_t rows, columns;
} basis;

// Which part of the free motion: D = T_{P−1} − T_0, the mean of all T_p, or T_p itself.
typedef enum part { PART_DIFFERENCE, PART_MEAN, PART_PERIOD } part;

// Real unknowns: two a pair (real and imaginary part of c), one a real pole, two for a background
// that is constant over the band, one a degree.
static size_t unknowns(const double complex *pole, size_t poles, size_t degree) {
  size_t n = 2 + degree;
  for (size_t k = 0; k < poles; k++) n += cimag(pole[k]) != 0 ? 2 : 1;
  return n;
}

static size_t periods_of(const pb_periodic *p) {
  return p->run[0];
}

// Lines of one decay λᵗ over a period, g(f), times a factor that depends on the pole only.
static double complex decay_line(const pb_periodic *p, size_t l, double complex lambda,
                                 double complex factor) {
  double at = l < p->lines ? (double)(p->first + l) : 0;
  double angle = -2 * M_PI * at / (double)p->options.period;
  return factor * 2 / (double)p->options.period / (1 - lambda * CMPLX(cos(angle), sin(angle)));
}

// The factor of 1/(1 − λ e^{−iω}).
static double complex factor_of(const pb_periodic *p, double complex lambda, part which, size_t k) {
  double n = (double)p->options.period, count = (double)periods_of(p);
  double complex turn = clog(lambda) * n;
  if (which == PART_MEAN) return (1 - cexp(turn * count)) / count;
  if (which == PART_PERIOD) return cexp(turn * (double)k) * (1 - cexp(turn));
  return (cexp(turn * (count - 1)) - 1) * (1 - cexp(turn));
}

static void put(double *column, size_t rows, size_t l, double complex value) {
  column[l] = creal(value);
  column[rows / 2 + l] = cimag(value);
}

static size_t put_pole(const basis *b, double complex pole, part which, size_t period, double *m) {
  const pb_periodic *p = b->p;
  bool pair = cimag(pole) != 0;
  double complex up = factor_of(p, pole, which, period);
  double complex down = factor_of(p, conj(pole), which, period);
  for (size_t l = 0; l < p->all; l++) {
    double complex g = decay_line(p, l, pole, up);
    double complex c = pair ? decay_line(p, l, conj(pole), down) : 0;
    put(m, b->rows, l, g + c);
    if (pair) put(m + b->rows, b->rows, l, CMPLX(-cimag(g - c), creal(g - c)));
  }
  return pair ? 2 : 1;
}

// ((t − P N / 2) / (P N / 2))^q.
static double power_at(const pb_periodic *p, size_t period, size_t k, size_t q) {
  double half = (double)(periods_of(p) * p->options.period) / 2;
  double at = (double)(period * p->options.period + k) / half - 1;
  return pow(at, (double)q);
}

// The trend of degree q over a period of the given part.
static double trend_at(const pb_periodic *p, size_t q, part which, size_t period, size_t k) {
  size_t last = periods_of(p) - 1;
  double sum = 0;
  if (which == PART_PERIOD) return power_at(p, period, k, q);
  if (which == PART_DIFFERENCE) return power_at(p, last, k, q) - power_at(p, 0, k, q);
  for (size_t n = 0; n <= last; n++) sum += power_at(p, n, k, q);
  return sum / (double)(last + 1);
}

static void put_trend(const basis *b, size_t q, part which, size_t period, double complex *work,
                      double *column) {
  pb_periodic *p = b->p;
  size_t n = p->options.period;
  for (size_t k = 0; k < n; k++) work[k] = trend_at(p, q, which, period, k);
  pb_fft_forward(&p->fft, work, work);
  for (size_t l = 0; l < p->all; l++) {
    // Of a ramp the difference is constant, and has no line but by rounding.
    bool none = which == PART_DIFFERENCE && q == 1 && l < p->lines;
    put(column, b->rows, l, none ? 0 : 2 / (double)n * work[l < p->lines ? p->first + l : 0]);
  }
}

// All columns into m [rows × columns].
static void fill(const basis *b, part which, size_t period, double complex *work, double *m) {
  size_t column = 0;
  for (size_t k = 0; k < b->poles; k++)
    column += put_pole(b, b->pole[k], which, period, m + column * b->rows);
  // The background belongs to decays long gone: it has no part in the mean.
  for (size_t l = 0; l < b->p->all; l++) {
    double one = which == PART_DIFFERENCE && l < b->p->lines;
    put(m + column * b->rows, b->rows, l, one);
    put(m + (column + 1) * b->rows, b->rows, l, CMPLX(0, one));
  }
  column += 2;
  for (size_t q = 1; q <= b->degree; q++)
    put_trend(b, q, which, period, work, m + column++ * b->rows);
}

// ---- least squares ------------------------------------------------------------------------------

typedef struct solution {
  basis b;
  double *difference, *mean;  // [rows × columns]
  double *c;                  // [columns × series]
  double *left;               // [series] Σ|r|² over the lines
  double *spread;             // [lines] ‖m S⁻¹‖² over real and imaginary part of the mean
} solution;

static void solution_clear(solution *s) {
  free(s->difference);
  free(s->mean);
  free(s->c);
  free(s->left);
  free(s->spread);
  *s = (solution){0};
}

static double complex line_of(const basis *b, const double *m, const double *c, size_t l) {
  double re = 0, im = 0;
  for (size_t k = 0; k < b->columns; k++) {
    re += m[l + k * b->rows] * c[k];
    im += m[b->rows / 2 + l + k * b->rows] * c[k];
  }
  return CMPLX(re, im);
}

// Thin singular value decomposition of a [rows × n], overwritten by U; vt [n × n], s [n].
static pb_status decompose(double *a, size_t rows, size_t n, double *s, double *vt, pb_error *err) {
  int ir = (int)rows, in = (int)n, query = -1, info, one = 1;
  double size;
  dgesvd_("O", "A", &ir, &in, a, &ir, s, NULL, &one, vt, &in, &size, &query, &info);
  int lwork = (int)size;
  double *work = malloc((size_t)lwork * sizeof *work);
  if (!work) return pb_fail_memory(err, "periodic");
  dgesvd_("O", "A", &ir, &in, a, &ir, s, NULL, &one, vt, &in, work, &lwork, &info);
  free(work);
  return info == 0 ? PB_OK : pb_fail(err, PB_ERR_NUMERIC, "periodic", "dgesvd: %d", info);
}

// ‖S⁺ Vᵀ m‖² of a row of the mean, columns by their norms.
static double spread_of(const basis *b, const double *row, const double *norm, const double *s,
                        const double *vt) {
  double sum = 0;
  for (size_t j = 0; j < b->columns; j++) {
    double dot = 0;
    if (!(s[j] > 1e-12 * s[0])) continue;
    for (size_t k = 0; k < b->columns; k++)
      dot += vt[j + k * b->columns] * row[k * b->rows] / norm[k];
    sum += dot / s[j] * (dot / s[j]);
  }
  return sum;
}

// c = V S⁺ Uᵀ d of one series, and the power that it leaves at the lines.
static void solve_series(solution *x, size_t series, const double *norm, const double *u,
                         const double *s, const double *vt) {
  const basis *b = &x->b;
  const pb_periodic *p = b->p;
  double *c = x->c + series * b->columns;
  memset(c, 0, b->columns * sizeof *c);
  for (size_t j = 0; j < b->columns; j++) {
    double dot = 0;
    if (!(s[j] > 1e-12 * s[0])) continue;
    for (size_t l = 0; l < p->all; l++) {
      double complex d = difference_of(p, series, l);
      dot += u[l + j * b->rows] * creal(d) + u[p->all + l + j * b->rows] * cimag(d);
    }
    for (size_t k = 0; k < b->columns; k++) c[k] += vt[j + k * b->columns] * dot / s[j] / norm[k];
  }
  for (size_t l = 0; l < p->lines; l++)
    x->left[series] += pow(cabs(difference_of(p, series, l) - line_of(b, x->difference, c, l)), 2);
}

static void solve_all(solution *x, const double *norm, const double *u, const double *s,
                      const double *vt) {
  const basis *b = &x->b;
  for (size_t k = 0; k < b->p->options.experiments * b->p->signals; k++)
    solve_series(x, k, norm, u, s, vt);
  for (size_t l = 0; l < b->p->lines; l++)
    x->spread[l] = spread_of(b, x->mean + l, norm, s, vt) +
                   spread_of(b, x->mean + b->rows / 2 + l, norm, s, vt);
}

// Fits poles and trends to D of all series.
static pb_status fit(pb_periodic *p, const double complex *pole, size_t poles, size_t degree,
                     solution *x, pb_error *err) {
  size_t n = unknowns(pole, poles, degree), rows = 2 * p->all;
  size_t series = p->options.experiments * p->signals;
  *x = (solution){.b = {p, pole, poles, degree, rows, n}};
  double *u = malloc(rows * n * sizeof *u), *s = malloc(n * (n + 2) * sizeof *s);
  double complex *work = malloc(p->options.period * sizeof *work);
  x->difference = malloc(rows * n * sizeof *x->difference);
  x->mean = malloc(rows * n * sizeof *x->mean);
  x->c = malloc(n * series * sizeof *x->c);
  x->left = calloc(series, sizeof *x->left);
  x->spread = calloc(p->lines, sizeof *x->spread);
  bool have = u && s && work && x->difference && x->mean && x->c && x->left && x->spread;
  pb_status status = have ? PB_OK : pb_fail_memory(err, "periodic");
  if (status == PB_OK) {
    double *norm = s + n, *vt = norm + n;
    fill(&x->b, PART_DIFFERENCE, 0, work, x->difference);
    fill(&x->b, PART_MEAN, 0, work, x->mean);
    memcpy(u, x->difference, rows * n * sizeof *u);
    for (size_t k = 0; k < n; k++) {
      double sum = 0;
      for (size_t r = 0; r < rows; r++) sum += u[r + k * rows] * u[r + k * rows];
      norm[k] = sum > 0 ? sqrt(sum) : 1;
      for (size_t r = 0; r < rows; r++) u[r + k * rows] /= norm[k];
    }
    status = decompose(u, rows, n, s, vt, err);
    if (status == PB_OK) solve_all(x, norm, u, s, vt);
  }
  free(u);
  free(s);
  free(work);
  if (status != PB_OK) solution_clear(x);
  return status;
}

// ---- choice of the degree -----------------------------------------------------------------------

static double rounding_power(const pb_periodic *p, size_t series) {
  return (double)p->lines * pow(pb_periodic_rounding(p, series), 2);
}

// Whether a lower degree leaves no more of any series than four times what a higher one does.
static bool is_enough(const solution *low, const solution *high) {
  const pb_periodic *p = low->b.p;
  for (size_t k = 0; k < p->options.experiments * p->signals; k++) {
    if (low->left[k] > 4 * high->left[k] + rounding_power(p, k)) return false;
  }
  return true;
}

// The lowest degree that is enough against every higher one.
static pb_status fit_degree(pb_periodic *p, const double complex *pole, size_t poles, solution *out,
                            pb_error *err) {
  solution x[MOST_DEGREE] = {0};
  size_t count = 0, best = 0;
  pb_status status = PB_OK;
  while (count < MOST_DEGREE && status == PB_OK &&
         2 * unknowns(pole, poles, count + 1) <= 2 * p->all) {
    status = fit(p, pole, poles, count + 1, &x[count], err);
    count += status == PB_OK;
  }
  for (size_t high = 1; high < count; high++) {
    if (!is_enough(&x[best], &x[high])) best = high;
  }
  for (size_t k = 0; k < count; k++) {
    if (status == PB_OK && k == best) continue;
    solution_clear(&x[k]);
  }
  *out = status == PB_OK ? x[best] : (solution){0};
  return status;
}

// Part of D's power at the lines that is explained; each output that has any counts alike.
static double explained_part(const solution *x) {
  const pb_periodic *p = x->b.p;
  double part_left = 0;
  size_t counted = 0;
  for (size_t k = 0; k < p->options.experiments * p->signals; k++) {
    if (k % p->signals < p->nu) continue;
    double power = 0;
    for (size_t l = 0; l < p->lines; l++) power += pow(cabs(difference_of(p, k, l)), 2);
    if (!(power > rounding_power(p, k))) continue;
    part_left += x->left[k] / power;
    counted++;
  }
  return counted ? 1 - part_left / (double)counted : 0;
}

// ---- what comes of it ---------------------------------------------------------------------------

static bool allocate(pb_periodic *p) {
  size_t all = p->options.experiments * p->signals * p->lines;
  if (!p->shift) p->shift = malloc(all * sizeof *p->shift);
  if (!p->remainder) p->remainder = malloc(all * sizeof *p->remainder);
  if (!p->excess) p->excess = malloc(all * sizeof *p->excess);
  if (!p->moved) p->moved = malloc(all * sizeof *p->moved);
  return p->shift && p->remainder && p->excess && p->moved;
}

// Σ_p |T_p − T̄|² of all lines and series.
static void add_moved(const solution *x, size_t period, double complex *work, double *m) {
  const basis *b = &x->b;
  const pb_periodic *p = b->p;
  fill(b, PART_PERIOD, period, work, m);
  for (size_t k = 0; k < p->options.experiments * p->signals * p->lines; k++) {
    const double *c = x->c + k / p->lines * b->columns;
    p->moved[k] += pow(cabs(line_of(b, m, c, k % p->lines) - p->shift[k]), 2);
  }
}

static pb_status apply(pb_periodic *p, const solution *x, pb_error *err) {
  const basis *b = &x->b;
  double *m = malloc(b->rows * b->columns * sizeof *m);
  double complex *work = malloc(p->options.period * sizeof *work);
  bool have = m && work && allocate(p);
  pb_status status = have ? PB_OK : pb_fail_memory(err, "periodic");
  p->freedom = 1 - (double)b->columns / (double)b->rows;
  for (size_t k = 0; have && k < p->options.experiments * p->signals; k++) {
    const double *c = x->c + k * b->columns;
    // Of D; of rounding only where that is more. Its real and imaginary part have half of it each.
    double power = (x->left[k] + rounding_power(p, k)) / (double)p->lines / p->freedom / 2;
    for (size_t l = 0; l < p->lines; l++) {
      size_t at = k * p->lines + l;
      p->shift[at] = line_of(b, x->mean, c, l);
      p->remainder[at] = (difference_of(p, k, l) - line_of(b, x->difference, c, l)) *
                         (double)p->runs[k / p->signals];
      p->excess[at] = power * x->spread[l];
      p->moved[at] = 0;
    }
  }
  // With two periods the scatter is that of their difference anyway.
  for (size_t n = 0; have && periods_of(p) > 2 && n < periods_of(p); n++) add_moved(x, n, work, m);
  p->settled = have;
  free(m);
  free(work);
  return status;
}

static bool equally_long(const pb_periodic *p) {
  for (size_t e = 1; e < p->options.experiments; e++)
    if (p->count[e] != p->count[0] || p->run[e] != p->run[0]) return false;
  return true;
}

// Poles that a run cannot tell from a trend are left out; kept[poles].
static size_t keep_poles(const pb_periodic *p, const double complex *pole, size_t poles,
                         double complex *kept) {
  double length = (double)(periods_of(p) * p->options.period);
  size_t count = 0;
  for (size_t k = 0; k < poles; k++)
    if (cabs(clog(pole[k])) * length > 0.1) kept[count++] = pole[k];
  return count;
}

pb_status pb_periodic_settle(pb_periodic *p, const double complex *pole, size_t poles,
                             double *explained, pb_error *err) {
  *explained = 0;
  pb_status status = check(p, err);
  if (status != PB_OK || !equally_long(p)) return status;
  double complex *kept = malloc((poles + 1) * sizeof *kept);
  if (!kept) return pb_fail_memory(err, "periodic");
  poles = keep_poles(p, pole, poles, kept);
  if (unknowns(kept, poles, 1) > p->all) poles = 0;
  solution x = {0};
  status = fit_degree(p, kept, poles, &x, err);
  if (status == PB_OK) *explained = explained_part(&x);
  if (status == PB_OK && poles > 0 && *explained <= 0.5) {
    solution_clear(&x);
    *explained = 0;
    status = fit_degree(p, kept, 0, &x, err);
  }
  if (status == PB_OK && x.c) status = apply(p, &x, err);
  solution_clear(&x);
  free(kept);
  return status;
}
