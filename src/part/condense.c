// Multifrontal condensation: see condense.h.
//
// A front holds the columns of one supernode of CHOLMOD's analysis and the rows they reach, then,
// where one of these columns or of those below it in the tree meets the border, all rows of the
// border:
//   panel  rows × columns, becomes L;    update  (rows − columns)², lower triangle, passed on
#include "part/condense.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"

enum { PIVOTS = 64, STRIP = 128 };  // columns eliminated at once; columns updated at once

typedef struct front {
  size_t rows, columns;         // of the panel, the border's among the rows
  size_t listed;                // rows without the border's
  const SuiteSparse_long *row;  // [listed] places in the elimination order, ascending
  double *panel, *update;
  size_t next;   // next child of its parent; SIZE_MAX: the last
  size_t child;  // its first child
  bool bordered;
} front;

typedef struct condensation {
  pb_factor *order;
  cholmod_sparse *k, *m;
  double shift, largest;
  const pb_border *border;
  double *s, *scaled;
  size_t scaled_room;
  front *front;   // [supernodes]
  size_t *local;  // [n] place in the present front
  pb_condensation *result;
} condensation;

// ---- dense elimination --------------------------------------------------------------------------

static void subtract_product(size_t m, size_t n, size_t k, const double *a, size_t lda,
                             const double *b, size_t ldb, double *c, size_t ldc) {
  int im = (int)m, in = (int)n, ik = (int)k, ia = (int)lda, ib = (int)ldb, ic = (int)ldc;
  double minus = -1, one = 1;
  if (m && n && k) dgemm_("N", "T", &im, &in, &ik, &minus, a, &ia, b, &ib, &one, c, &ic);
}

// LDLᵀ of the n × n block at a: unit L below the diagonal, D on it.
static void eliminate_block(size_t n, double *a, size_t ld, condensation *c) {
  for (size_t k = 0; k < n; k++) {
    double pivot = a[k * (ld + 1)];
    c->result->negative += pivot < 0;
    if (!(fabs(pivot) > 0)) {
      c->result->growth = INFINITY;
      a[k * (ld + 1)] = pivot = c->largest;
    }
    for (size_t j = k + 1; j < n; j++) {
      double l = a[j + k * ld] / pivot;
      c->result->growth = fmax(c->result->growth, fabs(l * a[j + k * ld]) / c->largest);
      for (size_t i = j; i < n; i++) a[i + j * ld] -= a[i + k * ld] * l;
    }
    for (size_t j = k + 1; j < n; j++) a[j + k * ld] /= pivot;
  }
}

// The rows below an eliminated block: x = L D on entry to the scaling, L after it. The copy keeps
// L D for the columns still to come.
static void scale_rows(size_t rows, size_t n, double *x, size_t ld, const double *d, size_t ld_d,
                       double *copy, condensation *c) {
  for (size_t k = 0; k < n; k++) {
    double pivot = d[k * (ld_d + 1)], largest = 0;
    for (size_t i = 0; i < rows; i++) {
      double value = x[i + k * ld];
      largest = fmax(largest, fabs(value));
      copy[i + k * rows] = value;
      x[i + k * ld] = value / pivot;
    }
    c->result->growth = fmax(c->result->growth, largest * largest / fabs(pivot) / c->largest);
  }
}

static void eliminate(front *f, condensation *c) {
  size_t ld = f->rows;
  for (size_t j = 0; j < f->columns; j += PIVOTS) {
    size_t n = f->columns - j < PIVOTS ? f->columns - j : PIVOTS, rows = f->rows - j - n;
    double *block = f->panel + j * (ld + 1), *below = block + n, one = 1;
    int im = (int)rows, in = (int)n, il = (int)ld;
    eliminate_block(n, block, ld, c);
    if (!rows) continue;
    dtrsm_("R", "L", "T", "U", &im, &in, &one, block, &il, below, &il);
    scale_rows(rows, n, below, ld, block, ld, c->scaled, c);
    for (size_t col = j + n; col < f->columns; col += STRIP) {
      size_t strip = f->columns - col < STRIP ? f->columns - col : STRIP, skip = col - j - n;
      subtract_product(f->rows - col, strip, n, below + skip, ld, c->scaled + skip, rows,
                       f->panel + col * (ld + 1), ld);
    }
  }
}

