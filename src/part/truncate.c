// An element with fewer modes: see truncate.h.
#include "part/truncate.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"
#include "part/truncate_internal.h"

static const double two_pi = 6.283185307179586476925286766559;

// The element in the coordinates of T with all of Φ: dropping modes is dropping rows.
typedef struct interior {
  size_t b, p;    // coordinates of the frames, modes
  double *k, *m;  // (b + p)², frames first; K is block diagonal
  double *hz;     // [p] ascending
  size_t *order;  // [p] modes by what they do to the frames in the band, most first
} interior;

static void clear_interior(interior *x) {
  free(x->k);
  free(x->m);
  free(x->hz);
  free(x->order);
  *x = (interior){0};
}

static double *block(const double *x, size_t n, size_t row, size_t rows, size_t col, size_t cols) {
  double *out = malloc((rows * cols + 1) * sizeof *out);
  for (size_t c = 0; out && c < cols; c++)
    memcpy(out + c * rows, x + row + (col + c) * n, rows * sizeof *out);
  return out;
}

// Fixed-interface modes: Φ (p × p, M-normalised) and their frequencies.
static pb_status solve_interior(const char *name, const pb_element_data *e, interior *x,
                                double *phi, double *mii, pb_error *err) {
  int p = (int)x->p, itype = 1, info = 0, lwork = 1 + 6 * p + 2 * p * p, liwork = 3 + 5 * p;
  double *work = malloc((size_t)lwork * sizeof *work), *m = NULL;
  int *iwork = malloc((size_t)liwork * sizeof *iwork);
  m = block(mii, x->p, 0, x->p, 0, x->p);
  pb_status st = work && iwork && m ? PB_OK : pb_fail_memory(err, name);
  if (!st) {
    dsygvd_(&itype, "V", "U", &p, phi, &p, m, &p, x->hz, work, &lwork, iwork, &liwork, &info);
    if (info > p)
      st = pb_fail(err, PB_ERR_ELEMENT, name, "M of the modes is not positive definite");
    else if (info)
      st = pb_fail(err, PB_ERR_NUMERIC, name, "the fixed-interface modes did not converge");
    else if (!(x->hz[0] > 0))
      st = pb_fail(err, PB_ERR_ELEMENT, name,
                   "its modes are not held by its frames: the first has ω² = %g of %zu rows",
                   x->hz[0], e->size);
  }
  for (size_t i = 0; !st && i < x->p; i++) x->hz[i] = sqrt(x->hz[i]) / two_pi;
  free(work);
  free(iwork);
  free(m);
  return st;
}

// T = [[I, 0], [Ψ, Φ]] (size × size), Ψ = −Φ ω⁻² Φᵀ K_ib.
static void make_transform(const pb_element_data *e, const interior *x, const double *phi,
                           double *t) {
  size_t n = e->size, b = x->b, p = x->p;
  memset(t, 0, n * n * sizeof *t);
  for (size_t j = 0; j < b; j++) {
    t[j + j * n] = 1;
    for (size_t q = 0; q < p; q++) {
      double load = 0, omega = two_pi * x->hz[q];
      for (size_t i = 0; i < p; i++) load += phi[i + q * p] * e->k[b + i + j * n];
      load /= omega * omega;
      if (load != 0)
        for (size_t i = 0; i < p; i++) t[b + i + j * n] -= phi[i + q * p] * load;
    }
  }
  for (size_t q = 0; q < p; q++) memcpy(t + b + (b + q) * n, phi + q * p, p * sizeof *t);
}

static void congruence(const double *t, const double *x, size_t size, double *work, double *out) {
  int n = (int)size;
  double one = 1, zero = 0;
  dgemm_("N", "N", &n, &n, &n, &one, x, &n, t, &n, &zero, work, &n);
  dgemm_("T", "N", &n, &n, &n, &one, t, &n, work, &n, &zero, out, &n);
  for (size_t j = 0; j < size; j++)
    for (size_t i = 0; i < j; i++)
      out[i + j * size] = out[j + i * size] = 0.5 * (out[i + j * size] + out[j + i * size]);
}

