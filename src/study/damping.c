// Attainable damping: see damping.h. The gains are swept twice: in equal ratios, then with more of
// them around the gains at which each mode, and the least damped of them, is damped most.
#include "study/damping.h"

#include <math.h>
#include <stdlib.h>

enum {
  SWEEP = 122,  // gains of the first sweep, 0 among them
  FINER = 6,    // gains put between two of the sweep, on either side of a best one
};

void pb_attainable_clear(pb_attainable *a) {
  if (!a) return;
  free(a->mode);
  pb_rootlocus_clear(&a->locus);
  *a = (pb_attainable){0};
}

// The gain at which a mode's damping is largest.
static size_t most_damped(const pb_rootlocus *l, size_t branch) {
  const pb_pole *p = l->pole + branch * l->gains;
  size_t best = 0;
  for (size_t k = 1; k < l->gains; k++)
    if (p[k].damping > p[best].damping) best = k;
  return best;
}

// A branch's damping at a gain. A pole that was real when it was seen last has left the band along
// the real axis; another that is lost is as good as unstable.
static double damping_of(const pb_rootlocus *l, size_t branch, size_t k) {
  const pb_pole *p = l->pole + branch * l->gains;
  size_t seen = k;
  while (seen > 0 && isnan(p[seen].hz)) seen--;
  if (seen == k) return p[k].damping;
  return cimag(p[seen].z) == 0 ? p[seen].damping : -1;
}

// The least damping at a gain, of the modes and of the controller's poles, which begin real: where
// a mode has split into two real poles, the slow one can make a pair again with one of these. What
// else begins in the band are modes above half the sample rate under another frequency.
static double smallest_damping(const pb_rootlocus *l, size_t k) {
  double smallest = INFINITY;
  for (size_t b = 0; b < l->branches; b++)
    if (l->is_mode[b] || cimag(l->pole[b * l->gains].z) == 0)
      smallest = fmin(smallest, damping_of(l, b, k));
  return smallest;
}

// The gain up to `last` with the largest smallest damping.
static size_t best_gain(const pb_rootlocus *l, size_t last) {
  size_t best = 0;
  double most = smallest_damping(l, 0);
  for (size_t k = 1; k <= last; k++) {
    double smallest = smallest_damping(l, k);
    if (smallest > most) most = smallest, best = k;
  }
  return best;
}

static int ascending(const void *a, const void *b) {
  const double *x = a, *y = b;
  return (*x > *y) - (*x < *y);
}

// Gains between the neighbours of gain k into gain[]; returns their number.
static size_t add_finer(const pb_rootlocus *l, size_t k, double *gain) {
  size_t count = 0;
  size_t low = k > 1 ? k - 1 : 1, high = k + 1 < l->gains ? k + 1 : l->gains - 1;
  for (; low < high; low++)
    for (int i = 1; i <= FINER; i++)
      gain[count++] = l->gain[low] * pow(l->gain[low + 1] / l->gain[low], i / (FINER + 1.0));
  return count;
}

// All gains of a sweep and those around its best ones, ascending, each once.
static size_t refine_gains(const pb_rootlocus *l, double *gain) {
  size_t count = 0, kept = 1;
  for (size_t k = 0; k < l->gains; k++) gain[count++] = l->gain[k];
  count += add_finer(l, best_gain(l, l->gains - 1), gain + count);
  for (size_t b = 0; b < l->branches; b++)
    if (l->is_mode[b]) count += add_finer(l, most_damped(l, b), gain + count);
  qsort(gain, count, sizeof *gain, ascending);
  for (size_t k = 1; k < count; k++)
    if (gain[k] > gain[kept - 1] * (1 + 1e-9)) gain[kept++] = gain[k];
  return kept;
}

