// The loop shape and the controllers of HAC-LAC: see hac.h.
#include "control/hac.h"

#include <math.h>
#include <stdlib.h>

#include "control/lti_ops.h"

pb_hac_shape pb_hac_shape_default(double bandwidth_hz, double sample_rate) {
  const double lowpass = fmin(10 * bandwidth_hz, 0.4 * sample_rate);
  return (pb_hac_shape){bandwidth_hz, 9, bandwidth_hz / 10,
                        lowpass < 3 * bandwidth_hz ? 0 : lowpass};
}

static pb_status check_shape(const pb_hac_shape *s, double rate, pb_error *err) {
  if (!(s->bandwidth_hz > 0 && s->bandwidth_hz < rate / 2)) {
    return pb_fail(err, PB_ERR_ARGUMENT, "bandwidth", "%g Hz is not within 0 … %g Hz",
                   s->bandwidth_hz, rate / 2);
  }
  if (!(s->lead >= 1 && isfinite(s->lead))) {
    return pb_fail(err, PB_ERR_ARGUMENT, "lead", "a ratio of %g is below 1", s->lead);
  }
  if (!(s->integrator_hz >= 0 && s->integrator_hz < rate / 2)) {
    return pb_fail(err, PB_ERR_ARGUMENT, "integrator", "%g Hz is not within 0 … %g Hz",
                   s->integrator_hz, rate / 2);
  }
  if (!(s->lowpass_hz >= 0 && s->lowpass_hz < rate / 2)) {
    return pb_fail(err, PB_ERR_ARGUMENT, "low-pass", "%g Hz is not within 0 … %g Hz", s->lowpass_hz,
                   rate / 2);
  }
  return PB_OK;
}

// (b1 s + b0)/(s + a0), made discrete by itself: a pole at 0 stays exactly at z = 1.
static pb_status section(double b1, double b0, double a0, double rate, pb_lti *chain,
                         pb_error *err) {
  pb_lti s = {0}, d = {0}, longer = {0};
  pb_status status = pb_lti_new(1, 1, 1, 0, &s, err);
  if (status == PB_OK) {
    s.a[0] = -a0;
    s.b[0] = 1;
    s.c[0] = b0 - b1 * a0;
    s.d[0] = b1;
    status = pb_lti_c2d(&s, 1 / rate, PB_C2D_TUSTIN, &d, err);
  }
  if (status == PB_OK) status = pb_lti_series(chain, &d, &longer, err);
  pb_lti_free(&s);
  pb_lti_free(&d);
  if (status != PB_OK) return status;
  pb_lti_free(chain);
  *chain = longer;
  return PB_OK;
}

pb_status pb_hac_shape_discrete(const pb_hac_shape *shape, double rate, pb_lti *out,
                                pb_error *err) {
  *out = (pb_lti){0};
  pb_status status = check_shape(shape, rate, err);
  if (status == PB_OK) status = pb_lti_new(0, 1, 1, 1 / rate, out, err);
  if (status != PB_OK) return status;
  out->d[0] = 1;
  double wc = 2 * M_PI * shape->bandwidth_hz, wi = 2 * M_PI * shape->integrator_hz;
  double wl = 2 * M_PI * shape->lowpass_hz, root = sqrt(shape->lead);
  if (wi > 0) status = section(1, wi, 0, rate, out, err);
  if (status == PB_OK && root > 1) status = section(root, wc, root * wc, rate, out, err);
  if (status == PB_OK && wl > 0) status = section(0, wl, wl, rate, out, err);
  if (status != PB_OK) pb_lti_free(out);
  return status;
}

pb_status pb_hac_gains(const pb_lti *shape, const double *hz, size_t nf,
                       const double complex *plant, const double complex *low, size_t n,
                       bool floating, double *gain, pb_error *err) {
  for (size_t i = 0; i < n; i++) gain[i] = 0;
  for (size_t f = 0; f < nf; f++) {
    double complex h, z = cexp(CMPLX(0, 2 * M_PI * hz[f] * shape->dt));
    pb_status status = pb_lti_evaluate(shape, z, &h, NULL, err);
    if (status != PB_OK) return status;
    for (size_t i = 0; i < n; i++) gain[i] = fmax(gain[i], cabs(h * plant[(f * n + i) * n + i]));
  }
  for (size_t i = 0; i < n; i++) {
    double size = gain[i], rest = creal(low[i * n + i]);
    if (!(size > 0 && isfinite(size)) || rest == 0) {
      return pb_fail(err, PB_ERR_STATE, "bandwidth", "loop %zu has no gain from %g Hz on", i + 1,
                     nf > 0 ? hz[0] : 0);
    }
    // A spring line is positive at low frequency, the mass line of a floating plant negative.
    gain[i] = ((rest > 0) == !floating ? 1 : -1) / size;
  }
  return PB_OK;
}

