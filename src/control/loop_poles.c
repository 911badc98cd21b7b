// Closed-loop poles of small and large plants: see loop.h.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "control/loop.h"
#include "control/loop_internal.h"
#include "control/lti_ops.h"
#include "signal/small_solve.h"

enum { REDUCED_STATES = 120, MAX_ITERATIONS = 60 };
// A root counts as found when its s stands still to this part: a double root cannot do much better.
static const double good_enough = 1e-4;
static const double smallest_z = 0.3;  // poles below vanish within a few samples
static const double doubtful_z = 0.8;  // starts below may be the reduction's own

const pb_loop *pb_loop_solver_loop(const pb_loop_solver *solver) {
  return &solver->loop;
}

void pb_loop_solver_free(pb_loop_solver *s) {
  if (!s) return;
  pb_lti_free(&s->plant);
  free(s->channels.b);
  free(s->channels.bd);
  free(s->channels.c);
  free(s->channels.d);
  free(s->channels.input_electronics);
  free(s->channels.output_electronics);
  free(s->open);
  free(s->far);
  free(s->h);
  free(s->dh);
  free(s->k);
  free(s->dk);
  free(s->m);
  free(s->rhs);
  free(s);
}

// The model's A with the loop's columns of B and rows of C: evaluation then costs no more than
// needed.
static pb_status select_channels(pb_loop_solver *s, pb_error *err) {
  const pb_model *m = s->loop.model;
  size_t nu = s->loop.controller->ny, ny = s->loop.controller->nu, nx = m->nx;
  pb_model *c = &s->channels;
  *c = *m;
  c->nu = nu;
  c->ny = ny;
  c->input_electronics = c->output_electronics = NULL;  // the model's: see select_electronics
  c->b = malloc((nx * nu + 1) * sizeof *c->b);
  c->bd = malloc((nx * nu + 1) * sizeof *c->bd);
  c->c = malloc((ny * nx + 1) * sizeof *c->c);
  c->d = malloc(ny * nu * sizeof *c->d);
  if (!c->b || !c->bd || !c->c || !c->d) return pb_fail_memory(err, "loop");
  for (size_t i = 0; i < nu; i++) {
    memcpy(c->b + i * nx, m->b + s->loop.input[i] * nx, nx * sizeof *c->b);
    memcpy(c->bd + i * nx, m->bd + s->loop.input[i] * nx, nx * sizeof *c->bd);
  }
  for (size_t o = 0; o < ny; o++) {
    size_t row = s->loop.output[o];
    for (size_t k = 0; k < nx; k++) c->c[o + k * ny] = m->c[row + k * m->ny];
    for (size_t i = 0; i < nu; i++) c->d[o + i * ny] = m->d[row + s->loop.input[i] * m->ny];
  }
  return PB_OK;
}

// Their electronics with them; counts the delays.
static pb_status select_electronics(pb_loop_solver *s, pb_error *err) {
  const pb_model *m = s->loop.model;
  pb_model *c = &s->channels;
  c->input_electronics = m->input_electronics ? malloc(c->nu * sizeof(pb_electronics)) : NULL;
  c->output_electronics = m->output_electronics ? malloc(c->ny * sizeof(pb_electronics)) : NULL;
  if ((m->input_electronics && !c->input_electronics) ||
      (m->output_electronics && !c->output_electronics))
    return pb_fail_memory(err, "loop");
  for (size_t i = 0; c->input_electronics && i < c->nu; i++) {
    c->input_electronics[i] = m->input_electronics[s->loop.input[i]];
    s->delays += c->input_electronics[i].delay;
  }
  for (size_t o = 0; c->output_electronics && o < c->ny; o++) {
    c->output_electronics[o] = m->output_electronics[s->loop.output[o]];
    s->delays += c->output_electronics[o].delay;
  }
  return PB_OK;
}

static int by_size(const void *a, const void *b) {
  double p = cabs(*(const double complex *)a), q = cabs(*(const double complex *)b);
  return (p > q) - (p < q);
}

