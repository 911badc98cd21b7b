// Small dense linear algebra of the modal form: block diagonalisation and matrix exponentials.
#ifndef PB_MODEL_BLOCK_H
#define PB_MODEL_BLOCK_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

#include "base/status.h"

// Block-diagonalises a real n × n matrix: A V = V diag(blocks).
// Complex pairs give [[σ, ω], [−ω, σ]]; a real eigenvalue gives a 1 × 1 block. Where the
// eigenvectors are too ill-conditioned (reciprocal condition below 1e-6, defective matrices among
// them) the matrix is brought to real Schur form and split only as far as the transformation stays
// well-conditioned (Bavely and Stewart, SIAM J. Numer. Anal. 16, 1979): eigenvalues that cannot be
// told apart share a larger block. a: n × n, destroyed, on return the block-diagonal matrix. v: n ×
// n. size[n]: *blocks block sizes. `context` names the object in errors. Fails with PB_ERR_NUMERIC,
// PB_ERR_MEMORY. [init]
pb_status pb_block_diagonalize(size_t n, double *a, double *v, size_t *blocks, size_t *size,
                               const char *context, pb_error *err);

// Exact zero-order hold of one block: ad = e^{A h}, gd = ∫₀ʰ e^{A s} ds, both n × n. Complex 2 × 2
// pairs and pairs of separate real eigenvalues in closed form, everything else by scaling and
// squaring of the augmented matrix [[A, I], [0, 0]] with a [13/13] Padé approximant (Higham, SIAM
// J. Matrix Anal. Appl. 26, 2005). [init]
pb_status pb_block_discretize(size_t n, const double *a, double h, double *ad, double *gd,
                              pb_error *err);

// Eigenvalues of one block into out[n], conjugates adjacent; those of 2 × 2 blocks in closed form,
// real ones to an accuracy of their own each. Fails with PB_ERR_NUMERIC, PB_ERR_MEMORY. [init]
pb_status pb_block_poles(size_t n, const double *a, double complex *out, pb_error *err);

// Whether none of n numbers is infinite or NaN. [any]
bool pb_all_finite(const double *x, size_t n);

#endif
