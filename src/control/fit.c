// Order search and results of the rational fit: see fit.h.
#include "control/fit.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "control/fit_internal.h"

enum { QUICK_ITERATIONS = 6, FINAL_ITERATIONS = 30, STALLS = 2 };

void pb_fit_clear(pb_fit *fit) {
  if (!fit) return;
  free(fit->w);
  free(fit->pole);
  free(fit->strength);
  free(fit->residue);
  free(fit->direct);
  *fit = (pb_fit){0};
}

static void add_pair(pb_fit_poles *poles, double x) {
  poles->p[poles->n] = CMPLX(-0.01 * x, x);
  poles->p[poles->n + 1] = CMPLX(-0.01 * x, -x);
  poles->n += 2;
}

// Pairs spread over the band, half of them evenly in frequency and half in its logarithm.
static void spread(const pb_fit_data *d, size_t pairs, pb_fit_poles *poles) {
  double low = d->x[0], high = d->x[d->lines - 1];
  poles->n = 0;
  for (size_t k = 0; k < pairs; k++) {
    double share = (double)(k + 1) / (double)(pairs + 1);
    add_pair(poles, k % 2 ? low + share * (high - low) : low * pow(high / low, share));
  }
}

// The search's working set: the model under way and the best one so far.
typedef struct search {
  const pb_fit_data *data;
  pb_fit_poles now, best;
  double complex *before;  // [capacity]
  double *c;               // [channels][capacity + 1]
  double complex *error;   // [channels][lines]
  double now_rms, best_rms;
} search;

static void search_clear(search *s) {
  free(s->now.p);
  free(s->best.p);
  free(s->before);
  free(s->c);
  free(s->error);
}

static pb_status search_init(const pb_fit_data *d, size_t capacity, search *s, pb_error *err) {
  *s = (search){.data = d, .best_rms = INFINITY};
  s->now.p = malloc(capacity * sizeof *s->now.p);
  s->best.p = malloc(capacity * sizeof *s->best.p);
  s->before = malloc(capacity * sizeof *s->before);
  s->c = malloc(d->channels * (capacity + 1) * sizeof *s->c);
  s->error = malloc(d->channels * d->lines * sizeof *s->error);
  bool have = s->now.p && s->best.p && s->before && s->c && s->error;
  return have ? PB_OK : pb_fail_memory(err, "fit");
}

static pb_status measure(search *s, pb_error *err) {
  pb_status status = pb_fit_residues(s->data, &s->now, s->c, s->error, err);
  if (status != PB_OK) return status;
  size_t count = s->data->channels * s->data->lines;
  double sum = 0;
  for (size_t k = 0; k < count; k++) sum += creal(s->error[k] * conj(s->error[k]));
  s->now_rms = sqrt(sum / (double)count);
  return PB_OK;
}

static void keep(search *s) {
  s->best.n = s->now.n;
  memcpy(s->best.p, s->now.p, s->now.n * sizeof *s->now.p);
  s->best_rms = s->now_rms;
}

// Relocates until the poles stand still, at most `iterations` times.
static pb_status relocate(search *s, unsigned iterations, pb_error *err) {
  for (unsigned it = 0; it < iterations; it++) {
    memcpy(s->before, s->now.p, s->now.n * sizeof *s->before);
    pb_status status = pb_fit_relocate(s->data, &s->now, err);
    if (status != PB_OK) return status;
    double change = 0;
    for (size_t k = 0; k < s->now.n; k++) {
      change = fmax(change, cabs(s->now.p[k] - s->before[k]) / cabs(s->now.p[k]));
    }
    if (change < 1e-10) break;
  }
  return measure(s, err);
}

// A pair where the error of all channels together is largest.
static void add_where_worst(search *s) {
  const pb_fit_data *d = s->data;
  size_t worst = 0;
  double largest = -1;
  for (size_t l = 0; l < d->lines; l++) {
    double sum = 0;
    for (size_t c = 0; c < d->channels; c++) {
      double complex e = s->error[c * d->lines + l];
      sum += creal(e * conj(e));
    }
    if (sum > largest) largest = sum, worst = l;
  }
  add_pair(&s->now, d->x[worst]);
}

