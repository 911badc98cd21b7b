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

// Logarithm of det(I − L(e^{iθ})), freed of integrators: of its size, and i times its phase in −π …
// π.
static pb_status log_at(pb_loop_solver *s, double gain, double theta, double complex *value,
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
  *value = clog(determinant(s->m, n) * without_integrators(s, z));
  return isfinite(cimag(*value)) && !isnan(creal(*value))
             ? PB_OK
             : pb_fail(err, PB_ERR_NUMERIC, "loop", "no value at θ = %g", theta);
}

static int ascending(const void *a, const void *b) {
  double p = *(const double *)a, q = *(const double *)b;
  return (p > q) - (p < q);
}

enum { EVEN = 2000, AROUND = 9 };

// Angles of 0 … π around a pole: its distance to the circle times powers of 3.
static void add_around(double complex z, double *grid, size_t *count) {
  double theta = carg(z), width = fabs(1 - cabs(z));
  if (theta < 0 || width > 0.1) return;
  for (int k = -AROUND / 2; k <= AROUND / 2; k++) {
    double at = theta + (k < 0 ? -width : width) * (k == 0 ? 0 : pow(3, abs(k) - 2));
    if (at > 0 && at < M_PI) grid[(*count)++] = at;
  }
}

// Even steps, and those around each pole of the open and of the closed loop: of two closed-loop
// poles at one place the turns by −π each would go unseen between even steps. *count of them, the
// caller frees.
static double *make_grid(const pb_loop_solver *s, const pb_pole_list *closed, size_t *count) {
  // A delay turns the determinant by itself: as many steps more keep each well below a radian.
  size_t even = EVEN + 10 * s->delays, n = 0;
  double *grid = malloc((even + 1 + (s->open_count + closed->count) * AROUND) * sizeof *grid);
  for (size_t k = 0; grid && k <= even; k++) grid[n++] = M_PI * (double)k / (double)even;
  if (grid) grid[0] = 1e-9;  // nothing turns below; at 0 itself an integrator has no value
  for (size_t j = 0; grid && j < s->open_count; j++) add_around(s->open[j], grid, &n);
  for (size_t j = 0; grid && j < closed->count; j++) add_around(closed->item[j].z, grid, &n);
  if (grid) qsort(grid, n, sizeof *grid, ascending);
  *count = n;
  return grid;
}

static double wrapped(double phase) {
  return remainder(phase, 2 * M_PI);
}

// A stretch of the circle, and the logarithms at its ends.
typedef struct stretch {
  double a, b;
  double complex log_a, log_b;
} stretch;

// Where the size changes by a factor of e, poles are near.
static bool is_steep(const stretch *t) {
  return !(fabs(creal(t->log_b) - creal(t->log_a)) < 1);
}

// Phase gained along a stretch, halved until it turns by less than a radian and is not steep: two
// poles at one place turn it by a whole turn, which the ends alone do not show. look: halve it once
// at least, as the next one is steep.
static pb_status turn(pb_loop_solver *s, double gain, const stretch *t, bool look, unsigned depth,
                      double *sum, pb_error *err) {
  double step = wrapped(cimag(t->log_b) - cimag(t->log_a));
  bool smooth = fabs(step) < 1 && !is_steep(t) && !look;
  if (smooth || depth == 0 || !(t->b - t->a > 1e-13)) {
    *sum += step;
    return PB_OK;
  }
  double middle = 0.5 * (t->a + t->b);
  double complex value;
  pb_status status = log_at(s, gain, middle, &value, err);
  const stretch low = {t->a, middle, t->log_a, value}, high = {middle, t->b, value, t->log_b};
  if (status == PB_OK) status = turn(s, gain, &low, is_steep(&high), depth - 1, sum, err);
  if (status == PB_OK) status = turn(s, gain, &high, is_steep(&low), depth - 1, sum, err);
  return status;
}

static pb_status poles_outside(pb_loop_solver *s, double gain, const pb_pole_list *closed,
                               long *outside, pb_error *err) {
  for (size_t j = 0; j < s->open_count; j++) {
    if (cabs(s->open[j]) < 1 || is_integrator(s, j)) continue;
    return pb_fail(err, PB_ERR_STATE, "loop",
                   "the open loop has a pole on or outside the unit circle");
  }
  size_t count;
  double *grid = make_grid(s, closed, &count), sum = 0;
  stretch t = {0};
  bool steep = false;
  pb_status status = grid ? log_at(s, gain, grid[0], &t.log_b, err) : pb_fail_memory(err, "loop");
  for (size_t k = 1; k < count && status == PB_OK; k++) {
    t = (stretch){grid[k - 1], grid[k], t.log_b, 0};
    status = log_at(s, gain, grid[k], &t.log_b, err);
    if (status == PB_OK) status = turn(s, gain, &t, steep, 40, &sum, err);
    steep = is_steep(&t);
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
  status = pb_loop_solver_poles(s, gain, 0, INFINITY, &list, err);
  if (status == PB_OK) status = poles_outside(s, gain, &list, &outside, err);
  for (size_t k = 0; k < list.count; k++) {
    if (cabs(list.item[k].z) > cabs(worst->z)) *worst = list.item[k];
  }
  *stable = outside == 0;
  pb_pole_list_clear(&list);
  return status;
}
