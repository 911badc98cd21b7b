// The full model condensed onto its frames at one frequency: see reduce_dynamic.h.
#include "part/reduce_dynamic.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"

static const double two_pi = 6.283185307179586476925286766559;
static const double largest_growth = 1e8;  // of 1e16: eight digits are left

// ---- border -------------------------------------------------------------------------------------

static void gather(gathered *g, size_t row, size_t column, double value) {
  if (g->failed) return;
  if (g->count == g->room) {
    size_t room = 2 * g->room + 1024;
    size_t *r = realloc(g->row, room * sizeof *r);
    if (r) g->row = r;
    size_t *c = realloc(g->column, room * sizeof *c);
    if (c) g->column = c;
    double *v = realloc(g->value, room * sizeof *v);
    if (v) g->value = v;
    g->failed = !r || !c || !v;
    if (g->failed) return;
    g->room = room;
  }
  g->row[g->count] = row;
  g->column[g->count] = column;
  g->value[g->count++] = value;
}

void dynamic_clear(dynamic *d) {
  free(d->s);
  free(d->pin_of);
  free(d->frame_of);
  free(d->tie_of);
  free(d->rigid_at);
  free(d->g.row);
  free(d->g.column);
  free(d->g.value);
  free(d->border.start);
  free(d->border.column);
  free(d->border.value);
}

// How row r is seen by the border: itself when it is free, else the columns it moves with.
typedef struct view {
  bool free;
  size_t count, column[6];
  double share[6];
} view;

static view look(const dynamic *d, size_t r) {
  const reduce_work *w = d->w;
  if (w->rigid_row[r]) {
    view v = {.count = 6};
    size_t f = d->frame_of[r], at = d->tie_of[r];
    for (size_t c = 0; c < 6; c++) {
      v.column[c] = d->rigid_at[f] + c;
      v.share[c] = w->frame[f].tie[18 * (at / 3) + at % 3 + 3 * c];
    }
    return v;
  }
  if (w->held[r]) return (view){.count = 1, .column = {d->pin_of[r]}, .share = {1}};
  return (view){.free = true};
}

// value at (row i, row j) of a symmetric matrix over all rows: into B or D, if either is held.
static void add_held(dynamic *d, size_t i, size_t j, double value) {
  view a = look(d, i), b = look(d, j);
  if (a.free && b.free) return;
  if (a.free || b.free) {
    const view *held = a.free ? &b : &a;
    for (size_t c = 0; c < held->count; c++)
      gather(&d->g, a.free ? i : j, held->column[c], value * held->share[c]);
    return;
  }
  for (size_t p = 0; p < a.count; p++) {
    for (size_t q = 0; q < b.count; q++) {
      double part = value * a.share[p] * b.share[q];
      d->s[a.column[p] + b.column[q] * d->size] += part;
      if (i != j) d->s[b.column[q] + a.column[p] * d->size] += part;
    }
  }
}

static void add_matrix(dynamic *d, const pb_sparse *a, double factor) {
  for (size_t j = 0; j < a->n; j++)
    for (int64_t at = a->start[j]; at < a->start[j + 1]; at++)
      if (d->w->held[j] || d->w->held[a->row[at]])
        add_held(d, (size_t)a->row[at], j, factor * a->value[at]);
}

// Cᵀ: as if each multiplier were a column of the matrix.
static void add_averages(dynamic *d) {
  const reduce_work *w = d->w;
  for (size_t f = 0; f < w->frames; f++) {
    const reduce_frame *frame = &w->frame[f];
    for (size_t i = 0; !frame->rigid && i < 18 * frame->from->nodes; i++) {
      int64_t r = w->fem->dof[(i / 6) % 3 + 3 * frame->from->node[i / 18]];
      size_t column = frame->border + i % 6;
      if (r < 0) continue;
      view v = look(d, (size_t)r);
      if (v.free) gather(&d->g, (size_t)r, column, frame->tie[i]);
      for (size_t c = 0; c < v.count; c++) {
        d->s[v.column[c] + column * d->size] += frame->tie[i] * v.share[c];
        d->s[column + v.column[c] * d->size] += frame->tie[i] * v.share[c];
      }
    }
  }
}

static pb_status order_border(dynamic *d, pb_error *err) {
  size_t full = d->w->full;
  gathered *g = &d->g;
  d->border.columns = d->size;
  d->border.start = calloc(full + 2, sizeof *d->border.start);
  d->border.column = malloc((g->count + 1) * sizeof *d->border.column);
  d->border.value = malloc((g->count + 1) * sizeof *d->border.value);
  bool ok = !g->failed && d->border.start && d->border.column && d->border.value;
  if (!ok) return pb_fail_memory(err, d->w->fem->name);
  size_t *at = d->border.start + 1;  // filling moves each start to the next row's
  for (size_t e = 0; e < g->count; e++) at[g->row[e] + 1]++;
  for (size_t r = 0; r < full; r++) at[r + 1] += at[r];
  for (size_t e = 0; e < g->count; e++) {
    size_t to = at[g->row[e]]++;
    d->border.column[to] = g->column[e];
    d->border.value[to] = g->value[e];
  }
  return PB_OK;
}

