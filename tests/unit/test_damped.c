// Damped modes by refined clusters, against the dense eigenproblem and their defining equations.
#include "support/check.h"

#include "base/lapack.h"
#include "model/damped.h"

typedef struct problem {
  size_t n;
  double *omega, *damping;
} problem;

static double noise(uint64_t *seed) {
  *seed = *seed * 6364136223846793005u + 1442695040888963407u;
  return (double)(*seed >> 11) / 0x1p52 - 1;
}

// Frequencies from 100 rad/s on, in families of `family` within `spread` of each other; damping
// ratio ζ with coupling `coupling` of it.
static problem problem_new(size_t n, size_t family, double spread, double zeta, double coupling) {
  problem p = {n, malloc(n * sizeof(double)), calloc(n * n, sizeof(double))};
  uint64_t seed = 7;
  for (size_t i = 0; i < n; i++)
    p.omega[i] = 100 * pow(1.35, (double)(i / family)) * (1 + spread * (double)(i % family));
  for (size_t j = 0; j < n; j++) {
    for (size_t i = 0; i < j; i++)
      p.damping[i + j * n] = p.damping[j + i * n] =
          coupling * zeta * sqrt(p.omega[i] * p.omega[j]) * noise(&seed);
    p.damping[j + j * n] = 2 * zeta * p.omega[j];
  }
  return p;
}

static void problem_free(problem *p) {
  free(p->omega);
  free(p->damping);
}

static double complex value(const double *const part[2], size_t at) {
  return part[0][at] + I * part[1][at];
}

// Largest entry of (λ² + λĈ + Ω²) x, over all eigenpairs, against the larger of ω_i and |λ| and
// the length of the vector as a state [ω x, λ x]; P = Ĉ x is held to the same.
static double worst_residual(const problem *p, const pb_damped *d) {
  const size_t n = p->n;
  const double *const x[2] = {d->x[0], d->x[1]}, *const cx[2] = {d->p[0], d->p[1]};
  double worst = 0;
  for (size_t k = 0; k < d->columns; k++) {
    const double complex l = d->cluster.lambda[k];
    double length = 0;
    for (size_t i = 0; i < n; i++)
      length =
          hypot(length, hypot(p->omega[d->cluster.mode[i]], cabs(l)) * cabs(value(x, i + k * n)));
    for (size_t i = 0; i < n; i++) {
      const size_t mi = d->cluster.mode[i];
      double complex sum = 0;
      for (size_t j = 0; j < n; j++)
        sum += p->damping[mi + d->cluster.mode[j] * n] * value(x, j + k * n);
      const double complex r =
          (l * l + p->omega[mi] * p->omega[mi]) * value(x, i + k * n) + l * sum;
      const double size = fmax(p->omega[mi], cabs(l)) * length;
      worst = fmax(worst, cabs(r) / size);
      worst = fmax(worst, cabs(l) * cabs(sum - value(cx, i + k * n)) / size);
    }
  }
  return worst;
}

static int by_imaginary(const void *a, const void *b) {
  const double complex x = *(const double complex *)a, y = *(const double complex *)b;
  if (cimag(x) != cimag(y)) return cimag(x) < cimag(y) ? -1 : 1;
  return (creal(x) > creal(y)) - (creal(x) < creal(y));
}

// All eigenvalues with Im ≥ 0 of the dense first-order matrix, sorted; returns how many.
static size_t dense_eigenvalues(const problem *p, double complex *out) {
  const size_t n = p->n, nx = 2 * n;
  int size = (int)nx, one = 1, info = 0, lwork = 64 * size;
  double none = 0, *a = calloc(nx * nx, sizeof *a), *w = malloc(2 * nx * sizeof *w);
  double *work = malloc((size_t)lwork * sizeof *work);
  for (size_t j = 0; j < n; j++) {
    a[j + (n + j) * nx] = p->omega[j];
    a[n + j + j * nx] = -p->omega[j];
    for (size_t i = 0; i < n; i++) a[n + i + (n + j) * nx] = -p->damping[i + j * n];
  }
  dgeev_("N", "N", &size, a, &size, w, w + nx, &none, &one, &none, &one, work, &lwork, &info);
  assert_int_equal(info, 0);
  size_t count = 0;
  for (size_t k = 0; k < nx; k++)
    if (w[nx + k] >= 0) out[count++] = w[k] + I * w[nx + k];
  qsort(out, count, sizeof *out, by_imaginary);
  free(a);
  free(w);
  free(work);
  return count;
}

static void check(const problem *p, bool expect_solved) {
  pb_damped d;
  bool solved;
  REQUIRE(pb_damped_solve(p->n, p->omega, p->damping, NULL, &d, &solved, &err));
  assert_int_equal(solved, expect_solved);
  if (!solved) {
    assert_null(d.x[0]);
    return;
  }
  double complex *dense = malloc(2 * p->n * sizeof *dense), *ours = malloc(2 * p->n * sizeof *ours);
  assert_int_equal(dense_eigenvalues(p, dense), d.columns);
  memcpy(ours, d.cluster.lambda, d.columns * sizeof *ours);
  qsort(ours, d.columns, sizeof *ours, by_imaginary);
  const double largest = p->omega[p->n - 1];
  for (size_t k = 0; k < d.columns; k++) {
    ASSERT_NEAR(creal(ours[k]), creal(dense[k]), 1e-12 * largest);
    ASSERT_NEAR(cimag(ours[k]), cimag(dense[k]), 1e-12 * largest);
  }
  ASSERT_NEAR(worst_residual(p, &d), 0, 1e-13);
  free(dense);
  free(ours);
  pb_damped_clear(&d);
}

static void test_weakly_coupled(void **state) {
  (void)state;
  problem p = problem_new(60, 1, 0, 0.01, 0.5);
  check(&p, true);
  problem_free(&p);
}

// Families of six, from well apart to equal but for rounding: inside them the coupling decides.
static void test_clusters(void **state) {
  (void)state;
  static const double spread[] = {1e-3, 1e-6, 1e-12, 0};
  for (size_t k = 0; k < 4; k++) {
    problem p = problem_new(60, 6, spread[k], 0.01, 0.3);
    check(&p, true);
    problem_free(&p);
  }
}

// Real eigenvalues: two modes are overdamped.
static void test_overdamped(void **state) {
  (void)state;
  problem p = problem_new(40, 1, 0, 0.005, 0.5);
  p.damping[7 + 7 * 40] = 5 * p.omega[7];
  p.damping[20 + 20 * 40] = 3 * p.omega[20];
  check(&p, true);
  problem_free(&p);
}

// What is not for this method is left alone: everything coupled, or a critically damped mode.
static void test_refused(void **state) {
  (void)state;
  problem p = problem_new(20, 20, 1e-2, 0.3, 1);
  check(&p, false);
  problem_free(&p);
  p = problem_new(20, 1, 0, 0.005, 0.5);
  p.damping[4 + 4 * 20] = 2 * p.omega[4];
  check(&p, false);
  problem_free(&p);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_weakly_coupled),
      cmocka_unit_test(test_clusters),
      cmocka_unit_test(test_overdamped),
      cmocka_unit_test(test_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
