// The element's dynamic stiffness at the frames beside the full model's: see reduce_dynamic.h.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"
#include "part/reduce_dynamic.h"

static const double two_pi = 6.283185307179586476925286766559;

// The frames' forces for unit motions of each: boundary × boundary. q's columns in the border are
// the multipliers of averaged frames and those of rigid ones.
static pb_status dynamic_stiffness(const dynamic *d, double *out, pb_error *err) {
  const reduce_work *w = d->w;
  int n = (int)d->z, columns = (int)w->boundary, info = 0;
  double *a = malloc((d->z * d->z + 1) * sizeof *a);
  double *x = calloc(d->z * w->boundary + 1, sizeof *x);
  int *pivot = malloc((d->z + 1) * sizeof *pivot);
  size_t *place = malloc(w->boundary * sizeof *place);
  pb_status st = a && x && pivot && place ? PB_OK : pb_fail_memory(err, w->fem->name);
  for (size_t q = 0; !st && q < w->boundary; q++)
    place[q] = (w->frame[q / 6].rigid ? d->rigid_at[q / 6] : w->frame[q / 6].border) + q % 6;
  for (size_t q = 0; !st && q < w->boundary; q++) {
    if (place[q] < d->z) {
      x[place[q] + q * d->z] = 1;
    } else {
      for (size_t i = 0; i < d->z; i++) x[i + q * d->z] = -d->s[i + place[q] * d->size];
    }
  }
  for (size_t j = 0; !st && j < d->z; j++)
    memcpy(a + j * d->z, d->s + j * d->size, d->z * sizeof *a);
  if (!st && n) dgesv_(&n, &columns, a, &n, pivot, x, &n, &info);
  if (info) st = pb_fail(err, PB_ERR_NUMERIC, w->fem->name, "the frames' averages are dependent");
  for (size_t q = 0; !st && q < w->boundary; q++) {
    for (size_t p = 0; p < w->boundary; p++) {
      double force = 0;
      if (place[p] < d->z) {
        force = -x[place[p] + q * d->z];
      } else {
        for (size_t i = 0; i < d->z; i++) force += d->s[place[p] + i * d->size] * x[i + q * d->z];
        if (place[q] >= d->z) force += d->s[place[p] + place[q] * d->size];
      }
      out[p + q * w->boundary] = force;
    }
  }
  free(a);
  free(x);
  free(pivot);
  free(place);
  return st;
}

// K − ω²M of the element with its modes condensed: D_bb − ω⁴ Σ m_bp m_bpᵀ / (ω_p² − ω²).
static double element_stiffness(const reduce_work *w, double omega2, size_t i, size_t j) {
  const pb_reduction *r = w->out;
  double sum = r->k[i + j * r->size] - omega2 * r->m[i + j * r->size];
  for (size_t p = w->boundary; p < r->size; p++)
    sum -= omega2 * omega2 * r->m[i + p * r->size] * r->m[j + p * r->size] /
           (r->k[p + p * r->size] - omega2);
  return sum;
}

// Forces against forces, moments against moments, and what lies between against its like.
static double compare(const reduce_work *w, const double *full, double omega2) {
  double largest[3] = {0}, difference[3] = {0}, error = 0;
  for (size_t j = 0; j < w->boundary; j++) {
    for (size_t i = 0; i < w->boundary; i++) {
      size_t units = (i % 6 >= 3) + (size_t)(j % 6 >= 3);
      double value = full[i + j * w->boundary];
      largest[units] = fmax(largest[units], fabs(value));
      difference[units] = fmax(difference[units], fabs(value - element_stiffness(w, omega2, i, j)));
    }
  }
  for (size_t u = 0; u < 3; u++)
    if (largest[u] > 0) error = fmax(error, difference[u] / largest[u]);
  return error;
}

static pb_status compare_at(reduce_work *w, double hz, pb_reduce_check *out, pb_error *err) {
  dynamic d = {0};
  size_t negative = 0;
  *out = (pb_reduce_check){.hz = hz};
  double *full = malloc(w->boundary * w->boundary * sizeof *full);
  pb_status st = full ? PB_OK : pb_fail_memory(err, w->fem->name);
  if (!st) st = dynamic_condense(w, &out->hz, &d, &negative, err);
  if (!st) st = dynamic_count(&d, negative, &out->fixed_below, &out->free_below, err);
  if (!st) st = dynamic_stiffness(&d, full, err);
  if (!st) out->error = compare(w, full, pow(two_pi * out->hz, 2));
  dynamic_clear(&d);
  free(full);
  return st;
}

pb_status reduce_compare(reduce_work *w, pb_error *err) {
  const pb_reduce_options *o = w->options;
  pb_status st = reduce_begin(w, PB_REDUCE_CHECK, err);
  double top = o->check_to_hz;
  if (!st && !(top > 0)) {
    if (!w->modes)
      return pb_fail(err, PB_ERR_ARGUMENT, w->fem->name,
                     "without modes the check needs its highest frequency");
    top = w->out->fixed_hz[w->modes - 1] / 2;
  }
  w->out->check = st ? NULL : malloc(o->check_points * sizeof *w->out->check);
  if (!st && !w->out->check) st = pb_fail_memory(err, w->fem->name);
  for (size_t i = 0; !st && i < o->check_points; i++) {
    double hz = top * (double)(i + 1) / (double)o->check_points;
    st = compare_at(w, hz, &w->out->check[i], err);
    if (!st) w->out->checks++;
  }
  return st;
}
