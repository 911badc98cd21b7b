// One point of a study: see point.h.
#include "study/point.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "control/iff.h"
#include "model/zeros.h"
#include "study/file_model.h"
#include "study/rga.h"

enum { N = PB_STUDY_STRUTS };

// ---- arrays -------------------------------------------------------------------------------------

size_t pb_study_point_doubles(const pb_study_sizes *s) {
  return s->lines * (3 + 3 * 2 * N * N) + 4 * s->modes + s->gains + s->branches +
         2 * s->branches * s->gains + 2 * s->zeros;
}

static double *cut(double **next, size_t count) {
  double *at = *next;
  *next += count;
  return at;
}

pb_status pb_study_point_allocate(pb_study_point *p, pb_error *err) {
  const pb_study_sizes *s = &p->size;
  p->data = calloc(pb_study_point_doubles(s) + 1, sizeof *p->data);
  if (!p->data) return pb_fail_memory(err, "study");
  double *next = p->data;
  p->hac = (double complex *)cut(&next, 2 * s->lines * N * N);
  p->iff = (double complex *)cut(&next, 2 * s->lines * N * N);
  p->hac_damped = (double complex *)cut(&next, 2 * s->lines * N * N);
  p->locus = (double complex *)cut(&next, 2 * s->branches * s->gains);
  p->zero = (double complex *)cut(&next, 2 * s->zeros);
  p->hz = cut(&next, s->lines);
  p->rga = cut(&next, s->lines);
  p->rga_open = cut(&next, s->lines);
  p->mode_hz = cut(&next, s->modes);
  p->mode_damping = cut(&next, s->modes);
  p->attainable = cut(&next, s->modes);
  p->attained_at = cut(&next, s->modes);
  p->gain = cut(&next, s->gains);
  p->is_mode = cut(&next, s->branches);
  return PB_OK;
}

void pb_study_point_clear(pb_study_point *point) {
  if (!point) return;
  free(point->data);
  *point = (pb_study_point){0};
}

// ---- channels and band --------------------------------------------------------------------------

pb_status pb_hexapod_channels_find(const pb_model *m, pb_hexapod_channels *out, pb_error *err) {
  const bool voltage = pb_model_input(m, "Va1") >= 0;
  const char *const stem[3] = {voltage ? "Va" : "f", voltage ? "Vs" : "fm", "dL"};
  size_t *const list[3] = {out->input, out->sensor, out->metrology};
  for (int kind = 0; kind < 3; kind++) {
    for (int k = 0; k < N; k++) {
      char name[16];
      snprintf(name, sizeof name, "%s%d", stem[kind], k + 1);
      int index = kind == 0 ? pb_model_input(m, name) : pb_model_output(m, name);
      if (index < 0)
        return pb_fail(err, PB_ERR_STATE, name, "the plant has no such %s of a hexapod",
                       kind == 0 ? "input" : "output");
      list[kind][k] = (size_t)index;
    }
  }
  return PB_OK;
}

pb_status pb_hexapod_band(const pb_model *m, double *f1, double *f2, pb_error *err) {
  const double *hz = m->mode_hz, highest = 0.4 * m->sample_rate;
  if (m->modes < N || hz[0] <= 0)
    return pb_fail(err, PB_ERR_STATE, m->name ? m->name : "",
                   "the plant does not have six modes with stiffness: name a band");
  *f1 = hz[0] / 3;
  *f2 = fmin(m->modes > N ? sqrt(hz[N - 1] * hz[N]) : 2 * hz[N - 1], highest);
  if (hz[N - 1] < *f2) return PB_OK;
  return pb_fail(err, PB_ERR_STATE, m->name ? m->name : "",
                 "the sixth mode, at %g Hz, is above 0.4 of the sample rate", hz[N - 1]);
}

// ---- one analysis -------------------------------------------------------------------------------

typedef struct analysis {
  const pb_study_options *options;
  pb_model *model, *lowest;  // the whole plant; that of the locus, NULL: the same
  pb_hexapod_channels channels;
  pb_lti controller;
  pb_loop loop, low_loop;
  pb_loop_solver *solver, *low_solver;
  pb_attainable damping;
  double complex *zero, *alone;  // all that were found
  size_t zeros, alones;
} analysis;