// Raises the order from two pairs until the error is small, or stops falling by a third a pair.
static pb_status raise_order(search *s, size_t max_poles, double enough, pb_error *err) {
  unsigned stalls = 0;
  spread(s->data, 2, &s->now);
  for (;;) {
    pb_status status = relocate(s, QUICK_ITERATIONS, err);
    if (status != PB_OK) return status;
    if (s->now_rms < 0.67 * s->best_rms) {
      stalls = 0;
      keep(s);
    } else {
      stalls++;
    }
    if (s->best_rms < enough || stalls > STALLS || s->now.n + 2 > max_poles) return PB_OK;
    add_where_worst(s);
  }
}

static pb_status find_poles(search *s, const pb_fit_options *o, size_t capacity, pb_error *err) {
  pb_status status = PB_OK;
  if (o->poles > 0) {
    spread(s->data, (o->poles + 1) / 2, &s->now);
    if (o->poles % 2) s->now.p[--s->now.n - 1] = -s->data->x[0];
    keep(s);
  } else {
    double enough = o->tolerance > 0 ? o->tolerance : 1e-7;
    status = raise_order(s, capacity, o->weight == PB_FIT_NOISE ? fmax(1.05, enough) : enough, err);
  }
  if (status != PB_OK) return status;
  s->now.n = s->best.n;
  memcpy(s->now.p, s->best.p, s->best.n * sizeof *s->now.p);
  return relocate(s, FINAL_ITERATIONS, err);
}

static double relative_error(const search *s) {
  const pb_fit_data *d = s->data;
  double mean = 0;
  for (size_t c = 0; c < d->channels; c++) {
    double difference = 0, power = 0;
    for (size_t l = 0; l < d->lines; l++) {
      size_t k = c * d->lines + l;
      difference += pow(cabs(s->error[k]) / d->weight[k], 2);
      power += pow(cabs(d->h[k]), 2);
    }
    mean += difference / power / (double)d->channels;
  }
  return sqrt(mean);
}

// Moves entry k of the result (pole, residues) out of the real parameters k of the search.
static void export_pole(const search *s, size_t k, double rate, pb_fit *out) {
  const pb_fit_data *d = s->data;
  size_t n1 = s->now.n + 1, slot = out->poles++;
  double complex p = s->now.p[k] * d->scale;
  double complex half = p / (2 * rate);
  out->w[slot] = p;
  out->pole[slot] = pb_pole_from_z((1 + half) / (1 - half), rate);
  out->strength[slot] = 0;
  for (size_t c = 0; c < d->channels; c++) {
    const double *coefficient = s->c + c * n1 + k;
    double imaginary = cimag(p) != 0 ? coefficient[1] : 0;
    out->residue[c * s->now.n + slot] = d->scale * CMPLX(coefficient[0], imaginary);
  }
}

static int by_frequency(const void *a, const void *b) {
  const pb_pole *p = *(const pb_pole *const *)a, *q = *(const pb_pole *const *)b;
  return (p->hz > q->hz) - (p->hz < q->hz);
}

