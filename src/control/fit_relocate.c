// The two linear problems of vector fitting: pole relocation and residues. See fit.h.
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"
#include "control/fit_internal.h"

void pb_fit_basis(const pb_fit_poles *poles, double x, double complex *phi) {
  double complex w = CMPLX(0, x);
  for (size_t k = 0; k < poles->n; k++) {
    double complex p = poles->p[k], a = 1 / (w - p);
    phi[k] = a;
    if (cimag(p) == 0) continue;
    double complex b = 1 / (w - conj(p)), difference = a - b;
    phi[k] = a + b;
    phi[++k] = CMPLX(-cimag(difference), creal(difference));
  }
}

// Rows of one channel: weight·[φ 1 | −H φ  −H], real parts above imaginary ones. m is 2 lines ×
// columns.
static void fill_rows(const pb_fit_data *d, const pb_fit_poles *poles, size_t channel,
                      double complex *phi, double *m) {
  size_t n = poles->n, rows = 2 * d->lines;
  for (size_t l = 0; l < d->lines; l++) {
    double weight = d->weight[channel * d->lines + l];
    double complex h = d->h[channel * d->lines + l];
    pb_fit_basis(poles, d->x[l], phi);
    phi[n] = 1;
    for (size_t k = 0; k <= n; k++) {
      double complex left = weight * phi[k], right = -weight * (h * phi[k]);
      m[l + k * rows] = creal(left);
      m[d->lines + l + k * rows] = cimag(left);
      m[l + (n + 1 + k) * rows] = creal(right);
      m[d->lines + l + (n + 1 + k) * rows] = cimag(right);
    }
  }
}

// QR of m (rows × columns, overwritten); the triangle's lower right block of n1 columns goes to row
// `at` of stack (ld rows).
static pb_status compress(double *m, size_t rows, size_t columns, size_t n1, double *tau,
                          double *work, int lwork, double *stack, size_t ld, size_t at,
                          pb_error *err) {
  int ir = (int)rows, ic = (int)columns, info;
  dgeqrf_(&ir, &ic, m, &ir, tau, work, &lwork, &info);
  if (info != 0) return pb_fail(err, PB_ERR_NUMERIC, "fit", "dgeqrf: %d", info);
  size_t skip = columns - n1;
  for (size_t c = 0; c < n1; c++) {
    for (size_t r = 0; r < n1; r++) {
      stack[at + r + c * ld] = r <= c ? m[skip + r + (skip + c) * rows] : 0;
    }
  }
  return PB_OK;
}

// The condition that keeps the relaxed problem from the zero solution: Σ_l Re(Σ c φ + d) = lines.
static void relaxation_row(const pb_fit_data *d, const pb_fit_poles *poles, double complex *phi,
                           double *stack, size_t ld, size_t row, double *rhs) {
  size_t n = poles->n;
  double norm = 0;
  for (size_t k = 0; k < d->channels * d->lines; k++) {
    double size = d->weight[k] * cabs(d->h[k]);
    norm += size * size;
  }
  double scale = sqrt(norm) / (double)d->lines;
  for (size_t l = 0; l < d->lines; l++) {
    pb_fit_basis(poles, d->x[l], phi);
    for (size_t k = 0; k < n; k++) stack[row + k * ld] += scale * creal(phi[k]);
  }
  stack[row + n * ld] = scale * (double)d->lines;
  rhs[row] = scale * (double)d->lines;
}

// Least squares stack x = rhs with columns scaled to unit norm; x into rhs.
static pb_status solve_scaled(double *stack, size_t rows, size_t columns, double *rhs, double *norm,
                              pb_error *err) {
  for (size_t c = 0; c < columns; c++) {
    double sum = 0;
    for (size_t r = 0; r < rows; r++) sum += stack[r + c * rows] * stack[r + c * rows];
    norm[c] = sum > 0 ? sqrt(sum) : 1;
    for (size_t r = 0; r < rows; r++) stack[r + c * rows] /= norm[c];
  }
  int ir = (int)rows, ic = (int)columns, one = 1, lwork = 64 * (ir + ic), info;
  double *work = malloc((size_t)lwork * sizeof *work);
  if (!work) return pb_fail_memory(err, "fit");
  dgels_("N", &ir, &ic, &one, stack, &ir, rhs, &ir, work, &lwork, &info);
  free(work);
  if (info != 0) return pb_fail(err, PB_ERR_NUMERIC, "fit", "dgels: %d", info);
  for (size_t c = 0; c < columns; c++) rhs[c] /= norm[c];
  return PB_OK;
}