static void analysis_clear(analysis *a) {
  free(a->zero);
  free(a->alone);
  pb_attainable_clear(&a->damping);
  pb_loop_solver_free(a->low_solver);
  pb_loop_solver_free(a->solver);
  pb_lti_free(&a->controller);
  pb_model_free(a->lowest);
  pb_model_free(a->model);
}

static pb_status close_loop(analysis *a, pb_study_point *p, pb_error *err) {
  pb_iff law = pb_iff_default(1);
  if (a->options->integrator_hz > 0) law.integrator_hz = a->options->integrator_hz;
  if (a->options->highpass_hz > 0) law.highpass_hz = a->options->highpass_hz;
  p->f1 = a->options->f1;
  p->f2 = a->options->f2;
  pb_status status = PB_OK;
  if (p->f1 == 0 && p->f2 == 0) status = pb_hexapod_band(a->model, &p->f1, &p->f2, err);
  if (!status) status = pb_iff_discrete(&law, N, a->model->sample_rate, &a->controller, err);
  a->loop = (pb_loop){a->model, &a->controller, a->channels.sensor, a->channels.input, 1, 0};
  if (!status) status = pb_loop_solver_new(&a->loop, &a->solver, err);
  if (!status) status = pb_model_lowest(a->model, &a->lowest, err);
  a->low_loop = a->loop;
  a->low_loop.model = a->lowest;
  if (!status && a->lowest) status = pb_loop_solver_new(&a->low_loop, &a->low_solver, err);
  if (status) return status;
  return pb_attainable_find(a->lowest ? a->low_solver : a->solver, a->solver, p->f1, p->f2,
                            &a->damping, err);
}

// Zeros of the upper half plane that oscillate; controllers make those at 0, which rounding moves
// about, so that a hundredth of the band's begin is the least that counts.
static size_t keep_complex(double complex *zero, size_t count, double least) {
  size_t kept = 0;
  for (size_t k = 0; k < count; k++)
    if (cimag(zero[k]) > 1e-3 * cabs(zero[k]) && cabs(zero[k]) > least) zero[kept++] = zero[k];
  return kept;
}

static pb_status find_zeros(analysis *a, double f1, pb_error *err) {
  const double least = 2 * M_PI * 0.01 * f1;
  const pb_hexapod_channels *c = &a->channels;
  pb_status status =
      pb_model_zeros(a->model, c->input, c->sensor, N, a->options->to, &a->zero, &a->zeros, err);
  if (!status)
    status = pb_model_zeros(a->model, c->input, c->sensor, 1, a->options->to, &a->alone, &a->alones,
                            err);
  if (status) return status;
  a->zeros = keep_complex(a->zero, a->zeros, least);
  a->alones = keep_complex(a->alone, a->alones, least);
  return PB_OK;
}

// ---- into the point -----------------------------------------------------------------------------

static void name_channels(const analysis *a, pb_study_point *p) {
  const pb_signal *input = &a->model->input[a->channels.input[0]],
                  *sensor = &a->model->output[a->channels.sensor[0]];
  snprintf(p->input, sizeof p->input, "%s", input->name);
  snprintf(p->sensor, sizeof p->sensor, "%s", sensor->name);
  snprintf(p->input_unit, sizeof p->input_unit, "%s", input->unit);
  snprintf(p->sensor_unit, sizeof p->sensor_unit, "%s", sensor->unit);
}

static void copy_locus(const analysis *a, pb_study_point *p) {
  const pb_rootlocus *l = &a->damping.locus;
  for (size_t k = 0; k < l->gains; k++) p->gain[k] = l->gain[k];
  for (size_t b = 0; b < l->branches; b++) p->is_mode[b] = l->is_mode[b];
  for (size_t k = 0; k < l->branches * l->gains; k++)
    p->locus[k] =
        isnan(l->pole[k].hz) ? CMPLX(NAN, NAN) : pb_pole_s(l->pole[k].z, a->model->sample_rate);
}

