// Triangular solves for eight right-hand sides side by side: see supersolve.h.
//
// Supernode s: columns c = super[s] …, rows ls[0 …] of which the first are its columns, values
// column-major with the number of rows as leading dimension. Columns are taken in strips of at most
// STRIP: a small triangle, then the rows below it in groups of ROWS.
#include "part/supersolve.h"

#include <stddef.h>
#include <string.h>

enum { WIDTH = PB_SUPERSOLVE_WIDTH, STRIP = 32, ROWS = 4 };

typedef double row8 __attribute__((vector_size(WIDTH * sizeof(double)), aligned(8)));

// The widest instructions that the processor has, chosen when the program starts. The sanitizers
// run before that choice can be made.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__SANITIZE_ADDRESS__)
#define WIDEST __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define WIDEST
#endif

typedef struct supernode {
  size_t columns, rows;
  const SuiteSparse_long *row;
  const double *value;
} supernode;

static inline supernode supernode_at(const cholmod_factor *l, size_t s) {
  const SuiteSparse_long *super = l->super, *pi = l->pi, *px = l->px, *row = l->s;
  const double *value = l->x;
  return (supernode){(size_t)(super[s + 1] - super[s]), (size_t)(pi[s + 1] - pi[s]), row + pi[s],
                     value + px[s]};
}

static inline size_t strip_width(size_t columns, size_t first) {
  return columns - first < STRIP ? columns - first : STRIP;
}

WIDEST static void forward(const cholmod_factor *l, row8 *y) {
  for (size_t s = 0; s < l->nsuper; s++) {
    supernode n = supernode_at(l, s);
    row8 *own = y + n.row[0];
    for (size_t j = 0; j < n.columns; j += STRIP) {
      size_t width = strip_width(n.columns, j), i = j + width;
      const double *a = n.value + j * n.rows;
      row8 *x = own + j;
      for (size_t k = 0; k < width; k++) {
        x[k] /= a[j + k + k * n.rows];
        for (size_t r = k + 1; r < width; r++) x[r] -= a[j + r + k * n.rows] * x[k];
      }
      for (; i + ROWS <= n.rows; i += ROWS) {
        row8 s0 = {0}, s1 = {0}, s2 = {0}, s3 = {0};
        for (size_t k = 0; k < width; k++) {
          const double *at = a + i + k * n.rows;
          row8 xk = x[k];
          s0 += at[0] * xk;
          s1 += at[1] * xk;
          s2 += at[2] * xk;
          s3 += at[3] * xk;
        }
        y[n.row[i]] -= s0;
        y[n.row[i + 1]] -= s1;
        y[n.row[i + 2]] -= s2;
        y[n.row[i + 3]] -= s3;
      }
      for (; i < n.rows; i++) {
        row8 sum = {0};
        for (size_t k = 0; k < width; k++) sum += a[i + k * n.rows] * x[k];
        y[n.row[i]] -= sum;
      }
    }
  }
}

WIDEST static void backward(const cholmod_factor *l, row8 *y, row8 *spare) {
  for (size_t s = l->nsuper; s-- > 0;) {
    supernode n = supernode_at(l, s);
    row8 *own = y + n.row[0];
    for (size_t i = n.columns; i < n.rows; i++) spare[i] = y[n.row[i]];
    for (size_t strip = (n.columns + STRIP - 1) / STRIP; strip-- > 0;) {
      size_t j = strip * STRIP, width = strip_width(n.columns, j), k = 0;
      const double *a = n.value + j * n.rows;
      row8 *x = own + j;
      for (; k + ROWS <= width; k += ROWS) {
        const double *a0 = a + k * n.rows, *a1 = a0 + n.rows, *a2 = a1 + n.rows, *a3 = a2 + n.rows;
        row8 s0 = {0}, s1 = {0}, s2 = {0}, s3 = {0};
        for (size_t i = j + width; i < n.rows; i++) {
          row8 yi = spare[i];
          s0 += a0[i] * yi;
          s1 += a1[i] * yi;
          s2 += a2[i] * yi;
          s3 += a3[i] * yi;
        }
        x[k] -= s0;
        x[k + 1] -= s1;
        x[k + 2] -= s2;
        x[k + 3] -= s3;
      }
      for (; k < width; k++) {
        row8 sum = {0};
        for (size_t i = j + width; i < n.rows; i++) sum += a[i + k * n.rows] * spare[i];
        x[k] -= sum;
      }
      for (k = width; k-- > 0;) {
        for (size_t r = k + 1; r < width; r++) x[k] -= a[j + r + k * n.rows] * x[r];
        x[k] /= a[j + k + k * n.rows];
        spare[j + k] = x[k];
      }
    }
  }
}

void pb_supersolve(const cholmod_factor *l, double *y, double *spare) {
  forward(l, (row8 *)y);
  backward(l, (row8 *)y, (row8 *)spare);
}