static pb_status set_up(dynamic *d, pb_error *err) {
  const reduce_work *w = d->w;
  d->z = w->border;
  d->size = w->border + 6 * (w->frames - w->averaged);
  d->s = calloc(d->size * d->size + 1, sizeof *d->s);
  d->pin_of = calloc(w->full, sizeof *d->pin_of);
  d->frame_of = calloc(w->full, sizeof *d->frame_of);
  d->tie_of = calloc(w->full, sizeof *d->tie_of);
  d->rigid_at = calloc(w->frames, sizeof *d->rigid_at);
  if (!d->s || !d->pin_of || !d->frame_of || !d->tie_of || !d->rigid_at)
    return pb_fail_memory(err, w->fem->name);
  for (size_t p = 0; p < w->pins; p++) d->pin_of[w->pin[p]] = p;
  size_t at = d->z;
  for (size_t f = 0; f < w->frames; f++) {
    const reduce_frame *frame = &w->frame[f];
    if (!frame->rigid) continue;
    d->rigid_at[f] = at;
    at += 6;
    for (size_t i = 0; i < 3 * frame->from->nodes; i++) {
      int64_t r = w->fem->dof[i % 3 + 3 * frame->from->node[i / 3]];
      d->frame_of[r] = f;
      d->tie_of[r] = i;
    }
  }
  add_matrix(d, &w->fem->k, 1);
  add_matrix(d, &w->fem->m, d->shift);
  add_averages(d);
  return order_border(d, err);
}

// ---- condensation -------------------------------------------------------------------------------

static bool pass_progress(void *context, double done, double total) {
  const reduce_work *w = context;
  return reduce_progress(w, w->phase, done, total, NULL) == PB_OK;
}

pb_status dynamic_condense(reduce_work *w, double *hz, dynamic *d, size_t *negative,
                           pb_error *err) {
  pb_status st = PB_OK;
  pb_condensation result = {.progress = w->options->progress ? pass_progress : NULL, .context = w};
  double asked = *hz;
  for (int attempt = 0; !st; attempt++) {
    *hz = asked * (1 + 1e-7 * attempt);
    *d = (dynamic){.w = w, .shift = -pow(two_pi * *hz, 2)};
    st = set_up(d, err);
    if (!st)
      st =
          pb_condense(&w->factor, &w->fem->k, &w->fem->m, d->shift, &d->border, d->s, &result, err);
    if (st || result.growth <= largest_growth) break;
    dynamic_clear(d);
    *d = (dynamic){0};
    if (attempt == 4)
      st = pb_fail(err, PB_ERR_NUMERIC, w->fem->name,
                   "K − ω²M cannot be factored near %.6g Hz: its numbers grow by %.1e", asked,
                   result.growth);
  }
  *negative = result.negative;
  for (size_t j = 0; !st && j < d->size; j++)
    for (size_t i = 0; i < j; i++) d->s[i + j * d->size] = d->s[j + i * d->size];
  return st;
}

// Negative eigenvalues of the rows and columns of s from `first`, `skip` left out in between. A
// scaling that brings the largest entries to one keeps their number.
static pb_status count_negative(const double *s, size_t ld, const size_t *index, size_t n,
                                size_t *count, pb_error *err) {
  int in = (int)n, lwork = 1 + 2 * in, liwork = 1, info = 0, iwork[1];
  double *a = malloc((n * n + 4 * n + 2) * sizeof *a);
  *count = 0;
  if (!a) return pb_fail_memory(err, "condensation");
  double *value = a + n * n, *work = value + n, *scale = work + 2 * n + 1;
  for (size_t j = 0; j < n; j++) scale[j] = 1;
  for (int pass = 0; pass < 20; pass++) {
    for (size_t j = 0; j < n; j++) {
      double largest = 0;
      for (size_t i = 0; i < n; i++)
        largest = fmax(largest, fabs(s[index[i] + index[j] * ld] * scale[i] * scale[j]));
      value[j] = largest > 0 ? 1 / sqrt(largest) : 1;
    }
    for (size_t j = 0; j < n; j++) scale[j] *= value[j];
  }
  for (size_t j = 0; j < n; j++)
    for (size_t i = 0; i < n; i++) a[i + j * n] = s[index[i] + index[j] * ld] * scale[i] * scale[j];
  if (n) dsyevd_("N", "U", &in, a, &in, value, work, &lwork, iwork, &liwork, &info);
  for (size_t j = 0; j < n; j++) *count += value[j] < 0;
  free(a);
  return info ? pb_fail(err, PB_ERR_NUMERIC, "condensation", "dsyevd reports %d", info) : PB_OK;
}

pb_status dynamic_count(const dynamic *d, size_t negative, size_t *fixed_below, size_t *free_below,
                        pb_error *err) {
  const reduce_work *w = d->w;
  size_t *index = malloc((d->size + 1) * sizeof *index), held = 0, loose = 0, n = 0;
  if (!index) return pb_fail_memory(err, w->fem->name);
  for (size_t i = 0; i < d->z; i++) index[i] = i;
  pb_status st = count_negative(d->s, d->size, index, d->z, &held, err);
  for (size_t i = 0; i < d->size; i++)
    if (i < w->pins || i >= d->z) index[n++] = i;
  if (!st) st = count_negative(d->s, d->size, index, n, &loose, err);
  free(index);
  *fixed_below = negative + held - 6 * w->averaged;
  *free_below = negative + loose;
  return st;
}

pb_status reduce_count(reduce_work *w, double hz, size_t *fixed_below, size_t *free_below,
                       pb_error *err) {
  dynamic d = {0};
  size_t negative = 0;
  pb_status st = dynamic_condense(w, &hz, &d, &negative, err);
  if (!st) st = dynamic_count(&d, negative, fixed_below, free_below, err);
  dynamic_clear(&d);
  return st;
}
