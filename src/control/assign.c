// Optimal assignment: see assign.h.
#include "control/assign.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

static const size_t none = SIZE_MAX;

pb_status pb_assignment_new(size_t rows, size_t columns, pb_assignment *out, pb_error *err) {
  *out = (pb_assignment){.rows = rows, .columns = columns};
  if (rows > columns)
    return pb_fail(err, PB_ERR_ARGUMENT, "assignment", "%zu rows for %zu columns", rows, columns);
  out->cost = malloc((rows * columns + 1) * sizeof *out->cost);
  out->column = malloc((rows + 1) * sizeof *out->column);
  out->u = malloc((rows + 1) * sizeof *out->u);
  out->v = malloc((columns + 1) * sizeof *out->v);
  out->least = malloc((columns + 1) * sizeof *out->least);
  out->row = malloc((columns + 1) * sizeof *out->row);
  out->from = malloc((columns + 1) * sizeof *out->from);
  out->done = malloc(columns + 1);
  if (out->cost && out->column && out->u && out->v && out->least && out->row && out->from &&
      out->done)
    return PB_OK;
  pb_assignment_clear(out);
  return pb_fail_memory(err, "assignment");
}

void pb_assignment_clear(pb_assignment *a) {
  if (!a) return;
  free(a->cost);
  free(a->column);
  free(a->u);
  free(a->v);
  free(a->least);
  free(a->row);
  free(a->from);
  free(a->done);
  *a = (pb_assignment){0};
}

// Each row takes its cheapest column while that is free.
static void take_cheapest(pb_assignment *a) {
  for (size_t j = 0; j < a->columns; j++) {
    a->row[j] = none;
    a->v[j] = 0;
  }
  for (size_t i = 0; i < a->rows; i++) {
    const double *cost = a->cost + i * a->columns;
    size_t best = 0;
    for (size_t j = 1; j < a->columns; j++)
      if (cost[j] < cost[best]) best = j;
    a->u[i] = cost[best];
    a->column[i] = a->row[best] == none ? best : none;
    if (a->row[best] == none) a->row[best] = i;
  }
}

// Lengths of the paths through a row that the tree has reached; returns the nearest column that is
// not in the tree.
static size_t extend(pb_assignment *a, size_t row, double length) {
  size_t nearest = none;
  for (size_t j = 0; j < a->columns; j++) {
    if (a->done[j]) continue;
    double reduced = length + a->cost[row * a->columns + j] - a->u[row] - a->v[j];
    if (reduced < a->least[j]) {
      a->least[j] = reduced;
      a->from[j] = row;
    }
    if (nearest == none || a->least[j] < a->least[nearest]) nearest = j;
  }
  return nearest;
}

// The tree of shortest paths from a row without a column to the first free column; then the
// potentials that keep all reduced costs above 0, and the columns along the path change hands.
static void augment(pb_assignment *a, size_t start) {
  for (size_t j = 0; j < a->columns; j++) {
    a->least[j] = INFINITY;
    a->from[j] = start;
  }
  memset(a->done, 0, a->columns);
  size_t at = extend(a, start, 0);
  while (a->row[at] != none) {
    a->done[at] = 1;
    at = extend(a, a->row[at], a->least[at]);
  }
  double length = a->least[at];
  a->u[start] += length;
  for (size_t j = 0; j < a->columns; j++) {
    if (!a->done[j]) continue;
    a->u[a->row[j]] += length - a->least[j];
    a->v[j] -= length - a->least[j];
  }
  for (size_t i = none; i != start;) {
    i = a->from[at];
    size_t next = a->column[i];
    a->row[at] = i;
    a->column[i] = at;
    at = next;
  }
}

void pb_assignment_solve(pb_assignment *a) {
  take_cheapest(a);
  for (size_t i = 0; i < a->rows; i++)
    if (a->column[i] == none) augment(a, i);
}
