// See sampled_roots.h.
#include "model/sampled_roots.h"

#include <math.h>
#include <stdlib.h>

#include "model/zeros.h"
#include "model/zeros_finder.h"

static const double two_pi = 6.283185307179586476925286766559;
static const double rounding = 1e-9;  // of a damping ratio

enum { STAGES = 8 };  // periods on the way from 0 to that of the model

// ---- a root -------------------------------------------------------------------------------------

static double damping_of(double complex s) {
  return s != 0 ? -creal(s) / cabs(s) : 0;
}

static pb_sampled_root root_of(double complex s) {
  return (pb_sampled_root){
      .s = s, .hz = cabs(s) / two_pi, .damping = damping_of(s), .multiplicity = 1};
}

// sampled: ln(z)/T.
static void set_sampled(pb_sampled_root *root, double complex sampled, double period) {
  root->has_sampled = true;
  root->z = cexp(sampled * period);
  root->sampled_hz = cabs(sampled) / two_pi;
  root->sampled_damping = damping_of(sampled);
  root->sign_differs = (root->damping < -rounding) != (root->sampled_damping < -rounding);
}

static void count_equal(pb_sampled_root *root, size_t count) {
  for (size_t k = 0; k < count;) {
    size_t end = k + 1;
    while (end < count && root[end].s == root[k].s) end++;
    for (size_t i = k; i < end; i++) root[i].multiplicity = end - k;
    k = end;
  }
}

// ---- zeros --------------------------------------------------------------------------------------

typedef struct follower {
  pb_sampled_root *root;
  double complex *at;  // [count] where each of them is now
  bool *lost;          // [count]
  size_t count;
  double complex *pole;  // [poles] of the channel
  size_t poles;
} follower;

// Distance from `centre` to the nearest other zero, or a conjugate.
static double clearance(const follower *w, size_t first, size_t many, double complex centre) {
  double distance = INFINITY;
  for (size_t k = 0; k < w->count; k++) {
    const bool own = k >= first && k < first + many;
    if (w->lost[k]) continue;
    if (!own) distance = fmin(distance, cabs(w->at[k] - centre));
    if (!own || cimag(centre) != 0) distance = fmin(distance, cabs(conj(w->at[k]) - centre));
  }
  return distance;
}

// The largest circle around `centre` without other zeros and poles.
static double circle(const follower *w, size_t first, size_t many, double complex centre,
                     double scale) {
  double distance = clearance(w, first, many, centre);
  for (size_t k = 0; k < w->poles; k++) distance = fmin(distance, cabs(w->pole[k] - centre));
  return fmin(0.2 * scale, 0.4 * distance);
}

// Newton's method, else the one zero inside a circle that no other zero shares.
static bool follow_one(const follower *w, size_t k, pb_zero_finder *f) {
  double complex s = w->at[k], inside[PB_ZEROS_INSIDE];
  const double scale = pb_zero_scale(f, s);
  f->reach = fmin(0.2, 0.4 * clearance(w, k, 1, s) / scale);
  const bool found = pb_zero_polish(f, &s);
  if (!found) {
    if (pb_zeros_inside(f, w->at[k], circle(w, k, 1, w->at[k], scale), inside) != 1) return false;
    s = inside[0];
  }
  if (cimag(w->at[k]) == 0) s = creal(s);
  w->at[k] = s;
  return cimag(s) >= 0;
}

// Zeros of higher order: as many inside a circle, whatever they have become.
static bool follow_many(const follower *w, size_t first, size_t many, pb_zero_finder *f) {
  double complex centre = 0, inside[PB_ZEROS_INSIDE];
  for (size_t k = first; k < first + many; k++) centre += w->at[k] / (double)many;
  const double scale = pb_zero_scale(f, centre);
  const bool real = fabs(cimag(centre)) < 1e-9 * scale;
  if (real) centre = creal(centre);
  const double radius = circle(w, first, many, centre, scale);
  if (pb_zeros_inside(f, centre, radius, inside) != many) return false;
  for (size_t k = 0; k < many; k++) {
    w->at[first + k] = inside[k];
    if (real && fabs(cimag(inside[k])) < 1e-6 * scale) w->at[first + k] = creal(inside[k]);
  }
  return true;
}

// One stage: all zeros at this period.
static pb_status follow(follower *w, const pb_channel *channel, double period, pb_error *err) {
  pb_channel sampled = {0};
  pb_zero_finder f = {0};
  pb_status st = pb_channel_sample(channel, period, &sampled, err);
  if (!st && !pb_zero_finder_open(&f, &sampled)) st = pb_fail_memory(err, "zeros");
  for (size_t k = 0; k < w->count && !st;) {
    const size_t many = w->root[k].multiplicity;
    if (!w->lost[k]) {
      const bool kept = many == 1 ? follow_one(w, k, &f) : follow_many(w, k, many, &f);
      for (size_t i = k; i < k + many; i++) w->lost[i] = !kept;
    }
    k += many;
  }
  pb_zero_finder_close(&f);
  pb_channel_free(&sampled);
  return st;
}

