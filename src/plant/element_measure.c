// Measures of an element's matrices: see element_doctor_internal.h.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"
#include "plant/element_doctor_internal.h"

static const double two_pi = 6.283185307179586476925286766559;

// ---- digits -------------------------------------------------------------------------------------

static int digits_of(double x) {
  char text[40];
  for (int d = 1; d < 17; d++) {
    snprintf(text, sizeof text, "%.*e", d - 1, x);
    if (strtod(text, NULL) == x) return d;
  }
  return 17;
}

// Digits that all but 2 % of the entries make do with; of a large matrix a sample is looked at.
// What is exact in single precision has 7.
int pb_measure_digits(const double *x, size_t n) {
  enum { SAMPLE = 3000 };
  size_t count[18] = {0}, total = 0, whole = n * n, stride = whole / SAMPLE + 1;
  bool single = true;
  while (whole % stride == 0 && stride > 1) stride++;  // not the same columns all the time
  for (size_t i = 0; i < whole; i += stride) {
    if (x[i] == 0 || x[i] == 1) continue;
    count[digits_of(x[i])]++;
    total++;
    single &= x[i] == (double)(float)x[i];
  }
  if (!total) return 17;
  size_t beyond = total;
  int digits = 0;
  while (digits < 17 && beyond > total / 50) beyond -= count[++digits];
  return single && digits > 7 ? 7 : digits;
}

// ---- symmetry -----------------------------------------------------------------------------------

