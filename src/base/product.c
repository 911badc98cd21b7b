// See product.h.
#include "base/product.h"

#include "base/lapack.h"

size_t pb_product_panel(size_t n) {
  const size_t quarter = (n / 4 + 16) / 16 * 16;
  return quarter < 64 ? 64 : quarter;
}

static void panel(void *context, size_t item, size_t worker) {
  (void)worker;
  const pb_product *p = context;
  const size_t wide = pb_product_panel(p->n), first = item * wide;
  const size_t columns = p->n - first < wide ? p->n - first : wide;
  const double *b = p->b + first * (*p->op_b == 'N' ? p->ldb : 1);
  const int m = (int)p->m, n = (int)columns, k = (int)p->k;
  const int lda = (int)p->lda, ldb = (int)p->ldb, ldc = (int)p->ldc;
  const double one = 1;
  dgemm_(p->op_a, p->op_b, &m, &n, &k, &one, p->a, &lda, b, &ldb, &p->beta, p->c + first * p->ldc,
         &ldc);
}

void pb_product_make(const pb_product *product, const pb_workers *workers) {
  if (product->m == 0) return;
  const size_t wide = pb_product_panel(product->n);
  const double operations = 2.0 * (double)product->m * (double)product->n * (double)product->k;
  pb_workers_run(pb_workers_for(workers, operations), (product->n + wide - 1) / wide, panel,
                 (void *)product);
}
