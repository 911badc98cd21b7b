// Block Lanczos for the fixed-interface modes: the basis and its Ritz pairs.
//
// The operator A = K⁻¹M under the frames' constraints is symmetric in the inner product of M and
// its eigenvalues are θ = 1/ω². From A Q_j = Q_j H_j + Q_{j+1} B_j follow the Ritz pairs (θ, Q s)
// and, exactly, their residuals ‖A x − θ x‖_M = ‖B_j s_last‖. A block of eight finds eigenvalues of
// that multiplicity; where a block runs dry a random one goes on. All are reorthogonalised fully.
// Source: R. Grimes, J. Lewis, H. Simon, "A shifted block Lanczos algorithm for solving sparse
// symmetric generalized eigenproblems", SIAM J. Matrix Anal. Appl. 15, 1994.
#ifndef PB_PART_REDUCE_LANCZOS_H
#define PB_PART_REDUCE_LANCZOS_H

#include "part/reduce_internal.h"
#include "signal/random.h"

enum { BLOCK = 8 };

typedef struct lanczos {
  reduce_work *w;
  size_t full, limit;              // limit: dimension of the space
  size_t k, room;                  // basis vectors, allocated ones
  size_t block;                    // vectors of the newest block, 0: the space is used up
  size_t last;                     // vectors of the block before it
  double *q;                       // full × k
  double *h;                       // room × room, upper triangle: QᵀM A Q
  double *u, *mu;                  // full × BLOCK: block at work and M times it
  double *spare;                   // full × BLOCK
  double coupling[BLOCK * BLOCK];  // B_j, block × last
  double *theta, *s;               // Ritz values ascending, k × k vectors
  size_t ritz;                     // size of the last decomposition
  pb_random random;
} lanczos;

// z->w, full and limit are set, all else is zero. Fails with PB_ERR_MEMORY.
pb_status lanczos_begin(lanczos *z, pb_error *err);
void lanczos_clear(lanczos *z);

// A random block orthogonal to the basis: z->block is 0 where the space is used up.
pb_status lanczos_append_random(lanczos *z, pb_error *err);

// One application of A to the newest block.
pb_status lanczos_extend(lanczos *z, pb_error *err);

// Ritz pairs of the basis without its newest block, to which A was not applied yet.
pb_status lanczos_decompose(lanczos *z, pb_error *err);

// Of the i-th largest Ritz value: the residual relative to it, and ω².
double lanczos_residual(const lanczos *z, size_t i);
double lanczos_omega2(const lanczos *z, size_t i);

// The first `count` Ritz vectors: out full × count. Fails with PB_ERR_MEMORY.
pb_status lanczos_vectors(const lanczos *z, size_t count, double *out, pb_error *err);

#endif
