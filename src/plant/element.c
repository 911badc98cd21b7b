// Super-elements: see element.h.
#include "plant/element.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/array.h"
#include "base/lapack.h"
#include "base/text.h"

static const double two_pi = 6.283185307179586476925286766559;

// Against √(X_ii X_jj), so that forces and moments are each measured in their own unit.
static double asymmetry(const double *x, size_t n) {
  double worst = 0;
  for (size_t j = 0; j < n; j++) {
    for (size_t i = 0; i < j; i++) {
      double difference = fabs(x[i + j * n] - x[j + i * n]);
      double size = sqrt(fabs(x[i + i * n] * x[j + j * n]));
      if (difference > 0) worst = fmax(worst, size > 0 ? difference / size : INFINITY);
    }
  }
  return worst;
}

static void symmetrize(double *x, size_t n) {
  for (size_t j = 0; j < n; j++)
    for (size_t i = 0; i < j; i++)
      x[i + j * n] = x[j + i * n] = 0.5 * (x[i + j * n] + x[j + i * n]);
}

// Mass and centre of mass from RᵀMR, R the rigid motions of the interface frames: the translations
// give the mass, the products of translation and rotation give m·(centre).
static void measure_mass(pb_element *e) {
  size_t n = e->size;
  double g[6][6] = {{0}};
  for (size_t jf = 0; jf < 6 * e->frames; jf++) {
    for (size_t i = 0; i < 6 * e->frames; i++) {
      double value = e->m[i + jf * n];
      for (int a = 0; a < 6; a++) {
        for (int b = 0; b < 6; b++) {
          double ra[6] = {0}, rb[6] = {0};
          const double *pa = e->position + 3 * (i / 6), *pb = e->position + 3 * (jf / 6);
          ra[a] = rb[b] = 1;
          if (a >= 3) {  // rotation about axis a-3: u = θ × p
            int x = a - 3, y = (x + 1) % 3, z = (x + 2) % 3;
            ra[y] = -pa[z], ra[z] = pa[y];
          }
          if (b >= 3) {
            int x = b - 3, y = (x + 1) % 3, z = (x + 2) % 3;
            rb[y] = -pb[z], rb[z] = pb[y];
          }
          g[a][b] += ra[i % 6] * value * rb[jf % 6];
        }
      }
    }
  }
  double mass = (g[0][0] + g[1][1] + g[2][2]) / 3;
  e->health.mass = mass;
  // ½m|v + ω×c|²: the product of v_x and ω_y is m c_z, that of v_y and ω_z is m c_x, of v_z and ω_x
  // m c_y.
  e->health.center[0] = mass != 0 ? 0.5 * (g[1][5] - g[2][4]) / mass : 0;
  e->health.center[1] = mass != 0 ? 0.5 * (g[2][3] - g[0][5]) / mass : 0;
  e->health.center[2] = mass != 0 ? 0.5 * (g[0][4] - g[1][3]) / mass : 0;
}

static double signed_hz(double omega2) {
  double hz = sqrt(fabs(omega2)) / two_pi;
  return omega2 < 0 ? -hz : hz;
}

static int magnitude_order(const void *a, const void *b) {
  double x = fabs(*(const double *)a), y = fabs(*(const double *)b);
  return (x > y) - (x < y);
}

// Eigenvalues of the free element, and its largest rigid-body frequency.
static pb_status solve_free(pb_element *e, pb_error *err) {
  int n = (int)e->size, info = 0, lwork = 1 + 6 * n + 2 * n * n, liwork = 3 + 5 * n, itype = 1;
  size_t bytes = (size_t)n * (size_t)n * sizeof(double);
  double *mass = pb_array_new(1, bytes), *work = pb_array_new((size_t)lwork, sizeof *work);
  double *sorted = malloc((size_t)n * sizeof *sorted);
  int *iwork = malloc((size_t)liwork * sizeof *iwork);
  pb_status st = PB_OK;
  if (!mass || !work || !iwork || !sorted) {
    st = pb_fail_memory(err, e->file);
    goto done;
  }
  memcpy(mass, e->m, bytes);
  memcpy(e->shape, e->k, bytes);
  dsygvd_(&itype, "V", "U", &n, e->shape, &n, mass, &n, e->omega2, work, &lwork, iwork, &liwork,
          &info);
  if (info > n) {
    st = pb_fail(err, PB_ERR_ELEMENT, e->file,
                 "M is not positive definite (leading minor %d of %d)", info - n, n);
  } else if (info) {
    st = pb_fail(err, PB_ERR_NUMERIC, e->file, "the free element's eigenvalues did not converge");
  } else {
    memcpy(sorted, e->omega2, (size_t)n * sizeof *sorted);
    qsort(sorted, (size_t)n, sizeof *sorted, magnitude_order);
    e->health.rigid_hz = signed_hz(sorted[n < 6 ? n - 1 : 5]);
    e->health.flexible_hz = n > 6 ? signed_hz(sorted[6]) : INFINITY;
  }
done:
  free(mass);
  free(work);
  free(sorted);
  free(iwork);
  return st;
}

