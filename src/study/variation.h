// One thing varied over a plant: the bending, torsional or axial stiffness of a hexapod's joints,
// its payload, or the model of its joints or of its actuators.
//
// A variation turns a plant file with the template "nano_hexapod" into another plant file, so that
// the same change can be compiled here or sent to a running daemon. Joints and actuators that the
// file gives by the name of a model are written out, with one key or the type changed.
//
//   bending   k_f of both joints                          Nm/rad   report fig. 3.2, 3.3
//   torsion   k_t of the joints that turn about the strut Nm/rad
//   axial     k_a of both joints; infinite: locked        N/m      report fig. 3.4, 3.5
//   mass      of the payload; 0: none                     kg
//   joint-model     ideal, bending, axial, bushing, plant, or a model of the file    report
//   fig. 3.8 actuator-model  1dof, 2dof, plant, or a model of the file report fig. 2.7
//
// "Optimization using Finite Element Models" (T. Dehaeze, 2025), sections 2.6 and 3.
#ifndef PB_STUDY_VARIATION_H
#define PB_STUDY_VARIATION_H

#include "base/json.h"

typedef enum pb_study_kind {
  PB_STUDY_BENDING,
  PB_STUDY_TORSION,
  PB_STUDY_AXIAL,
  PB_STUDY_MASS,
  PB_STUDY_JOINT_MODEL,
  PB_STUDY_ACTUATOR_MODEL,
  PB_STUDY_KINDS,
} pb_study_kind;

typedef struct pb_study_kind_facts {
  const char *name;      // as on the command line
  const char *quantity;  // what a value is: "k_f"
  const char *unit;      // NULL: values are names of models
  const char *values;    // what is studied unless told, comma-separated
} pb_study_kind_facts;

// [any]
const pb_study_kind_facts *pb_study_kind_of(pb_study_kind kind);

// Stiffnesses for joint models; NaN: as the file's joint has it, by its keys or by an element's
// matrices, else as the other joint of the struts has it.
typedef struct pb_joint_stiffness {
  double k_f, k_t;  // Nm/rad
  double k_a, k_s;  // N/m
} pb_joint_stiffness;

typedef struct pb_variation {
  pb_study_kind kind;
  const char *text;  // the value as given: a number, "inf" (axial), or a name
  pb_joint_stiffness stiffness;
  const char *directory;  // of element files; NULL: the working directory
} pb_variation;

// The plant file changed by a variation; the other template keys stay. *out is the caller's
// (cJSON_Delete). [init] Fails with PB_ERR_ARGUMENT (a value that is no number or out of range, a
// stiffness that a joint model needs and nobody gives), PB_ERR_STATE (a plant without the template,
// a joint without that direction), PB_ERR_REFERENCE (no such model), PB_ERR_MEMORY.
pb_status pb_variation_apply(const cJSON *file, const pb_variation *variation, cJSON **out,
                             pb_error *err);

// The number a value stands for (INFINITY for "inf"); NaN where values are names. Fails with
// PB_ERR_ARGUMENT. [any]
pb_status pb_variation_number(const pb_variation *variation, double *out, pb_error *err);

#endif