// Open-loop poles as z, and those that `reduced` lacks: each of its poles strikes out the nearest.
static pb_status list_poles(pb_loop_solver *s, const pb_model *reduced, pb_error *err) {
  const pb_model *m = s->loop.model;
  size_t nk = s->loop.controller->nx;
  s->open_count = m->nx + nk;
  s->open = malloc((s->open_count + 1) * sizeof *s->open);
  s->far = malloc((m->nx + 1) * sizeof *s->far);
  double complex *kept = malloc((reduced->nx + 1) * sizeof *kept);
  pb_status status = s->open && s->far && kept ? PB_OK : pb_fail_memory(err, "loop");
  if (status == PB_OK) status = pb_model_poles(m, PB_SAMPLED, s->open, err);
  if (status == PB_OK) status = pb_lti_poles(s->loop.controller, s->open + m->nx, err);
  if (status == PB_OK) status = pb_model_poles(reduced, PB_SAMPLED, kept, err);
  if (status != PB_OK) goto done;
  memcpy(s->far, s->open, m->nx * sizeof *s->far);
  s->far_count = m->nx;
  for (size_t k = 0; k < reduced->nx; k++) {
    size_t nearest = 0;
    for (size_t j = 1; j < s->far_count; j++) {
      if (cabs(s->far[j] - kept[k]) < cabs(s->far[nearest] - kept[k])) nearest = j;
    }
    s->far[nearest] = s->far[--s->far_count];
  }
done:
  free(kept);
  return status;
}

// The lowest modes of a large plant, about REDUCED_STATES of its states.
static pb_status reduce(const pb_model *model, pb_model **out, pb_error *err) {
  *out = NULL;
  double complex *poles = malloc(model->nx * sizeof *poles);
  if (!poles) return pb_fail_memory(err, "loop");
  pb_status status = pb_model_poles(model, PB_CONTINUOUS, poles, err);
  if (status == PB_OK) {
    qsort(poles, model->nx, sizeof *poles, by_size);
    double limit = cabs(poles[REDUCED_STATES]) * (1 + 1e-9) / (2 * M_PI);
    status = pb_model_truncate(model, limit, out, err);
  }
  free(poles);
  return status;
}

static pb_status prepare(pb_loop_solver *s, pb_error *err) {
  const pb_model *m = s->loop.model;
  size_t nu = s->loop.controller->ny, ny = s->loop.controller->nu;
  pb_model *reduced = NULL;
  s->exact = m->nx <= PB_LOOP_DENSE;
  s->h = malloc(ny * nu * sizeof *s->h);
  s->dh = malloc(ny * nu * sizeof *s->dh);
  s->k = malloc(ny * nu * sizeof *s->k);
  s->dk = malloc(ny * nu * sizeof *s->dk);
  s->m = malloc(nu * nu * sizeof *s->m);
  s->rhs = malloc(nu * nu * sizeof *s->rhs);
  bool have = s->h && s->dh && s->k && s->dk && s->m && s->rhs;
  pb_status status = have ? select_channels(s, err) : pb_fail_memory(err, "loop");
  if (status == PB_OK) status = select_electronics(s, err);
  if (status == PB_OK && !s->exact) status = reduce(m, &reduced, err);
  const pb_model *low = reduced ? reduced : m;
  if (status == PB_OK) status = list_poles(s, low, err);
  const pb_lti_channels channels = {s->loop.input, s->loop.output, nu, ny};
  if (status == PB_OK) status = pb_lti_from_channels(low, PB_SAMPLED, &channels, &s->plant, err);
  pb_model_free(reduced);
  return status;
}

pb_status pb_loop_solver_new(const pb_loop *loop, pb_loop_solver **out, pb_error *err) {
  *out = NULL;
  pb_status status = pb_loop_check(loop, 1, err);
  if (status != PB_OK) return status;
  pb_loop_solver *s = calloc(1, sizeof *s);
  if (!s) return pb_fail_memory(err, "loop");
  s->loop = *loop;
  status = prepare(s, err);
  if (status != PB_OK) {
    pb_loop_solver_free(s);
    return status;
  }
  *out = s;
  return PB_OK;
}

// Poles of the (reduced) plant with the loop closed, all of them; *count of *z, the caller frees.
static pb_status dense_poles(const pb_loop_solver *s, double gain, double complex **z,
                             size_t *count, pb_error *err) {
  pb_lti controller = {0}, closed = {0};
  *z = NULL;
  pb_status status = pb_loop_delayed_controller(&s->loop, gain, &controller, err);
  controller.dt = s->plant.dt;
  if (status == PB_OK) status = pb_lti_feedback(&s->plant, &controller, 1, &closed, err);
  if (status == PB_OK) {
    *count = closed.nx;
    *z = malloc((closed.nx + s->far_count + 1) * sizeof **z);
    status = *z ? pb_lti_poles(&closed, *z, err) : pb_fail_memory(err, "loop");
  }
  if (status != PB_OK) {
    free(*z);
    *z = NULL;
  }
  pb_lti_free(&controller);
  pb_lti_free(&closed);
  return status;
}

// κ(z) and κ'(z) from K and K', in place.
static void delay_controller(const pb_loop_solver *s, double gain, double complex z) {
  size_t n = s->loop.controller->ny * s->loop.controller->nu;
  double complex factor = gain * s->loop.sign * cpow(z, -(double)s->loop.delay);
  for (size_t i = 0; i < n; i++) {
    s->dk[i] = factor * (s->dk[i] - s->loop.delay * s->k[i] / z);
    s->k[i] *= factor;
  }
}