pb_status pb_element_warn(const pb_element *e, pb_warnings *warnings, pb_error *err) {
  const pb_element_health *h = &e->health;
  pb_status st = PB_OK;
  double worst = fmax(h->asymmetry_k, h->asymmetry_m);
  if (worst > 1e-9)
    st =
        pb_warn(warnings, err, e->file,
                "K and M are symmetric to %.1e only; the mean with their transpose is used", worst);
  if (!st && (fabs(h->rigid_hz) > 1e-2 * fabs(h->flexible_hz) || fabs(h->rigid_hz) > 10))
    st = pb_warn(warnings, err, e->file,
                 "rigid-body motions of the free element appear at %.3g Hz instead of 0 (first "
                 "flexible mode %.4g Hz): the export has too few digits, the frames are not where "
                 "the file says, or the part is fixed",
                 h->rigid_hz, h->flexible_hz);
  return st;
}

static pb_status check_finite(const double *x, size_t n, const char *name, const char *file,
                              pb_error *err) {
  for (size_t i = 0; i < n; i++)
    if (!(fabs(x[i]) <= 1e30))  // as in plant files: products stay finite
      return pb_fail(err, PB_ERR_ELEMENT, file, "%s has an entry that is not finite or above 1e30",
                     name);
  return PB_OK;
}

static pb_status allocate(pb_element *e, const char *name) {
  size_t n = e->size;
  e->file = pb_text_copy(name);
  e->position = pb_array_new(3 * e->frames, sizeof(double));
  e->k = pb_array_new(n * n, sizeof(double));
  e->m = pb_array_new(n * n, sizeof(double));
  e->omega2 = malloc(n * sizeof(double));
  e->shape = pb_array_new(n * n, sizeof(double));
  bool ok = e->file && e->position && e->k && e->m && e->omega2 && e->shape;
  return ok ? PB_OK : PB_ERR_MEMORY;
}

pb_status pb_element_new(const char *name, size_t frames, size_t size, const double *position,
                         const double *k, const double *m, pb_warnings *warnings, pb_element **out,
                         pb_error *err) {
  *out = NULL;
  if (!frames || size < 6 * frames || size > 20000)
    return pb_fail(err, PB_ERR_SYNTAX, name,
                   "%zu × %zu matrices do not fit %zu interface frames (6 each, then modes)", size,
                   size, frames);
  pb_status st = check_finite(k, size * size, "K", name, err);
  if (!st) st = check_finite(m, size * size, "M", name, err);
  if (!st) st = check_finite(position, 3 * frames, "int_xyz", name, err);
  if (st) return st;
  pb_element *e = calloc(1, sizeof *e);
  if (!e) return pb_fail_memory(err, name);
  atomic_init(&e->users, 1);
  e->frames = frames;
  e->size = size;
  if (allocate(e, name)) {
    st = pb_fail_memory(err, name);
    goto done;
  }
  memcpy(e->position, position, 3 * frames * sizeof(double));
  memcpy(e->k, k, size * size * sizeof(double));
  memcpy(e->m, m, size * size * sizeof(double));
  e->health.asymmetry_k = asymmetry(k, size);
  e->health.asymmetry_m = asymmetry(m, size);
  if (fmax(e->health.asymmetry_k, e->health.asymmetry_m) > 1e-3) {
    st = pb_fail(err, PB_ERR_ELEMENT, name, "K or M is not symmetric (by %.1e of its diagonal)",
                 fmax(e->health.asymmetry_k, e->health.asymmetry_m));
    goto done;
  }
  symmetrize(e->k, size);
  symmetrize(e->m, size);
  measure_mass(e);
  st = solve_free(e, err);
  if (!st) st = pb_element_warn(e, warnings, err);
done:
  if (st) {
    pb_element_free(e);
  } else {
    *out = e;
  }
  return st;
}

pb_element *pb_element_share(pb_element *element) {
  atomic_fetch_add(&element->users, 1);
  return element;
}

size_t pb_element_users(const pb_element *e) {
  return atomic_load(&e->users);
}

void pb_element_free(pb_element *e) {
  if (!e || atomic_fetch_sub(&e->users, 1) > 1) return;
  free(e->file);
  free(e->position);
  free(e->k);
  free(e->m);
  free(e->omega2);
  free(e->shape);
  free(e);
}

pb_status pb_element_damping(const pb_element *e, double ratio, double *c, pb_error *err) {
  int n = (int)e->size;
  size_t size = e->size;
  double one = 1, zero = 0;
  double *mphi = pb_array_new(size * size, sizeof *mphi),
         *scaled = pb_array_new(size * size, sizeof *scaled);
  if (!mphi || !scaled) {
    free(mphi);
    free(scaled);
    return pb_fail_memory(err, e->file);
  }
  dgemm_("N", "N", &n, &n, &n, &one, e->m, &n, e->shape, &n, &zero, mphi, &n);
  for (size_t j = 0; j < size; j++) {
    double gain = 2 * ratio * sqrt(fmax(e->omega2[j], 0));
    for (size_t i = 0; i < size; i++) scaled[i + j * size] = gain * mphi[i + j * size];
  }
  dgemm_("N", "T", &n, &n, &n, &one, scaled, &n, mphi, &n, &one, c, &n);
  free(mphi);
  free(scaled);
  return PB_OK;
}
