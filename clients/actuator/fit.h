// plantbus-actuator fit: what its files share.
#ifndef PB_ACTUATOR_FIT_H
#define PB_ACTUATOR_FIT_H

#include "actuator.h"

typedef struct fit_options {
  subject_options subject;
  const char *frf;          // file of plantbus-identify
  const char *write;        // file of the model
  const char *name;         // of the model; NULL: of what it is tuned to, and "-2dof"
  double load, mass;        // kg; mass 0: of the element or model
  double inner;             // kg
  double ratio;             // k_e/k_a
  double sample_rate;       // Hz, of a CSV file; 0: of the file
  double length, radius;    // m, of the model; 0: of the element
  double f1, f2;            // Hz, looked at
  double refine1, refine2;  // Hz; 0: no refinement
  bool free_ratio;
  double tolerance;
} fit_options;

typedef struct fit_result {
  char name[128], subject[160];
  pb_apa_data data;
  pb_apa_landmarks landmarks;
  pb_apa_2dof by_order, apa;  // after step 3, at the end
  pb_apa_refine_report refined;
  pb_apa_match match;
  double mass, length, radius;
  double complex *model;  // [nf][2] response of the fitted model
} fit_result;

pb_status fit_present(const fit_options *options, const fit_result *result, pb_error *err);

// The model as an object {"models": {NAME: {...}}} that a plant file takes as a merge patch; the
// caller's (cJSON_Delete). NULL: out of memory.
cJSON *fit_model(const fit_result *result);

#endif