// At the origin the static response is 0 in either time: one zero stays at z = 1. Others of it, and
// those above Nyquist, are not followed.
static void begin(follower *w, double period) {
  for (size_t k = 0; k < w->count; k++) {
    w->at[k] = w->root[k].s;
    w->lost[k] = w->root[k].s == 0 || cabs(w->root[k].s) >= 0.5 * two_pi / period;
  }
}

static pb_status follow_all(pb_sampled_root *root, size_t count, const pb_channel *channel,
                            double period, pb_error *err) {
  follower w = {.root = root, .count = count, .poles = channel->n};
  w.at = malloc((count + 1) * sizeof *w.at);
  w.lost = malloc((count + 1) * sizeof *w.lost);
  w.pole = malloc((channel->n + 1) * sizeof *w.pole);
  pb_status st = w.at && w.lost && w.pole ? pb_channel_poles(channel, w.pole, err)
                                          : pb_fail_memory(err, "zeros");
  if (!st) begin(&w, period);
  for (int stage = 1; stage <= STAGES && !st; stage++)
    st = follow(&w, channel, period * stage / STAGES, err);
  for (size_t k = 0; k < count && !st; k++) {
    const bool at_origin = root[k].s == 0 && (k == 0 || root[k - 1].s != 0);
    if (at_origin) w.at[k] = 0;
    if (!w.lost[k] || at_origin) set_sampled(&root[k], w.at[k], period);
  }
  free(w.at);
  free(w.lost);
  free(w.pole);
  return st;
}

pb_status pb_model_sampled_zeros(const pb_model *model, const size_t *input, const size_t *output,
                                 size_t channels, double max_hz, pb_sampled_root **out,
                                 size_t *count, pb_error *err) {
  double complex *zero = NULL;
  size_t zeros = 0, kept = 0;
  pb_channel channel = {0};
  *out = NULL;
  *count = 0;
  pb_status st = pb_model_zeros(model, input, output, channels, max_hz, &zero, &zeros, err);
  pb_sampled_root *root = st ? NULL : malloc((zeros + 1) * sizeof *root);
  if (!st && !root) st = pb_fail_memory(err, "zeros");
  for (size_t k = 0; k < zeros && !st; k++)
    if (cimag(zero[k]) >= 0) root[kept++] = root_of(zero[k]);
  if (!st) count_equal(root, kept);
  if (!st) st = pb_channel_open(model, input, output, channels, &channel, err);
  if (!st) st = pb_channel_drop_unseen(&channel, err);
  if (!st) st = follow_all(root, kept, &channel, 1 / model->sample_rate, err);
  pb_channel_free(&channel);
  free(zero);
  if (st) {
    free(root);
    return st;
  }
  *out = root;
  *count = kept;
  return PB_OK;
}

// ---- poles --------------------------------------------------------------------------------------

static int by_size(const void *a, const void *b) {
  const pb_sampled_root *x = a, *y = b;
  if (x->hz != y->hz) return x->hz < y->hz ? -1 : 1;
  return (x->damping > y->damping) - (x->damping < y->damping);
}

pb_status pb_model_sampled_poles(const pb_model *model, double max_hz, pb_sampled_root **out,
                                 size_t *count, pb_error *err) {
  const double period = 1 / model->sample_rate;
  double complex *pole = malloc((model->nx + 1) * sizeof *pole);
  pb_sampled_root *root = malloc((model->nx + 1) * sizeof *root);
  size_t kept = 0;
  *out = NULL;
  *count = 0;
  pb_status st =
      pole && root ? pb_model_poles(model, PB_CONTINUOUS, pole, err) : pb_fail_memory(err, "poles");
  for (size_t k = 0; k < model->nx && !st; k++) {
    if (cimag(pole[k]) < 0 || (max_hz > 0 && cabs(pole[k]) > two_pi * max_hz)) continue;
    pb_sampled_root r = root_of(pole[k]);
    const double complex z = cexp(pole[k] * period);
    const bool below = cimag(pole[k]) < 0.5 * two_pi / period;
    set_sampled(&r, below || z == 0 ? pole[k] : clog(z) / period, period);
    r.has_sampled = below;
    if (!below) r.sign_differs = false;
    root[kept++] = r;
  }
  free(pole);
  if (st) {
    free(root);
    return st;
  }
  qsort(root, kept, sizeof *root, by_size);
  count_equal(root, kept);
  *out = root;
  *count = kept;
  return PB_OK;
}
