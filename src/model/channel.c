// A scaled channel of a model: see channel.h.
#include "model/channel.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"
#include "model/block.h"

enum { SCALE_POINTS = 24 };

// ---- memory -------------------------------------------------------------------------------------

static bool allocate(pb_channel *ch, size_t m, size_t n, size_t blocks, size_t values,
                     size_t widest) {
  *ch = (pb_channel){.m = m, .n = n, .blocks = blocks, .widest = widest};
  ch->start = calloc(blocks + 1, sizeof *ch->start);
  ch->value = calloc(blocks + 1, sizeof *ch->value);
  ch->a = calloc(values + 1, sizeof *ch->a);
  ch->b = calloc(n * m + 1, sizeof *ch->b);
  ch->c = calloc(n * m + 1, sizeof *ch->c);
  ch->d = calloc(m * m, sizeof *ch->d);
  ch->radius = calloc(blocks + 1, sizeof *ch->radius);
  ch->work = calloc(2 * widest * widest + 2 * widest * m + m * m, sizeof *ch->work);
  ch->pivot = calloc(widest + 1, sizeof *ch->pivot);
  return ch->start && ch->value && ch->a && ch->b && ch->c && ch->d && ch->radius && ch->work &&
         ch->pivot;
}

void pb_channel_free(pb_channel *ch) {
  free(ch->start);
  free(ch->value);
  free(ch->a);
  free(ch->b);
  free(ch->c);
  free(ch->d);
  free(ch->radius);
  free(ch->work);
  free(ch->pivot);
  *ch = (pb_channel){0};
}

pb_status pb_channel_copy(const pb_channel *from, pb_channel *out, pb_error *err) {
  size_t values = from->value[from->blocks], m = from->m, n = from->n;
  if (!allocate(out, m, n, from->blocks, values, from->widest)) {
    pb_channel_free(out);
    return pb_fail_memory(err, "zeros");
  }
  memcpy(out->start, from->start, (from->blocks + 1) * sizeof *out->start);
  memcpy(out->value, from->value, (from->blocks + 1) * sizeof *out->value);
  memcpy(out->a, from->a, values * sizeof *out->a);
  memcpy(out->b, from->b, n * m * sizeof *out->b);
  memcpy(out->c, from->c, n * m * sizeof *out->c);
  memcpy(out->d, from->d, m * m * sizeof *out->d);
  memcpy(out->radius, from->radius, from->blocks * sizeof *out->radius);
  out->period = from->period;
  return PB_OK;
}

// ---- evaluation ---------------------------------------------------------------------------------

// W = (sI − A_b)⁻¹ [size × size], column-major; an exactly singular matrix gives infinite entries.
static void block_inverse(const pb_channel *ch, size_t block, double complex s, double complex *w) {
  int size = (int)(ch->start[block + 1] - ch->start[block]), info = 0;
  const double *a = &ch->a[ch->value[block]];
  if (size == 1) {
    w[0] = 1 / (s - a[0]);
  } else if (size == 2) {
    double complex det = (s - a[0]) * (s - a[3]) - a[1] * a[2];
    w[0] = (s - a[3]) / det;
    w[1] = a[1] / det;
    w[2] = a[2] / det;
    w[3] = (s - a[0]) / det;
  } else {
    double complex *t = w + size * size;
    for (int i = 0; i < size * size; i++) {
      bool diagonal = i % (size + 1) == 0;
      t[i] = (diagonal ? s : 0) - a[i];
      w[i] = diagonal;
    }
    zgesv_(&size, &size, t, &size, ch->pivot, w, &size, &info);
    if (info) w[0] = INFINITY;
  }
}

