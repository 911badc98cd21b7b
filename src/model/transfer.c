// Preparing, applying and examining a transfer: see transfer.h.
#include "model/transfer.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/array.h"
#include "base/lapack.h"
#include "base/product.h"
#include "model/electronics.h"

// c = a b + beta c; a is m × k, b k × n.
static void multiply(size_t m, size_t n, size_t k, double alpha, const double *a, const double *b,
                     double beta, double *c) {
  const int im = (int)m, in = (int)n, ik = (int)k;
  if (m && n) dgemm_("N", "N", &im, &in, &ik, &alpha, a, &im, b, &ik, &beta, c, &im);
}

// Rows of a matrix, first ≤ r < end.
typedef struct range {
  size_t first, end;
} range;

static range nonzeros(const double *column, size_t rows) {
  range r = {0, rows};
  while (r.end > 0 && column[r.end - 1] == 0.0) r.end--;
  while (r.first < r.end && column[r.first] == 0.0) r.first++;
  return r;
}

// c = a s where s (k × n) is nearly block diagonal, as what belongs to components is: columns whose
// entries share rows with those before are a block, a product of its own.
typedef struct blocks {
  size_t m, k;
  const double *a, *s;
  double *c;
  size_t *column;  // [count + 1] where each begins
  range *rows;     // [count]
  size_t count;
} blocks;

static void blocks_find(blocks *b, size_t n) {
  for (size_t j = 0, next; j < n; j = next) {
    range rows = nonzeros(b->s + j * b->k, b->k);
    for (next = j + 1; next < n; next++) {
      const range r = nonzeros(b->s + next * b->k, b->k);
      if (r.first >= rows.end || r.end <= rows.first) break;
      if (r.first < rows.first) rows.first = r.first;
      if (r.end > rows.end) rows.end = r.end;
    }
    b->column[b->count] = j;
    b->rows[b->count++] = rows;
  }
  b->column[b->count] = n;
}

static double operations(const blocks *b) {
  double sum = 0;
  for (size_t i = 0; i < b->count; i++)
    sum += (double)((b->column[i + 1] - b->column[i]) * (b->rows[i].end - b->rows[i].first));
  return 2 * (double)b->m * sum;
}

static void blocks_multiply(void *context, size_t item, size_t worker) {
  (void)worker;
  const blocks *b = context;
  const size_t first = b->column[item], columns = b->column[item + 1] - first, m = b->m;
  const range rows = b->rows[item];
  if (rows.end > rows.first)
    pb_product_make(&(pb_product){"N", "N", m, columns, rows.end - rows.first,
                                  b->a + rows.first * m, b->s + rows.first + first * b->k, m, b->k,
                                  0, b->c + first * m, m},
                    NULL);
  else
    memset(b->c + first * m, 0, m * columns * sizeof *b->c);
}

static pb_status multiply_blocks(size_t m, size_t n, size_t k, const double *a, const double *s,
                                 double *c, const pb_workers *workers, pb_error *err) {
  blocks b = {.m = m, .k = k, .a = a, .s = s, .c = c};
  b.column = malloc((n + 1) * sizeof *b.column);
  b.rows = malloc((n + 1) * sizeof *b.rows);
  const bool ok = b.column && b.rows;
  if (ok) {
    blocks_find(&b, n);
    pb_workers_run(pb_workers_for(workers, operations(&b)), b.count, blocks_multiply, &b);
  }
  free(b.column);
  free(b.rows);
  return ok ? PB_OK : pb_fail_memory(err, "transfer");
}

// Work space of the preparation; nq old, nr new coordinates.
typedef struct work {
  double *lu;       // nr × nu'
  double *l;        // nr × nq
  double *ml;       // nr × nq: M' L
  double *bml;      // nx' × nq: B M' L
  double *static_;  // nr × nu: D_q' after the old inputs' names
  double *force;    // nr × nu: M' of it
} work;

static void work_clear(work *w) {
  free(w->l);
  free(w->lu);
  free(w->ml);
  free(w->bml);
  free(w->static_);
  free(w->force);
}

// X = beta X + (B M' L) C, leaving B M' L in the work space.
static pb_status add_part(const pb_transfer *t, work *w, const double *b, const double *c,
                          double beta, const pb_workers *workers, pb_error *err) {
  const pb_motion_map *from = t->from_map, *to = t->to_map;
  pb_status st = multiply_blocks(to->nx, from->n, to->n, b, w->ml, w->bml, workers, err);
  const pb_product product = {"N", "N",    to->nx,    from->nx, from->n, w->bml,
                              c,   to->nx, from->ldc, beta,     t->x,    to->nx};
  if (!st) pb_product_make(&product, workers);
  return st;
}

