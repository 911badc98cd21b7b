// Characteristic loci and singular values of several loops: see margins.h.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"
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

static void find_peaks(const double *hz, pb_mimo *m) {
  double low = 1 / sqrt(2);
  int below = 1;
  m->s_peak = m->t_peak = 0;
  m->s_low_hz = 0;
  for (size_t f = 0; f < m->nf; f++) {
    if (m->s[f] > m->s_peak) m->s_peak = m->s[f], m->s_peak_hz = hz[f];
    if (m->t[f] > m->t_peak) m->t_peak = m->t[f], m->t_peak_hz = hz[f];
    below = below && m->s[f] < low;
    if (below) m->s_low_hz = hz[f];
  }
}

pb_status pb_mimo_analyse(const double *hz, size_t nf, size_t n, const double complex *l,
                          pb_mimo *out, pb_error *err) {
  *out = (pb_mimo){.nf = nf, .n = n};
  pb_assignment pairs = {0};
  out->locus = malloc((nf * n + 1) * sizeof *out->locus);
  out->s = malloc((nf + 1) * sizeof *out->s);
  out->t = malloc((nf + 1) * sizeof *out->t);
  out->margins = malloc((n + 1) * sizeof *out->margins);
  double complex *work = malloc((3 * n * n + 4 * n + 1) * sizeof *work);
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
  pb_assignment_clear(&pairs);
  free(work);
  if (status != PB_OK) {
    pb_mimo_clear(out);
    return status;
  }
  find_peaks(hz, out);
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
