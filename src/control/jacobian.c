// Jacobians from a geometry or from static gains: see jacobian.h.
#include "control/jacobian.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"

void pb_jacobian_geometry(const pb_hexapod *h, double j[36]) {
  for (size_t k = 0; k < 6; k++) {
    const double *s = h->strut[k].z, *top = h->strut[k].top;
    const double b[3] = {top[0], top[1], top[2] - h->point_of_interest_height};
    const double row[6] = {s[0],
                           s[1],
                           s[2],
                           b[1] * s[2] - b[2] * s[1],
                           b[2] * s[0] - b[0] * s[2],
                           b[0] * s[1] - b[1] * s[0]};
    for (size_t c = 0; c < 6; c++) j[k + c * 6] = row[c];
  }
}

// X of A X = B for square A, both overwritten, B by X.
static pb_status solve(double *a, double *b, size_t n, const char *what, pb_error *err) {
  int size = (int)n, info = 0;
  int *pivot = malloc((n + 1) * sizeof *pivot);
  if (!pivot) return pb_fail_memory(err, "jacobian");
  dgesv_(&size, &size, a, &size, pivot, b, &size, &info);
  free(pivot);
  for (size_t k = 0; k < n * n && info == 0; k++) info = isfinite(b[k]) ? 0 : 1;
  if (info == 0) return PB_OK;
  return pb_fail(err, PB_ERR_SINGULAR, "jacobian", "%s", what);
}

// Xᵀ of G_XFᵀ Jᵀ = G_εFᵀ, from the static gains.
static pb_status transposed(const pb_model *model, const double *gain, const size_t *metrology,
                            const size_t *motion, const size_t *force, size_t n, double *a,
                            double *b, pb_error *err) {
  for (size_t r = 0; r < n; r++) {
    for (size_t c = 0; c < n; c++) {
      a[c + r * n] = gain[motion[r] * model->nu + force[c]];
      b[c + r * n] = gain[metrology[r] * model->nu + force[c]];
      if (isfinite(a[c + r * n]) && isfinite(b[c + r * n])) continue;
      return pb_fail(err, PB_ERR_STATE, "jacobian",
                     "%s moves without limit under %s: the plant floats",
                     model->output[motion[r]].name, model->input[force[c]].name);
    }
  }
  return solve(a, b, n, "the forces do not move the point of interest in independent ways", err);
}

pb_status pb_jacobian_static(const pb_model *model, const size_t *metrology, const size_t *motion,
                             const size_t *force, size_t n, double *j, pb_error *err) {
  double *gain = malloc((model->ny * model->nu + 1) * sizeof *gain);
  double *a = malloc((n * n + 1) * sizeof *a), *b = malloc((n * n + 1) * sizeof *b);
  pb_status status =
      gain && a && b ? pb_model_dc(model, gain, err) : pb_fail_memory(err, "jacobian");
  if (status == PB_OK) status = transposed(model, gain, metrology, motion, force, n, a, b, err);
  for (size_t k = 0; k < n * n && status == PB_OK; k++) j[k / n + (k % n) * n] = b[k];
  free(gain);
  free(a);
  free(b);
  return status;
}

static pb_status condition_of(const double *j, size_t n, double *condition, pb_error *err) {
  int size = (int)n, one = 1, info = 0, length = (int)(10 * n + 10);
  double *a = malloc((n * n + 1) * sizeof *a), *s = malloc((n + 1) * sizeof *s);
  double *work = malloc((size_t)length * sizeof *work);
  pb_status status = a && s && work ? PB_OK : pb_fail_memory(err, "jacobian");
  if (status == PB_OK) {
    memcpy(a, j, n * n * sizeof *a);
    dgesvd_("N", "N", &size, &size, a, &size, s, NULL, &one, NULL, &one, work, &length, &info);
    if (info) status = pb_fail(err, PB_ERR_NUMERIC, "jacobian", "singular values: info %d", info);
    *condition = status == PB_OK ? s[0] / s[n - 1] : NAN;
  }
  free(a);
  free(s);
  free(work);
  return status;
}

pb_status pb_jacobian_invert(const double *j, size_t n, double *inverse, double *condition,
                             pb_error *err) {
  double *a = malloc((n * n + 1) * sizeof *a);
  if (!a) return pb_fail_memory(err, "jacobian");
  memcpy(a, j, n * n * sizeof *a);
  memset(inverse, 0, n * n * sizeof *inverse);
  for (size_t k = 0; k < n; k++) inverse[k + k * n] = 1;
  pb_status status = solve(a, inverse, n, "it has no inverse", err);
  free(a);
  if (status == PB_OK && condition) status = condition_of(j, n, condition, err);
  return status;
}