// New poles: the zeros of σ(w) = Σ c φ + d, eigenvalues of A − b c'/d, unstable ones reflected.
static pb_status zeros_of_sigma(pb_fit_poles *poles, const double *c, double d, pb_error *err) {
  size_t n = poles->n;
  int in = (int)n, one = 1, lwork = 8 * in, info = 0;
  double *a = calloc(n * n, sizeof *a), *wr = malloc(2 * n * sizeof *wr);
  double *work = malloc((size_t)lwork * sizeof *work);
  pb_status status = PB_OK;
  if (!a || !wr || !work) {
    status = pb_fail_memory(err, "fit");
    goto done;
  }
  for (size_t k = 0; k < n; k++) {
    double re = creal(poles->p[k]), im = cimag(poles->p[k]), b = im == 0 ? 1 : 2;
    a[k + k * n] = re;
    if (im != 0) {
      a[k + (k + 1) * n] = im;
      a[k + 1 + k * n] = -im;
      a[k + 1 + (k + 1) * n] = re;
    }
    for (size_t j = 0; j < n; j++) a[k + j * n] -= b * c[j] / d;
    k += im != 0;
  }
  for (size_t k = 0; k < n * n; k++) {
    if (!isfinite(a[k]))
      status = pb_fail(err, PB_ERR_NUMERIC, "fit", "the relocation is not finite");
  }
  if (status != PB_OK) goto done;
  dgeev_("N", "N", &in, a, &in, wr, wr + n, NULL, &one, NULL, &one, work, &lwork, &info);
  if (info != 0) {
    status = pb_fail(err, PB_ERR_NUMERIC, "fit", "dgeev: %d", info);
    goto done;
  }
  for (size_t k = 0; k < n; k++) {
    // Reflected, and kept off the axis where the basis has no value.
    double least = 1e-10 * hypot(wr[k], wr[n + k]) + 1e-14;
    poles->p[k] = CMPLX(-fmax(fabs(wr[k]), least), wr[n + k]);
  }
done:
  free(a);
  free(wr);
  free(work);
  return status;
}

pb_status pb_fit_relocate(const pb_fit_data *d, pb_fit_poles *poles, pb_error *err) {
  size_t n = poles->n, n1 = n + 1, columns = 2 * n1, rows = 2 * d->lines;
  size_t ld = d->channels * n1 + 1;
  int lwork = 64 * (int)columns;
  double complex *phi = malloc(n1 * sizeof *phi);
  double *m = malloc(rows * columns * sizeof *m), *stack = calloc(ld * n1, sizeof *stack);
  double *rhs = calloc(ld, sizeof *rhs), *tau = malloc(columns * sizeof *tau);
  double *work = malloc((size_t)lwork * sizeof *work);
  bool have = phi && m && stack && rhs && tau && work;
  pb_status status = have ? PB_OK : pb_fail_memory(err, "fit");
  for (size_t c = 0; c < d->channels && status == PB_OK; c++) {
    fill_rows(d, poles, c, phi, m);
    status = compress(m, rows, columns, n1, tau, work, lwork, stack, ld, c * n1, err);
  }
  if (status == PB_OK) {
    relaxation_row(d, poles, phi, stack, ld, ld - 1, rhs);
    status = solve_scaled(stack, ld, n1, rhs, tau, err);
  }
  if (status == PB_OK) {
    // Towards 0 the zeros of σ run away; a bound keeps them.
    double direct = fabs(rhs[n]) > 1e-8 ? rhs[n] : copysign(1e-8, rhs[n]);
    status = zeros_of_sigma(poles, rhs, direct, err);
  }
  free(phi);
  free(m);
  free(stack);
  free(rhs);
  free(tau);
  free(work);
  return status;
}

// Coefficients c[n + 1] of one channel for given poles, m and rhs as work.
static pb_status channel_residues(const pb_fit_data *d, const pb_fit_poles *poles, size_t channel,
                                  double complex *phi, double *m, double *rhs, double *norm,
                                  double *c, pb_error *err) {
  size_t n1 = poles->n + 1, rows = 2 * d->lines;
  for (size_t l = 0; l < d->lines; l++) {
    double weight = d->weight[channel * d->lines + l];
    double complex h = weight * d->h[channel * d->lines + l];
    pb_fit_basis(poles, d->x[l], phi);
    phi[n1 - 1] = 1;
    for (size_t k = 0; k < n1; k++) {
      m[l + k * rows] = weight * creal(phi[k]);
      m[d->lines + l + k * rows] = weight * cimag(phi[k]);
    }
    rhs[l] = creal(h);
    rhs[d->lines + l] = cimag(h);
  }
  pb_status status = solve_scaled(m, rows, n1, rhs, norm, err);
  if (status == PB_OK) memcpy(c, rhs, n1 * sizeof *c);
  return status;
}

pb_status pb_fit_residues(const pb_fit_data *d, const pb_fit_poles *poles, double *c,
                          double complex *error, pb_error *err) {
  size_t n1 = poles->n + 1, rows = 2 * d->lines;
  double complex *phi = malloc(n1 * sizeof *phi);
  double *m = malloc(rows * n1 * sizeof *m), *rhs = malloc(rows * sizeof *rhs);
  double *norm = malloc(n1 * sizeof *norm);
  pb_status status = phi && m && rhs && norm ? PB_OK : pb_fail_memory(err, "fit");
  for (size_t k = 0; k < d->channels && status == PB_OK; k++) {
    double *ck = c + k * n1;
    status = channel_residues(d, poles, k, phi, m, rhs, norm, ck, err);
    for (size_t l = 0; l < d->lines && status == PB_OK; l++) {
      double complex sum = ck[n1 - 1] - d->h[k * d->lines + l];
      pb_fit_basis(poles, d->x[l], phi);
      for (size_t j = 0; j + 1 < n1; j++) sum += ck[j] * phi[j];
      error[k * d->lines + l] = d->weight[k * d->lines + l] * sum;
    }
  }
  free(phi);
  free(m);
  free(rhs);
  free(norm);
  return status;
}