static bool is_identity(const double *a, size_t n) {
  for (size_t j = 0; j < n; j++)
    for (size_t i = 0; i < n; i++)
      if (a[i + j * n] != (i == j ? 1.0 : 0.0)) return false;
  return true;
}

// Only signals differ: then the modes have the bits that they had (mode_store.h, or by solving the
// same equations anew), and B_q M C_q + B_v M C_v = I need not be computed.
static bool same_motion(const pb_motion_map *a, const pb_motion_map *b, const double *l) {
  const size_t square = a->n * a->n * sizeof(double), rows = a->n * sizeof(double);
  if (a->n != b->n || a->nx != b->nx || memcmp(a->m, b->m, square) != 0) return false;
  if (memcmp(a->bq, b->bq, a->nx * rows) != 0 || memcmp(a->bv, b->bv, a->nx * rows) != 0)
    return false;
  for (size_t j = 0; j < a->nx; j++)
    if (memcmp(a->cq + j * a->ldc, b->cq + j * b->ldc, rows) != 0 ||
        memcmp(a->cv + j * a->ldc, b->cv + j * b->ldc, rows) != 0)
      return false;
  return is_identity(l, a->n);
}

// What inputs hold statically, without states or inside what is new: U = B_q M' (L D_q − D_q' +
// L_u).
static void add_static(const pb_transfer *t, work *w) {
  const pb_motion_map *from = t->from_map, *to = t->to_map;
  multiply(to->nx, from->nu, from->n, 1.0, w->bml, from->dq, 0.0, t->u);
  for (size_t i = 0; i < to->nu; i++) {
    if (t->input_from[i] < 0) continue;
    for (size_t r = 0; r < to->n; r++)
      w->static_[r + (size_t)t->input_from[i] * to->n] =
          to->dq[r + i * to->n] - w->lu[r + i * to->n];
  }
  multiply(to->n, from->nu, to->n, 1.0, to->m, w->static_, 0.0, w->force);
  multiply(to->nx, from->nu, to->n, -1.0, to->bq, w->force, 1.0, t->u);
}

// States of residual pairs (rates.h): the only ones in which no coordinate takes part.
static bool is_residual(const pb_motion_map *map, size_t state) {
  for (size_t r = 0; r < map->n; r++)
    if (map->bq[state + r * map->nx] != 0 || map->bv[state + r * map->nx] != 0) return false;
  return true;
}

static bool has_residual(const pb_motion_map *map) {
  for (size_t j = 0; j < map->nx; j++)
    if (is_residual(map, j)) return true;
  return false;
}

// A residual pair, of the states x_1 = P u_i and x_2, rests under the input that is held: x_1 =
// u_i.
static void set_residual(const pb_transfer *t) {
  const pb_model *to = t->to;
  for (size_t j = 0; j + 1 < to->nx; j++) {
    if (!is_residual(t->to_map, j)) continue;
    for (size_t i = 0; i < to->nu; i++)
      if (to->b[j + 1 + i * to->nx] != 0 && t->input_from[i] >= 0)
        t->u[j + (size_t)t->input_from[i] * to->nx] = 1;
    j++;
  }
}

static pb_status x_new(pb_transfer *t, pb_error *err) {
  t->x = pb_array_new(t->to->nx * t->from->nx, sizeof *t->x);
  return t->x ? PB_OK : pb_fail_memory(err, "transfer");
}

static pb_status matrices_make(pb_transfer *t, const pb_workers *workers, pb_error *err) {
  const pb_motion_map *from = t->from_map, *to = t->to_map;
  work w = {0};
  pb_status st = pb_transfer_coordinates(from, to, &w.l, &w.lu, err);
  w.ml = pb_array_new(to->n * from->n, sizeof(double));
  w.bml = pb_array_new(to->nx * from->n, sizeof(double));
  w.static_ = pb_array_zero(to->n * from->nu + 1, sizeof(double));
  w.force = pb_array_new(to->n * from->nu + 1, sizeof(double));
  if (!st && (!w.ml || !w.bml || !w.static_ || !w.force)) st = pb_fail_memory(err, "transfer");
  if (!st) st = multiply_blocks(to->n, from->n, to->n, to->m, w.l, w.ml, workers, err);
  const bool residual = has_residual(to), same = !st && !residual && same_motion(from, to, w.l);
  if (!st && !same) st = x_new(t, err);
  if (!st && !same) st = add_part(t, &w, to->bv, from->cv, 0, workers, err);
  if (!st && !same) st = add_part(t, &w, to->bq, from->cq, 1, workers, err);
  if (same) st = multiply_blocks(to->nx, from->n, to->n, to->bq, w.ml, w.bml, workers, err);
  if (!st) add_static(t, &w);  // with what the displacements have left
  if (!st && residual) set_residual(t);
  work_clear(&w);
  return st;
}

