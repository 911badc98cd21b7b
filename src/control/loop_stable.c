// Stability of sampled closed loops of any size: see loop.h.
#include <math.h>
#include <stdlib.h>

#include "control/loop.h"
#include "control/loop_internal.h"
#include "control/lti_ops.h"

// The whole plant with the loop closed, between the loop's channels only.
static pb_status close_loop(const pb_loop_solver *s, double gain, pb_lti *closed, pb_error *err) {
  const pb_loop *l = &s->loop;
  const pb_lti_channels channels = {l->input, l->output, l->controller->ny, l->controller->nu};
  pb_lti plant = {0}, controller = {0};
  *closed = (pb_lti){0};
  pb_status status = pb_lti_from_channels(l->model, PB_SAMPLED, &channels, &plant, err);
  if (status == PB_OK) status = pb_loop_delayed_controller(l, gain, &controller, err);
  controller.dt = plant.dt;  // equal to 1e-9, made equal to the bit
  if (status == PB_OK) status = pb_lti_feedback(&plant, &controller, 1, closed, err);
  pb_lti_free(&plant);
  pb_lti_free(&controller);
  return status;
}

static pb_status dense_stable(const pb_loop_solver *s, double gain, bool *stable, pb_pole *worst,
                              pb_error *err) {
  pb_lti closed;
  pb_status status = close_loop(s, gain, &closed, err);
  if (status != PB_OK) return status;
  double complex *z = malloc((closed.nx + 1) * sizeof *z);
  status = z ? pb_lti_poles(&closed, z, err) : pb_fail_memory(err, "loop");
  size_t largest = 0;
  for (size_t k = 1; k < closed.nx && status == PB_OK; k++) {
    if (cabs(z[k]) > cabs(z[largest])) largest = k;
  }
  if (status == PB_OK && closed.nx > 0) {
    double complex upper = cimag(z[largest]) < 0 ? conj(z[largest]) : z[largest];
    *worst = pb_pole_from_z(upper, s->loop.model->sample_rate);
    *stable = cabs(upper) < 1;
  }
  free(z);
  pb_lti_free(&closed);
  return status;
}

// Determinant by elimination; a (n × n column-major) is overwritten.
static double complex determinant(double complex *a, size_t n) {
  double complex value = 1;
  for (size_t k = 0; k < n; k++) {
    size_t pivot = k;
    for (size_t r = k + 1; r < n; r++) {
      if (cabs(a[r + k * n]) > cabs(a[pivot + k * n])) pivot = r;
    }
    if (a[pivot + k * n] == 0) return 0;
    if (pivot != k) value = -value;
    for (size_t c = k; c < n; c++) {
      double complex t = a[k + c * n];
      a[k + c * n] = a[pivot + c * n];
      a[pivot + c * n] = t;
    }
    value *= a[k + k * n];
    for (size_t r = k + 1; r < n; r++) {
      double complex factor = a[r + k * n] / a[k + k * n];
      for (size_t c = k + 1; c < n; c++) a[r + c * n] -= factor * a[k + c * n];
    }
  }
  return value;
}

// A controller's integrator, on the circle itself: ((z − 1)/(z − 0.9)) takes its place in the
// determinant, which then has neither pole nor zero there, and the same zeros outside.
static bool is_integrator(const pb_loop_solver *s, size_t open) {
  return open >= s->loop.model->nx && cabs(s->open[open] - 1) < 1e-9;
}

static double complex without_integrators(const pb_loop_solver *s, double complex z) {
  double complex factor = 1;
  for (size_t j = s->loop.model->nx; j < s->open_count; j++) {
    if (is_integrator(s, j)) factor *= (z - 1) / (z - 0.9);
  }
  return factor;
}

// Phase of det(I − L(e^{iθ})), freed of integrators, in −π … π.
static pb_status phase_at(pb_loop_solver *s, double gain, double theta, double *phase,
                          pb_error *err) {
  size_t n = s->loop.controller->ny, nk = s->loop.controller->nu;
  double complex z = CMPLX(cos(theta), sin(theta));
  double complex factor =
      gain * s->loop.sign * CMPLX(cos(theta * s->loop.delay), -sin(theta * s->loop.delay));
  pb_status status = pb_lti_evaluate(s->loop.controller, z, s->k, NULL, err);
  if (status != PB_OK) return status;
  pb_model_evaluate(&s->channels, PB_SAMPLED, z, s->h, NULL);
  for (size_t c = 0; c < n; c++) {
    for (size_t r = 0; r < n; r++) {
      double complex l = 0;
      for (size_t k = 0; k < nk; k++) l += s->k[r * nk + k] * s->h[k * n + c];
      s->m[r + c * n] = (r == c) - factor * l;
    }
  }
  *phase = carg(determinant(s->m, n) * without_integrators(s, z));
  return isfinite(*phase) ? PB_OK
                          : pb_fail(err, PB_ERR_NUMERIC, "loop", "no value at θ = %g", theta);
}

