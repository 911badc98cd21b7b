// The 2-DoF model tuned to an actuator's responses, in the report's order. [report 2.4]
//
//   1  k_1, c_1 from the first zero of V_a → V_s:  M s² + c_1 s + k_1 = 0
//   2  k_a, c_a, k_e, c_e from the first pole of V_a → y: with k_e = r k_a, c_e = r c_a (r = 2: two
//      actuator stacks beside one sensor stack) k_1 + k_a r/(1 + r) = M ω², likewise c
//   3  g_a from y/V_a and g_s from V_s/V_a at 0 Hz
//   4  optionally least squares over a band (pb_apa_refine)
#ifndef PB_STUDY_ACTUATOR_FIT_H
#define PB_STUDY_ACTUATOR_FIT_H

#include <stdbool.h>

#include "model/model.h"
#include "signal/frf.h"
#include "study/actuator_2dof.h"

// What the first steps look at.
typedef struct pb_apa_landmarks {
  double zero_hz, zero_damping;  // first zero of V_a → V_s
  double pole_hz, pole_damping;  // first pole of V_a → y
  double gain_y, gain_vs;        // at 0 Hz: m/V, V/V
} pb_apa_landmarks;

// Responses to tune to: a frf of one input V_a and the outputs y, V_s, in this order.
typedef struct pb_apa_data {
  pb_frf frf;          // ascending frequencies > 0; variance all 0 where it is not known
  double sample_rate;  // Hz; 0: responses in continuous time
} pb_apa_data;         // free with pb_apa_data_clear

void pb_apa_data_clear(pb_apa_data *data);

// Exact responses and landmarks of a model with input Va and outputs y, Vs. Fails with
// PB_ERR_REFERENCE (a signal missing), PB_ERR_NUMERIC (no zero or pole that rings). [init]
pb_status pb_apa_data_of_model(const pb_model *model, const double *hz, size_t nf, pb_apa_data *out,
                               pb_error *err);
pb_status pb_apa_landmarks_of_model(const pb_model *model, pb_apa_landmarks *out, pb_error *err);

// Landmarks of a measured response by a rational fit (control/fit.h); sample_rate must be known.
// Fails as pb_fit_frf; PB_ERR_NUMERIC where no zero or pole rings within the data. [init]
pb_status pb_apa_landmarks_of_data(const pb_apa_data *data, pb_apa_landmarks *out, pb_error *err);

// Steps 1 to 3. moving: M, kg; inner: m, kg; ratio: r. A damping that would be below zero is 0.
// sample_rate: of the response that the landmarks are of, 0: continuous time. Sampling moves the
// zero, by the damping of the inner mass beyond the Nyquist frequency more than by its own: the
// model is chosen whose sampled zero is the landmark's (where there is none, as if it were
// continuous). Fails with PB_ERR_NUMERIC where the landmarks are not those of such an actuator.
// [init]
pb_status pb_apa_from_landmarks(const pb_apa_landmarks *landmarks, double sample_rate,
                                double moving, double inner, double ratio, pb_apa_2dof *out,
                                pb_error *err);

typedef struct pb_apa_refine_options {
  double f1, f2;    // Hz
  bool free_ratio;  // k_e and c_e of their own
} pb_apa_refine_options;

typedef struct pb_apa_refine_report {
  size_t lines, iterations;
  double before, after;  // rms of ln(H_model/H) over lines and outputs
} pb_apa_refine_report;

// Step 4: Levenberg and Marquardt on the logarithms of the parameters, residuals ln(H_model/H) of
// both outputs, each octave of frequency weighing alike. *apa is start and result, unchanged on
// failure. PB_ERR_ARGUMENT (fewer than ten lines in the band), PB_ERR_NUMERIC, PB_ERR_MEMORY.
// [init]
pb_status pb_apa_refine(const pb_apa_data *data, const pb_apa_refine_options *options,
                        pb_apa_2dof *apa, pb_apa_refine_report *report, pb_error *err);

// How good the match is, by thirds of an octave: √(Σ|H_model − H|²/Σ|H|²) of each output.
typedef struct pb_apa_band {
  double low, high;              // Hz
  double error[PB_APA_OUTPUTS];  // NaN: no line
} pb_apa_band;

typedef struct pb_apa_match {
  size_t bands;
  pb_apa_band *band;             // [bands]
  double end[PB_APA_OUTPUTS];    // Hz: where, beyond the first pole, the error first exceeds the
                                 // tolerance; infinite: not within the data
  double worst[PB_APA_OUTPUTS];  // largest error up to there
} pb_apa_match;

// *out is freed with pb_apa_match_clear. [init]
pb_status pb_apa_match_find(const pb_apa_data *data, const pb_apa_2dof *apa, double pole_hz,
                            double tolerance, pb_apa_match *out, pb_error *err);
void pb_apa_match_clear(pb_apa_match *match);

#endif
