// Optimal assignment: each row gets a column of its own such that the sum of their costs is
// smallest. Shortest augmenting paths with potentials (H. Kuhn, 1955; R. Jonker, A. Volgenant,
// 1987): rows whose cheapest column is free cost one look, each other one O(rows·columns).
#ifndef PB_CONTROL_ASSIGN_H
#define PB_CONTROL_ASSIGN_H

#include <stddef.h>

#include "base/status.h"

// Zero-initialise; free with pb_assignment_clear.
typedef struct pb_assignment {
  size_t rows, columns;  // rows ≤ columns
  double *cost;          // [rows][columns] finite, the caller's to fill
  size_t *column;        // [rows] the answer
  double *u, *v;         // potentials [rows], [columns]
  double *least;         // [columns] length of the shortest path so far
  size_t *row, *from;    // [columns] row that has it, or none; row before it on the path
  char *done;            // [columns]
} pb_assignment;

// [init] PB_ERR_ARGUMENT (more rows than columns), PB_ERR_MEMORY.
pb_status pb_assignment_new(size_t rows, size_t columns, pb_assignment *out, pb_error *err);
void pb_assignment_clear(pb_assignment *assignment);

// column[] from cost[]. No allocation. [any]
void pb_assignment_solve(pb_assignment *assignment);

#endif