static pb_status allocate(pb_transfer *t, pb_error *err) {
  t->u = pb_array_zero(t->to->nx * t->from->nu, sizeof *t->u);
  t->input_from = calloc(t->to->nu, sizeof *t->input_from);
  t->output_from = calloc(t->to->ny, sizeof *t->output_from);
  t->before = pb_state_new(t->from);
  t->after = pb_state_new(t->to);
  if (!t->u || !t->input_from || !t->output_from || !t->before || !t->after)
    return pb_fail_memory(err, "transfer");
  for (size_t i = 0; i < t->to->nu; i++)
    t->input_from[i] = pb_model_input(t->from, t->to->input[i].name);
  for (size_t o = 0; o < t->to->ny; o++)
    t->output_from[o] = pb_model_output(t->from, t->to->output[o].name);
  return PB_OK;
}

pb_status pb_transfer_new(const pb_model *from, const pb_motion_map *from_map, const pb_model *to,
                          const pb_motion_map *to_map, const pb_workers *workers, pb_transfer **out,
                          pb_error *err) {
  *out = NULL;
  if (!from_map || !to_map)
    return pb_fail(err, PB_ERR_STATE, "/components",
                   "more than %d coordinates, elements' modes included, cannot be carried over "
                   "while the plant runs",
                   PB_MOTION_MAP_LARGEST);
  pb_transfer *t = calloc(1, sizeof *t);
  if (!t) return pb_fail_memory(err, "transfer");
  t->from = from;
  t->to = to;
  t->from_map = from_map;
  t->to_map = to_map;
  pb_status st = allocate(t, err);
  if (!st) st = matrices_make(t, workers, err);
  if (st)
    pb_transfer_free(t);
  else
    *out = t;
  return st;
}

void pb_transfer_free(pb_transfer *t) {
  if (!t) return;
  free(t->x);
  free(t->u);
  free(t->input_from);
  free(t->output_from);
  free(t->before);
  free(t->after);
  free(t);
}

// With X x in its place.
static void finish(pb_transfer *t, const pb_state *before, pb_state *after) {
  memcpy(t->before, before, pb_state_bytes(t->from));
  pb_electronics_carry(t->from, before, t->input_from, t->output_from, t->to, after);
  pb_add_columns(t->to->nx, t->from->nu, t->u, before->data + t->from->nx, after->data);
  after->step = before->step;
  pb_state_measure(t->to, after);
  memcpy(t->after, after, pb_state_bytes(t->to));
}

void pb_transfer_apply(pb_transfer *t, const pb_state *before, pb_state *after) {
  const size_t nx = t->from->nx, mx = t->to->nx;
  if (t->x) {
    memset(after->data, 0, mx * sizeof *after->data);
    pb_add_columns(mx, nx, t->x, before->data, after->data);
  } else {
    memcpy(after->data, before->data, mx * sizeof *after->data);
  }
  finish(t, before, after);
}

void pb_transfer_apply_moved(pb_transfer *t, const pb_state *before, const double *moved,
                             pb_state *after) {
  memcpy(after->data, moved, t->to->nx * sizeof *after->data);
  finish(t, before, after);
}

// Output o of the plant itself, y = C x + D u, and the sum of the magnitudes that it adds up from.
static double output_of(const pb_model *m, const pb_state *s, size_t o, double *size) {
  double sum = 0.0;
  for (size_t j = 0; j < m->nx + m->nu; j++) {
    const double *a = j < m->nx ? m->c + j * m->ny : m->d + (j - m->nx) * m->ny;
    sum += a[o] * s->data[j];
    *size += fabs(a[o] * s->data[j]);
  }
  return sum;
}

pb_status pb_transfer_examine(const pb_transfer *t, pb_transfer_report *out, pb_error *err) {
  const pb_state *a = t->before, *b = t->after;
  double worst = -1.0;
  *out = (pb_transfer_report){.worst_output = -1};
  for (size_t o = 0; o < t->to->ny; o++) {
    if (t->output_from[o] < 0) continue;
    double size = 0.0;
    const double jump = fabs(output_of(t->to, b, o, &size) -
                             output_of(t->from, a, (size_t)t->output_from[o], &size));
    const double part = size > 0.0 ? jump / size : 0.0;
    if (part <= worst) continue;
    worst = part;
    out->output_jump = jump;
    out->worst_output = (int)o;
  }
  pb_status st =
      pb_motion_map_energy(t->from_map, a->data, a->data + t->from->nx, &out->energy_before, err);
  if (!st)
    st = pb_motion_map_energy(t->to_map, b->data, b->data + t->to->nx, &out->energy_after, err);
  return st;
}
