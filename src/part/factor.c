// Sparse Cholesky by CHOLMOD: see factor.h.
#include "part/factor.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "part/supersolve.h"

static pb_status fail_cholmod(const pb_factor *f, pb_error *err) {
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
  f->common.postorder = true;
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

// Vertices of the graph are the nodes that have rows left.
typedef struct graph {
  size_t vertices;
  size_t *node;     // [vertices]
  int64_t *vertex;  // [nodes] −1: all its rows are held
  pb_sparse edge;   // pattern
} graph;

static void clear_graph(graph *g) {
  free(g->node);
  free(g->vertex);
  pb_sparse_clear(&g->edge);
}

static pb_status number_vertices(size_t nodes, const int64_t *dof, const bool *held, graph *g,
                                 pb_error *err) {
  g->node = malloc((nodes + 1) * sizeof *g->node);
  g->vertex = malloc((nodes + 1) * sizeof *g->vertex);
  if (!g->node || !g->vertex) return pb_fail_memory(err, "stiffness");
  for (size_t i = 0; i < nodes; i++) {
    bool left = false;
    for (size_t d = 0; d < 3; d++) left |= dof[d + 3 * i] >= 0 && !held[dof[d + 3 * i]];
    g->vertex[i] = left ? (int64_t)g->vertices : -1;
    if (left) g->node[g->vertices++] = i;
  }
  return PB_OK;
}

// The vertices that node v's columns reach, each once; a marker keeps them single. Returns how many
// there are; `to` may be NULL for counting only.
static size_t list_neighbours(const pb_sparse *a, const int64_t *dof, const int64_t *vertex_of_row,
                              const graph *g, size_t v, int64_t *mark, int64_t stamp, int64_t *to) {
  size_t count = 0;
  for (size_t d = 0; d < 3; d++) {
    int64_t r = dof[d + 3 * g->node[v]];
    if (r < 0) continue;
    for (int64_t at = a->start[r]; at < a->start[r + 1]; at++) {
      int64_t other = vertex_of_row[a->row[at]];
      if (other < 0 || mark[other] == stamp) continue;
      mark[other] = stamp;
      if (to) to[count] = other;
      count++;
    }
  }
  return count;
}

static pb_status connect_vertices(const pb_sparse *a, const int64_t *dof,
                                  const int64_t *vertex_of_row, graph *g, pb_error *err) {
  size_t count = 0, used = 0;
  int64_t *mark = calloc(g->vertices + 1, sizeof *mark), *row = NULL, *col = NULL;
  double *none = NULL;
  pb_status st = PB_OK;
  if (mark) {
    for (size_t v = 0; v < g->vertices; v++)
      count += list_neighbours(a, dof, vertex_of_row, g, v, mark, (int64_t)v + 1, NULL);
    row = malloc((count + 1) * sizeof *row);
    col = malloc((count + 1) * sizeof *col);
    none = calloc(count + 1, sizeof *none);
  }
  if (!mark || !row || !col || !none) {
    st = pb_fail_memory(err, "stiffness");
    goto done;
  }
  for (size_t v = 0; v < g->vertices; v++) {
    int64_t stamp = (int64_t)(g->vertices + v) + 1;
    size_t found = list_neighbours(a, dof, vertex_of_row, g, v, mark, stamp, row + used);
    for (size_t k = 0; k < found; k++) col[used + k] = (int64_t)v;
    used += found;
  }
  st = pb_sparse_from_entries(g->vertices, count, row, col, none, &g->edge, err);
done:
  free(mark);
  free(row);
  free(col);
  free(none);
  return st;
}

static pb_status build_graph(const pb_sparse *a, size_t nodes, const int64_t *dof, const bool *held,
                             graph *g, pb_error *err) {
  pb_status st = number_vertices(nodes, dof, held, g, err);
  if (st) return st;
  int64_t *vertex_of_row = malloc((a->n + 1) * sizeof *vertex_of_row);
  if (!vertex_of_row) return pb_fail_memory(err, "stiffness");
  for (size_t i = 0; i < a->n; i++) vertex_of_row[i] = -1;
  for (size_t i = 0; i < nodes; i++)
    for (size_t d = 0; d < 3; d++)
      if (dof[d + 3 * i] >= 0) vertex_of_row[dof[d + 3 * i]] = g->vertex[i];
  st = connect_vertices(a, dof, vertex_of_row, g, err);
  free(vertex_of_row);
  return st;
}

// Nested dissection of the graph: sequence [vertices].
static pb_status dissect(pb_factor *f, graph *g, int64_t *sequence, pb_error *err) {
  cholmod_sparse edges = {.nrow = g->vertices,
                          .ncol = g->vertices,
                          .nzmax = (size_t)g->edge.start[g->vertices],
                          .p = g->edge.start,
                          .i = g->edge.row,
                          .stype = 1,
                          .itype = CHOLMOD_LONG,
                          .xtype = CHOLMOD_PATTERN,
                          .dtype = CHOLMOD_DOUBLE,
                          .sorted = true,
                          .packed = true};
  bool ok = cholmod_l_metis(&edges, NULL, 0, true, sequence, &f->common);
  return ok && f->common.status >= 0 ? PB_OK : fail_cholmod(f, err);
}

static void number_rows(pb_factor *f, const graph *g, const int64_t *sequence, const int64_t *dof,
                        const bool *held) {
  f->n = 0;
  for (size_t i = 0; i < f->rows; i++) f->place[i] = -1;
  for (size_t v = 0; v < g->vertices; v++) {
    for (size_t d = 0; d < 3; d++) {
      int64_t r = dof[d + 3 * g->node[sequence[v]]];
      if (r < 0 || held[r]) continue;
      f->place[r] = (int64_t)f->n;
      f->row[f->n++] = (size_t)r;
    }
  }
}

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
  if (!f->l) return fail_cholmod(f, err);
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
  graph g = {0};
  int64_t *sequence = NULL;
  start(f);
  f->place = malloc((a->n + 1) * sizeof *f->place);
  f->row = malloc((a->n + 1) * sizeof *f->row);
  pb_status st = f->place && f->row ? PB_OK : pb_fail_memory(err, "stiffness");
  if (!st) st = build_graph(a, nodes, dof, held, &g, err);
  if (!st) {
    sequence = malloc((g.vertices + 1) * sizeof *sequence);
    st = sequence ? dissect(f, &g, sequence, err) : pb_fail_memory(err, "stiffness");
  }
  if (!st) number_rows(f, &g, sequence, dof, held);
  clear_graph(&g);
  free(sequence);
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

pb_status pb_factor_numeric(pb_factor *f, const pb_sparse *a, size_t *weak, double *pivot,
                            pb_error *err) {
  *weak = f->row[0];
  *pivot = 0;
  cholmod_sparse *s = permute(f, a, true);
  bool ok = s && cholmod_l_factorize(s, f->l, &f->common);
  cholmod_l_free_sparse(&s, &f->common);
  if (!ok || f->common.status < 0) return fail_cholmod(f, err);
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

// A solve's room is kept for the next one: the system hands out large pieces page by page, zeroed,
// which takes as long as using them.
static pb_status reserve(pb_factor *f, size_t columns, pb_error *err) {
  size_t wanted = (f->n + f->largest) * columns;
  if (wanted <= f->room) return PB_OK;
  free(f->work);
  f->room = 0;
  f->work = malloc(wanted * sizeof *f->work);
  if (!f->work) return pb_fail_memory(err, "stiffness");
  f->room = wanted;
  return PB_OK;
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

static bool solve_wide(pb_factor *f, size_t columns, double *x) {
  double *y = f->work;
  cholmod_dense by = dense(f->n, columns, y);
  cholmod_dense spare = dense(f->largest, columns, y + f->n * columns);
  for (size_t c = 0; c < columns; c++)
    for (size_t i = 0; i < f->n; i++) y[i + c * f->n] = x[f->row[i] + c * f->rows];
  bool ok = cholmod_l_super_lsolve(f->l, &by, &spare, &f->common) &&
            cholmod_l_super_ltsolve(f->l, &by, &spare, &f->common);
  for (size_t c = 0; ok && c < columns; c++)
    for (size_t i = 0; i < f->n; i++) x[f->row[i] + c * f->rows] = y[i + c * f->n];
  return ok;
}

pb_status pb_factor_solve(pb_factor *f, size_t columns, double *x, pb_error *err) {
  bool narrow = columns <= PB_SUPERSOLVE_WIDTH;
  pb_status st = reserve(f, narrow ? PB_SUPERSOLVE_WIDTH : columns, err);
  if (st) return st;
  if (narrow) {
    solve_narrow(f, columns, x);
  } else if (!solve_wide(f, columns, x)) {
    return fail_cholmod(f, err);
  }
  for (size_t c = 0; c < columns; c++)
    for (size_t i = 0; i < f->rows; i++)
      if (f->place[i] < 0) x[i + c * f->rows] = 0;
  return PB_OK;
}
