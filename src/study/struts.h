// Whether the forces of a hexapod's struts act along them: J. McInroy's condition on the joints.
//
//   k_r ≪ k l²
//
// k is the axial stiffness of a strut, l its length from joint to joint, k_r the bending stiffness
// of its joints. Bent joints pass k_r/l² of transverse stiffness on beside the axial k: where that
// is not small the kinematics of the struts' lengths no longer describe the platform.
// J. McInroy, "Modeling and design of flexure jointed Stewart platforms for control purposes"
// (2002); "Optimization using Finite Element Models" (T. Dehaeze, 2025), section 3.2: 9000 Nm/rad
// for 1 N/µm and 95 mm, 90 Nm/rad for 10⁴ N/m.
#ifndef PB_STUDY_STRUTS_H
#define PB_STUDY_STRUTS_H

#include <stdbool.h>

#include "base/json.h"

// What "much smaller" is taken to be: a tenth.
#define PB_STRUT_MARGIN 10.0

typedef struct pb_strut_condition {
  double k;        // N/m, axial, of the actuator held at one end
  double length;   // m
  double bending;  // k_r, Nm/rad, the stiffer of the two joints
  double limit;    // k l², Nm/rad
  double margin;   // limit / k_r; infinite for joints that bend freely
  bool held;       // margin ≥ PB_STRUT_MARGIN
} pb_strut_condition;

// [any]
pb_strut_condition pb_strut_condition_make(double k, double length, double bending);

// The condition for the struts of a plant file with the template; element files are relative to
// directory. [init] Fails as pb_template_part, pb_plant_parse, pb_model_compile.
pb_status pb_strut_condition_find(const cJSON *file, const char *directory, pb_strut_condition *out,
                                  pb_error *err);

#endif
