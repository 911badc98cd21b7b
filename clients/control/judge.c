// Responses of the plant in the frame, of the loops and from disturbance to motion.
#include <math.h>
#include <stdlib.h>

#include "control_tool.h"

enum { POINTS = 800 };

static pb_status add_poles(pb_pole_list *all, const pb_pole_list *more, pb_error *err) {
  pb_pole *grown = realloc(all->item, (all->count + more->count + 1) * sizeof *grown);
  if (!grown) return pb_fail_memory(err, "poles");
  all->item = grown;
  for (size_t k = 0; k < more->count; k++) all->item[all->count++] = more->item[k];
  return PB_OK;
}

pb_status control_near_poles(const control_design *d, pb_pole_list *all, pb_error *err) {
  double highest = fmin(d->model->sample_rate / 2, 20 * d->shape.bandwidth_hz);
  pb_status status = pb_all_poles(d->model, all, err);
  for (int s = STAGE_IFF; s < STAGES && status == PB_OK; s++) {
    pb_pole_list some = {0};
    if (!d->solver[s]) continue;
    status = pb_loop_solver_poles(d->solver[s], 1, 0, highest, &some, err);
    if (status == PB_OK) status = add_poles(all, &some, err);
    pb_pole_list_clear(&some);
  }
  size_t kept = 0;
  for (size_t k = 0; k < all->count; k++) {
    if (cimag(all->item[k].z) > 0) all->item[kept++] = all->item[k];
  }
  all->count = kept;
  return status;
}

static pb_status make_grid(const control_design *d, control_judgement *j, pb_error *err) {
  double nyquist = d->model->sample_rate / 2, bandwidth = d->shape.bandwidth_hz;
  pb_pole_list poles = {0};
  pb_status status = control_near_poles(d, &poles, err);
  if (status == PB_OK) {
    status =
        pb_margins_grid(fmin(0.1, 1e-3 * bandwidth), nyquist, POINTS, &poles, &j->hz, &j->nf, err);
  }
  pb_pole_list_clear(&poles);
  return status;
}

static pb_status find_transmissions(const control_design *d, control_judgement *j, pb_error *err) {
  size_t nu = d->model->nu, some = d->motions * d->disturbances;
  double complex *full = malloc(d->model->ny * nu * sizeof *full);
  pb_status status = full ? PB_OK : pb_fail_memory(err, "transmission");
  for (int s = 0; s < STAGES && status == PB_OK; s++) {
    double complex *t = j->transmission[s] = malloc(j->nf * some * sizeof *t);
    if (!t) status = pb_fail_memory(err, "transmission");
    for (size_t f = 0; f < j->nf && status == PB_OK; f++) {
      status = control_response(d, (control_stage)s, &j->hz[f], 1, full, err);
      for (size_t k = 0; k < some && status == PB_OK; k++) {
        t[f * some + k] =
            full[d->motion[k / d->disturbances] * nu + d->disturbance[k % d->disturbances]];
      }
    }
  }
  free(full);
  return status;
}

// Loci and singular values of L at the metrology, J L J⁻¹ in the Cartesian frame: strut lengths
// have one unit, what mixes metres and radians has no size.
static pb_status analyse(const control_design *d, control_judgement *j, pb_error *err) {
  const control_frame *frame = &d->frame;
  size_t n = d->n;
  if (!frame->cartesian) return pb_mimo_analyse(j->hz, j->nf, n, j->l, &j->mimo, err);
  double complex *l = malloc(j->nf * n * n * sizeof *l);
  if (!l) return pb_fail_memory(err, "loops");
  for (size_t f = 0; f < j->nf; f++) {
    pb_hac_transform(n, frame->j, frame->inverse, j->l + f * n * n, l + f * n * n);
  }
  pb_status status = pb_mimo_analyse(j->hz, j->nf, n, l, &j->mimo, err);
  free(l);
  return status;
}

static pb_status find_loops(const control_design *d, control_judgement *j, pb_error *err) {
  size_t n = d->n;
  for (int k = 0; k < 2; k++) j->plant[k] = malloc(j->nf * n * n * sizeof *j->plant[k]);
  j->l = malloc(j->nf * n * n * sizeof *j->l);
  j->margins = malloc(n * sizeof *j->margins);
  if (!j->plant[0] || !j->plant[1] || !j->l || !j->margins) return pb_fail_memory(err, "loops");
  pb_status status = PB_OK;
  for (int k = 0; k < 2 && status == PB_OK; k++) {
    const pb_lti *iff = k && d->damped ? &d->iff.controller_used : NULL;
    status = pb_hac_plant(d->model, &d->channels, &d->frame.transform, iff, d->iff_delay, j->hz,
                          j->nf, j->plant[k], err);
  }
  if (status == PB_OK) {
    status = pb_hac_loop_gain(&d->shape_lti, d->gain, d->hac_delay, j->hz, j->nf, n, j->plant[1],
                              j->l, err);
  }
  if (status == PB_OK) status = analyse(d, j, err);
  for (size_t i = 0; i < n && status == PB_OK; i++) {
    j->margins[i] = pb_margins_of(j->hz, j->nf, j->l + i * (n + 1), n * n);
  }
  return status;
}

pb_status control_judge(const control_design *d, control_judgement *j, pb_error *err) {
  *j = (control_judgement){0};
  pb_status status = make_grid(d, j, err);
  if (status == PB_OK) status = find_loops(d, j, err);
  if (status == PB_OK) status = find_transmissions(d, j, err);
  if (status != PB_OK) control_judgement_clear(j);
  return status;
}

void control_judgement_clear(control_judgement *j) {
  free(j->hz);
  for (int k = 0; k < 2; k++) free(j->plant[k]);
  free(j->l);
  free(j->margins);
  pb_mimo_clear(&j->mimo);
  for (int s = 0; s < STAGES; s++) free(j->transmission[s]);
  *j = (control_judgement){0};
}
