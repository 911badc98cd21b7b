// Craig–Bampton reduction of a full model: see reduce.h. The phases in their order; each is a file
// of its own.
#include "part/reduce_internal.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

const char *pb_reduce_phase_name(pb_reduce_phase phase) {
  static const char *const name[PB_REDUCE_PHASES] = {"ordering",         "factorisation",
                                                     "constraint modes", "fixed-interface modes",
                                                     "projection",       "check"};
  return phase < PB_REDUCE_PHASES ? name[phase] : "";
}

void pb_reduction_free(pb_reduction *r) {
  if (!r) return;
  free(r->position);
  free(r->k);
  free(r->m);
  free(r->fixed_hz);
  free(r->shape);
  free(r->check);
  free(r);
}

// ---- progress and time --------------------------------------------------------------------------

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

pb_status reduce_progress(const reduce_work *w, pb_reduce_phase phase, double done, double total,
                          pb_error *err) {
  const pb_reduce_options *o = w->options;
  if (!o->progress || o->progress(o->context, phase, done, total)) return PB_OK;
  return pb_fail(err, PB_ERR_STATE, w->fem->name, "the reduction was stopped");
}

static void end_phase(reduce_work *w) {
  double time = now();
  if (w->began > 0) w->out->seconds[w->phase] += time - w->began;
  w->began = time;
}

pb_status reduce_begin(reduce_work *w, pb_reduce_phase phase, pb_error *err) {
  end_phase(w);
  w->phase = phase;
  return reduce_progress(w, phase, 0, 0, err);
}

// ---- the whole ----------------------------------------------------------------------------------

static void clear_work(reduce_work *w) {
  for (size_t f = 0; w->frame && f < w->frames; f++) free(w->frame[f].tie);
  free(w->frame);
  free(w->node_of_row);
  free(w->rigid_row);
  free(w->held);
  free(w->pin_entry);
  pb_sparse_clear(&w->mass);
  pb_factor_clear(&w->factor);
  free(w->w);
  free(w->d);
  free(w->scale);
  free(w->pivot);
  free(w->psi);
  free(w->stiffness);
  free(w->phi);
  free(w->omega2);
}

static pb_status check_options(const pb_fem *fem, const pb_reduce_options *o, pb_error *err) {
  if (!isfinite(o->max_hz) || o->max_hz < 0 || !isfinite(o->check_to_hz) || o->check_to_hz < 0)
    return pb_fail(err, PB_ERR_ARGUMENT, fem->name, "a frequency limit is negative or not finite");
  return PB_OK;
}

static pb_status prepare_result(reduce_work *w, pb_error *err) {
  pb_reduction *out = w->out;
  out->frames = w->frames;
  out->full_dof = w->full;
  out->position = malloc(3 * w->frames * sizeof *out->position);
  if (!out->position) return pb_fail_memory(err, w->fem->name);
  for (size_t f = 0; f < w->frames; f++)
    memcpy(out->position + 3 * f, w->fem->frame[f].origin, 3 * sizeof *out->position);
  return PB_OK;
}

static pb_status keep_shape(reduce_work *w, pb_error *err) {
  pb_reduction *out = w->out;
  size_t bytes = w->full * w->boundary * sizeof *out->shape;
  out->shape = malloc(w->full * out->size * sizeof *out->shape);
  if (!out->shape) return pb_fail_memory(err, w->fem->name);
  memcpy(out->shape, w->psi, bytes);
  memcpy(out->shape + w->full * w->boundary, w->phi, w->full * w->modes * sizeof *out->shape);
  return PB_OK;
}

// The modes take the most memory of all phases; K makes room for them.
static void spend_stiffness(const reduce_work *w) {
  const pb_reduce_options *o = w->options;
  if (o->spend && !o->prove && !(o->max_hz > 0) && !o->check_points) pb_sparse_clear(o->spend);
}

pb_status pb_reduce(const pb_fem *fem, const pb_reduce_options *options, bool keep_shapes,
                    pb_reduction **out, pb_error *err) {
  *out = NULL;
  reduce_work w = {.fem = fem, .options = options};
  pb_status st = check_options(fem, options, err);
  if (st) return st;
  w.out = calloc(1, sizeof *w.out);
  if (!w.out) return pb_fail_memory(err, fem->name);
  st = reduce_set_up(&w, err);
  if (!st) st = prepare_result(&w, err);
  if (!st) st = reduce_static(&w, err);
  if (!st) st = reduce_project_stiffness(&w, err);
  if (!st) spend_stiffness(&w);
  if (!st) st = reduce_modes(&w, err);
  if (!st) st = reduce_project(&w, err);
  if (!st && keep_shapes) st = keep_shape(&w, err);
  if (!st && options->check_points) st = reduce_compare(&w, err);
  if (!st) end_phase(&w);
  w.out->factor_entries = pb_factor_entries(&w.factor);
  if (st) {
    pb_reduction_free(w.out);
  } else {
    *out = w.out;
  }
  clear_work(&w);
  return st;
}