static void copy_results(const analysis *a, pb_study_point *p) {
  const pb_attainable *d = &a->damping;
  p->states = a->model->nx;
  p->dof = a->model->dof;
  p->sample_rate = a->model->sample_rate;
  p->best = d->best;
  p->stable = d->stable;
  p->stable_to = d->stable_to;
  p->chosen = d->chosen;
  p->smallest_attainable = INFINITY;
  for (size_t k = 0; k < d->modes; k++) {
    p->mode_hz[k] = d->mode[k].open.hz;
    p->mode_damping[k] = d->mode[k].open.damping;
    p->attainable[k] = d->mode[k].damping;
    p->attained_at[k] = d->mode[k].gain;
    p->smallest_attainable = fmin(p->smallest_attainable, d->mode[k].damping);
  }
  for (size_t k = 0; k < a->zeros; k++) p->zero[k] = a->zero[k];
  p->zero_hz = a->zeros ? cabs(a->zero[0]) / (2 * M_PI) : NAN;
  p->zero_alone_hz = a->alones ? cabs(a->alone[0]) / (2 * M_PI) : NAN;
  name_channels(a, p);
  copy_locus(a, p);
}

static void pick(const double complex *h, const analysis *a, const size_t *output, size_t lines,
                 double complex *out) {
  const size_t nu = a->model->nu, ny = a->model->ny;
  for (size_t f = 0; f < lines; f++)
    for (size_t o = 0; o < N; o++)
      for (size_t i = 0; i < N; i++)
        out[(f * N + o) * N + i] = h[(f * ny + output[o]) * nu + a->channels.input[i]];
}

static pb_status find_responses(const analysis *a, pb_study_point *p, pb_error *err) {
  const pb_study_options *o = a->options;
  const size_t lines = p->size.lines;
  for (size_t f = 0; f < lines; f++)
    p->hz[f] = o->from * pow(o->to / o->from, (double)f / (double)(lines - 1));
  double complex *h = malloc(lines * a->model->ny * a->model->nu * sizeof *h);
  if (!h) return pb_fail_memory(err, "study");
  pb_status status = pb_model_frf(a->model, PB_CONTINUOUS, p->hz, lines, h, err);
  if (!status) {
    pick(h, a, a->channels.metrology, lines, p->hac);
    pick(h, a, a->channels.sensor, lines, p->iff);
    status = pb_loop_frf(&a->loop, p->best.gain, p->hz, lines, h, err);
  }
  if (!status) pick(h, a, a->channels.metrology, lines, p->hac_damped);
  free(h);
  return status;
}

static pb_status find_coupling(pb_study_point *p, pb_error *err) {
  const double highest = p->size.modes ? p->mode_hz[p->size.modes - 1] : 0;
  pb_status status = PB_OK;
  for (size_t f = 0; f < p->size.lines && !status; f++) {
    status = pb_rga_number(N, p->hac + f * N * N, &p->rga_open[f], err);
    if (!status) status = pb_rga_number(N, p->hac_damped + f * N * N, &p->rga[f], err);
    if (p->hz[f] > highest) continue;
    p->rga_undamped = fmax(p->rga_undamped, p->rga_open[f]);
    p->rga_damped = fmax(p->rga_damped, p->rga[f]);
  }
  return status;
}

static pb_status check_options(const pb_study_options *o, pb_error *err) {
  if (o->points < 2 || !(o->from > 0 && o->from < o->to && isfinite(o->to)))
    return pb_fail(err, PB_ERR_ARGUMENT, "study", "%zu frequencies from %g to %g Hz", o->points,
                   o->from, o->to);
  return PB_OK;
}

pb_status pb_study_point_find(const cJSON *file, const char *directory, const pb_study_options *o,
                              pb_study_point *out, pb_error *err) {
  analysis a = {.options = o};
  *out = (pb_study_point){0};
  pb_status status = check_options(o, err);
  if (!status) status = pb_file_model(file, directory, &a.model, err);
  if (!status) status = pb_hexapod_channels_find(a.model, &a.channels, err);
  if (!status) status = pb_strut_condition_find(file, directory, &out->struts, err);
  if (!status) status = close_loop(&a, out, err);
  if (!status) status = find_zeros(&a, out->f1, err);
  if (!status) {
    out->size = (pb_study_sizes){o->points, a.damping.modes, a.damping.locus.branches,
                                 a.damping.locus.gains, a.zeros};
    status = pb_study_point_allocate(out, err);
  }
  if (!status) {
    copy_results(&a, out);
    status = find_responses(&a, out, err);
  }
  if (!status) status = find_coupling(out, err);
  analysis_clear(&a);
  if (status) pb_study_point_clear(out);
  return status;
}
