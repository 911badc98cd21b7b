// Sampled closed loops as state space and as frequency response: see loop.h.
#include "control/loop.h"

#include <math.h>
#include <stdlib.h>

#include "control/loop_internal.h"
#include "control/lti_ops.h"
#include "signal/small_solve.h"

pb_status pb_loop_check(const pb_loop *loop, double gain, pb_error *err) {
  const pb_model *m = loop->model;
  const pb_lti *k = loop->controller;
  if (!(fabs(k->dt * m->sample_rate - 1) < 1e-9)) {
    return pb_fail(err, PB_ERR_ARGUMENT, "loop",
                   "the controller's period %g s is not the plant's %g s", k->dt,
                   1 / m->sample_rate);
  }
  for (size_t i = 0; i < k->nu; i++) {
    if (loop->output[i] >= m->ny) {
      return pb_fail(err, PB_ERR_ARGUMENT, "loop", "no output %zu", loop->output[i]);
    }
  }
  for (size_t i = 0; i < k->ny; i++) {
    if (loop->input[i] >= m->nu) {
      return pb_fail(err, PB_ERR_ARGUMENT, "loop", "no input %zu", loop->input[i]);
    }
  }
  if (!isfinite(gain) || !(fabs(loop->sign) == 1)) {
    return pb_fail(err, PB_ERR_ARGUMENT, "loop", "gain %g, sign %g", gain, loop->sign);
  }
  return PB_OK;
}

pb_status pb_loop_delayed_controller(const pb_loop *loop, double gain, pb_lti *out, pb_error *err) {
  pb_status status = pb_lti_delay(loop->controller, loop->delay, out, err);
  if (status == PB_OK) pb_lti_scale(out, gain * loop->sign);
  return status;
}

// E K S: the controller with all outputs of the model as inputs and all its inputs as outputs.
static pb_status spread_controller(const pb_loop *loop, const pb_lti *k, pb_lti *out,
                                   pb_error *err) {
  const pb_model *m = loop->model;
  pb_status status = pb_lti_new(k->nx, m->ny, m->nu, k->dt, out, err);
  if (status != PB_OK) return status;
  for (size_t i = 0; i < k->nx * k->nx; i++) out->a[i] = k->a[i];
  for (size_t i = 0; i < k->nu; i++) {
    for (size_t r = 0; r < k->nx; r++) out->b[r + loop->output[i] * k->nx] += k->b[r + i * k->nx];
  }
  for (size_t o = 0; o < k->ny; o++) {
    size_t row = loop->input[o];
    for (size_t c = 0; c < k->nx; c++) out->c[row + c * m->nu] += k->c[o + c * k->ny];
    for (size_t i = 0; i < k->nu; i++) {
      out->d[row + loop->output[i] * m->nu] += k->d[o + i * k->ny];
    }
  }
  return PB_OK;
}

pb_status pb_loop_closed(const pb_loop *loop, double gain, pb_lti *out, pb_error *err) {
  *out = (pb_lti){0};
  pb_lti plant = {0}, delayed = {0}, spread = {0};
  pb_status status = pb_loop_check(loop, gain, err);
  if (status == PB_OK) status = pb_lti_from_model(loop->model, PB_SAMPLED, &plant, err);
  if (status == PB_OK) status = pb_loop_delayed_controller(loop, gain, &delayed, err);
  if (status == PB_OK) status = spread_controller(loop, &delayed, &spread, err);
  if (status == PB_OK) {
    spread.dt = plant.dt;  // equal to 1e-9, made equal to the bit
    status = pb_lti_feedback(&plant, &spread, 1, out, err);
  }
  pb_lti_free(&plant);
  pb_lti_free(&delayed);
  pb_lti_free(&spread);
  return status;
}

// κ(z) = sign·gain·z^{−delay} K(z), [n_in][n_out] of the loop, row-major.
static pb_status controller_at(const pb_loop *loop, double gain, double hz, double complex *kappa,
                               pb_error *err) {
  const pb_lti *k = loop->controller;
  double angle = 2 * M_PI * hz / loop->model->sample_rate;
  pb_status status = pb_lti_evaluate(k, cexp(CMPLX(0, angle)), kappa, NULL, err);
  double complex factor = gain * loop->sign * cexp(CMPLX(0, -angle * loop->delay));
  for (size_t i = 0; status == PB_OK && i < k->ny * k->nu; i++) kappa[i] *= factor;
  return status;
}

