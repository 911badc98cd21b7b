// Least squares over a band: see actuator_fit.h.
//
// θ = ln(k_1, c_1, k_a, c_a, g_a, g_s[, k_e, c_e]); r = √w ln(H_model/H), w by octave. A step
// solves
//   (JᵀJ + λ diag JᵀJ) Δ = −Jᵀr
// with λ falling where it helps and rising where it does not (D. Marquardt, SIAM J. Appl. Math. 11,
// 1963). J by central differences.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"
#include "study/actuator_fit.h"

enum { SHARED = 6, MOST = 8, ITERATIONS = 100 };
// A sampled response is good to 1e-8 near its zero: differences over less than this drown in it.
static const double difference_step = 1e-4;

typedef struct problem {
  const pb_apa_data *data;
  pb_apa_2dof fixed;  // masses, ratios and signs
  double ratio_k, ratio_c;
  size_t parameters, lines, residuals;
  size_t *line;           // [lines] indices into the data
  double *hz, *weight;    // [lines]
  double complex *h;      // [lines][2] of the model
  double *r, *moved, *j;  // [residuals], [residuals], [residuals × parameters]
} problem;

static void problem_clear(problem *p) {
  free(p->line);
  free(p->hz);
  free(p->weight);
  free(p->h);
  free(p->r);
  free(p->moved);
  free(p->j);
}

static bool usable(const pb_frf *frf, size_t f) {
  for (size_t k = 0; k < PB_APA_OUTPUTS; k++) {
    const size_t at = f * PB_APA_OUTPUTS + k;
    if (!isfinite(frf->variance[at]) || !(cabs(frf->h[at]) > 0)) return false;
  }
  return true;
}

static pb_status problem_new(const pb_apa_data *d, const pb_apa_refine_options *o, problem *p,
                             pb_error *err) {
  const size_t nf = d->frf.nf;
  *p = (problem){.data = d, .parameters = o->free_ratio ? MOST : SHARED};
  p->line = malloc(nf * sizeof *p->line);
  p->hz = malloc(nf * sizeof *p->hz);
  p->weight = malloc(nf * sizeof *p->weight);
  p->h = malloc(nf * PB_APA_OUTPUTS * sizeof *p->h);
  p->r = malloc(2 * nf * PB_APA_OUTPUTS * sizeof *p->r);
  p->moved = malloc(2 * nf * PB_APA_OUTPUTS * sizeof *p->moved);
  p->j = malloc(2 * nf * PB_APA_OUTPUTS * MOST * sizeof *p->j);
  if (!p->line || !p->hz || !p->weight || !p->h || !p->r || !p->moved || !p->j) {
    problem_clear(p);
    return pb_fail_memory(err, "refine");
  }
  for (size_t f = 0; f < nf; f++) {
    const double hz = d->frf.frequency_hz[f];
    if (hz < o->f1 || hz > o->f2 || !usable(&d->frf, f)) continue;
    p->hz[p->lines] = hz;
    p->line[p->lines++] = f;
  }
  p->residuals = 2 * PB_APA_OUTPUTS * p->lines;
  if (p->lines >= 10) return PB_OK;
  const size_t lines = p->lines;
  problem_clear(p);
  return pb_fail(err, PB_ERR_ARGUMENT, "band",
                 "only %zu lines between %g and %g Hz: ten are needed", lines, o->f1, o->f2);
}

// Each line stands for the part of the logarithmic axis around it; the sum is 1.
static void fill_weights(problem *p) {
  double sum = 0;
  for (size_t f = 0; f < p->lines; f++) {
    const double low = p->hz[f > 0 ? f - 1 : 0], high = p->hz[f + 1 < p->lines ? f + 1 : f];
    sum += p->weight[f] = log(high / low);
  }
  for (size_t f = 0; f < p->lines; f++) p->weight[f] = sqrt(p->weight[f] / sum / PB_APA_OUTPUTS);
}

static pb_apa_2dof unpack(const problem *p, const double *theta) {
  pb_apa_2dof a = p->fixed;
  a.k_1 = exp(theta[0]), a.c_1 = exp(theta[1]);
  a.k_a = exp(theta[2]), a.c_a = exp(theta[3]);
  a.g_a = copysign(exp(theta[4]), p->fixed.g_a);
  a.g_s = copysign(exp(theta[5]), p->fixed.g_s);
  const bool ratio = p->parameters == MOST;
  a.k_e = ratio ? exp(theta[6]) : p->ratio_k * a.k_a;
  a.c_e = ratio ? exp(theta[7]) : p->ratio_c * a.c_a;
  return a;
}

