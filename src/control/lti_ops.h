// Building blocks on dense linear systems: connections, delays, discretisation, analysis, running.
//
// Systems that are connected must have the same dt. Unless said otherwise all functions are [init],
// write a new system into *out (freed with pb_lti_free, zeroed on failure), and fail with
// PB_ERR_ARGUMENT (sizes or periods that do not fit) or PB_ERR_MEMORY.
#ifndef PB_CONTROL_LTI_OPS_H
#define PB_CONTROL_LTI_OPS_H

#include "control/lti.h"
#include "model/model.h"

pb_status pb_lti_copy(const pb_lti *lti, pb_lti *out, pb_error *err);

// C and D multiplied by a gain, in place. [any]
void pb_lti_scale(pb_lti *lti, double gain);

// y = second(first(u)).
pb_status pb_lti_series(const pb_lti *first, const pb_lti *second, pb_lti *out, pb_error *err);

// y = g(u) + h(u).
pb_status pb_lti_parallel(const pb_lti *g, const pb_lti *h, pb_lti *out, pb_error *err);

// Block diagonal: inputs and outputs of g, then those of h.
pb_status pb_lti_append(const pb_lti *g, const pb_lti *h, pb_lti *out, pb_error *err);

// Inputs input[nu] (NULL: all) and outputs output[ny] of a system, in that order.
pb_status pb_lti_select(const pb_lti *lti, const size_t *input, size_t nu, const size_t *output,
                        size_t ny, pb_lti *out, pb_error *err);

// y = g(w + sign·k(y)), from w to y. PB_ERR_SINGULAR: an algebraic loop without a solution, that is
// I − sign·D_k D_g singular to 1e-12.
pb_status pb_lti_feedback(const pb_lti *g, const pb_lti *k, double sign, pb_lti *out,
                          pb_error *err);

// Outputs delayed by whole samples (ny states each); dt > 0.
pb_status pb_lti_delay(const pb_lti *lti, unsigned samples, pb_lti *out, pb_error *err);

typedef enum pb_c2d_method {
  PB_C2D_ZOH,     // exact for an input held over each period: e^{[A B; 0 0] T}
  PB_C2D_TUSTIN,  // s → (2/T)(z − 1)/(z + 1)
} pb_c2d_method;

// Discretises a continuous system with period dt. PB_ERR_SINGULAR: Tustin with a pole at 2/T.
pb_status pb_lti_c2d(const pb_lti *lti, double dt, pb_c2d_method method, pb_lti *out,
                     pb_error *err);

// e^A into e, both n × n column-major: scaling and squaring of the [13/13] Padé approximant (N.
// Higham, 2005). PB_ERR_NUMERIC for a non-finite A.
pb_status pb_expm(size_t n, const double *a, double *e, pb_error *err);

// Poles [nx] (rad/s, or z), conjugates adjacent. PB_ERR_NUMERIC if the eigenvalues do not converge.
pb_status pb_lti_poles(const pb_lti *lti, double complex *poles, pb_error *err);

// Responses at hz[nf] into h[nf][ny][nu], at s = jω or z = e^{jωT}. One Hessenberg reduction, then
// O(nx²) a frequency. PB_ERR_SINGULAR at a frequency that is a pole.
pb_status pb_lti_frf(const pb_lti *lti, const double *hz, size_t nf, double complex *h,
                     pb_error *err);

// Response at one complex point (s or z) into h[ny][nu], and its derivative into dh when not NULL.
// For small systems (controllers). PB_ERR_SINGULAR at a pole.
pb_status pb_lti_evaluate(const pb_lti *lti, double complex point, double complex *h,
                          double complex *dh, pb_error *err);

// The same system as a compiled model, from the inputs and to the outputs that the time base means.
// PB_SAMPLED, PB_APPLIED: y(k) = C x(k) + D u(k−1), so that a model with D gets nu more states
// which hold u(k−1); delays of the electronics are a state a sample. PB_CONTINUOUS: PB_ERR_ARGUMENT
// where a signal is delayed.
pb_status pb_lti_from_model(const pb_model *model, pb_time_base base, pb_lti *out, pb_error *err);

// Channels of a model.
typedef struct pb_lti_channels {
  const size_t *input, *output;  // [nu], [ny]; NULL: the first nu, ny in order
  size_t nu, ny;
} pb_lti_channels;

// The same of chosen inputs and outputs, without the delays of the others.
pb_status pb_lti_from_channels(const pb_model *model, pb_time_base base,
                               const pb_lti_channels *channels, pb_lti *out, pb_error *err);

// One sample of a discrete system: y = C x + D u, then x ← A x + B u. x[nx] and scratch[nx] are the
// caller's; no allocation. [rt]
void pb_lti_step(const pb_lti *lti, double *x, double *scratch, const double *u, double *y);

#endif
