// The order of elimination: nested dissection (METIS) of the graph of nodes, a third of the size of
// that of rows.
#include <stdlib.h>

#include "part/factor_internal.h"

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
  return ok && f->common.status >= 0 ? PB_OK : factor_fail(f, err);
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

pb_status factor_dissect(pb_factor *f, const pb_sparse *a, size_t nodes, const int64_t *dof,
                         const bool *held, pb_error *err) {
  graph g = {0};
  int64_t *sequence = NULL;
  pb_status st = build_graph(a, nodes, dof, held, &g, err);
  if (!st) {
    sequence = malloc((g.vertices + 1) * sizeof *sequence);
    st = sequence ? dissect(f, &g, sequence, err) : pb_fail_memory(err, "stiffness");
  }
  if (!st) number_rows(f, &g, sequence, dof, held);
  clear_graph(&g);
  free(sequence);
  return st;
}