static pb_status make_interior(const char *name, const pb_element_data *e, interior *x,
                               pb_error *err) {
  size_t n = e->size;
  *x = (interior){.b = 6 * e->frames, .p = n - 6 * e->frames};
  double *phi = block(e->k, n, x->b, x->p, x->b, x->p),
         *mii = block(e->m, n, x->b, x->p, x->b, x->p);
  double *t = malloc(n * n * sizeof *t), *work = malloc(n * n * sizeof *work);
  x->k = malloc(n * n * sizeof *x->k);
  x->m = malloc(n * n * sizeof *x->m);
  x->hz = malloc((x->p + 1) * sizeof *x->hz);
  bool ok = phi && mii && t && work && x->k && x->m && x->hz;
  pb_status st = ok ? PB_OK : pb_fail_memory(err, name);
  if (!st) st = solve_interior(name, e, x, phi, mii, err);
  if (!st) {
    make_transform(e, x, phi, t);
    congruence(t, e->k, n, work, x->k);
    congruence(t, e->m, n, work, x->m);
    // What is zero or one by construction is made so.
    for (size_t j = x->b; j < n; j++) {
      for (size_t i = 0; i < n; i++) {
        double omega = two_pi * x->hz[j - x->b];
        x->k[i + j * n] = x->k[j + i * n] = i == j ? omega * omega : 0;
        if (i >= x->b) x->m[i + j * n] = i == j;
      }
    }
  }
  free(phi);
  free(mii);
  free(t);
  free(work);
  if (st) clear_interior(x);
  return st;
}

typedef struct ranked {
  double weight;
  size_t mode;
} ranked;

static int by_weight(const void *a, const void *b) {
  const ranked *x = a, *y = b;
  if (x->weight != y->weight) return x->weight < y->weight ? 1 : -1;
  return (x->mode > y->mode) - (x->mode < y->mode);
}

// A mode adds −ω⁴ M_bq M_qb / (ω_q² − ω²) to the frames' dynamic stiffness: its size at the band's
// end against ω² M_bb, the largest over the frames' coordinates. Modes of the band come first.
static pb_status rank_modes(const char *name, interior *x, double high_hz, pb_error *err) {
  ranked *list = malloc((x->p + 1) * sizeof *list);
  x->order = malloc((x->p + 1) * sizeof *x->order);
  if (!list || !x->order) {
    free(list);
    return pb_fail_memory(err, name);
  }
  size_t n = x->b + x->p;
  for (size_t q = 0; q < x->p; q++) {
    double ratio = pow(x->hz[q] / high_hz, 2), share = 0;
    for (size_t i = 0; i < x->b; i++) {
      double mass = x->m[i + i * n], coupling = x->m[i + (x->b + q) * n];
      if (mass > 0) share = fmax(share, coupling * coupling / mass);
    }
    list[q] = (ranked){ratio > 1.5 ? share / (ratio - 1) : INFINITY, q};
  }
  qsort(list, x->p, sizeof *list, by_weight);
  for (size_t q = 0; q < x->p; q++) x->order[q] = list[q].mode;
  free(list);
  return PB_OK;
}

static int ascending(const void *a, const void *b) {
  size_t x = *(const size_t *)a, y = *(const size_t *)b;
  return (x > y) - (x < y);
}

// The first `modes` of the ranking, by frequency.
static pb_status take_modes(const char *name, const pb_element_data *e, const interior *x,
                            size_t modes, pb_element_data *out, pb_error *err) {
  size_t n = x->b + modes, whole = x->b + x->p;
  *out = (pb_element_data){.frames = e->frames, .size = n};
  out->position = malloc(3 * e->frames * sizeof *out->position);
  out->k = malloc(n * n * sizeof *out->k);
  out->m = malloc(n * n * sizeof *out->m);
  size_t *from = malloc(n * sizeof *from);
  if (!out->position || !out->k || !out->m || !from) {
    free(from);
    pb_element_data_clear(out);
    return pb_fail_memory(err, name);
  }
  memcpy(out->position, e->position, 3 * e->frames * sizeof *out->position);
  for (size_t i = 0; i < n; i++) from[i] = i < x->b ? i : x->b + x->order[i - x->b];
  qsort(from, n, sizeof *from, ascending);
  for (size_t j = 0; j < n; j++) {
    for (size_t i = 0; i < n; i++) {
      out->k[i + j * n] = x->k[from[i] + from[j] * whole];
      out->m[i + j * n] = x->m[from[i] + from[j] * whole];
    }
  }
  free(from);
  return PB_OK;
}

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
  pb_status st = take_modes(t->name, t->e, &t->x, modes, &e, t->err);
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
  if (!st) st = take_modes(t->name, t->e, &t->x, modes, &out->element, t->err);
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
  st = make_interior(name, &symmetric, &t.x, err);
  if (!st) st = rank_modes(name, &t.x, options->high_hz, err);
  if (!st) st = pb_proof_make(name, &symmetric, options, &t.before, err);
  if (!st && !modes) st = choose(&t, &modes);
  if (!st) st = finish(&t, modes, out);
  pb_proof_clear(&t.before);
  clear_interior(&t.x);
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
