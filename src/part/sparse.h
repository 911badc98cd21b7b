// Symmetric sparse matrices by compressed columns, entries on and above the diagonal only, rows
// ascending within a column, no duplicates: the form that CHOLMOD takes as it is (stype 1).
#ifndef PB_PART_SPARSE_H
#define PB_PART_SPARSE_H

#include <stddef.h>
#include <stdint.h>

#include "base/status.h"

typedef struct pb_sparse {
  size_t n;        // rows = columns
  int64_t *start;  // [n + 1] start[j] … start[j+1] are the entries of column j; start[n] = entries
  int64_t *row;    // [entries] ≤ j in column j
  double *value;   // [entries]
} pb_sparse;

// From unordered entries (row[k], col[k], value[k]) of either triangle; equal places are added up.
// An entry and its mirror image both given count twice: hand over one triangle only.
// Fails with PB_ERR_MEMORY, PB_ERR_ARGUMENT (an index beyond n). *out is owned by the caller.
// [init]
pb_status pb_sparse_from_entries(size_t n, size_t count, const int64_t *row, const int64_t *col,
                                 const double *value, pb_sparse *out, pb_error *err);

// The j-th entry of the diagonal; 0 where none is stored. [any]
static inline double pb_sparse_diagonal(const pb_sparse *a, size_t j) {
  int64_t last = a->start[j + 1] - 1;
  return last >= a->start[j] && a->row[last] == (int64_t)j ? a->value[last] : 0;
}

// y ← A x for `columns` columns, x and y n × columns with leading dimension n. [any]
void pb_sparse_multiply(const pb_sparse *a, size_t columns, const double *x, double *y);

// y ← (A ⊗ I₃) x: the same where each row stands for the three translations of a node, x and y
// 3n × columns. [any]
void pb_sparse_multiply_triple(const pb_sparse *a, size_t columns, const double *x, double *y);

void pb_sparse_clear(pb_sparse *a);

#endif
