// The search for the best gain: see rootlocus.h.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "control/rootlocus_internal.h"

enum { SEARCH_GAINS = 41, REFINE_GAINS = 9, REFINE_ROUNDS = 2 };

void pb_best_gain_clear(pb_best_gain *best) {
  if (!best) return;
  free(best->attainable);
  free(best->attained_at);
  free(best->out_hz);
  free(best->out_damping);
  free(best->out_most);
  *best = (pb_best_gain){0};
}

pb_status pb_loop_unit_gain(const pb_loop *loop, double f1, double f2, double *gain,
                            pb_error *err) {
  enum { POINTS = 25 };
  size_t n = loop->controller->ny;
  double hz[POINTS];
  double complex *l = malloc(POINTS * n * n * sizeof *l);
  if (!l) return pb_fail_memory(err, "best gain");
  for (int k = 0; k < POINTS; k++) hz[k] = f1 * pow(f2 / f1, (k + 0.5) / POINTS);
  pb_status status = pb_loop_gain(loop, 1, hz, POINTS, l, err);
  double mean = 0;
  for (size_t k = 0; status == PB_OK && k < POINTS; k++) {
    double largest = 0;
    for (size_t r = 0; r < n; r++) {
      double sum = 0;
      for (size_t c = 0; c < n; c++) sum += cabs(l[(k * n + r) * n + c]);
      largest = fmax(largest, sum);
    }
    mean += log(largest) / POINTS;
  }
  free(l);
  if (status == PB_OK && !isfinite(mean)) {
    status = pb_fail(err, PB_ERR_STATE, "best gain", "the loop has no gain in %g … %g Hz", f1, f2);
  }
  *gain = exp(-mean);
  return status;
}

// Index of the largest smallest damping among stable gains, or `gains` when there is none.
static size_t best_of(const pb_rootlocus *l, const bool *unstable) {
  size_t best = l->gains;
  for (size_t k = 1; k < l->gains; k++) {
    if (unstable[k]) continue;
    if (best == l->gains || l->smallest[k] > l->smallest[best]) best = k;
  }
  return best;
}

static pb_status can_be_doubled(pb_loop_solver *s, double gain, bool *yes, pb_error *err) {
  return pb_loop_solver_stable(s, 2 * gain, yes, NULL, err);
}

// Leaves out gains that cannot be doubled, as all poles of the whole plant say. Instability is
// taken to stay once it is there, so that the last good gain up to the best one is found by
// bisection; *limit is then where between it and the next one doubling ends, to 0.5 %.
static pb_status keep_margin(pb_loop_solver *s, const pb_rootlocus *l, bool *unstable,
                             double *limit, pb_error *err) {
  size_t bad = best_of(l, unstable), good = 0;
  bool yes;
  *limit = INFINITY;
  if (bad == l->gains) return PB_OK;
  pb_status status = can_be_doubled(s, l->gain[bad], &yes, err);
  if (status != PB_OK) return status;
  if (yes) good = bad++;
  while (bad - good > 1 && status == PB_OK) {
    size_t middle = (good + bad) / 2;
    status = can_be_doubled(s, l->gain[middle], &yes, err);
    if (yes)
      good = middle;
    else
      bad = middle;
  }
  for (size_t k = good + 1; k < l->gains; k++) unstable[k] = true;
  double low = l->gain[good], high = bad < l->gains ? l->gain[bad] : low;
  if (status == PB_OK) status = can_be_doubled(s, high, &yes, err);
  if (yes) low = high;
  while (status == PB_OK && high > 1.005 * low && low > 0) {
    double middle = sqrt(low * high);
    status = can_be_doubled(s, middle, &yes, err);
    *(yes ? &low : &high) = middle;
  }
  *limit = low;
  return status;
}

static double most_of(const pb_rootlocus *l, size_t branch) {
  const pb_pole *p = l->pole + branch * l->gains;
  double most = 0;
  for (size_t k = 1; k < l->gains; k++) most = fmax(most, p[k].damping);
  return most;
}

static bool is_reached(const pb_rootlocus *l, size_t branch) {
  const double most = most_of(l, branch);
  return l->is_mode[branch] && most > 0.01 && most > 3 * l->pole[branch * l->gains].damping;
}

static pb_status note_left_out(const pb_rootlocus *l, pb_best_gain *out, pb_error *err) {
  out->out_hz = malloc((l->branches + 1) * sizeof *out->out_hz);
  out->out_damping = malloc((l->branches + 1) * sizeof *out->out_damping);
  out->out_most = malloc((l->branches + 1) * sizeof *out->out_most);
  if (!out->out_hz || !out->out_damping || !out->out_most) return pb_fail_memory(err, "best gain");
  for (size_t b = 0; b < l->branches; b++) {
    if (!l->is_mode[b] || is_reached(l, b)) continue;
    const pb_pole *p = l->pole + b * l->gains;
    out->out_hz[out->left_out] = p->hz;
    out->out_damping[out->left_out] = p->damping;
    out->out_most[out->left_out++] = most_of(l, b);
  }
  return PB_OK;
}

