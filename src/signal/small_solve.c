// Gaussian elimination with partial pivoting on small complex matrices: see small_solve.h.
#include "signal/small_solve.h"

#include <math.h>

static void swap_rows(double complex *m, size_t ld, size_t columns, size_t r, size_t s) {
  for (size_t c = 0; c < columns; c++) {
    double complex t = m[r + c * ld];
    m[r + c * ld] = m[s + c * ld];
    m[s + c * ld] = t;
  }
}

// Rows scaled to a largest entry of 1, so that one threshold fits rows of any unit.
static bool scale_rows(size_t n, size_t nrhs, double complex *a, double complex *b) {
  for (size_t r = 0; r < n; r++) {
    double largest = 0;
    for (size_t c = 0; c < n; c++) largest = fmax(largest, cabs(a[r + c * n]));
    if (!(largest > 0) || !isfinite(largest)) return false;
    for (size_t c = 0; c < n; c++) a[r + c * n] /= largest;
    for (size_t c = 0; c < nrhs; c++) b[r + c * n] /= largest;
  }
  return true;
}

bool pb_small_solve(size_t n, size_t nrhs, double complex *a, double complex *b) {
  if (!scale_rows(n, nrhs, a, b)) return false;
  for (size_t k = 0; k < n; k++) {
    size_t pivot = k;
    for (size_t r = k + 1; r < n; r++) {
      if (cabs(a[r + k * n]) > cabs(a[pivot + k * n])) pivot = r;
    }
    if (!(cabs(a[pivot + k * n]) > 1e-13)) return false;
    swap_rows(a, n, n, k, pivot);
    swap_rows(b, n, nrhs, k, pivot);
    for (size_t r = k + 1; r < n; r++) {
      double complex factor = a[r + k * n] / a[k + k * n];
      for (size_t c = k + 1; c < n; c++) a[r + c * n] -= pb_product(factor, a[k + c * n]);
      for (size_t c = 0; c < nrhs; c++) b[r + c * n] -= pb_product(factor, b[k + c * n]);
    }
  }
  for (size_t c = 0; c < nrhs; c++) {
    for (size_t r = n; r-- > 0;) {
      double complex sum = b[r + c * n];
      for (size_t k = r + 1; k < n; k++) sum -= pb_product(a[r + k * n], b[k + c * n]);
      b[r + c * n] = sum / a[r + r * n];
    }
  }
  return true;
}
