// Sparse Cholesky by CHOLMOD: see factor.h.
#include "part/factor.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

#include "part/factor_internal.h"
#include "part/supersolve.h"

pb_status factor_fail(const pb_factor *f, pb_error *err) {
  if (f->common.status == CHOLMOD_OUT_OF_MEMORY) return pb_fail_memory(err, "stiffness");
  return pb_fail(err, PB_ERR_NUMERIC, "stiffness", "CHOLMOD reports status %d", f->common.status);
}

static void start(pb_factor *f) {
  cholmod_l_start(&f->common);
  f->started = true;
  f->common.print = 0;
  f->common.supernodal = CHOLMOD_SUPERNODAL;
  f->common.quick_return_if_not_posdef = true;
  f->common.nmethods = 1;
  f->common.method[0].ordering = CHOLMOD_NATURAL;  // ours is made before
  f->common.postorder = false;
}

void pb_factor_clear(pb_factor *f) {
  if (f->started) {
    cholmod_l_free_factor(&f->l, &f->common);
    cholmod_l_finish(&f->common);
  }
  free(f->place);
  free(f->row);
  free(f->work);
  *f = (pb_factor){0};
}

size_t pb_factor_entries(const pb_factor *f) {
  return f->l ? f->l->xsize : 0;
}

// ---- order --------------------------------------------------------------------------------------

// The lower triangle of `a` in the order of elimination, with values or as a pattern.
static cholmod_sparse *permute(pb_factor *f, const pb_sparse *a, bool values) {
  size_t entries = 0;
  for (size_t j = 0; j < a->n; j++) {
    if (f->place[j] < 0) continue;
    for (int64_t at = a->start[j]; at < a->start[j + 1]; at++) entries += f->place[a->row[at]] >= 0;
  }
  cholmod_sparse *out = cholmod_l_allocate_sparse(
      f->n, f->n, entries, false, true, -1, values ? CHOLMOD_REAL : CHOLMOD_PATTERN, &f->common);
  if (!out) return NULL;
  SuiteSparse_long *start = out->p, *row = out->i;
  double *value = out->x;
  memset(start, 0, (f->n + 1) * sizeof *start);
  for (int pass = 0; pass < 2; pass++) {  // count, then fill
    for (size_t j = 0; j < a->n; j++) {
      SuiteSparse_long pj = f->place[j];
      for (int64_t at = a->start[j]; pj >= 0 && at < a->start[j + 1]; at++) {
        SuiteSparse_long pi = f->place[a->row[at]], col = pi < pj ? pi : pj;
        if (pi < 0) continue;
        if (!pass) {
          start[col + 1]++;
          continue;
        }
        SuiteSparse_long to = start[col]++;
        row[to] = pi < pj ? pj : pi;
        if (values) value[to] = a->value[at];
      }
    }
    if (!pass)
      for (size_t j = 0; j < f->n; j++) start[j + 1] += start[j];
  }
  memmove(start + 1, start, f->n * sizeof *start);  // filling moved each start to the next one
  start[0] = 0;
  return out;
}

// CHOLMOD postorders the elimination tree; that becomes part of our order, and its own is none.
static pb_status analyse(pb_factor *f, const pb_sparse *a, pb_error *err) {
  cholmod_sparse *pattern = permute(f, a, false);
  if (pattern) f->l = cholmod_l_analyze(pattern, &f->common);
  cholmod_l_free_sparse(&pattern, &f->common);
  if (!f->l) return factor_fail(f, err);
  if (!f->l->is_super)
    return pb_fail(err, PB_ERR_NUMERIC, "stiffness", "CHOLMOD is not supernodal");
  size_t *row = malloc((f->n + 1) * sizeof *row);
  if (!row) return pb_fail_memory(err, "stiffness");
  SuiteSparse_long *perm = f->l->Perm;
  for (size_t i = 0; i < f->n; i++) {
    row[i] = f->row[perm[i]];
    f->place[row[i]] = (int64_t)i;
    perm[i] = (SuiteSparse_long)i;
  }
  f->l->ordering = CHOLMOD_NATURAL;
  const SuiteSparse_long *pi = f->l->pi;
  for (size_t s = 0; s < f->l->nsuper; s++)
    if ((size_t)(pi[s + 1] - pi[s]) > f->largest) f->largest = (size_t)(pi[s + 1] - pi[s]);
  free(f->row);
  f->row = row;
  return PB_OK;
}

pb_status pb_factor_order(const pb_sparse *a, size_t nodes, const int64_t *dof, const bool *held,
                          pb_factor *f, pb_error *err) {
  *f = (pb_factor){.rows = a->n};
  start(f);
  f->place = malloc((a->n + 1) * sizeof *f->place);
  f->row = malloc((a->n + 1) * sizeof *f->row);
  pb_status st = f->place && f->row ? PB_OK : pb_fail_memory(err, "stiffness");
  if (!st) st = factor_dissect(f, a, nodes, dof, held, err);
  return st ? st : analyse(f, a, err);
}

// ---- factor and solve ---------------------------------------------------------------------------

