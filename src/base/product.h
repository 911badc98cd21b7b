// Large matrix products, shared among workers.
#ifndef PB_BASE_PRODUCT_H
#define PB_BASE_PRODUCT_H

#include "base/workers.h"

// C (m × n) = op(A) op(B) + beta C with op(A) m × k and op(B) k × n, op as dgemm's "N" or "T"; lda,
// ldb, ldc leading dimensions. Panels of C's columns are products of their own, whoever computes
// them: the bits do not depend on the workers (NULL: none). [init]
typedef struct pb_product {
  const char *op_a, *op_b;
  size_t m, n, k;
  const double *a, *b;
  size_t lda, ldb;
  double beta;
  double *c;
  size_t ldc;
} pb_product;

// Columns of a panel of n: quarters, which a few workers share well, but no fewer than 64, so that
// packing A for each does not show. [any]
size_t pb_product_panel(size_t n);

void pb_product_make(const pb_product *product, const pb_workers *workers);

// out [rows] += A v, A rows × columns. Column after column: each sum in the order of its row, many
// rows at once. [rt]
static inline void pb_add_columns(size_t rows, size_t columns, const double *restrict a,
                                  const double *restrict v, double *restrict out) {
  for (size_t k = 0; k < columns; k++, a += rows)
    for (size_t r = 0; r < rows; r++) out[r] += a[r] * v[k];
}

#endif
