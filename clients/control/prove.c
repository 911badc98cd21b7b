// What the closed-loop poles say: stability, how far HAC's gain is from the border, the modes.
#include <math.h>
#include <stdlib.h>

#include "control/lti_ops.h"
#include "control_tool.h"

// Whether the loop is stable with HAC's gain multiplied.
static pb_status stable_at(const control_design *d, double factor, bool *stable, pb_error *err) {
  pb_lti hac = {0}, both = {0};
  pb_loop_solver *solver = NULL;
  pb_status status = pb_lti_copy(&d->hac, &hac, err);
  if (status == PB_OK) {
    pb_lti_scale(&hac, factor);
    status = pb_hac_combine(d->damped ? &d->iff.controller_used : NULL, d->iff_delay, &hac,
                            d->hac_delay, d->n, &both, err);
  }
  pb_loop loop = d->loop[STAGE_HAC];
  loop.controller = &both;
  if (status == PB_OK) status = pb_loop_solver_new(&loop, &solver, err);
  if (status == PB_OK) status = pb_loop_solver_stable(solver, 1, stable, NULL, err);
  pb_loop_solver_free(solver);
  pb_lti_free(&hac);
  pb_lti_free(&both);
  return status;
}

// The factor nearest to 1, upwards (ratio > 1) or downwards, at which the loop is at the border:
// steps of the ratio until it is unstable, then bisection to 0.1 %. `none` when it is not within
// two decades.
static pb_status border(const control_design *d, double ratio, double none, double *factor,
                        pb_error *err) {
  double good = 1, bad = ratio;
  bool stable = true;
  pb_status status = PB_OK;
  *factor = none;
  for (;; bad *= ratio) {
    if (bad > 100 || bad < 0.01) return PB_OK;
    status = stable_at(d, bad, &stable, err);
    if (status != PB_OK) return status;
    if (!stable) break;
    good = bad;
  }
  while (fabs(bad / good - 1) > 1e-3) {
    double middle = sqrt(good * bad);
    status = stable_at(d, middle, &stable, err);
    if (status != PB_OK) return status;
    if (stable)
      good = middle;
    else
      bad = middle;
  }
  *factor = good;
  return PB_OK;
}

static pb_status list_modes(control_design *d, pb_error *err) {
  pb_experiment_options e;
  iff_experiment_defaults(&d->options->iff, d->model, &e);
  pb_status status = pb_loop_solver_poles(d->solver[STAGE_HAC], 1, e.f1, e.f2, &d->modes, err);
  size_t kept = 0;
  for (size_t k = 0; k < d->modes.count; k++) {
    const pb_pole *p = &d->modes.item[k];
    if (cimag(p->z) > 0 && p->damping < 0.7) d->modes.item[kept++] = *p;
  }
  d->modes.count = kept;
  return status;
}

pb_status control_prove(control_design *d, pb_error *err) {
  pb_loop_solver *s = d->solver[STAGE_HAC];
  d->gain_up = d->gain_down = NAN;
  d->closed_states = d->model->nx + d->both.nx;
  pb_status status = pb_loop_solver_stable(s, 1, &d->stable, &d->worst, err);
  if (status == PB_OK) status = list_modes(d, err);
  bool dense = d->closed_states <= PB_LOOP_STABLE_DENSE;
  if (status != PB_OK || !d->stable || !dense) return status;
  status = border(d, 1.25, INFINITY, &d->gain_up, err);
  return status == PB_OK ? border(d, 1 / 1.25, 0, &d->gain_down, err) : status;
}
