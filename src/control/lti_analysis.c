// Poles and frequency responses of dense linear systems: see lti_ops.h.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"
#include "control/lti_ops.h"
#include "signal/small_solve.h"

pb_status pb_lti_poles(const pb_lti *lti, double complex *poles, pb_error *err) {
  size_t n = lti->nx;
  if (n == 0) return PB_OK;
  int in = (int)n, one = 1, lwork = 8 * in, info;
  double *a = malloc(n * n * sizeof *a), *wr = malloc(2 * n * sizeof *wr);
  double *work = malloc((size_t)lwork * sizeof *work);
  pb_status status = PB_OK;
  if (!a || !wr || !work) {
    status = pb_fail_memory(err, "poles");
    goto done;
  }
  memcpy(a, lti->a, n * n * sizeof *a);
  for (size_t k = 0; k < n * n; k++) {
    if (isfinite(a[k])) continue;
    status = pb_fail(err, PB_ERR_NUMERIC, "poles", "the state matrix is not finite");
    goto done;
  }
  dgeev_("N", "N", &in, a, &in, wr, wr + n, NULL, &one, NULL, &one, work, &lwork, &info);
  if (info != 0) {
    status =
        pb_fail(err, PB_ERR_NUMERIC, "poles", "the eigenvalues did not converge (dgeev %d)", info);
    goto done;
  }
  for (size_t k = 0; k < n; k++) poles[k] = CMPLX(wr[k], wr[n + k]);
done:
  free(a);
  free(wr);
  free(work);
  return status;
}

// H = Qᵀ A Q upper Hessenberg, QᵀB and C Q.
typedef struct hessenberg {
  size_t n;
  double *h;          // n × n row-major, so that elimination runs along rows
  double *b;          // n × nu row-major
  double *c;          // ny × n column-major
  double complex *m;  // n × n row-major, of one frequency
  double complex *x;  // n × nu row-major
} hessenberg;

static void hessenberg_free(hessenberg *s) {
  free(s->h);
  free(s->b);
  free(s->c);
  free(s->m);
  free(s->x);
}

// Reduces a (overwritten) and forms Q in q; both n × n column-major.
static pb_status reduce(size_t n, double *a, double *q, pb_error *err) {
  int in = (int)n, one = 1, lwork = 64 * in, info = 0;
  double *tau = malloc(n * sizeof *tau), *work = malloc((size_t)lwork * sizeof *work);
  pb_status status = PB_OK;
  if (!tau || !work) {
    status = pb_fail_memory(err, "frf");
  } else {
    dgehrd_(&in, &one, &in, a, &in, tau, work, &lwork, &info);
    memcpy(q, a, n * n * sizeof *q);
    if (info == 0) dorghr_(&in, &one, &in, q, &in, tau, work, &lwork, &info);
    if (info != 0) status = pb_fail(err, PB_ERR_NUMERIC, "frf", "Hessenberg reduction: %d", info);
  }
  free(tau);
  free(work);
  return status;
}

static pb_status hessenberg_init(const pb_lti *lti, hessenberg *s, pb_error *err) {
  size_t n = lti->nx, nu = lti->nu, ny = lti->ny;
  *s = (hessenberg){.n = n};
  double *a = malloc(n * n * sizeof *a), *q = malloc(n * n * sizeof *q);
  s->h = calloc(n * n, sizeof *s->h);
  s->b = malloc(n * nu * sizeof *s->b);
  s->c = malloc(ny * n * sizeof *s->c);
  s->m = malloc(n * n * sizeof *s->m);
  s->x = malloc(n * nu * sizeof *s->x);
  bool have = a && q && s->h && s->b && s->c && s->m && s->x;
  pb_status status = have ? PB_OK : pb_fail_memory(err, "frf");
  if (status != PB_OK) goto done;
  memcpy(a, lti->a, n * n * sizeof *a);
  status = reduce(n, a, q, err);
  if (status != PB_OK) goto done;
  for (size_t r = 0; r < n; r++) {
    for (size_t c = r > 0 ? r - 1 : 0; c < n; c++) s->h[r * n + c] = a[r + c * n];
  }
  int in = (int)n, iu = (int)nu, iy = (int)ny;
  double one = 1, zero = 0;
  // Bᵀ Q column-major nu × n is Qᵀ B row-major.
  dgemm_("T", "N", &iu, &in, &in, &one, lti->b, &in, q, &in, &zero, s->b, &iu);
  dgemm_("N", "N", &iy, &in, &in, &one, lti->c, &iy, q, &in, &zero, s->c, &iy);
done:
  free(a);
  free(q);
  if (status != PB_OK) hessenberg_free(s);
  return status;
}

static void swap_rows(double complex *a, double complex *b, size_t count) {
  for (size_t c = 0; c < count; c++) {
    double complex t = a[c];
    a[c] = b[c];
    b[c] = t;
  }
}

