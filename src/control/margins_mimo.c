// Characteristic loci and singular values of several loops: see margins.h.
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"
#include "control/arc.h"
#include "control/assign.h"
#include "control/margins.h"
#include "signal/small_solve.h"

int pb_sensitivity_of(size_t n, const double complex *l, double complex *s, double complex *work) {
  double complex *a = work, *b = work + n * n;
  for (size_t k = 0; k < n * n; k++) {
    size_t r = k / n, c = k % n;
    a[r + c * n] = l[k] + (r == c);
    b[k] = k % (n + 1) == 0;
  }
  if (!pb_small_solve(n, n, a, b)) return 0;
  for (size_t k = 0; k < n * n; k++) s[k] = b[k / n + (k % n) * n];
  return 1;
}

pb_status pb_largest_gain(size_t n, const double complex *m, double *out, pb_error *err) {
  int size = (int)n, one = 1, info = 0, length = (int)(5 * n + 5);
  double complex *a = malloc((n * n + (size_t)length) * sizeof *a);
  double *s = malloc((6 * n + 1) * sizeof *s);
  pb_status status = a && s ? PB_OK : pb_fail_memory(err, "margins");
  if (status == PB_OK) {
    memcpy(a, m, n * n * sizeof *a);
    zgesvd_("N", "N", &size, &size, a, &size, s, NULL, &one, NULL, &one, a + n * n, &length, s + n,
            &info);
    *out = s[0];
    if (info) status = pb_fail(err, PB_ERR_NUMERIC, "margins", "singular values: info %d", info);
  }
  free(a);
  free(s);
  return status;
}

static pb_status eigenvalues(size_t n, const double complex *l, double complex *value,
                             double complex *work, pb_error *err) {
  int size = (int)n, one = 1, info = 0, length = (int)(4 * n);
  double complex *a = work, *scratch = work + n * n;
  double real_work[2 * 32];
  if (n > 32) return pb_fail(err, PB_ERR_ARGUMENT, "margins", "%zu loops, at most 32", n);
  memcpy(a, l, n * n * sizeof *a);  // the transpose has the same eigenvalues
  zgeev_("N", "N", &size, a, &size, value, NULL, &one, NULL, &one, scratch, &length, real_work,
         &info);
  return info ? pb_fail(err, PB_ERR_NUMERIC, "margins", "eigenvalues: info %d", info) : PB_OK;
}

// Reorders now[n] so that its values together are nearest to before[n].
static void follow(pb_assignment *a, const double complex *before, double complex *now,
                   double complex *work) {
  size_t n = a->rows;
  for (size_t k = 0; k < n; k++)
    for (size_t j = 0; j < n; j++) a->cost[k * n + j] = cabs(now[j] - before[k]);
  pb_assignment_solve(a);
  memcpy(work, now, n * sizeof *work);
  for (size_t k = 0; k < n; k++) now[k] = work[a->column[k]];
}

static pb_status singular_values(size_t n, const double complex *l, double complex *work, double *s,
                                 double *t, pb_error *err) {
  double complex *sensitivity = work + 2 * n * n;
  *s = *t = INFINITY;
  if (!pb_sensitivity_of(n, l, sensitivity, work)) return PB_OK;
  pb_status status = pb_largest_gain(n, sensitivity, s, err);
  // T = I − S
  for (size_t k = 0; k < n * n; k++) sensitivity[k] = (k % (n + 1) == 0) - sensitivity[k];
  return status == PB_OK ? pb_largest_gain(n, sensitivity, t, err) : status;
}

// Singular values between the points of the grid, from each entry of L on its arc.
typedef struct between {
  const double *hz;
  const double complex *l;
  size_t nf, n;
  double complex *at, *work;  // [n²], [3 n² + 4 n]
} between;

static pb_status values_between(const between *b, size_t f, double x, double *s, double *t,
                                pb_error *err) {
  const size_t all = b->n * b->n;
  for (size_t k = 0; k < all; k++) {
    const pb_arc a = pb_arc_of(b->hz, b->nf, b->l + k, all, f);
    b->at[k] = pb_arc_at(&a, x);
  }
  return singular_values(b->n, b->at, b->work, s, t, err);
}