// update ← update − L D Lᵀ of all the front's columns.
static void update_rest(front *f, condensation *c) {
  size_t rest = f->rows - f->columns;
  const double *l = f->panel + f->columns;
  for (size_t k = 0; k < f->columns; k++) {
    double pivot = f->panel[k * (f->rows + 1)];
    for (size_t i = 0; i < rest; i++) c->scaled[i + k * rest] = l[i + k * f->rows] * pivot;
  }
  for (size_t col = 0; col < rest; col += STRIP) {
    size_t strip = rest - col < STRIP ? rest - col : STRIP;
    subtract_product(rest - col, strip, f->columns, l + col, f->rows, c->scaled + col, rest,
                     f->update + col * (rest + 1), rest);
  }
}

// ---- assembly -----------------------------------------------------------------------------------

static double *entry(front *f, size_t i, size_t j) {
  size_t rest = f->rows - f->columns;
  if (i < j) {
    size_t swap = i;
    i = j, j = swap;
  }
  return j < f->columns ? f->panel + i + j * f->rows
                        : f->update + (i - f->columns) + (j - f->columns) * rest;
}

static void add_columns(condensation *c, front *f, size_t first, const cholmod_sparse *a,
                        double factor) {
  const SuiteSparse_long *start = a->p, *row = a->i;
  const double *value = a->x;
  for (size_t k = 0; k < f->columns; k++)
    for (SuiteSparse_long at = start[first + k]; at < start[first + k + 1]; at++)
      f->panel[c->local[row[at]] + k * f->rows] += factor * value[at];
}

static void add_border(condensation *c, front *f, size_t first) {
  for (size_t k = 0; k < f->columns; k++) {
    size_t row = c->order->row[first + k];
    for (size_t at = c->border->start[row]; at < c->border->start[row + 1]; at++)
      f->panel[f->listed + c->border->column[at] + k * f->rows] += c->border->value[at];
  }
}

// The child's update into the parent's front, and away with it.
static void add_child(condensation *c, front *f, front *child) {
  size_t rest = child->rows - child->columns, listed = child->listed - child->columns;
  const SuiteSparse_long *row = child->row + child->columns;
  for (size_t j = 0; j < rest; j++) {
    size_t to_j = j < listed ? c->local[row[j]] : f->listed + j - listed;
    for (size_t i = j; i < rest; i++) {
      size_t to_i = i < listed ? c->local[row[i]] : f->listed + i - listed;
      *entry(f, to_i, to_j) += child->update[i + j * rest];
    }
  }
  free(child->update);
  child->update = NULL;
}

static pb_status allocate_front(condensation *c, front *f, pb_error *err) {
  size_t rest = f->rows - f->columns, room = f->rows * f->columns;
  f->panel = calloc(room, sizeof *f->panel);
  f->update = calloc(rest * rest + 1, sizeof *f->update);
  if (f->panel && f->update && room > c->scaled_room) {
    double *more = realloc(c->scaled, 2 * room * sizeof *more);
    if (!more) return pb_fail_memory(err, "condensation");
    c->scaled = more;
    c->scaled_room = 2 * room;
  }
  return f->panel && f->update ? PB_OK : pb_fail_memory(err, "condensation");
}