// p'/p at z; false where it cannot be evaluated (on an open-loop pole, or a converged root).
static bool log_derivative(pb_loop_solver *s, double gain, double complex z,
                           double complex *value) {
  size_t n = s->loop.controller->ny, nk = s->loop.controller->nu;
  double complex sum = 0;
  for (size_t j = 0; j < s->open_count; j++) sum += 1 / (z - s->open[j]);
  if (s->loop.delay + s->delays > 0) sum += (double)(n * s->loop.delay + s->delays) / z;
  pb_model_evaluate(&s->channels, PB_SAMPLED, z, s->h, s->dh);
  if (pb_lti_evaluate(s->loop.controller, z, s->k, s->dk, NULL) != PB_OK) return false;
  delay_controller(s, gain, z);
  for (size_t c = 0; c < n; c++) {
    for (size_t r = 0; r < n; r++) {
      double complex l = 0, dl = 0;
      for (size_t k = 0; k < nk; k++) {
        l += s->k[r * nk + k] * s->h[k * n + c];
        dl += s->dk[r * nk + k] * s->h[k * n + c] + s->k[r * nk + k] * s->dh[k * n + c];
      }
      s->m[r + c * n] = (r == c) - l;
      s->rhs[r + c * n] = dl;
    }
  }
  if (!pb_small_solve(n, n, s->m, s->rhs)) return false;
  for (size_t r = 0; r < n; r++) sum -= s->rhs[r + r * n];
  *value = sum;
  return isfinite(creal(sum)) && isfinite(cimag(sum));
}

// Far from the root a correction is only a direction: a fraction of |s| T ≈ |z − 1| is enough.
static double complex limited(double complex step, double complex z) {
  double size = cabs(step), limit = 0.1 * cabs(z - 1);
  return size > limit ? step * (limit / size) : step;
}

// One correction of root i, pushed away from the others (Aberth); returns its size relative to |z|,
// 0 when it stays where it is.
static double correct(pb_loop_solver *s, double gain, double complex *z, size_t count, size_t i) {
  double complex ratio, others = 0;
  if (!log_derivative(s, gain, z[i], &ratio)) return 0;
  for (size_t j = 0; j < count; j++) {
    if (j != i && z[j] != z[i]) others += 1 / (z[i] - z[j]);
  }
  double complex step = 1 / (ratio - others);
  double size = cabs(step);
  if (!isfinite(size)) return 0;
  z[i] -= limited(step, z[i]);
  return size / cabs(z[i]);
}

// Off an open-loop pole that the loop does not move, where the determinant has no value; each start
// in its own direction, or the starts of a double pole would push each other away.
static void spread_starts(double complex *z, size_t count) {
  for (size_t i = 0; i < count; i++) {
    double angle = 2.4 * (double)i;
    z[i] += 1e-4 * cabs(z[i] - 1) * CMPLX(cos(angle), cimag(z[i]) == 0 ? 0 : sin(angle));
  }
}

// Makes the roots z[count] exact on the whole plant; last[count]: size of each last correction.
static void iterate(pb_loop_solver *s, double gain, double complex *z, size_t count, double *last) {
  for (size_t i = 0; i < count; i++) last[i] = INFINITY;
  spread_starts(z, count);
  for (int it = 0; it < MAX_ITERATIONS; it++) {
    size_t moving = 0;
    for (size_t i = 0; i < count; i++) {
      if (last[i] < 1e-12) continue;
      last[i] = correct(s, gain, z, count, i);
      moving += last[i] >= 1e-12;
    }
    if (moving == 0) return;
  }
}

// One root by Newton's method alone. Steps that shrink by a constant factor tell a multiple root:
// the rest of their sum is then taken at once. Returns the size of the last step relative to |z|.
static double newton(pb_loop_solver *s, double gain, double complex *z) {
  double complex before = 0, ratio;
  double size = INFINITY;
  *z *= 1 - 1e-9;  // off an open-loop pole that the loop does not move
  for (int it = 0; it < MAX_ITERATIONS && size >= 1e-12; it++) {
    if (!log_derivative(s, gain, *z, &ratio)) return 0;
    double complex step = 1 / ratio, shrink = before != 0 ? step / before : 0;
    if (!isfinite(cabs(step))) return 0;
    before = step;
    if (creal(shrink) > 0.3 && creal(shrink) < 0.95 && fabs(cimag(shrink)) < 0.2) {
      step /= 1 - shrink;
      before = 0;
    }
    size = cabs(step) / cabs(*z);
    *z -= limited(step, *z);
  }
  return size;
}