// A damping of 0 starts from 1e-6 of critical: its logarithm must be finite.
static void pack(problem *p, const pb_apa_2dof *a, double *theta) {
  const double least = 2e-6 * sqrt(a->k_1 * a->moving);
  p->fixed = *a;
  p->ratio_k = a->k_e / a->k_a;
  p->ratio_c = a->c_a > 0 ? a->c_e / a->c_a : p->ratio_k;
  theta[0] = log(a->k_1), theta[1] = log(fmax(a->c_1, least));
  theta[2] = log(a->k_a), theta[3] = log(fmax(a->c_a, least));
  theta[4] = log(fabs(a->g_a)), theta[5] = log(fabs(a->g_s));
  theta[6] = log(a->k_e), theta[7] = log(fmax(a->c_e, least));
}

static pb_status residuals(problem *p, const double *theta, double *r, double *sum, pb_error *err) {
  const pb_apa_2dof a = unpack(p, theta);
  pb_status st = pb_apa_2dof_response(&a, p->data->sample_rate, p->hz, p->lines, p->h, err);
  *sum = 0;
  for (size_t f = 0; f < p->lines && !st; f++)
    for (size_t k = 0; k < PB_APA_OUTPUTS; k++) {
      const size_t at = f * PB_APA_OUTPUTS + k;
      const double complex e =
          p->weight[f] * clog(p->h[at] / p->data->frf.h[p->line[f] * PB_APA_OUTPUTS + k]);
      r[2 * at] = creal(e);
      r[2 * at + 1] = cimag(e);
      *sum += creal(e) * creal(e) + cimag(e) * cimag(e);
    }
  return st;
}

static pb_status jacobian(problem *p, const double *theta, pb_error *err) {
  pb_status st = PB_OK;
  for (size_t i = 0; i < p->parameters && !st; i++) {
    double *column = p->j + i * p->residuals, above[MOST], below[MOST], sum;
    memcpy(above, theta, sizeof above);
    memcpy(below, theta, sizeof below);
    above[i] += difference_step;
    below[i] -= difference_step;
    st = residuals(p, above, column, &sum, err);
    if (!st) st = residuals(p, below, p->moved, &sum, err);
    for (size_t k = 0; k < p->residuals && !st; k++)
      column[k] = (column[k] - p->moved[k]) / (2 * difference_step);
  }
  return st;
}

// Δ for one λ; false where the equations are singular.
static bool step_for(const problem *p, double lambda, double *delta) {
  double a[MOST * MOST];
  int n = (int)p->parameters, one = 1, info = 0;
  for (size_t i = 0; i < p->parameters; i++) {
    const double *x = p->j + i * p->residuals;
    delta[i] = 0;
    for (size_t k = 0; k < p->residuals; k++) delta[i] -= x[k] * p->r[k];
    for (size_t c = 0; c <= i; c++) {
      const double *y = p->j + c * p->residuals;
      double sum = 0;
      for (size_t k = 0; k < p->residuals; k++) sum += x[k] * y[k];
      a[c + i * p->parameters] = sum * (c == i ? 1 + lambda : 1);
    }
    a[i + i * p->parameters] += 1e-300;
  }
  dpotrf_("U", &n, a, &n, &info);
  if (!info) dpotrs_("U", &n, &one, a, &n, delta, &n, &info);
  return info == 0;
}

// One accepted step, or none: *moved tells.
static pb_status improve(problem *p, double *theta, double *sum, double *lambda, bool *moved,
                         pb_error *err) {
  pb_status st = jacobian(p, theta, err);
  *moved = false;
  for (int tries = 0; tries < 12 && !st && !*moved; tries++) {
    double delta[MOST] = {0}, next[MOST], value;
    memcpy(next, theta, sizeof next);
    if (!step_for(p, *lambda, delta)) {
      *lambda *= 10;
      continue;
    }
    for (size_t i = 0; i < p->parameters; i++) next[i] += fmax(-1, fmin(1, delta[i]));
    st = residuals(p, next, p->moved, &value, err);
    if (st || !(value < *sum)) {
      *lambda *= 10;
      continue;
    }
    *moved = *sum - value > 1e-12 * *sum;
    memcpy(theta, next, sizeof next);
    memcpy(p->r, p->moved, p->residuals * sizeof *p->r);
    *sum = value;
    *lambda = fmax(*lambda / 10, 1e-12);
    break;
  }
  return st;
}

pb_status pb_apa_refine(const pb_apa_data *d, const pb_apa_refine_options *o, pb_apa_2dof *apa,
                        pb_apa_refine_report *report, pb_error *err) {
  problem p;
  double theta[MOST], sum = 0, lambda = 1e-3;
  bool moved = true;
  pb_status st = problem_new(d, o, &p, err);
  if (st) return st;
  fill_weights(&p);
  pack(&p, apa, theta);
  st = residuals(&p, theta, p.r, &sum, err);
  *report = (pb_apa_refine_report){.lines = p.lines, .before = sqrt(sum)};
  while (!st && moved && report->iterations < ITERATIONS) {
    st = improve(&p, theta, &sum, &lambda, &moved, err);
    report->iterations++;
  }
  report->after = sqrt(sum);
  if (!st) *apa = unpack(&p, theta);
  problem_clear(&p);
  return st;
}