static pb_status process(condensation *c, size_t s, pb_error *err) {
  const SuiteSparse_long *super = c->order->l->super;
  size_t first = (size_t)super[s], columns = c->border->columns;
  front *f = &c->front[s];
  for (size_t k = 0; k < f->columns && !f->bordered; k++) {
    size_t row = c->order->row[first + k];
    f->bordered = c->border->start[row + 1] > c->border->start[row];
  }
  for (size_t k = f->child; k != SIZE_MAX; k = c->front[k].next)
    f->bordered |= c->front[k].bordered;
  f->rows = f->listed + (f->bordered ? columns : 0);
  pb_status st = allocate_front(c, f, err);
  if (st) return st;
  for (size_t i = 0; i < f->listed; i++) c->local[f->row[i]] = i;
  add_columns(c, f, first, c->k, 1);
  add_columns(c, f, first, c->m, c->shift);
  if (f->bordered) add_border(c, f, first);
  for (size_t k = f->child; k != SIZE_MAX; k = c->front[k].next) add_child(c, f, &c->front[k]);
  eliminate(f, c);
  update_rest(f, c);
  free(f->panel);
  f->panel = NULL;
  bool root = f->listed == f->columns;
  for (size_t j = 0; root && f->bordered && j < columns; j++)
    for (size_t i = j; i < columns; i++) c->s[i + j * columns] += f->update[i + j * columns];
  if (root) {
    free(f->update);
    f->update = NULL;
  }
  return PB_OK;
}

// ---- the whole ----------------------------------------------------------------------------------

static pb_status build_tree(condensation *c, pb_error *err) {
  const cholmod_factor *l = c->order->l;
  const SuiteSparse_long *super = l->super, *pi = l->pi, *row = l->s;
  size_t n = l->nsuper;
  size_t *owner = c->local;  // borrowed: supernode of each column
  c->front = calloc(n + 1, sizeof *c->front);
  if (!c->front) return pb_fail_memory(err, "condensation");
  for (size_t s = 0; s < n; s++) {
    c->front[s] = (front){.columns = (size_t)(super[s + 1] - super[s]),
                          .listed = (size_t)(pi[s + 1] - pi[s]),
                          .row = row + pi[s],
                          .next = SIZE_MAX,
                          .child = SIZE_MAX};
    for (SuiteSparse_long j = super[s]; j < super[s + 1]; j++) owner[j] = s;
  }
  for (size_t s = n; s-- > 0;) {
    front *f = &c->front[s];
    if (f->listed == f->columns) continue;
    front *parent = &c->front[owner[f->row[f->columns]]];
    f->next = parent->child;
    parent->child = s;
  }
  return PB_OK;
}

static double largest_diagonal(const cholmod_sparse *k, const cholmod_sparse *m, double shift) {
  double largest = 0;
  const cholmod_sparse *both[2] = {k, m};
  for (size_t b = 0; b < 2; b++) {
    const SuiteSparse_long *start = both[b]->p, *row = both[b]->i;
    const double *value = both[b]->x;
    for (size_t j = 0; j < k->ncol; j++)
      for (SuiteSparse_long at = start[j]; at < start[j + 1]; at++)
        if (row[at] == (SuiteSparse_long)j)
          largest = fmax(largest, fabs((b ? shift : 1) * value[at]));
  }
  return largest;
}

pb_status pb_condense(pb_factor *order, const pb_sparse *k, const pb_sparse *m, double shift,
                      const pb_border *border, double *s, pb_condensation *result, pb_error *err) {
  condensation c = {.order = order, .shift = shift, .border = border, .s = s, .result = result};
  size_t supernodes = order->l->nsuper;
  result->negative = 0;
  result->growth = 0;
  c.k = pb_factor_permuted(order, k);
  c.m = pb_factor_permuted(order, m);
  c.local = malloc((order->n + 1) * sizeof *c.local);
  pb_status st = c.k && c.m && c.local ? PB_OK : pb_fail_memory(err, "condensation");
  if (!st) st = build_tree(&c, err);
  if (!st) c.largest = largest_diagonal(c.k, c.m, shift);
  for (size_t i = 0; !st && i < supernodes; i++) {
    st = process(&c, i, err);
    bool tell = i % 64 == 0 && result->progress;
    if (!st && tell && !result->progress(result->context, (double)i, (double)supernodes))
      st = pb_fail(err, PB_ERR_STATE, "condensation", "the reduction was stopped");
  }
  for (size_t i = 0; c.front && i < supernodes; i++) {
    free(c.front[i].panel);
    free(c.front[i].update);
  }
  free(c.front);
  free(c.local);
  free(c.scaled);
  cholmod_l_free_sparse(&c.k, &order->common);
  cholmod_l_free_sparse(&c.m, &order->common);
  return st;
}