static pb_status follow(pb_loop_solver *s, double f1, double f2, pb_rootlocus *out, pb_error *err) {
  double sweep[SWEEP] = {0}, unit = 1, *gain = NULL;
  pb_rootlocus first = {0};
  pb_status status = pb_loop_unit_gain(pb_loop_solver_loop(s), f1, f2, &unit, err);
  for (int k = 1; k < SWEEP; k++) sweep[k] = unit * pow(10, 4.0 * (k - 1) / (SWEEP - 2) - 2);
  if (!status) status = pb_rootlocus_compute(s, sweep, SWEEP, 0, f2, &first, err);
  if (!status) {
    gain = malloc((SWEEP + (first.branches + 1) * 2 * FINER) * sizeof *gain);
    if (!gain) status = pb_fail_memory(err, "attainable damping");
  }
  if (!status) {
    size_t count = refine_gains(&first, gain);
    status = pb_rootlocus_compute(s, gain, count, 0, f2, out, err);
  }
  free(gain);
  pb_rootlocus_clear(&first);
  return status;
}

// The largest gain of the locus that keeps the loop stable: instability is taken to stay once it is
// there. 0 where none does.
static pb_status last_stable(pb_loop_solver *s, const pb_rootlocus *l, size_t *last,
                             pb_error *err) {
  size_t good = 0, bad = l->gains;
  pb_status status = PB_OK;
  while (bad - good > 1 && !status) {
    bool stable = false;
    size_t middle = bad == l->gains ? bad - 1 : (good + bad) / 2;
    status = pb_loop_solver_stable(s, l->gain[middle], &stable, NULL, err);
    if (stable)
      good = middle;
    else
      bad = middle;
    if (stable && middle == l->gains - 1) break;
  }
  *last = good;
  return status;
}

static int by_frequency(const void *a, const void *b) {
  const pb_attainable_mode *p = a, *q = b;
  return (p->open.hz > q->open.hz) - (p->open.hz < q->open.hz);
}

static pb_status list_modes(pb_attainable *a, double f1, double f2, pb_error *err) {
  a->mode = malloc((a->locus.branches + 1) * sizeof *a->mode);
  if (!a->mode) return pb_fail_memory(err, "attainable damping");
  for (size_t b = 0; b < a->locus.branches; b++) {
    const pb_pole *p = a->locus.pole + b * a->locus.gains;
    if (p[0].hz < f1) a->locus.is_mode[b] = false;
    if (!a->locus.is_mode[b]) continue;
    size_t k = most_damped(&a->locus, b);
    a->mode[a->modes++] =
        (pb_attainable_mode){.open = p[0], .damping = p[k].damping, .gain = a->locus.gain[k]};
  }
  qsort(a->mode, a->modes, sizeof *a->mode, by_frequency);
  if (a->modes > 0) return PB_OK;
  return pb_fail(err, PB_ERR_STATE, "attainable damping", "no mode in %g … %g Hz", f1, f2);
}

static pb_gain_choice choice(const pb_rootlocus *l, size_t k) {
  return (pb_gain_choice){l->gain[k], smallest_damping(l, k)};
}

pb_status pb_attainable_find(pb_loop_solver *s, pb_loop_solver *whole, double f1, double f2,
                             pb_attainable *out, pb_error *err) {
  size_t last = 0;
  *out = (pb_attainable){0};
  pb_status status = follow(s, f1, f2, &out->locus, err);
  if (!status) status = list_modes(out, f1, f2, err);
  if (!status) status = last_stable(whole, &out->locus, &last, err);
  if (status) {
    pb_attainable_clear(out);
    return status;
  }
  out->chosen = best_gain(&out->locus, out->locus.gains - 1);
  out->best = choice(&out->locus, out->chosen);
  out->stable = choice(&out->locus, best_gain(&out->locus, last));
  out->stable_to = out->locus.gain[last];
  return PB_OK;
}

pb_status pb_model_lowest(const pb_model *m, pb_model **out, pb_error *err) {
  *out = NULL;
  if (m->nx <= PB_DAMPING_STATES) return PB_OK;
  size_t kept = m->modes < PB_DAMPING_STATES / 2 ? m->modes : PB_DAMPING_STATES / 2;
  while (kept > 1 && kept < m->modes && m->mode_hz[kept] < 1.02 * m->mode_hz[kept - 1]) kept--;
  double hz =
      kept < m->modes ? sqrt(m->mode_hz[kept - 1] * m->mode_hz[kept]) : 2 * m->mode_hz[kept - 1];
  return pb_model_truncate(m, hz, out, err);
}