static int ascending(const void *a, const void *b) {
  double p = *(const double *)a, q = *(const double *)b;
  return (p > q) - (p < q);
}

// Angles of 0 … π: even steps, and around each open-loop pole its distance to the circle times
// powers of 3. *count of them, the caller frees.
static double *make_grid(const pb_loop_solver *s, size_t *count) {
  enum { EVEN = 2000, AROUND = 9 };
  // A delay turns the determinant by itself: as many steps more keep each well below a radian.
  size_t even = EVEN + 10 * s->delays;
  double *grid = malloc((even + 1 + s->open_count * AROUND) * sizeof *grid);
  size_t n = 0;
  for (size_t k = 0; grid && k <= even; k++) grid[n++] = M_PI * (double)k / (double)even;
  if (grid) grid[0] = 1e-9;  // nothing turns below; at 0 itself an integrator has no value
  for (size_t j = 0; grid && j < s->open_count; j++) {
    double theta = carg(s->open[j]), width = fabs(1 - cabs(s->open[j]));
    if (theta < 0 || width > 0.1) continue;
    for (int k = -AROUND / 2; k <= AROUND / 2; k++) {
      double at = theta + (k < 0 ? -width : width) * (k == 0 ? 0 : pow(3, abs(k) - 2));
      if (at > 0 && at < M_PI) grid[n++] = at;
    }
  }
  if (grid) qsort(grid, n, sizeof *grid, ascending);
  *count = n;
  return grid;
}

static double wrapped(double phase) {
  return remainder(phase, 2 * M_PI);
}

// Phase gained from a to b, halving the step until it turns by less than a radian.
static pb_status turn(pb_loop_solver *s, double gain, double a, double b, double phase_a,
                      double phase_b, unsigned depth, double *sum, pb_error *err) {
  double step = wrapped(phase_b - phase_a);
  if (fabs(step) < 1 || depth == 0 || !(b - a > 1e-13)) {
    *sum += step;
    return PB_OK;
  }
  double middle = 0.5 * (a + b), phase;
  pb_status status = phase_at(s, gain, middle, &phase, err);
  if (status == PB_OK) status = turn(s, gain, a, middle, phase_a, phase, depth - 1, sum, err);
  if (status == PB_OK) status = turn(s, gain, middle, b, phase, phase_b, depth - 1, sum, err);
  return status;
}

static pb_status poles_outside(pb_loop_solver *s, double gain, long *outside, pb_error *err) {
  for (size_t j = 0; j < s->open_count; j++) {
    if (cabs(s->open[j]) < 1 || is_integrator(s, j)) continue;
    return pb_fail(err, PB_ERR_STATE, "loop",
                   "the open loop has a pole on or outside the unit circle");
  }
  size_t count;
  double *grid = make_grid(s, &count), sum = 0, before = 0;
  pb_status status = grid ? phase_at(s, gain, grid[0], &before, err) : pb_fail_memory(err, "loop");
  for (size_t k = 1; k < count && status == PB_OK; k++) {
    double phase;
    status = phase_at(s, gain, grid[k], &phase, err);
    if (status == PB_OK) status = turn(s, gain, grid[k - 1], grid[k], before, phase, 40, &sum, err);
    before = phase;
  }
  free(grid);
  // The lower half of the circle turns as much again.
  *outside = lround(-2 * sum / (2 * M_PI));
  return status;
}

pb_status pb_loop_solver_stable(pb_loop_solver *s, double gain, bool *stable, pb_pole *worst,
                                pb_error *err) {
  pb_pole ignored;
  if (!worst) worst = &ignored;
  *worst = (pb_pole){0};
  *stable = true;
  pb_status status = pb_loop_check(&s->loop, gain, err);
  if (status != PB_OK) return status;
  if (s->loop.model->nx + s->loop.controller->nx + s->delays <= PB_LOOP_STABLE_DENSE) {
    return dense_stable(s, gain, stable, worst, err);
  }
  long outside = 0;
  pb_pole_list list = {0};
  status = poles_outside(s, gain, &outside, err);
  if (status == PB_OK) status = pb_loop_solver_poles(s, gain, 0, INFINITY, &list, err);
  for (size_t k = 0; k < list.count; k++) {
    if (cabs(list.item[k].z) > cabs(worst->z)) *worst = list.item[k];
  }
  *stable = outside == 0;
  pb_pole_list_clear(&list);
  return status;
}