// Adds C_b W B_b to h and −C_b W² B_b to dh (may be NULL); returns the largest entry of the former.
static double add_block(const pb_channel *ch, size_t block, double complex s, double complex *h,
                        double complex *dh) {
  size_t m = ch->m, first = ch->start[block], size = ch->start[block + 1] - first;
  double complex *w = ch->work, *x = w + 2 * ch->widest * ch->widest, *x2 = x + size * m;
  const double *b = &ch->b[first * m], *c = &ch->c[first * m];
  double largest = 0;
  block_inverse(ch, block, s, w);
  for (size_t k = 0; k < size * m; k++) {  // X = W B, state by state
    x[k] = 0;
    for (size_t j = 0; j < size; j++) x[k] += w[k / m + j * size] * b[j * m + k % m];
  }
  for (size_t k = 0; dh && k < size * m; k++) {  // W² B
    x2[k] = 0;
    for (size_t j = 0; j < size; j++) x2[k] += w[k / m + j * size] * x[j * m + k % m];
  }
  for (size_t i = 0; i < m; i++) {
    for (size_t o = 0; o < m; o++) {
      double complex term = 0, slope = 0;
      for (size_t j = 0; j < size; j++) term += c[j * m + o] * x[j * m + i];
      for (size_t j = 0; dh && j < size; j++) slope += c[j * m + o] * x2[j * m + i];
      h[i * m + o] += term;
      if (dh) dh[i * m + o] -= slope;
      largest = fmax(largest, cabs(term));
    }
  }
  return largest;
}

void pb_channel_evaluate(const pb_channel *ch, double complex s, double complex *h,
                         double complex *dh, double *size) {
  const bool sampled = ch->period > 0;
  const double complex p = sampled ? cexp(s * ch->period) : s, through = sampled ? 1 / p : 1;
  double total = 0;
  for (size_t k = 0; k < ch->m * ch->m; k++) {
    h[k] = ch->d[k] * through;
    if (dh) dh[k] = sampled ? -h[k] * through : 0;
    total = fmax(total, cabs(h[k]));
  }
  for (size_t k = 0; k < ch->blocks; k++) total += add_block(ch, k, p, h, dh);
  for (size_t k = 0; dh && sampled && k < ch->m * ch->m; k++) dh[k] *= ch->period * p;
  *size = total;
}

double pb_channel_block_size(const pb_channel *ch, size_t block, double complex s) {
  double complex *term = ch->work + 2 * ch->widest * ch->widest + 2 * ch->widest * ch->m;
  for (size_t k = 0; k < ch->m * ch->m; k++) term[k] = 0;
  return add_block(ch, block, s, term, NULL);
}

// ---- building -----------------------------------------------------------------------------------

// |det A_b|^(1/size) by LU; the blocks are small.
static double block_radius(const double *a, size_t size, double *copy, int *pivot) {
  if (size == 1) return fabs(a[0]);
  if (size == 2) return sqrt(fabs(a[0] * a[3] - a[1] * a[2]));
  int n = (int)size, info = 0;
  double logarithm = 0;
  memcpy(copy, a, size * size * sizeof *copy);
  dgetrf_(&n, &n, copy, &n, pivot, &info);
  for (size_t i = 0; i < size; i++) logarithm += log(fabs(copy[i * (size + 1)]));
  return exp(logarithm / n);
}

static void copy_model(const pb_model *model, const size_t *input, const size_t *output,
                       pb_channel *ch) {
  size_t m = ch->m, nx = model->nx;
  memcpy(ch->start, model->block_start, (ch->blocks + 1) * sizeof *ch->start);
  memcpy(ch->value, model->block_value, (ch->blocks + 1) * sizeof *ch->value);
  memcpy(ch->a, model->a, ch->value[ch->blocks] * sizeof *ch->a);
  for (size_t k = 0; k < m; k++) {
    for (size_t j = 0; j < nx; j++) {
      ch->b[j * m + k] = model->b[input[k] * nx + j];
      ch->c[j * m + k] = model->c[j * model->ny + output[k]];
    }
    for (size_t o = 0; o < m; o++) ch->d[k * m + o] = model->d[input[k] * model->ny + output[o]];
  }
  for (size_t k = 0; k < ch->blocks; k++) {
    size_t size = ch->start[k + 1] - ch->start[k];
    ch->radius[k] = block_radius(&ch->a[ch->value[k]], size, (double *)ch->work, ch->pivot);
  }
}

// Mean logarithm of each entry of |H| over frequencies that span the blocks'; NAN where H is zero.
static void mean_logarithms(const pb_channel *ch, double *mean, double complex *h) {
  double low = INFINITY, high = 0, size;
  for (size_t k = 0; k < ch->blocks; k++) {
    if (ch->radius[k] > 0) low = fmin(low, ch->radius[k]);
    high = fmax(high, ch->radius[k]);
  }
  if (!(high > 0)) low = high = 1;
  for (size_t k = 0; k < ch->m * ch->m; k++) mean[k] = 0;
  for (int p = 0; p < SCALE_POINTS; p++) {
    double w = low * pow(high / low, (p + 0.5) / SCALE_POINTS);
    pb_channel_evaluate(ch, w * (0.1 + I), h, NULL,
                        &size);  // off the axis: no resonance stands out
    for (size_t k = 0; k < ch->m * ch->m; k++) mean[k] += log(cabs(h[k])) / SCALE_POINTS;
  }
  for (size_t k = 0; k < ch->m * ch->m; k++) {
    if (!isfinite(mean[k])) mean[k] = NAN;
  }
}