// Modes that no gain damps beyond 1 % and three times what they have are not counted against a
// gain, unless there are no others.
static pb_status forget_unreachable(pb_rootlocus *l, pb_best_gain *out, pb_error *err) {
  size_t reachable = 0;
  for (size_t b = 0; b < l->branches; b++) reachable += is_reached(l, b);
  pb_status status = reachable > 0 ? note_left_out(l, out, err) : PB_OK;
  for (size_t b = 0; b < l->branches && reachable > 0; b++) l->is_mode[b] = is_reached(l, b);
  for (size_t k = 0; k < l->gains; k++) pb_rootlocus_find_smallest(l, k);
  return status;
}

// What the modes have at gain k where that is more than was attained so far.
static void note_attained(const pb_rootlocus *l, size_t k, pb_best_gain *out) {
  size_t mode = 0;
  for (size_t b = 0; b < l->branches; b++) {
    if (!l->is_mode[b]) continue;
    double damping = l->pole[b * l->gains + k].damping;
    if (damping > out->attainable[mode]) {
      out->attainable[mode] = damping;
      out->attained_at[mode] = l->gain[k];
    }
    mode++;
  }
}

// Repeats the search between the neighbours of the best gain, starting from the lower one's poles.
// Not beyond `limit`.
static pb_status refine(pb_loop_solver *s, const pb_rootlocus *from, double limit, size_t best,
                        unsigned rounds, pb_best_gain *out, pb_error *err) {
  size_t low = best - 1, high = best + 1 < from->gains ? best + 1 : best;
  out->gain = from->gain[best];
  out->smallest_damping = from->smallest[best];
  note_attained(from, best, out);
  if (rounds == 0) return PB_OK;
  pb_rootlocus l;
  const bool allowed[REFINE_GAINS] = {false};
  pb_status status = pb_rootlocus_new(REFINE_GAINS, from->branches, &l, err);
  if (status != PB_OK) return status;
  memcpy(l.is_mode, from->is_mode, l.branches * sizeof *l.is_mode);
  for (size_t b = 0; b < l.branches; b++) l.pole[b * l.gains] = from->pole[b * from->gains + low];
  double g1 = from->gain[low], g2 = fmin(from->gain[high], limit);
  for (size_t k = 0; k < l.gains; k++) {
    l.gain[k] = g1 + (g2 - g1) * (double)k / (double)(l.gains - 1);
  }
  status = pb_rootlocus_follow(s, &l, err);
  size_t finer = status == PB_OK ? best_of(&l, allowed) : l.gains;
  if (finer < l.gains && l.smallest[finer] >= from->smallest[best]) {
    status = refine(s, &l, limit, finer, rounds - 1, out, err);
  }
  pb_rootlocus_clear(&l);
  return status;
}

static pb_status attainable(const pb_rootlocus *l, const bool *unstable, pb_best_gain *out,
                            pb_error *err) {
  for (size_t b = 0; b < l->branches; b++) out->modes += l->is_mode[b];
  out->attainable = malloc((out->modes + 1) * sizeof *out->attainable);
  out->attained_at = malloc((out->modes + 1) * sizeof *out->attained_at);
  if (!out->attainable || !out->attained_at) return pb_fail_memory(err, "best gain");
  size_t mode = 0;
  for (size_t b = 0; b < l->branches; b++) {
    if (!l->is_mode[b]) continue;
    out->attainable[mode] = l->pole[b * l->gains].damping;
    out->attained_at[mode++] = 0;
  }
  for (size_t k = 1; k < l->gains; k++)
    if (!unstable[k]) note_attained(l, k, out);
  return PB_OK;
}

pb_status pb_best_gain_find(pb_loop_solver *s, double f1, double f2, double decades,
                            pb_best_gain *out, pb_error *err) {
  *out = (pb_best_gain){0};
  if (!(f1 > 0 && f1 < f2 && isfinite(f2)) || !(decades >= 0 && decades < 10)) {
    return pb_fail(err, PB_ERR_ARGUMENT, "best gain", "band %g … %g Hz, %g decades", f1, f2,
                   decades);
  }
  if (decades == 0) decades = 2;
  double unit = 1, limit = INFINITY;
  pb_rootlocus l = {0};
  bool unstable[SEARCH_GAINS] = {false};
  pb_status status = pb_loop_unit_gain(pb_loop_solver_loop(s), f1, f2, &unit, err);
  if (status == PB_OK) status = pb_rootlocus_start(s, SEARCH_GAINS, f1, f2, &l, err);
  if (status != PB_OK) goto done;
  l.gain[0] = 0;
  for (size_t k = 1; k < l.gains; k++) {
    double step = (double)(k - 1) / (SEARCH_GAINS - 2);
    l.gain[k] = unit * pow(10, decades * (2 * step - 1));
  }
  status = pb_rootlocus_follow(s, &l, err);
  if (status == PB_OK) status = forget_unreachable(&l, out, err);
  if (status == PB_OK) {
    status = keep_margin(s, &l, unstable, &limit, err);
  }
  if (status == PB_OK) status = attainable(&l, unstable, out, err);
  if (status != PB_OK) goto done;
  size_t best = best_of(&l, unstable);
  if (out->modes == 0 || best == l.gains || l.smallest[best] <= 0) {
    status = pb_fail(err, PB_ERR_STATE, "best gain",
                     "%zu modes in %g … %g Hz, none damped by a stable gain", out->modes, f1, f2);
    goto done;
  }
  status = refine(s, &l, limit, best, REFINE_ROUNDS, out, err);
done:
  pb_rootlocus_clear(&l);
  if (status != PB_OK) pb_best_gain_clear(out);
  return status;
}
