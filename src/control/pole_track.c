// Following the poles of a loop over its gain: see pole_track.h.
#include "control/pole_track.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "control/loop_internal.h"

// How often a step may be halved. Where all poles are paired each time costs as many eigenvalue
// problems again, and one has been enough.
enum { HALVINGS = 6, HALVINGS_PAIRED = 1 };
// Poles this near to one another, relative to their distance from z = 1, may change places unseen.
static const double alike = 1e-3;
static const double smallest_z = 0.3;  // below, poles vanish within a few samples
// A pairing is clear when exchanging two poles makes it so many times as bad.
static const double clear = 3;
// How far an exact pole may be from its guess: relative to z − 1, and to the next pole's distance.
static const double sure_part = 0.1, sure_gap = 0.3;

void pb_pole_track_clear(pb_pole_track *t) {
  if (!t) return;
  free(t->z);
  free(t->before);
  free(t->guess);
  free(t->watched);
  free(t->lost);
  free(t->index);
  pb_assignment_clear(&t->assignment);
  *t = (pb_pole_track){0};
}

// ---- start --------------------------------------------------------------------------------------

// The poles of the dense loop nearest to z[wanted], each once.
static pb_status find_wanted(pb_pole_track *t, const double complex *z, pb_error *err) {
  pb_assignment a = {0};
  pb_status status = pb_assignment_new(t->wanted, t->count, &a, err);
  if (status != PB_OK) return status;
  for (size_t k = 0; k < t->wanted; k++)
    for (size_t p = 0; p < t->count; p++) a.cost[k * t->count + p] = cabs(t->z[p] - z[k]);
  pb_assignment_solve(&a);
  memcpy(t->index, a.column, t->wanted * sizeof *t->index);
  pb_assignment_clear(&a);
  return PB_OK;
}

static pb_status allocate(pb_pole_track *t, pb_error *err) {
  t->before = malloc((t->count + 1) * sizeof *t->before);
  t->guess = malloc((t->count + 1) * sizeof *t->guess);
  t->watched = calloc(t->count + 1, sizeof *t->watched);
  t->lost = calloc(t->count + 1, sizeof *t->lost);
  t->index = malloc((t->wanted + 1) * sizeof *t->index);
  return t->before && t->guess && t->watched && t->lost && t->index
             ? PB_OK
             : pb_fail_memory(err, "root locus");
}

pb_status pb_pole_track_start(pb_loop_solver *s, double gain, const double complex *z,
                              size_t wanted, pb_pole_track *out, pb_error *err) {
  *out = (pb_pole_track){.solver = s, .wanted = wanted, .gain = gain, .gain_before = gain};
  pb_status status = PB_OK;
  if (s->exact) {
    status = pb_loop_all_poles(s, gain, &out->z, &out->count, err);
    if (status == PB_OK) status = pb_assignment_new(out->count, out->count, &out->assignment, err);
  } else {
    out->count = wanted;
    out->z = malloc((wanted + 1) * sizeof *out->z);
    if (!out->z) status = pb_fail_memory(err, "root locus");
  }
  if (status == PB_OK) status = allocate(out, err);
  if (status == PB_OK && s->exact) status = find_wanted(out, z, err);
  if (status != PB_OK) {
    pb_pole_track_clear(out);
    return status;
  }
  for (size_t k = 0; k < wanted; k++) {
    if (!s->exact) out->index[k] = k;
    out->z[out->index[k]] = z[k];
    out->watched[out->index[k]] = true;
  }
  memcpy(out->before, out->z, out->count * sizeof *out->z);
  return PB_OK;
}

// ---- one step -----------------------------------------------------------------------------------

// On the line through the last two points, in z.
static void predict(pb_pole_track *t, double gain) {
  double last = t->gain - t->gain_before, ratio = last > 0 ? (gain - t->gain) / last : 0;
  // Steps that grow are extrapolated by at most twice the last one.
  ratio = fmin(ratio, 2);
  for (size_t k = 0; k < t->count; k++) t->guess[k] = t->z[k] + ratio * (t->z[k] - t->before[k]);
}

static bool are_alike(double complex a, double complex b) {
  return cabs(a - b) <= alike * cabs(a - 1);
}

// ---- all poles, paired

static void pair(pb_pole_track *t, const double complex *next) {
  for (size_t k = 0; k < t->count; k++)
    for (size_t p = 0; p < t->count; p++)
      t->assignment.cost[k * t->count + p] = cabs(next[p] - t->guess[k]);
  pb_assignment_solve(&t->assignment);
}

