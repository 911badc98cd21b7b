// Sparse Cholesky factor of the part of a symmetric matrix that is left when some rows are held:
// CHOLMOD's supernodal LLᵀ, ordered by nested dissection (METIS) of the graph of nodes, whose three
// rows stay together. Source: Y. Chen, T. Davis, W. Hager, S. Rajamanickam, "Algorithm 887:
// CHOLMOD", ACM TOMS 35, 2008.
#ifndef PB_PART_FACTOR_H
#define PB_PART_FACTOR_H

#include <cholmod.h>
#include <stdbool.h>

#include "part/fem.h"

typedef struct pb_factor {
  cholmod_common common;
  bool started;       // common is initialised
  cholmod_factor *l;  // symbolic after pb_factor_order, numeric after pb_factor_numeric
  size_t rows;        // of the whole matrix
  size_t n;           // rows that are not held
  int64_t *place;     // [rows] place in the elimination order; −1: held
  size_t *row;        // [n] the row at each place
  size_t largest;     // rows of the largest supernode
  double *work;       // [room] for solves
  size_t room;
} pb_factor;

// Order and symbolic analysis of pattern `a`, the rows of whose nodes are in dof [3 × nodes] (−1:
// none), each row in one place. held [rows]: rows to leave out; at least one must stay. Fails with
// PB_ERR_MEMORY, PB_ERR_NUMERIC (METIS gave up). *out is owned by the caller either way:
// pb_factor_clear. [init]
pb_status pb_factor_order(const pb_sparse *a, size_t nodes, const int64_t *dof, const bool *held,
                          pb_factor *out, pb_error *err);

// Numeric factorisation of `a`, of the pattern that was analysed. *weak: the row whose pivot is
// smallest relative to its diagonal, *pivot that ratio; 0 where the matrix is not positive
// definite (that is no failure). Fails with PB_ERR_MEMORY. [init]
pb_status pb_factor_numeric(pb_factor *factor, const pb_sparse *a, size_t *weak, double *pivot,
                            pb_error *err);

// x ← A⁻¹ x in place for `columns` columns of `rows`; held rows become zero. [init]
pb_status pb_factor_solve(pb_factor *factor, size_t columns, double *x, pb_error *err);

// The lower triangle of `a` in the elimination order, owned by the caller (cholmod_l_free_sparse
// with factor->common); NULL: out of memory. [init]
cholmod_sparse *pb_factor_permuted(pb_factor *factor, const pb_sparse *a);

// Frees the numbers of L and keeps order and analysis. [init]
void pb_factor_forget(pb_factor *factor);

size_t pb_factor_entries(const pb_factor *factor);  // stored numbers of L

void pb_factor_clear(pb_factor *factor);

#endif