// A gain matrix as a system; m NULL: the identity.
static pb_status static_gain(const double *m, size_t n, double dt, pb_lti *out, pb_error *err) {
  pb_status status = pb_lti_new(0, n, n, dt, out, err);
  for (size_t k = 0; status == PB_OK && k < n * n; k++) out->d[k] = m ? m[k] : k % (n + 1) == 0;
  return status;
}

// n copies of a one-channel system side by side, each with its gain.
static pb_status repeat(const pb_lti *one, const double *gain, size_t n, pb_lti *out,
                        pb_error *err) {
  size_t nx = one->nx;
  pb_status status = pb_lti_new(n * nx, n, n, one->dt, out, err);
  for (size_t i = 0; status == PB_OK && i < n; i++) {
    size_t at = i * nx;
    for (size_t c = 0; c < nx; c++) {
      for (size_t r = 0; r < nx; r++) out->a[at + r + (at + c) * n * nx] = one->a[r + c * nx];
      out->b[at + c + i * n * nx] = one->b[c];
      out->c[i + (at + c) * n] = gain[i] * one->c[c];
    }
    out->d[i + i * n] = gain[i] * one->d[0];
  }
  return status;
}

pb_status pb_hac_controller(const pb_lti *shape, const double *gain, const pb_hac_frame *frame,
                            size_t n, pb_lti *out, pb_error *err) {
  *out = (pb_lti){0};
  pb_lti loops = {0}, in = {0}, to = {0}, half = {0};
  pb_status status = repeat(shape, gain, n, &loops, err);
  if (status == PB_OK) status = static_gain(frame->ty, n, shape->dt, &in, err);
  if (status == PB_OK) status = static_gain(frame->tu, n, shape->dt, &to, err);
  if (status == PB_OK) status = pb_lti_series(&in, &loops, &half, err);
  if (status == PB_OK) status = pb_lti_series(&half, &to, out, err);
  pb_lti_free(&loops);
  pb_lti_free(&in);
  pb_lti_free(&to);
  pb_lti_free(&half);
  return status;
}

// The controller, delayed and with a sign; NULL: zeros.
static pb_status part(const pb_lti *k, unsigned delay, double sign, size_t n, double dt,
                      pb_lti *out, pb_error *err) {
  pb_status status = k ? pb_lti_delay(k, delay, out, err) : pb_lti_new(0, n, n, dt, out, err);
  if (status == PB_OK && k) pb_lti_scale(out, sign);
  return status;
}

pb_status pb_hac_combine(const pb_lti *iff, unsigned iff_delay, const pb_lti *hac,
                         unsigned hac_delay, size_t n, pb_lti *out, pb_error *err) {
  *out = (pb_lti){0};
  const pb_lti *given = iff ? iff : hac;
  if (!given || (iff && (iff->nu != n || iff->ny != n)) ||
      (hac && (hac->nu != n || hac->ny != n))) {
    return pb_fail(err, PB_ERR_ARGUMENT, "hac", "controllers of %zu loops are wanted", n);
  }
  pb_lti low = {0}, high = {0}, both = {0}, sum = {0};
  pb_status status = part(iff, iff_delay, 1, n, given->dt, &low, err);
  if (status == PB_OK) status = part(hac, hac_delay, -1, n, given->dt, &high, err);
  if (status == PB_OK) {
    high.dt = low.dt;  // equal to rounding, made equal to the bit
    status = pb_lti_append(&low, &high, &both, err);
  }
  if (status == PB_OK) status = pb_lti_new(0, 2 * n, n, low.dt, &sum, err);
  for (size_t i = 0; i < n && status == PB_OK; i++) {
    sum.d[i + i * n] = 1;
    sum.d[i + (n + i) * n] = 1;
  }
  if (status == PB_OK) status = pb_lti_series(&both, &sum, out, err);
  pb_lti_free(&low);
  pb_lti_free(&high);
  pb_lti_free(&both);
  pb_lti_free(&sum);
  return status;
}
