// The 2-DoF amplified actuator under a mass, in closed form. [report 2.4]
//
// M z̈ = −(k_1 + c_1 s) z − (k_e + c_e s)(z − w)                    z: load and upper half
// m ẅ = −(k_a + c_a s) w + (k_e + c_e s)(z − w) + g_a V_a           w: intermediate mass
//   y = z,  V_s = g_s (z − w)
//
// Its zero of V_a → V_s is where M rings on the shell, M s² + c_1 s + k_1 = 0; its first pole, with
// m small, where it rings on the shell and the two stacks in series.
#ifndef PB_STUDY_ACTUATOR_2DOF_H
#define PB_STUDY_ACTUATOR_2DOF_H

#include <complex.h>

#include "base/status.h"

typedef struct pb_apa_2dof {
  double k_1, c_1, k_a, c_a, k_e, c_e;  // N/m, Ns/m
  double g_a, g_s;                      // N/V, V/m
  double moving;                        // M, kg
  double inner;                         // m, kg
} pb_apa_2dof;

enum { PB_APA_Y, PB_APA_VS, PB_APA_OUTPUTS };

// y/V_a and V_s/V_a at hz [nf]: h[f * 2 + output]. sample_rate 0: continuous time; else what is
// sampled with V_a held, y(k) by V_a(k−1) (model.h, PB_SAMPLED). [init] PB_ERR_NUMERIC: parameters
// whose response is not finite.
pb_status pb_apa_2dof_response(const pb_apa_2dof *apa, double sample_rate, const double *hz,
                               size_t nf, double complex *h, pb_error *err);

// The zero of the sampled response V_a → V_s nearest to `start`, both as s (z = e^{s T}). Sampling
// moves it: the zero-order hold is half a step late. [init] PB_ERR_NUMERIC: the search diverges.
pb_status pb_apa_2dof_sampled_zero(const pb_apa_2dof *apa, double sample_rate, double complex start,
                                   double complex *zero, pb_error *err);

#endif
