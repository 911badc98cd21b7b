// K_IFF in state space: see iff.h.
#include "control/iff.h"

#include <math.h>
#include <stdbool.h>

#include "control/lti_ops.h"

pb_iff pb_iff_default(double gain) {
  return (pb_iff){.gain = gain, .integrator_hz = 2, .highpass_hz = 0.5};
}

// x_1 = u/(s + ω_i), x_2 = x_1/(s + ω_h), and s/(s + ω_h) = 1 − ω_h/(s + ω_h).
pb_status pb_iff_continuous(const pb_iff *iff, size_t struts, pb_lti *out, pb_error *err) {
  *out = (pb_lti){0};
  bool corners = isfinite(iff->integrator_hz) && iff->integrator_hz > 0 &&
                 isfinite(iff->highpass_hz) && iff->highpass_hz > 0;
  if (!isfinite(iff->gain) || !corners || struts == 0) {
    return pb_fail(err, PB_ERR_ARGUMENT, "iff", "gain %g, corners %g and %g Hz, %zu channels",
                   iff->gain, iff->integrator_hz, iff->highpass_hz, struts);
  }
  size_t n = 2 * struts;
  pb_status status = pb_lti_new(n, struts, struts, 0, out, err);
  if (status != PB_OK) return status;
  double wi = 2 * M_PI * iff->integrator_hz, wh = 2 * M_PI * iff->highpass_hz;
  for (size_t s = 0; s < struts; s++) {
    size_t x1 = 2 * s, x2 = x1 + 1;
    out->a[x1 + x1 * n] = -wi;
    out->a[x2 + x1 * n] = 1;
    out->a[x2 + x2 * n] = -wh;
    out->b[x1 + s * n] = 1;
    out->c[s + x1 * struts] = iff->gain;
    out->c[s + x2 * struts] = -iff->gain * wh;
  }
  return PB_OK;
}

pb_status pb_iff_discrete(const pb_iff *iff, size_t struts, double sample_rate, pb_lti *out,
                          pb_error *err) {
  *out = (pb_lti){0};
  if (!isfinite(sample_rate) || !(sample_rate > 0)) {
    return pb_fail(err, PB_ERR_ARGUMENT, "iff", "sample rate %g Hz", sample_rate);
  }
  pb_lti continuous;
  pb_status status = pb_iff_continuous(iff, struts, &continuous, err);
  if (status != PB_OK) return status;
  status = pb_lti_c2d(&continuous, 1 / sample_rate, PB_C2D_TUSTIN, out, err);
  pb_lti_free(&continuous);
  return status;
}
