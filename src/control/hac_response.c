// Responses of the damped plant and of the loops around it: see hac.h.
#include <math.h>
#include <stdlib.h>

#include "control/hac.h"
#include "control/lti_ops.h"

void pb_hac_transform(size_t n, const double *left, const double *right, const double complex *m,
                      double complex *out) {
  for (size_t r = 0; r < n; r++) {
    for (size_t c = 0; c < n; c++) {
      double complex sum = 0;
      for (size_t i = 0; i < n; i++) {
        double complex row = 0;
        for (size_t k = 0; k < n; k++) row += m[i * n + k] * (right ? right[k + c * n] : k == c);
        sum += (left ? left[r + i * n] : r == i) * row;
      }
      out[r * n + c] = sum;
    }
  }
}

// Frequencies whose whole responses, [ny][nu] each, are in memory at a time.
enum { AT_ONCE = 64 };

// Rows metrology and columns actuators of one whole response, in the frame; work [n × n].
static void into_frame(const pb_model *m, const pb_hac_channels *c, const pb_hac_frame *frame,
                       const double complex *full, double complex *work, double complex *h) {
  size_t n = c->n;
  for (size_t k = 0; k < n * n; k++) work[k] = full[c->metrology[k / n] * m->nu + c->input[k % n]];
  pb_hac_transform(n, frame->ty, frame->tu, work, h);
}

pb_status pb_hac_plant(const pb_model *model, const pb_hac_channels *channels,
                       const pb_hac_frame *frame, const pb_lti *iff, unsigned delay,
                       const double *hz, size_t nf, double complex *h, pb_error *err) {
  size_t n = channels->n, all = model->ny * model->nu, most = nf < AT_ONCE ? nf : AT_ONCE;
  pb_loop loop = {model, iff, channels->sensor, channels->input, 1, delay};
  double complex *full = malloc((most * all + 1) * sizeof *full);
  double complex *work = malloc((n * n + 1) * sizeof *work);
  pb_status status = full && work ? PB_OK : pb_fail_memory(err, "hac");
  for (size_t first = 0; first < nf && status == PB_OK; first += most) {
    size_t count = nf - first < most ? nf - first : most;
    status = iff ? pb_loop_frf(&loop, 1, hz + first, count, full, err)
                 : pb_model_frf(model, PB_SAMPLED, hz + first, count, full, err);
    for (size_t f = 0; f < count && status == PB_OK; f++)
      into_frame(model, channels, frame, full + f * all, work, h + (first + f) * n * n);
  }
  free(full);
  free(work);
  return status;
}

pb_status pb_hac_loop_gain(const pb_lti *shape, const double *gain, unsigned delay,
                           const double *hz, size_t nf, size_t n, const double complex *plant,
                           double complex *l, pb_error *err) {
  pb_status status = PB_OK;
  for (size_t f = 0; f < nf && status == PB_OK; f++) {
    double angle = 2 * M_PI * hz[f] * shape->dt;
    double complex h;
    status = pb_lti_evaluate(shape, cexp(CMPLX(0, angle)), &h, NULL, err);
    if (status != PB_OK) break;
    h *= cexp(CMPLX(0, -angle * delay));
    for (size_t k = 0; k < n * n; k++) l[f * n * n + k] = plant[f * n * n + k] * h * gain[k % n];
  }
  return status;
}