// Whether two poles could as well have been paired the other way round, and it makes a difference:
// not for conjugates, nor for poles that are one.
static bool is_doubtful(const pb_pole_track *t, const double complex *next, size_t a, size_t b) {
  const double *cost = t->assignment.cost;
  size_t n = t->count, p = t->assignment.column[a], q = t->assignment.column[b];
  double own = cost[a * n + p] + cost[b * n + q], other = cost[a * n + q] + cost[b * n + p];
  if (other >= clear * own) return false;
  if (cabs(next[p]) < smallest_z && cabs(next[q]) < smallest_z) return false;
  return !are_alike(t->z[a], conj(t->z[b])) && !are_alike(next[p], next[q]) &&
         !are_alike(t->guess[a], t->guess[b]);
}

static bool is_clear(const pb_pole_track *t, const double complex *next) {
  for (size_t a = 0; a < t->count; a++)
    for (size_t b = 0; t->watched[a] && b < t->count; b++)
      if (b != a && is_doubtful(t, next, a, b)) return false;
  return true;
}

// ---- some poles, made exact

// How far pole k may be from its guess.
static double reach(const pb_pole_track *t, size_t k) {
  double least = sure_part * cabs(t->guess[k] - 1);
  for (size_t j = 0; j < t->count; j++)
    if (!are_alike(t->guess[k], t->guess[j]))
      least = fmin(least, sure_gap * cabs(t->guess[k] - t->guess[j]));
  return least;
}

// Exact poles into next[]; *sure: all are found, and near their guesses.
static pb_status make_exact(pb_pole_track *t, double gain, double complex *next, bool *sure,
                            pb_error *err) {
  memcpy(next, t->guess, t->count * sizeof *next);
  pb_status status = pb_loop_refine_roots(t->solver, gain, next, t->count, t->lost, err);
  *sure = true;
  for (size_t k = 0; k < t->count && status == PB_OK; k++) {
    double moved = cabs(next[k] - t->guess[k]);
    *sure = *sure && !t->lost[k] && (moved <= reach(t, k) || are_alike(next[k], t->guess[k]));
    if (t->lost[k]) next[k] = t->guess[k];
  }
  return status;
}

// ---- both

static pb_status find_next(pb_pole_track *t, double gain, double complex **next, bool *sure,
                           pb_error *err) {
  size_t count;
  *next = NULL;
  predict(t, gain);
  if (!t->solver->exact) {
    *next = malloc((t->count + 1) * sizeof **next);
    return *next ? make_exact(t, gain, *next, sure, err) : pb_fail_memory(err, "root locus");
  }
  pb_status status = pb_loop_all_poles(t->solver, gain, next, &count, err);
  if (status != PB_OK) return status;
  pair(t, *next);
  *sure = is_clear(t, *next);
  return PB_OK;
}

static void accept(pb_pole_track *t, double gain, const double complex *next) {
  memcpy(t->before, t->z, t->count * sizeof *t->z);
  for (size_t k = 0; k < t->count; k++)
    t->z[k] = next[t->solver->exact ? t->assignment.column[k] : k];
  t->gain_before = t->gain;
  t->gain = gain;
}

static pb_status advance(pb_pole_track *t, double gain, unsigned halvings, pb_error *err) {
  double complex *next;
  bool sure = false;
  pb_status status = find_next(t, gain, &next, &sure, err);
  if (status == PB_OK && (sure || halvings == 0)) {
    accept(t, gain, next);
  } else if (status == PB_OK) {
    status = advance(t, 0.5 * (t->gain + gain), halvings - 1, err);
    if (status == PB_OK) status = advance(t, gain, halvings - 1, err);
  }
  free(next);
  return status;
}

pb_status pb_pole_track_advance(pb_pole_track *t, double gain, pb_error *err) {
  return advance(t, gain, t->solver->exact ? HALVINGS_PAIRED : HALVINGS, err);
}

pb_pole pb_pole_track_get(const pb_pole_track *t, size_t k) {
  double complex z = t->z[t->index[k]];
  if (fabs(cimag(z)) < 1e-12 * cabs(z)) z = creal(z);  // real but for rounding
  if (cimag(z) < 0) z = conj(z);
  pb_pole pole = pb_pole_from_z(z, t->solver->loop.model->sample_rate);
  // At z = 0 a pole has no frequency.
  if (t->lost[t->index[k]] || !isfinite(pole.hz)) pole.hz = pole.damping = NAN;
  return pole;
}