// x ← (p I − H)⁻¹ x by elimination of the subdiagonal with row interchanges.
static bool hessenberg_solve(hessenberg *s, size_t nu, double complex p) {
  size_t n = s->n;
  for (size_t k = 0; k < n * n; k++) s->m[k] = -s->h[k];
  for (size_t k = 0; k < n; k++) s->m[k * n + k] += p;
  for (size_t k = 0; k < n * nu; k++) s->x[k] = s->b[k];
  for (size_t k = 0; k + 1 < n; k++) {
    double complex *top = s->m + k * n, *next = top + n, *x = s->x + k * nu;
    if (cabs(next[k]) > cabs(top[k])) {
      swap_rows(top + k, next + k, n - k);
      swap_rows(x, x + nu, nu);
    }
    if (next[k] == 0) continue;
    double complex factor = next[k] / top[k];
    for (size_t c = k + 1; c < n; c++) next[c] -= pb_product(factor, top[c]);
    for (size_t i = 0; i < nu; i++) x[nu + i] -= pb_product(factor, x[i]);
  }
  for (size_t k = n; k-- > 0;) {
    const double complex *row = s->m + k * n;
    if (row[k] == 0) return false;
    for (size_t i = 0; i < nu; i++) {
      double complex sum = s->x[k * nu + i];
      for (size_t c = k + 1; c < n; c++) sum -= pb_product(row[c], s->x[c * nu + i]);
      s->x[k * nu + i] = sum / row[k];
    }
  }
  return true;
}

static double complex point_at(const pb_lti *lti, double hz) {
  double w = 2 * M_PI * hz;
  return lti->dt > 0 ? cexp(CMPLX(0, w * lti->dt)) : CMPLX(0, w);
}

pb_status pb_lti_frf(const pb_lti *lti, const double *hz, size_t nf, double complex *h,
                     pb_error *err) {
  size_t nx = lti->nx, nu = lti->nu, ny = lti->ny;
  hessenberg s = {0};
  for (size_t f = 0; f < nf; f++) {
    if (isfinite(hz[f]) && hz[f] >= 0) continue;
    return pb_fail(err, PB_ERR_ARGUMENT, "frf", "frequency %g Hz", hz[f]);
  }
  pb_status status = nx > 0 ? hessenberg_init(lti, &s, err) : PB_OK;
  if (status != PB_OK) return status;
  for (size_t f = 0; f < nf && status == PB_OK; f++) {
    if (nx > 0 && !hessenberg_solve(&s, nu, point_at(lti, hz[f]))) {
      status = pb_fail(err, PB_ERR_SINGULAR, "frf", "%g Hz is a pole", hz[f]);
    }
    for (size_t o = 0; o < ny && status == PB_OK; o++) {
      for (size_t i = 0; i < nu; i++) {
        double complex sum = lti->d[o + i * ny];
        for (size_t k = 0; k < nx; k++) sum += s.c[o + k * ny] * s.x[k * nu + i];
        h[(f * ny + o) * nu + i] = sum;
      }
    }
  }
  hessenberg_free(&s);
  return status;
}

// out[o][i] = sign·C X (+ D), X nx × nu column-major.
static void output_map(const pb_lti *lti, const double complex *x, double sign, bool direct,
                       double complex *out) {
  for (size_t o = 0; o < lti->ny; o++) {
    for (size_t i = 0; i < lti->nu; i++) {
      double complex sum = direct ? lti->d[o + i * lti->ny] : 0;
      for (size_t k = 0; k < lti->nx; k++)
        sum += sign * lti->c[o + k * lti->ny] * x[k + i * lti->nx];
      out[o * lti->nu + i] = sum;
    }
  }
}

static bool resolvent(const pb_lti *lti, double complex point, double complex *m,
                      double complex *x) {
  size_t n = lti->nx;
  for (size_t k = 0; k < n * n; k++) m[k] = -lti->a[k];
  for (size_t k = 0; k < n; k++) m[k + k * n] += point;
  return pb_small_solve(n, lti->nu, m, x);
}

pb_status pb_lti_evaluate(const pb_lti *lti, double complex point, double complex *h,
                          double complex *dh, pb_error *err) {
  size_t n = lti->nx, nu = lti->nu;
  double complex *m = malloc((n * n + 1) * sizeof *m), *x = malloc((n * nu + 1) * sizeof *x);
  pb_status status = m && x ? PB_OK : pb_fail_memory(err, "evaluate");
  if (status != PB_OK) goto done;
  for (size_t k = 0; k < n * nu; k++) x[k] = lti->b[k];
  bool regular = resolvent(lti, point, m, x);
  if (regular) output_map(lti, x, 1, true, h);
  // d/dp C (pI − A)⁻¹ B = −C (pI − A)⁻² B
  if (regular && dh) regular = resolvent(lti, point, m, x);
  if (regular && dh) output_map(lti, x, -1, false, dh);
  if (!regular) {
    status =
        pb_fail(err, PB_ERR_SINGULAR, "evaluate", "%g%+gi is a pole", creal(point), cimag(point));
  }
done:
  free(m);
  free(x);
  return status;
}