// Mean of the finite entries of a row or column of an m × m matrix; NAN: there is none.
static double line_mean(const double *entry, size_t m, size_t stride) {
  double sum = 0;
  size_t count = 0;
  for (size_t k = 0; k < m; k++) {
    if (isnan(entry[k * stride])) continue;
    sum += entry[k * stride];
    count++;
  }
  return count ? sum / (double)count : NAN;
}

// Scales column i of B and D by input[i], row o of C and D by output[o].
static void apply_scales(pb_channel *ch, const double *input, const double *output) {
  for (size_t j = 0; j < ch->n; j++) {
    for (size_t k = 0; k < ch->m; k++) {
      ch->b[j * ch->m + k] *= input[k];
      ch->c[j * ch->m + k] *= output[k];
    }
  }
  for (size_t i = 0; i < ch->m; i++) {
    for (size_t o = 0; o < ch->m; o++) ch->d[i * ch->m + o] *= input[i] * output[o];
  }
}

static pb_status scale_signals(pb_channel *ch, pb_error *err) {
  size_t m = ch->m;
  pb_status status = PB_OK;
  double *mean = malloc((m * m + 2 * m) * sizeof *mean), *input, *output;
  double complex *h = malloc(m * m * sizeof *h);
  if (!mean || !h) {
    status = pb_fail_memory(err, "zeros");
    goto done;
  }
  mean_logarithms(ch, mean, h);
  input = mean + m * m;
  output = input + m;
  for (size_t k = 0; k < m; k++) {
    output[k] = exp(-line_mean(mean + k, m, m));
    for (size_t i = 0; i < m; i++) mean[i * m + k] += log(output[k]);
  }
  for (size_t k = 0; k < m; k++) input[k] = exp(-line_mean(mean + k * m, m, 1));
  for (size_t k = 0; k < m; k++) {
    if (isfinite(input[k]) && isfinite(output[k])) continue;
    status = pb_fail(err, PB_ERR_SINGULAR, "zeros", "no input reaches one of the outputs");
    goto done;
  }
  apply_scales(ch, input, output);
done:
  free(mean);
  free(h);
  return status;
}

// The second state of a pair scaled so that the off-diagonal entries of A_b are of equal size: in
// companion form they are 1 and ω², which would cost the QZ method half of its digits.
static void balance_pair(pb_channel *ch, size_t block) {
  double *a = &ch->a[ch->value[block]];
  if (ch->start[block + 1] - ch->start[block] != 2 || a[1] == 0 || a[2] == 0) return;
  double factor = sqrt(fabs(a[1] / a[2]));
  size_t second = (ch->start[block] + 1) * ch->m;
  a[1] /= factor;
  a[2] *= factor;
  for (size_t k = 0; k < ch->m; k++) {
    ch->b[second + k] /= factor;
    ch->c[second + k] *= factor;
  }
}

// Then all states of each block by one factor (A stays), so that ‖B_b‖ = ‖C_b‖.
static void scale_states(pb_channel *ch) {
  for (size_t k = 0; k < ch->blocks; k++) {
    double b = 0, c = 0;
    balance_pair(ch, k);
    size_t from = ch->start[k] * ch->m, to = ch->start[k + 1] * ch->m;
    for (size_t j = from; j < to; j++) {
      b = hypot(b, ch->b[j]);
      c = hypot(c, ch->c[j]);
    }
    if (b == 0 || c == 0) continue;
    double factor = sqrt(c / b);
    for (size_t j = from; j < to; j++) {
      ch->b[j] *= factor;
      ch->c[j] /= factor;
    }
  }
}

