// A loop prepared for its poles: its channels, its open-loop poles, and a large plant's lowest
// modes. See loop.h.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "control/loop.h"
#include "control/loop_internal.h"
#include "control/lti_ops.h"

enum { REDUCED_STATES = 120 };

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
