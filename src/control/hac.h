// High authority control around a plant that low authority control (IFF) has damped: HAC-LAC.
//
//   u = K_IFF y_s − T_u K T_y y_m,   K(s) = diag(k_i) H(s)
//   H(s) = (s + ω_i)/s · √a (s + ω_c/√a)/(s + √a ω_c) · ω_l/(s + ω_l)
//
// y_s force sensors, y_m metrology. The frame says in which coordinates the loops are closed:
// T_y = T_u = I along the struts; T_y = J⁻¹, T_u = J⁻ᵀ in the Cartesian coordinates of the point of
// interest (jacobian.h). H is an integrator up to ω_i, a lead of ratio a around the crossover ω_c,
// where its gain is 1, and a low-pass at ω_l; a factor is left out where its parameter says so. The
// gains k_i make each loop gain reach 1 at ω_c and not exceed it beyond, whatever modes lie there:
// its highest crossover is the bandwidth, or the peak of a mode above it that just touches 1. They
// are those of the damped plant as it is sampled, with the controller as it is sampled (Tustin).
//
// The structure is that of A. Preumont, "Vibration Control of Active Structures", chapter 14; the
// voltages of both controllers add up on the actuators.
//
// n loops everywhere; real matrices n × n column-major; responses [nf][n][n] row-major as
// pb_model_frf. All functions: [init]; PB_ERR_ARGUMENT, PB_ERR_MEMORY.
#ifndef PB_CONTROL_HAC_H
#define PB_CONTROL_HAC_H

#include "control/loop.h"

typedef struct pb_hac_shape {
  double bandwidth_hz;   // ω_c/2π, > 0
  double lead;           // a > 1; 1: no lead
  double integrator_hz;  // ω_i/2π; 0: none
  double lowpass_hz;     // ω_l/2π; 0: none
} pb_hac_shape;

// Lead 9 (53° at the crossover), integrator at a tenth of the bandwidth, low-pass at ten times it,
// but not beyond 0.4 of the sample rate; none where that is less than three times the bandwidth.
pb_hac_shape pb_hac_shape_default(double bandwidth_hz, double sample_rate);

// H at a sample rate, one input and output. PB_ERR_ARGUMENT: a corner at or above half the sample
// rate, a lead below 1, a bandwidth that is not positive.
pb_status pb_hac_shape_discrete(const pb_hac_shape *shape, double sample_rate, pb_lti *out,
                                pb_error *err);

typedef struct pb_hac_channels {
  size_t n;
  const size_t *input;      // [n] actuators
  const size_t *sensor;     // [n] force sensors; may be NULL where no IFF is meant
  const size_t *metrology;  // [n]
} pb_hac_channels;

typedef struct pb_hac_frame {
  const double *ty, *tu;  // [n × n]; NULL: the identity
} pb_hac_frame;

// Responses from the actuators to the metrology, in the frame: T_y P(z) T_u at hz[nf], with IFF
// closed (iff: n × n, discrete, with its gain; NULL: undamped). delay: of IFF's loop, in samples.
pb_status pb_hac_plant(const pb_model *model, const pb_hac_channels *channels,
                       const pb_hac_frame *frame, const pb_lti *iff, unsigned delay,
                       const double *hz, size_t nf, double complex *h, pb_error *err);

// left · m · right for one frequency; left and right real, NULL: the identity; out is not m. [any]
void pb_hac_transform(size_t n, const double *left, const double *right, const double complex *m,
                      double complex *out);

// k_i for max |k_i H(z) P_ii(z)| = 1 over hz[nf], the frequencies from the bandwidth on; their sign
// makes each loop a negative feedback. plant: [nf][n][n] of pb_hac_plant at hz, low: [n][n] of it
// far below the bandwidth. floating: the plant has rigid-body modes. PB_ERR_STATE: a loop without
// gain there.
pb_status pb_hac_gains(const pb_lti *shape, const double *hz, size_t nf,
                       const double complex *plant, const double complex *low, size_t n,
                       bool floating, double *gain, pb_error *err);

// T_u diag(k_i H) T_y, n × n, from metrology to −u.
pb_status pb_hac_controller(const pb_lti *shape, const double *gain, const pb_hac_frame *frame,
                            size_t n, pb_lti *out, pb_error *err);

// L(z) = P K z^{−delay}, broken at the error in the frame: plant [nf][n][n] as of pb_hac_plant,
// K = diag(k_i H).
pb_status pb_hac_loop_gain(const pb_lti *shape, const double *gain, unsigned delay,
                           const double *hz, size_t nf, size_t n, const double complex *plant,
                           double complex *l, pb_error *err);

// Both controllers as one, from [y_s, y_m] to u: [K_IFF z^{−iff_delay}, −K_HAC z^{−hac_delay}].
// iff NULL: zero, with the sensors read all the same; hac NULL: likewise.
pb_status pb_hac_combine(const pb_lti *iff, unsigned iff_delay, const pb_lti *hac,
                         unsigned hac_delay, size_t n, pb_lti *out, pb_error *err);

#endif
