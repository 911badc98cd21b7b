// Benches on which an actuator or a joint is characterised, as plants of their own.
//
// Actuator: its bottom welded to the ground. Without a load its top is free; with one, a body on it
// that is guided along z, so that nothing else moves.
//   inputs   Va (where the actuator has g_a), f (force inside its stacks), F (force on top, z)
//   outputs  y (top, z), Vs (where it has g_s), e (an element's stacks, elongation)
// Joint: between the ground and a small body at its place.
//   inputs   Fx Fy Fz Mx My Mz on the body
//   outputs  Dx Dy Dz Rx Ry Rz of the body
#ifndef PB_STUDY_ELEMENT_BENCH_H
#define PB_STUDY_ELEMENT_BENCH_H

#include "model/model.h"
#include "plant/plant.h"
#include "study/element_source.h"

typedef struct pb_actuator_bench {
  double load;         // kg; 0: none
  bool all_stacks;     // f acts between the outermost ends of all stacks of an element
  double sample_rate;  // Hz; 0: that of plant files
} pb_actuator_bench;

typedef struct pb_bench_model {
  pb_plant *plant;
  pb_model *model;
} pb_bench_model;  // free with pb_bench_model_clear

// Fails as pb_plant_parse, pb_system_assemble, pb_model_compile; PB_ERR_SCHEMA where an element has
// no "ends". [init]
pb_status pb_actuator_bench_build(const pb_element_source *source, const pb_actuator_bench *bench,
                                  pb_warnings *warnings, pb_bench_model *out, pb_error *err);

// mass: kg, of the body, a sphere of 10 mm radius. [init]
pb_status pb_joint_bench_build(const pb_element_source *source, double mass, pb_warnings *warnings,
                               pb_bench_model *out, pb_error *err);

void pb_bench_model_clear(pb_bench_model *bench);

// The actuator of an actuator bench, component "part". [any]
const pb_component *pb_bench_part(const pb_bench_model *bench);

// Gain at 0 Hz from an input to an output by name; NaN where one is missing. *out infinite where
// the part floats. Fails with PB_ERR_MEMORY. [init]
pb_status pb_bench_gain(const pb_bench_model *bench, const char *input, const char *output,
                        double *gain, pb_error *err);

// The first mode that carries at least `share` of the static gain of a channel: *hz (undamped),
// *damping; NaN: none. [any]
void pb_bench_first_mode(const pb_bench_model *bench, const char *input, const char *output,
                         double share, double *hz, double *damping);

#endif
