// Cures of an element's matrices: see element_doctor.h.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"
#include "plant/element_doctor_internal.h"

void pb_cure_mirror(double *x, size_t n, char half) {
  for (size_t j = 0; j < n; j++)
    for (size_t i = 0; i < j; i++)
      if (half == 'u')
        x[j + i * n] = x[i + j * n];
      else
        x[i + j * n] = x[j + i * n];
}

void pb_cure_mean(double *x, size_t n) {
  for (size_t j = 0; j < n; j++)
    for (size_t i = 0; i < j; i++)
      x[i + j * n] = x[j + i * n] = 0.5 * (x[i + j * n] + x[j + i * n]);
}

// With u = L·u′, F = F₀·F′, t = T·t′ the energies ½ qᵀKq and ½ q̇ᵀMq̇ change by F₀L and F₀LT², so
// that each translation's row and column of K and M changes by 1/L more, a rotation's by nothing
// and a mode's by what keeps ΦᵀMΦ = I.
void pb_element_convert(pb_element_data *e, double length, double force, double time) {
  size_t n = e->size;
  double energy = force * length, action = energy * time * time;
  const double scale[3] = {1 / length, 1, 1 / sqrt(action)};
  for (size_t i = 0; i < 3 * e->frames; i++) e->position[i] *= length;
  for (size_t j = 0; j < n; j++) {
    for (size_t i = 0; i < n; i++) {
      double si = scale[i >= 6 * e->frames ? 2 : i % 6 > 2];
      double sj = scale[j >= 6 * e->frames ? 2 : j % 6 > 2];
      e->k[i + j * n] *= energy * si * sj;
      e->m[i + j * n] *= action * si * sj;
    }
  }
}

// Orthonormal columns of r (n × 6) in place.
static pb_status orthonormalise(const char *name, double *r, size_t n, pb_error *err) {
  for (size_t j = 0; j < 6; j++) {
    double *c = r + j * n, norm = 0;
    for (int pass = 0; pass < 2; pass++) {
      for (size_t l = 0; l < j; l++) {
        double dot = 0;
        for (size_t i = 0; i < n; i++) dot += r[i + l * n] * c[i];
        for (size_t i = 0; i < n; i++) c[i] -= dot * r[i + l * n];
      }
    }
    for (size_t i = 0; i < n; i++) norm += c[i] * c[i];
    norm = sqrt(norm);
    if (!(norm > 0)) return pb_fail(err, PB_ERR_NUMERIC, name, "has no six rigid motions");
    for (size_t i = 0; i < n; i++) c[i] /= norm;
  }
  return PB_OK;
}

// X ← (I − R Rᵀ) X (I − R Rᵀ), R orthonormal, kr n × 6 for X R.
static void project(double *x, size_t n, const double *r, double *kr) {
  for (size_t a = 0; a < 6; a++) {
    memset(kr + a * n, 0, n * sizeof *kr);
    for (size_t j = 0; j < n; j++)
      for (size_t i = 0; i < n; i++) kr[i + a * n] += x[i + j * n] * r[j + a * n];
  }
  double s[36];
  for (size_t a = 0; a < 6; a++) {
    for (size_t b = 0; b < 6; b++) {
      s[a + 6 * b] = 0;
      for (size_t i = 0; i < n; i++) s[a + 6 * b] += r[i + a * n] * kr[i + b * n];
    }
  }
  for (size_t j = 0; j < n; j++) {
    for (size_t a = 0; a < 6; a++) {
      double ra = r[j + a * n], ka = kr[j + a * n], back = 0;
      for (size_t b = 0; b < 6; b++) back += s[a + 6 * b] * r[j + b * n];
      for (size_t i = 0; i < n; i++)
        x[i + j * n] -= kr[i + a * n] * ra + r[i + a * n] * (ka - back);
    }
  }
}

pb_status pb_cure_rigid(const char *name, pb_element_data *e, bool weighted, double *change,
                        pb_error *err) {
  size_t n = e->size;
  double *r = malloc(6 * n * sizeof *r), *kr = malloc(6 * n * sizeof *kr);
  double *old = malloc(n * n * sizeof *old), *d = malloc(n * sizeof *d);
  pb_status st = r && kr && old && d ? PB_OK : pb_fail_memory(err, name);
  if (!st) {
    memcpy(old, e->k, n * n * sizeof *old);
    pb_rigid_motions(e, r);
    for (size_t i = 0; i < n; i++)
      d[i] = weighted && e->k[i + i * n] > 0 ? sqrt(e->k[i + i * n]) : 1;
    for (size_t a = 0; a < 6; a++)
      for (size_t i = 0; i < n; i++) r[i + a * n] *= d[i];
    for (size_t j = 0; j < n; j++)
      for (size_t i = 0; i < n; i++) e->k[i + j * n] /= d[i] * d[j];
    st = orthonormalise(name, r, n, err);
  }
  if (!st) {
    project(e->k, n, r, kr);
    project(e->k, n, r, kr);  // rounding of the first one is projected as well
    double off = 0, all = 0;
    for (size_t j = 0; j < n; j++) {
      for (size_t i = 0; i < n; i++) {
        double size = fabs(old[i + i * n] * old[j + j * n]), *k = &e->k[i + j * n];
        *k *= d[i] * d[j];
        if (!(size > 0)) continue;
        off += pow(*k - old[i + j * n], 2) / size;
        all += pow(old[i + j * n], 2) / size;
      }
    }
    *change = all > 0 ? sqrt(off / all) : 0;
    pb_cure_mean(e->k, n);
  }
  free(r);
  free(kr);
  free(old);
  free(d);
  return st;
}

pb_status pb_cure_mass(const char *name, pb_element_data *e, double least, pb_error *err) {
  int in = (int)e->size, lwork = 1 + 6 * in + 2 * in * in, liwork = 3 + 5 * in, info = 0;
  size_t n = e->size;
  double *v = malloc(n * n * sizeof *v), *w = malloc(n * sizeof *w);
  double *work = malloc((size_t)lwork * sizeof *work);
  int *iwork = malloc((size_t)liwork * sizeof *iwork);
  pb_status st = v && w && work && iwork ? PB_OK : pb_fail_memory(err, name);
  if (!st) {
    for (size_t j = 0; j < n; j++)
      for (size_t i = 0; i < n; i++)
        v[i + j * n] = e->m[i + j * n] / sqrt(e->m[i + i * n] * e->m[j + j * n]);
    dsyevd_("V", "U", &in, v, &in, w, work, &lwork, iwork, &liwork, &info);
    if (info) st = pb_fail(err, PB_ERR_NUMERIC, name, "the eigenvalues of M did not converge");
  }
  for (size_t i = 0; !st && i < n; i++) work[i] = sqrt(e->m[i + i * n]);
  for (size_t p = 0; !st && p < n && w[p] < least; p++)
    for (size_t j = 0; j < n; j++)
      for (size_t i = 0; i < n; i++)
        e->m[i + j * n] += (least - w[p]) * work[i] * v[i + p * n] * work[j] * v[j + p * n];
  if (!st) pb_cure_mean(e->m, n);
  free(v);
  free(w);
  free(work);
  free(iwork);
  return st;
}