// I − κ S P E into m [n × n] column-major (or S P E κ's counterpart L alone when `only_l`).
static void loop_matrix(const pb_loop *loop, const double complex *p, const double complex *kappa,
                        bool only_l, double complex *m) {
  size_t n = loop->controller->ny, nk = loop->controller->nu, nu = loop->model->nu;
  for (size_t c = 0; c < n; c++) {
    for (size_t r = 0; r < n; r++) {
      double complex sum = 0;
      for (size_t k = 0; k < nk; k++) {
        sum += kappa[r * nk + k] * p[loop->output[k] * nu + loop->input[c]];
      }
      m[r + c * n] = only_l ? sum : (r == c) - sum;
    }
  }
}

// h = P + P E v, (I − κ S P E) v = κ S P. m is [n × n], v [n × nu].
static bool close_at(const pb_loop *loop, const double complex *p, const double complex *kappa,
                     double complex *m, double complex *v, double complex *h) {
  size_t n = loop->controller->ny, nk = loop->controller->nu;
  size_t nu = loop->model->nu, ny = loop->model->ny;
  loop_matrix(loop, p, kappa, false, m);
  for (size_t i = 0; i < nu; i++) {
    for (size_t r = 0; r < n; r++) {
      double complex sum = 0;
      for (size_t k = 0; k < nk; k++) sum += kappa[r * nk + k] * p[loop->output[k] * nu + i];
      v[r + i * n] = sum;
    }
  }
  if (!pb_small_solve(n, nu, m, v)) return false;
  for (size_t o = 0; o < ny; o++) {
    for (size_t i = 0; i < nu; i++) {
      double complex sum = p[o * nu + i];
      for (size_t r = 0; r < n; r++) sum += p[o * nu + loop->input[r]] * v[r + i * n];
      h[o * nu + i] = sum;
    }
  }
  return true;
}

// Both responses share their set-up: the closed loop into h[nf][ny][nu], or L into h[nf][n][n].
static pb_status respond(const pb_loop *loop, double gain, const double *hz, size_t nf, bool only_l,
                         double complex *h, pb_error *err) {
  pb_status status = pb_loop_check(loop, gain, err);
  if (status != PB_OK) return status;
  size_t n = loop->controller->ny, nk = loop->controller->nu;
  size_t nu = loop->model->nu, ny = loop->model->ny;
  double complex *p = malloc((nf * ny * nu + 1) * sizeof *p),
                 *kappa = malloc(n * nk * sizeof *kappa);
  double complex *m = malloc(n * n * sizeof *m), *v = malloc(n * nu * sizeof *v);
  status = p && kappa && m && v ? pb_model_frf(loop->model, PB_SAMPLED, hz, nf, p, err)
                                : pb_fail_memory(err, "loop");
  for (size_t f = 0; f < nf && status == PB_OK; f++) {
    status = controller_at(loop, gain, hz[f], kappa, err);
    if (status != PB_OK) break;
    if (only_l) {
      loop_matrix(loop, p + f * ny * nu, kappa, true, m);
      for (size_t k = 0; k < n * n; k++) h[f * n * n + k] = m[k / n + (k % n) * n];
    } else if (!close_at(loop, p + f * ny * nu, kappa, m, v, h + f * ny * nu)) {
      status = pb_fail(err, PB_ERR_SINGULAR, "loop",
                       "a closed-loop pole lies at %g Hz without damping", hz[f]);
    }
  }
  free(p);
  free(kappa);
  free(m);
  free(v);
  return status;
}

pb_status pb_loop_frf(const pb_loop *loop, double gain, const double *hz, size_t nf,
                      double complex *h, pb_error *err) {
  return respond(loop, gain, hz, nf, false, h, err);
}

pb_status pb_loop_gain(const pb_loop *loop, double gain, const double *hz, size_t nf,
                       double complex *h, pb_error *err) {
  return respond(loop, gain, hz, nf, true, h, err);
}