// Sorts the poles by frequency, packs the residues to [channels][poles], measures the strengths.
static pb_status arrange(const pb_fit_data *d, size_t stride, pb_fit *fit, pb_error *err) {
  size_t n = fit->poles;
  const pb_pole **order = malloc((n + 1) * sizeof(const pb_pole *));
  pb_fit old = *fit;
  double *work = malloc((d->lines + 1) * sizeof *work);
  fit->w = malloc((n + 1) * sizeof *fit->w);
  fit->pole = malloc((n + 1) * sizeof *fit->pole);
  fit->strength = calloc(n + 1, sizeof *fit->strength);
  fit->residue = malloc((d->channels * n + 1) * sizeof *fit->residue);
  bool have = order && work && fit->w && fit->pole && fit->strength && fit->residue;
  pb_status status = have ? PB_OK : pb_fail_memory(err, "fit");
  for (size_t k = 0; have && k < n; k++) order[k] = &old.pole[k];
  if (have && n > 0) qsort(order, n, sizeof *order, by_frequency);
  for (size_t c = 0; have && c < d->channels; c++) {
    double median = pb_fit_median_size(d->h + c * d->lines, d->lines, work);
    for (size_t k = 0; k < n; k++) {
      size_t from = (size_t)(order[k] - old.pole);
      fit->w[k] = old.w[from];
      fit->pole[k] = old.pole[from];
      double complex r = old.residue[c * stride + from];
      fit->residue[c * n + k] = r;
      fit->strength[k] = fmax(fit->strength[k], cabs(r) / fabs(creal(fit->w[k])) / median);
    }
  }
  free(order);
  free(work);
  free(old.w);
  free(old.pole);
  free(old.strength);
  free(old.residue);
  return status;
}

static pb_status export_fit(const search *s, double rate, pb_fit *out, pb_error *err) {
  const pb_fit_data *d = s->data;
  size_t n = s->now.n;
  *out = (pb_fit){.sample_rate = rate, .channels = d->channels, .error = relative_error(s)};
  out->w = malloc((n + 1) * sizeof *out->w);
  out->pole = malloc((n + 1) * sizeof *out->pole);
  out->strength = malloc((n + 1) * sizeof *out->strength);
  out->residue = malloc((d->channels * n + 1) * sizeof *out->residue);
  out->direct = malloc(d->channels * sizeof *out->direct);
  if (!out->w || !out->pole || !out->strength || !out->residue || !out->direct) {
    return pb_fail_memory(err, "fit");
  }
  for (size_t k = 0; k < n; k++) {
    export_pole(s, k, rate, out);
    k += cimag(s->now.p[k]) != 0;
  }
  for (size_t c = 0; c < d->channels; c++) out->direct[c] = s->c[c * (n + 1) + n];
  return arrange(d, n, out, err);
}

pb_status pb_fit_frf(const pb_frf *frf, const pb_fit_channel *channel, size_t channels,
                     const pb_fit_options *o, pb_fit *out, pb_error *err) {
  *out = (pb_fit){0};
  pb_fit_data data;
  search s = {0};
  pb_status status = pb_fit_data_new(frf, channel, channels, o, &data, err);
  if (status != PB_OK) return status;
  // Two real equations a line for n + 1 coefficients a channel, and as many again in relocation.
  size_t most = data.lines > 3 ? data.lines - 2 : 1;
  size_t capacity = o->poles ? o->poles + 1 : o->max_poles ? o->max_poles : 40;
  if (o->poles > most) {
    status = pb_fail(err, PB_ERR_ARGUMENT, "fit", "%zu poles from %zu lines", o->poles, data.lines);
    goto done;
  }
  // An odd order is spread as pairs, the last of which then loses a pole.
  if (!o->poles && capacity > most) capacity = most;
  status = search_init(&data, capacity > 4 ? capacity : 4, &s, err);
  if (status == PB_OK) status = find_poles(&s, o, capacity, err);
  if (status == PB_OK) status = export_fit(&s, o->sample_rate, out, err);
done:
  if (status != PB_OK) pb_fit_clear(out);
  search_clear(&s);
  pb_fit_data_clear(&data);
  return status;
}

double complex pb_fit_evaluate(const pb_fit *fit, size_t channel, double hz) {
  double complex w = CMPLX(0, 2 * fit->sample_rate * tan(M_PI * hz / fit->sample_rate));
  double complex sum = fit->direct[channel];
  for (size_t k = 0; k < fit->poles; k++) {
    double complex r = fit->residue[channel * fit->poles + k], p = fit->w[k];
    sum += r / (w - p);
    if (cimag(p) != 0) sum += conj(r) / (w - conj(p));
  }
  return sum;
}
