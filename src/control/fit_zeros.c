// Zeros of a fitted channel, and the pole nearest to a wanted one: see fit.h.
#include <math.h>
#include <stdlib.h>

#include "base/lapack.h"
#include "control/fit.h"

// The pencil [A b; c d] − λ [I 0; 0 0] of one channel, w divided by `scale`, c and d by their size.
static void fill_pencil(const pb_fit *fit, size_t channel, double scale, size_t n, double *a,
                        double *e) {
  const double complex *residue = fit->residue + channel * fit->poles;
  double size = fabs(fit->direct[channel]);
  for (size_t k = 0; k < fit->poles; k++) size = fmax(size, cabs(residue[k]) / scale);
  size_t row = 0, last = n - 1;
  for (size_t k = 0; k < fit->poles; k++) {
    double complex p = fit->w[k] / scale, r = residue[k] / scale / size;
    a[row + row * n] = creal(p);
    a[last + row * n] = creal(r);
    a[row + last * n] = cimag(p) != 0 ? 2 : 1;
    e[row + row * n] = 1;
    if (cimag(p) != 0) {
      size_t next = row + 1;
      a[row + next * n] = cimag(p);
      a[next + row * n] = -cimag(p);
      a[next + next * n] = creal(p);
      a[last + next * n] = cimag(r);
      e[next + next * n] = 1;
      row++;
    }
    row++;
  }
  a[last + last * n] = fit->direct[channel] / size;
}

static size_t order_of(const pb_fit *fit) {
  size_t n = 0;
  for (size_t k = 0; k < fit->poles; k++) n += cimag(fit->w[k]) != 0 ? 2 : 1;
  return n;
}

pb_status pb_fit_zeros(const pb_fit *fit, size_t channel, pb_pole_list *out, pb_error *err) {
  *out = (pb_pole_list){0};
  if (channel >= fit->channels || fit->poles == 0) {
    return pb_fail(err, PB_ERR_ARGUMENT, "fit", "no channel %zu, or no pole", channel);
  }
  size_t n = order_of(fit) + 1;
  int in = (int)n, one = 1, lwork = 16 * in, info = 0;
  double scale = cabs(fit->w[fit->poles / 2]);
  double *a = calloc(n * n, sizeof *a), *e = calloc(n * n, sizeof *e);
  double *value = malloc(3 * n * sizeof *value), *work = malloc((size_t)lwork * sizeof *work);
  pb_status status = PB_OK;
  out->item = malloc(n * sizeof *out->item);
  if (!a || !e || !value || !work || !out->item) {
    status = pb_fail_memory(err, "fit");
    goto done;
  }
  fill_pencil(fit, channel, scale, n, a, e);
  dggev_("N", "N", &in, a, &in, e, &in, value, value + n, value + 2 * n, NULL, &one, NULL, &one,
         work, &lwork, &info);
  if (info != 0) {
    status = pb_fail(err, PB_ERR_NUMERIC, "fit", "dggev: %d", info);
    goto done;
  }
  for (size_t k = 0; k < n; k++) {
    double complex alpha = CMPLX(value[k], value[n + k]);
    double beta = value[2 * n + k];
    if (cimag(alpha) < 0 || !(fabs(beta) > 1e-10 * cabs(alpha))) continue;
    double complex half = scale * alpha / beta / (2 * fit->sample_rate);
    out->item[out->count++] = pb_pole_from_z((1 + half) / (1 - half), fit->sample_rate);
  }
  pb_pole_sort(out->item, out->count);
done:
  free(a);
  free(e);
  free(value);
  free(work);
  if (status != PB_OK) pb_pole_list_clear(out);
  return status;
}

const pb_pole *pb_pole_nearest(const pb_pole *pole, size_t count, pb_pole wanted,
                               double sample_rate) {
  double complex s = pb_pole_s(wanted.z, sample_rate);
  double nearest = INFINITY;
  const pb_pole *best = NULL;
  for (size_t k = 0; k < count; k++) {
    double distance = cabs(pb_pole_s(pole[k].z, sample_rate) - s);
    if (distance < nearest) nearest = distance, best = &pole[k];
  }
  return best;
}