pb_status pb_channel_open(const pb_model *model, const size_t *input, const size_t *output,
                          size_t count, pb_channel *out, pb_error *err) {
  size_t widest = 0;
  *out = (pb_channel){0};
  if (!count) return pb_fail(err, PB_ERR_ARGUMENT, "zeros", "no inputs and outputs are chosen");
  for (size_t k = 0; k < count; k++) {
    if (input[k] < model->nu && output[k] < model->ny) continue;
    return pb_fail(err, PB_ERR_ARGUMENT, "zeros", "an input or output index is out of range");
  }
  for (size_t k = 0; k < model->blocks; k++) {
    size_t size = model->block_start[k + 1] - model->block_start[k];
    if (size > widest) widest = size;
  }
  size_t values = model->block_value[model->blocks];
  if (!allocate(out, count, model->nx, model->blocks, values, widest)) {
    return pb_fail_memory(err, "zeros");
  }
  copy_model(model, input, output, out);
  pb_status status = scale_signals(out, err);
  if (!status) scale_states(out);
  return status;
}

// ---- parts --------------------------------------------------------------------------------------

static void keep_residual(pb_channel *ch, size_t block) {
  double complex *term = ch->work + 2 * ch->widest * ch->widest + 2 * ch->widest * ch->m;
  for (size_t k = 0; k < ch->m * ch->m; k++) term[k] = 0;
  add_block(ch, block, 0, term, NULL);
  for (size_t k = 0; k < ch->m * ch->m; k++) ch->d[k] += creal(term[k]);
}

void pb_channel_keep(pb_channel *ch, const bool *keep, bool residual) {
  size_t kept = 0, state = 0, value = 0;
  for (size_t k = 0; k < ch->blocks; k++) {
    size_t first = ch->start[k], size = ch->start[k + 1] - first;
    if (!keep[k]) {
      if (residual) keep_residual(ch, k);
      continue;
    }
    // Everything moves down only, so that the blocks still to come are untouched.
    memmove(ch->a + value, ch->a + ch->value[k], size * size * sizeof *ch->a);
    memmove(ch->b + state * ch->m, ch->b + first * ch->m, size * ch->m * sizeof *ch->b);
    memmove(ch->c + state * ch->m, ch->c + first * ch->m, size * ch->m * sizeof *ch->c);
    ch->radius[kept] = ch->radius[k];
    ch->start[kept] = state;
    ch->value[kept++] = value;
    state += size;
    value += size * size;
  }
  ch->blocks = kept;
  ch->start[kept] = ch->n = state;
  ch->value[kept] = value;
}

// ---- sampling -----------------------------------------------------------------------------------

// A_b ← e^{A_b T}, B_b ← ∫₀ᵀ e^{A_b s} ds B_b; space: 2 size² + size × m.
static pb_status sample_block(pb_channel *ch, size_t block, double period, double *space,
                              pb_error *err) {
  const size_t m = ch->m, first = ch->start[block], size = ch->start[block + 1] - first;
  double *ad = space, *gd = ad + size * size, *x = gd + size * size;
  double *a = &ch->a[ch->value[block]], *b = &ch->b[first * m];
  pb_status st = pb_block_discretize(size, a, period, ad, gd, err);
  if (st) return st;
  memcpy(x, b, size * m * sizeof *x);
  memcpy(a, ad, size * size * sizeof *a);
  for (size_t k = 0; k < size * m; k++) {
    b[k] = 0;
    for (size_t j = 0; j < size; j++) b[k] += gd[k / m + j * size] * x[j * m + k % m];
  }
  return PB_OK;
}

pb_status pb_channel_sample(const pb_channel *channel, double period, pb_channel *out,
                            pb_error *err) {
  pb_status st = pb_channel_copy(channel, out, err);
  if (st) return st;
  const size_t wide = channel->widest;
  double *space = malloc((2 * wide * wide + wide * channel->m + 1) * sizeof *space);
  if (!space) st = pb_fail_memory(err, "zeros");
  for (size_t k = 0; k < channel->blocks && !st; k++) st = sample_block(out, k, period, space, err);
  out->period = period;
  free(space);
  return st;
}

pb_status pb_channel_poles(const pb_channel *ch, double complex *pole, pb_error *err) {
  pb_status st = PB_OK;
  for (size_t k = 0; k < ch->blocks && !st; k++) {
    const size_t first = ch->start[k];
    st = pb_block_poles(ch->start[k + 1] - first, &ch->a[ch->value[k]], pole + first, err);
  }
  return st;
}