static bool has_converged(double complex z, double last) {
  return last * cabs(z) < good_enough * cabs(z - 1);
}

// Takes out what did not converge, and counts it. The static terms of the reduced plant act a
// sample late and add a state a loop: as many starts belong to nothing. Well inside the circle any
// may.
static size_t drop_unconverged(const pb_loop_solver *s, double complex *z, size_t *count,
                               const double complex *start, const double *last) {
  size_t kept = 0, lost = 0;
  for (size_t i = 0; i < *count; i++) {
    bool converged = has_converged(z[i], last[i]);
    if (converged) z[kept++] = z[i];
    lost += !converged && cabs(start[i]) >= doubtful_z;
  }
  *count = kept;
  size_t spurious = s->loop.controller->ny;
  return lost > spurious ? lost - spurious : 0;
}

static pb_status polish(pb_loop_solver *s, double gain, double complex *z, size_t *count,
                        size_t *lost, pb_error *err) {
  double complex *start = malloc((*count + 1) * sizeof *start);
  double *last = malloc((*count + 1) * sizeof *last);
  pb_status status = start && last ? PB_OK : pb_fail_memory(err, "loop");
  if (status == PB_OK) {
    memcpy(start, z, *count * sizeof *start);
    iterate(s, gain, z, *count, last);
    *lost = drop_unconverged(s, z, count, start, last);
  }
  free(start);
  free(last);
  return status;
}

// Keeps the upper half plane within the band widened by `slack`; returns how many are left.
static size_t keep_band(double complex *z, size_t count, double rate, double f1, double f2,
                        double slack) {
  size_t kept = 0;
  for (size_t i = 0; i < count; i++) {
    if (fabs(cimag(z[i])) < 1e-12 * cabs(z[i])) z[i] = creal(z[i]);  // real but for rounding
    if (cimag(z[i]) < 0 || cabs(z[i]) < smallest_z) continue;
    double hz = cabs(pb_pole_s(z[i], rate)) / (2 * M_PI);
    if (hz >= f1 / slack && hz <= f2 * slack) z[kept++] = z[i];
  }
  return kept;
}

// The closed-loop poles of the band, on the reduced plant only unless `exact`.
static pb_status find_poles(pb_loop_solver *s, double gain, double f1, double f2, bool exact,
                            pb_pole_list *out, pb_error *err) {
  *out = (pb_pole_list){0};
  pb_status status = pb_loop_check(&s->loop, gain, err);
  if (status != PB_OK) return status;
  double complex *z;
  size_t count;
  double rate = s->loop.model->sample_rate;
  status = dense_poles(s, gain, &z, &count, err);
  if (status != PB_OK) return status;
  if (!s->exact) {
    memcpy(z + count, s->far, s->far_count * sizeof *z);
    count = keep_band(z, count + s->far_count, rate, f1, f2, 1.25);
    if (exact) status = polish(s, gain, z, &count, &out->lost, err);
  }
  if (status == PB_OK) {
    count = keep_band(z, count, rate, f1, f2, 1);
    out->item = malloc((count + 1) * sizeof *out->item);
    if (!out->item) status = pb_fail_memory(err, "loop");
  }
  for (size_t i = 0; status == PB_OK && i < count; i++) out->item[i] = pb_pole_from_z(z[i], rate);
  if (status == PB_OK) {
    out->count = count;
    pb_pole_sort(out->item, count);
  }
  free(z);
  return status;
}

pb_status pb_loop_solver_poles(pb_loop_solver *s, double gain, double f1, double f2,
                               pb_pole_list *out, pb_error *err) {
  return find_poles(s, gain, f1, f2, true, out, err);
}

pb_status pb_loop_solver_estimate(pb_loop_solver *s, double gain, double f1, double f2,
                                  pb_pole_list *out, pb_error *err) {
  return find_poles(s, gain, f1, f2, false, out, err);
}

pb_status pb_loop_solver_polish(pb_loop_solver *s, double gain, pb_pole *pole, size_t count,
                                pb_error *err) {
  pb_status status = pb_loop_check(&s->loop, gain, err);
  if (status != PB_OK || s->exact) return status;
  for (size_t i = 0; i < count; i++) {
    double complex z = pole[i].z;
    double last = newton(s, gain, &z);
    if (fabs(cimag(z)) < 1e-12 * cabs(z)) z = creal(z);
    if (cimag(z) < 0) z = conj(z);
    bool good = has_converged(z, last);
    pole[i] = good ? pb_pole_from_z(z, s->loop.model->sample_rate)
                   : (pb_pole){.z = NAN, .hz = NAN, .damping = NAN};
  }
  return PB_OK;
}