// The diagonal of L squared is the pivot that elimination left of A's diagonal.
static void find_weakest(const pb_factor *f, const pb_sparse *a, size_t *weak, double *pivot) {
  const SuiteSparse_long *super = f->l->super, *pi = f->l->pi, *px = f->l->px;
  const double *value = f->l->x;
  *pivot = INFINITY;
  for (size_t s = 0; s < f->l->nsuper; s++) {
    size_t rows = (size_t)(pi[s + 1] - pi[s]);
    for (SuiteSparse_long j = super[s]; j < super[s + 1]; j++) {
      size_t row = f->row[j], k = (size_t)(j - super[s]);
      double l = value[(size_t)px[s] + k * (rows + 1)];
      double diagonal = a->value[a->start[row + 1] - 1];  // last of its column
      if (l * l / diagonal >= *pivot) continue;
      *pivot = l * l / diagonal;
      *weak = row;
    }
  }
}

cholmod_sparse *pb_factor_permuted(pb_factor *f, const pb_sparse *a) {
  return permute(f, a, true);
}

void pb_factor_forget(pb_factor *f) {
  if (!f->l || f->l->xtype == CHOLMOD_PATTERN) return;
  cholmod_l_free(f->l->xsize, sizeof(double), f->l->x, &f->common);
  f->l->x = NULL;
  f->l->xtype = CHOLMOD_PATTERN;
}

// The factor is the one big piece of memory: in small pages, first touching it and then finding it
// again in the page tables take a good part of the time. A system that has no large ones ignores
// the advice.
static void use_large_pages(void *memory, size_t bytes) {
  const uintptr_t page = (uintptr_t)2 << 20;
  uintptr_t begin = ((uintptr_t)memory + page - 1) / page * page;
  uintptr_t end = ((uintptr_t)memory + bytes) / page * page;
  if (end > begin) madvise((void *)begin, end - begin, MADV_HUGEPAGE);
}

pb_status pb_factor_numeric(pb_factor *f, const pb_sparse *a, size_t *weak, double *pivot,
                            pb_error *err) {
  *weak = f->row[0];
  *pivot = 0;
  cholmod_sparse *s = permute(f, a, true);
  bool ok = s && cholmod_l_change_factor(CHOLMOD_REAL, true, true, true, true, f->l, &f->common);
  if (ok) use_large_pages(f->l->x, f->l->xsize * sizeof(double));
  ok = ok && cholmod_l_factorize(s, f->l, &f->common);
  cholmod_l_free_sparse(&s, &f->common);
  if (!ok || f->common.status < 0) return factor_fail(f, err);
  if (f->l->minor < f->n) {
    *weak = f->row[f->l->minor];
  } else {
    find_weakest(f, a, weak, pivot);
  }
  return PB_OK;
}

static cholmod_dense dense(size_t rows, size_t columns, double *x) {
  return (cholmod_dense){.nrow = rows,
                         .ncol = columns,
                         .nzmax = rows * columns,
                         .d = rows,
                         .x = x,
                         .xtype = CHOLMOD_REAL,
                         .dtype = CHOLMOD_DOUBLE};
}

// The room of a narrow solve is kept for the next one: the system hands out large pieces page by
// page, zeroed, which takes as long as using them.
static pb_status reserve(pb_factor *f, pb_error *err) {
  if (f->work) return PB_OK;
  f->work = malloc((f->n + f->largest) * PB_SUPERSOLVE_WIDTH * sizeof *f->work);
  return f->work ? PB_OK : pb_fail_memory(err, "stiffness");
}

static void solve_narrow(pb_factor *f, size_t columns, double *x) {
  enum { WIDTH = PB_SUPERSOLVE_WIDTH };
  double *y = f->work;
  for (size_t i = 0; i < f->n; i++) {
    const double *from = x + f->row[i];
    for (size_t c = 0; c < WIDTH; c++) y[c + i * WIDTH] = c < columns ? from[c * f->rows] : 0;
  }
  pb_supersolve(f->l, y, y + f->n * WIDTH);
  for (size_t i = 0; i < f->n; i++)
    for (size_t c = 0; c < columns; c++) x[f->row[i] + c * f->rows] = y[c + i * WIDTH];
}

static pb_status solve_wide(pb_factor *f, size_t columns, double *x, pb_error *err) {
  double *y = malloc((f->n + f->largest) * columns * sizeof *y);
  if (!y) return pb_fail_memory(err, "stiffness");
  cholmod_dense by = dense(f->n, columns, y);
  cholmod_dense spare = dense(f->largest, columns, y + f->n * columns);
  for (size_t c = 0; c < columns; c++)
    for (size_t i = 0; i < f->n; i++) y[i + c * f->n] = x[f->row[i] + c * f->rows];
  bool ok = cholmod_l_super_lsolve(f->l, &by, &spare, &f->common) &&
            cholmod_l_super_ltsolve(f->l, &by, &spare, &f->common);
  for (size_t c = 0; ok && c < columns; c++)
    for (size_t i = 0; i < f->n; i++) x[f->row[i] + c * f->rows] = y[i + c * f->n];
  free(y);
  return ok ? PB_OK : factor_fail(f, err);
}

pb_status pb_factor_solve(pb_factor *f, size_t columns, double *x, pb_error *err) {
  bool narrow = columns <= PB_SUPERSOLVE_WIDTH;
  pb_status st = narrow ? reserve(f, err) : solve_wide(f, columns, x, err);
  if (st) return st;
  if (narrow) solve_narrow(f, columns, x);
  for (size_t c = 0; c < columns; c++)
    for (size_t i = 0; i < f->rows; i++)
      if (f->place[i] < 0) x[i + c * f->rows] = 0;
  return PB_OK;
}
