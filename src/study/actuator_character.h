// An actuator in the figures of a data sheet. [report 2.3]
//
//   stiffness          1/(y/F) at 0 Hz, bottom fixed, force on top
//   resonance          first mode of F → y, bottom fixed, top free
//   amplification      |y/e| under a force between the ends of all stacks, e their elongation
//   stack stiffness    of one stack (plant/boundary.h)
//   stroke             stacks × stroke of one × amplification
//   blocked force      stroke × stiffness
#ifndef PB_STUDY_ACTUATOR_CHARACTER_H
#define PB_STUDY_ACTUATOR_CHARACTER_H

#include "study/element_bench.h"

typedef struct pb_stack_nominal {
  double stroke;  // m, of one stack
  double length;  // m, of one stack
  size_t count;   // stacks that actuate; 0: as many as fit into the element's stacks by length
} pb_stack_nominal;

// What is not known is NaN.
typedef struct pb_actuator_character {
  double stiffness;        // N/m
  double resonance;        // Hz
  double damping;          // of that mode
  double amplification;    // vertical over stacks
  double stack_stiffness;  // N/m, one stack
  size_t stacks;           // counted
  double stroke;           // m
  double blocked_force;    // N
  double mass;             // kg
  double height;           // m
  double voltage_gain;     // y/V_a at 0 Hz, m/V
  double sensor_gain;      // V_s/V_a at 0 Hz
  double sensor_of_force;  // V_s/F at 0 Hz, V/N
} pb_actuator_character;

// bench receives the unloaded bench, for responses; the caller's (pb_bench_model_clear). [init]
pb_status pb_actuator_characterize(const pb_element_source *source, const pb_stack_nominal *nominal,
                                   pb_warnings *warnings, pb_bench_model *bench,
                                   pb_actuator_character *out, pb_error *err);

#endif