// The largest of S or of T from point f to f + 1, by golden section.
static pb_status rise(const between *b, size_t f, bool of_t, double *peak, double *peak_hz,
                      pb_error *err) {
  static const double ratio = 0.6180339887498949;
  double low = 0, high = b->hz[f + 1] - b->hz[f], value[2][2];
  pb_status status = PB_OK;
  for (int k = 0; k < 30 && status == PB_OK; k++) {
    const double x[2] = {high - ratio * (high - low), low + ratio * (high - low)};
    for (int side = 0; side < 2 && status == PB_OK; side++)
      status = values_between(b, f, x[side], &value[side][0], &value[side][1], err);
    if (value[0][of_t] > value[1][of_t])
      high = x[1];
    else
      low = x[0];
  }
  const double largest = fmax(value[0][of_t], value[1][of_t]);
  if (status != PB_OK || !(largest > *peak) || isinf(largest)) return status;
  *peak = largest;
  *peak_hz = b->hz[f] + 0.5 * (low + high);
  return PB_OK;
}

static pb_status find_peak(const between *b, const double *y, bool of_t, double *peak,
                           double *peak_hz, pb_error *err) {
  size_t at = 0;
  for (size_t f = 1; f < b->nf; f++)
    if (y[f] > y[at]) at = f;
  *peak = b->nf > 0 ? y[at] : 0;
  *peak_hz = b->nf > 0 ? b->hz[at] : NAN;
  if (isinf(*peak)) return PB_OK;
  pb_status status = at > 0 ? rise(b, at - 1, of_t, peak, peak_hz, err) : PB_OK;
  return status == PB_OK && at + 1 < b->nf ? rise(b, at, of_t, peak, peak_hz, err) : status;
}

// Where the largest singular value of S first comes up to 1/√2, by bisection; 0: it begins above.
static pb_status find_low(const between *b, const double *s, double *hz, pb_error *err) {
  const double border = 1 / sqrt(2);
  size_t f = 0;
  while (f < b->nf && s[f] < border) f++;
  *hz = f == 0 ? 0 : f == b->nf ? b->hz[f - 1] : b->hz[f];
  if (f == 0 || f == b->nf) return PB_OK;
  double low = 0, high = b->hz[f] - b->hz[f - 1], value[2];
  pb_status status = PB_OK;
  for (int k = 0; k < 40 && status == PB_OK; k++) {
    const double middle = 0.5 * (low + high);
    status = values_between(b, f - 1, middle, &value[0], &value[1], err);
    *(value[0] < border ? &low : &high) = middle;
  }
  *hz = b->hz[f - 1] + high;
  return status;
}

static pb_status find_peaks(const double *hz, const double complex *l, double complex *work,
                            pb_mimo *m, pb_error *err) {
  const between b = {hz, l, m->nf, m->n, work, work + m->n * m->n};
  pb_status status = find_peak(&b, m->s, false, &m->s_peak, &m->s_peak_hz, err);
  if (status == PB_OK) status = find_peak(&b, m->t, true, &m->t_peak, &m->t_peak_hz, err);
  return status == PB_OK ? find_low(&b, m->s, &m->s_low_hz, err) : status;
}

pb_status pb_mimo_analyse(const double *hz, size_t nf, size_t n, const double complex *l,
                          pb_mimo *out, pb_error *err) {
  *out = (pb_mimo){.nf = nf, .n = n};
  pb_assignment pairs = {0};
  out->locus = malloc((nf * n + 1) * sizeof *out->locus);
  out->s = malloc((nf + 1) * sizeof *out->s);
  out->t = malloc((nf + 1) * sizeof *out->t);
  out->margins = malloc((n + 1) * sizeof *out->margins);
  double complex *work = malloc((4 * n * n + 4 * n + 1) * sizeof *work);
  pb_status status = out->locus && out->s && out->t && out->margins && work
                         ? PB_OK
                         : pb_fail_memory(err, "margins");
  if (status == PB_OK) status = pb_assignment_new(n, n, &pairs, err);
  for (size_t f = 0; f < nf && status == PB_OK; f++) {
    double complex *value = out->locus + f * n;
    status = eigenvalues(n, l + f * n * n, value, work, err);
    if (status == PB_OK && f > 0) follow(&pairs, value - n, value, work);
    if (status == PB_OK) {
      status = singular_values(n, l + f * n * n, work, &out->s[f], &out->t[f], err);
    }
  }
  if (status == PB_OK) status = find_peaks(hz, l, work, out, err);
  pb_assignment_clear(&pairs);
  free(work);
  if (status != PB_OK) {
    pb_mimo_clear(out);
    return status;
  }
  for (size_t i = 0; i < n; i++) out->margins[i] = pb_margins_of(hz, nf, out->locus + i, n);
  return PB_OK;
}

void pb_mimo_clear(pb_mimo *m) {
  free(m->locus);
  free(m->s);
  free(m->t);
  free(m->margins);
  *m = (pb_mimo){0};
}
