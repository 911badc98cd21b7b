// Damped modes of weakly coupled modal equations, without a dense unsymmetric eigenproblem.
//
//   η̈ + Ĉ η̇ + Ω² η = f:   Q(λ_k) x_k = 0,  Q(λ) = λ² I + λ Ĉ + Ω²
//
// Q is symmetric, so that left vectors follow from right ones; what is left of Ĉ beside its
// diagonal tilts most vectors little. Clusters of strongly coupled modes (cluster.h) are solved
// exactly; then a chord iteration with the clusters' vectors V and Y as the basis,
//
//   Q(λ_k)⁻¹ ≈ Σ_j v_j y_jᵀ / (λ_k − λ_j) + conjugates,
//
// removes what couples clusters. Inside a cluster, where eigenvalues may lie as near to each other
// as they like, the effective matrix diag(λ) − YᵀR is diagonalised again instead of divided by
// differences. (Stewart and Sun, Matrix Perturbation Theory, 1990, ch. V, on invariant subspaces;
// Tisseur and Meerbergen, SIAM Review 43, 2001, on quadratic eigenproblems.)
#ifndef PB_MODEL_DAMPED_H
#define PB_MODEL_DAMPED_H

#include "base/workers.h"
#include "model/cluster.h"

typedef struct pb_damped {
  pb_clusters cluster;  // order of the modes, eigenvalues λ, bounds of the clusters
  size_t n, columns;    // modes, eigenpairs (complex ones once)
  double *x[2];         // n × columns, real and imaginary parts, rows in the order of the clusters
  double *p[2];         // n × columns: Ĉ x
} pb_damped;

// Solves for all eigenpairs. omega [n] rad/s, ascending or not; damping n × n, symmetric. *solved
// false, and *out empty: the coupling is too strong or the vectors too ill-conditioned for this
// method. Fails with PB_ERR_MEMORY. [init]
pb_status pb_damped_solve(size_t n, const double *omega, const double *damping,
                          const pb_workers *workers, pb_damped *out, bool *solved, pb_error *err);
void pb_damped_clear(pb_damped *damped);

#endif
