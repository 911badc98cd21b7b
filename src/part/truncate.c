// An element with fewer modes: see truncate.h.
#include "part/truncate.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "part/truncate_internal.h"

static const double two_pi = 6.283185307179586476925286766559;

// ---- judgement ----------------------------------------------------------------------------------

// Rows of the band, the i-th of a group against the i-th of its counterpart; what lies at zero
// (rigid motions) only has to be there.
static size_t compare(const pb_proof *before, const pb_proof *after, const pb_truncate_options *o,
                      pb_truncate_row *row, double *worst_zero, double *worst_pole) {
  size_t rows = 0;
  *worst_zero = *worst_pole = 0;
  for (size_t g = 0; g < before->groups; g++) {
    const pb_proof_group *a = &before->group[g], *b = &after->group[g];
    double *worst = a->zeros ? worst_zero : worst_pole;
    for (size_t i = 0; i < a->count && cabs(a->hz[i]) <= o->high_hz; i++) {
      double size = cabs(a->hz[i]);
      bool there = i < b->count, rigid = size < 1e-3 * o->high_hz;
      double error = !there ? INFINITY : rigid ? 0 : cabs(a->hz[i] - b->hz[i]) / size;
      if (there && rigid && cabs(b->hz[i]) > 2e-3 * o->high_hz) error = INFINITY;
      *worst = fmax(*worst, error);
      if (rigid || size < o->low_hz) continue;
      if (row)
        row[rows] =
            (pb_truncate_row){a->boundary, a->what, size, there ? cabs(b->hz[i]) : NAN, error};
      rows++;
    }
  }
  return rows;
}

typedef struct trial {
  const char *name;
  const pb_element_data *e;
  const pb_truncate_options *o;
  interior x;
  pb_proof before;
  pb_error *err;
} trial;

static pb_status try_modes(const trial *t, size_t modes, pb_proof *after, bool *good) {
  pb_element_data e;
  double zero, pole;
  pb_status st = interior_take(t->name, t->e, &t->x, modes, &e, t->err);
  if (!st) st = pb_proof_make(t->name, &e, t->o, after, t->err);
  if (!st) {
    compare(&t->before, after, t->o, NULL, &zero, &pole);
    *good = zero <= t->o->zero_error && pole <= t->o->pole_error;
  }
  pb_element_data_clear(&e);
  return st;
}

// The fewest that meet the budget: halving, and from there upwards should errors not fall evenly.
static pb_status choose(const trial *t, size_t *modes) {
  size_t low = 0, high = t->x.p;
  pb_proof after;
  bool good = false;
  pb_status st = PB_OK;
  while (!st && low < high) {
    size_t middle = (low + high) / 2;
    st = try_modes(t, middle, &after, &good);
    if (st) break;
    pb_proof_clear(&after);
    if (good)
      high = middle;
    else
      low = middle + 1;
  }
  for (*modes = high; !st; ++*modes) {
    st = try_modes(t, *modes, &after, &good);
    if (!st) pb_proof_clear(&after);
    if (good || *modes == t->x.p) break;
  }
  return st;
}

static pb_status finish(const trial *t, size_t modes, pb_truncation *out) {
  pb_proof after = {0};
  bool good;
  pb_status st = try_modes(t, modes, &after, &good);
  if (!st) st = interior_take(t->name, t->e, &t->x, modes, &out->element, t->err);
  if (st) {
    pb_proof_clear(&after);
    return st;
  }
  size_t rows = compare(&t->before, &after, t->o, NULL, &out->worst_zero, &out->worst_pole);
  out->modes_before = t->x.p;
  out->modes = modes;
  out->row = malloc((rows + 1) * sizeof *out->row);
  out->fixed_hz = malloc((modes + 1) * sizeof *out->fixed_hz);
  if (out->row && out->fixed_hz) {
    out->rows = compare(&t->before, &after, t->o, out->row, &out->worst_zero, &out->worst_pole);
    for (size_t q = 0; q < modes; q++)  // K is ω² there
      out->fixed_hz[q] = sqrt(out->element.k[(t->x.b + q) * (out->element.size + 1)]) / two_pi;
  } else {
    st = pb_fail_memory(t->err, t->name);
  }
  pb_proof_clear(&after);
  return st;
}

static bool distinct(const pb_element_data *e, size_t a, size_t b) {
  if (a >= e->frames || b >= e->frames || a == b) return false;
  return memcmp(e->position + 3 * a, e->position + 3 * b, 3 * sizeof(double)) != 0;
}

static pb_status check(const char *name, const pb_element_data *e, const pb_truncate_options *o,
                       pb_error *err) {
  if (e->size <= 6 * e->frames)
    return pb_fail(err, PB_ERR_ARGUMENT, name, "has no modes that could be dropped");
  if (e->frames < 2 || o->base >= e->frames || o->tip >= e->frames || o->base == o->tip)
    return pb_fail(err, PB_ERR_ARGUMENT, name, "frames %zu and %zu are not two of its %zu",
                   o->base + 1, o->tip + 1, e->frames);
  if (!(o->high_hz > 0) || !(o->low_hz >= 0) || !(o->low_hz < o->high_hz))
    return pb_fail(err, PB_ERR_ARGUMENT, name, "a band from %g to %g Hz is empty", o->low_hz,
                   o->high_hz);
  if (o->modes > e->size - 6 * e->frames)
    return pb_fail(err, PB_ERR_ARGUMENT, name, "has %zu modes, not %zu", e->size - 6 * e->frames,
                   o->modes);
  if (o->stacks && (!distinct(e, o->actuator[0], o->actuator[1]) ||
                    !distinct(e, o->sensor[0], o->sensor[1]) || !distinct(e, o->base, o->tip)))
    return pb_fail(err, PB_ERR_ARGUMENT, name,
                   "the stacks' frames and the ends have to be pairs of frames apart");
  return PB_OK;
}

pb_status pb_element_truncate(const char *name, const pb_element_data *data,
                              const pb_truncate_options *options, pb_truncation *out,
                              pb_error *err) {
  pb_element *sound = NULL;
  size_t modes = options->modes;
  *out = (pb_truncation){0};
  pb_status st = check(name, data, options, err);
  if (!st)
    st = pb_element_new(name, data->frames, data->size, data->position, data->k, data->m, NULL,
                        &sound, err);
  if (st) return st;
  const pb_element_data symmetric = {.frames = sound->frames,
                                     .size = sound->size,
                                     .position = sound->position,
                                     .k = sound->k,
                                     .m = sound->m};
  trial t = {.name = name, .e = &symmetric, .o = options, .err = err};
  st = interior_make(name, &symmetric, &t.x, err);
  if (!st) st = interior_rank(name, &t.x, options->high_hz, err);
  if (!st) st = pb_proof_make(name, &symmetric, options, &t.before, err);
  if (!st && !modes) st = choose(&t, &modes);
  if (!st) st = finish(&t, modes, out);
  pb_proof_clear(&t.before);
  interior_clear(&t.x);
  pb_element_free(sound);
  if (st) pb_truncation_clear(out);
  return st;
}

void pb_truncation_clear(pb_truncation *truncation) {
  pb_element_data_clear(&truncation->element);
  free(truncation->row);
  free(truncation->fixed_hz);
  *truncation = (pb_truncation){0};
}