double pb_measure_asymmetry(const double *x, size_t n) {
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

char pb_measure_half(const double *x, size_t n) {
  bool upper = false, lower = false;
  for (size_t j = 0; j < n; j++) {
    for (size_t i = 0; i < j; i++) {
      upper |= x[i + j * n] != 0;
      lower |= x[j + i * n] != 0;
    }
  }
  if (upper == lower) return 0;
  return upper ? 'u' : 'l';
}

// ---- rigid motions ------------------------------------------------------------------------------

void pb_rigid_motions(const pb_element_data *e, double *r) {
  size_t n = e->size;
  double mean[3] = {0};
  for (size_t f = 0; f < e->frames; f++)
    for (int a = 0; a < 3; a++) mean[a] += e->position[3 * f + (size_t)a] / (double)e->frames;
  memset(r, 0, 6 * n * sizeof *r);
  for (size_t f = 0; f < e->frames; f++) {
    for (size_t a = 0; a < 3; a++) {
      size_t y = (a + 1) % 3, z = (a + 2) % 3;
      r[6 * f + a + a * n] = 1;
      r[6 * f + 3 + a + (3 + a) * n] = 1;
      // u = θ × p about axis a
      r[6 * f + y + (3 + a) * n] = -(e->position[3 * f + z] - mean[z]);
      r[6 * f + z + (3 + a) * n] = e->position[3 * f + y] - mean[y];
    }
  }
}

void pb_measure_rigid(const pb_element_data *e, const double *r, double *translation,
                      double *rotation) {
  size_t n = e->size;
  *translation = *rotation = 0;
  for (size_t a = 0; a < 6; a++) {
    double scale = 0, worst = 0;
    for (size_t j = 0; j < n; j++) scale += fabs(e->k[j + j * n]) * r[j + a * n] * r[j + a * n];
    for (size_t i = 0; i < n; i++) {
      double force = 0, size = sqrt(fabs(e->k[i + i * n]) * scale);
      for (size_t j = 0; j < 6 * e->frames; j++) force += e->k[i + j * n] * r[j + a * n];
      if (force != 0) worst = fmax(worst, size > 0 ? fabs(force) / size : INFINITY);
    }
    double *of = a < 3 ? translation : rotation;
    *of = fmax(*of, worst);
  }
}

// ---- eigenvalues --------------------------------------------------------------------------------

pb_status pb_measure_mass(const char *name, const pb_element_data *e, double *smallest,
                          pb_error *err) {
  int n = (int)e->size, lwork = 2 * n + 1, liwork = 1, info = 0, iwork[1];
  size_t size = e->size;
  double *a = malloc(size * size * sizeof *a), *w = malloc(size * sizeof *w);
  double *work = malloc((size_t)lwork * sizeof *work);
  pb_status st = a && w && work ? PB_OK : pb_fail_memory(err, name);
  *smallest = -INFINITY;
  for (size_t i = 0; !st && i < size; i++)
    if (!(e->m[i + i * size] > 0)) goto done;
  if (!st) {
    for (size_t j = 0; j < size; j++)
      for (size_t i = 0; i < size; i++)
        a[i + j * size] = e->m[i + j * size] / sqrt(e->m[i + i * size] * e->m[j + j * size]);
    dsyevd_("N", "U", &n, a, &n, w, work, &lwork, iwork, &liwork, &info);
    if (info) st = pb_fail(err, PB_ERR_NUMERIC, name, "the eigenvalues of M did not converge");
    *smallest = w[0];
  }
done:
  free(a);
  free(w);
  free(work);
  return st;
}

double pb_signed_hz(double omega2) {
  double hz = sqrt(fabs(omega2)) / two_pi;
  return omega2 < 0 ? -hz : hz;
}

pb_status pb_measure_modes(const char *name, size_t n, const double *k, const double *m, double *hz,
                           double *shape, pb_error *err) {
  int in = (int)n, itype = 1, info = 0, lwork = 1 + 6 * in + 2 * in * in, liwork = 3 + 5 * in;
  size_t bytes = n * n * sizeof(double);
  double *a = shape ? shape : malloc(bytes), *b = malloc(bytes);
  double *work = malloc((size_t)lwork * sizeof *work);
  int *iwork = malloc((size_t)liwork * sizeof *iwork);
  pb_status st = a && b && work && iwork ? PB_OK : pb_fail_memory(err, name);
  if (!st) {
    memcpy(a, k, bytes);
    memcpy(b, m, bytes);
    dsygvd_(&itype, shape ? "V" : "N", "U", &in, a, &in, b, &in, hz, work, &lwork, iwork, &liwork,
            &info);
    if (info > in)
      st = pb_fail(err, PB_ERR_ELEMENT, name, "M is not positive definite");
    else if (info)
      st = pb_fail(err, PB_ERR_NUMERIC, name, "the modes did not converge");
    for (size_t i = 0; !st && i < n; i++) hz[i] = pb_signed_hz(hz[i]);
  }
  if (!shape) free(a);
  free(b);
  free(work);
  free(iwork);
  return st;
}

// The modes with the six coordinates of `base` left out.
static void leave_out(const double *x, size_t n, size_t base, double *out) {
  size_t left = n - 6;
  for (size_t j = 0, jj = 0; j < n; j++) {
    if (j / 6 == base) continue;
    for (size_t i = 0, ii = 0; i < n; i++)
      if (i / 6 != base) out[ii++ + jj * left] = x[i + j * n];
    jj++;
  }
}

static void read_held(size_t left, const double *hz, const double *shape, size_t tip,
                      const double axis[3], pb_element_held *out) {
  double total = 0;
  out->axial_hz = NAN;
  for (size_t i = 0; i < 4; i++) out->hz[i] = i < left ? hz[i] : NAN;
  for (int pass = 0; pass < 2; pass++) {
    for (size_t i = 0; i < left; i++) {
      double move = 0;
      for (size_t a = 0; a < 3; a++) move += axis[a] * shape[6 * tip + a + i * left];
      double compliance = move * move / (hz[i] * fabs(hz[i]));
      if (pass == 0) {
        total += fabs(compliance);
      } else if (fabs(compliance) >= 0.1 * total) {
        out->axial_hz = hz[i];
        return;
      }
    }
  }
}

pb_status pb_element_hold(const char *name, const pb_element_data *data, size_t base, size_t tip,
                          const double axis[3], pb_element_held *out, pb_error *err) {
  *out = (pb_element_held){{NAN, NAN, NAN, NAN}, NAN};
  if (base >= data->frames || tip >= data->frames || base == tip)
    return pb_fail(err, PB_ERR_ARGUMENT, name, "frames %zu and %zu are not two of its %zu",
                   base + 1, tip + 1, data->frames);
  size_t n = data->size, left = n - 6;
  double *k = malloc(left * left * sizeof *k), *m = malloc(left * left * sizeof *m);
  double *shape = malloc(left * left * sizeof *shape), *hz = malloc(left * sizeof *hz);
  pb_status st = k && m && shape && hz ? PB_OK : pb_fail_memory(err, name);
  if (!st) {
    leave_out(data->k, n, base, k);
    leave_out(data->m, n, base, m);
    st = pb_measure_modes(name, left, k, m, hz, shape, err);
  }
  if (!st) read_held(left, hz, shape, tip > base ? tip - 1 : tip, axis, out);
  free(k);
  free(m);
  free(shape);
  free(hz);
  return st;
}
