// What a part's element is known by, in the words of data sheets.
//
//   amplified_actuator  bottom frame held, the others free:
//     axial_stiffness   force on the top frame along z per motion there
//     axial_mode        of the modes, the one with the largest effective mass along z
//     amplification     motion of the top frame along z per elongation of the three stacks together
//                       (x of actuator_end − x of sensor_start) under equal forces in all of them
//     stroke            amplification × 0.1 % of the stacks' length, their usual free strain
//     blocked_force     axial_stiffness × stroke
//     stack_stiffness   force between the ends of the sensor stack per elongation, all frames else
//                       held
//   flexible_joint      bottom frame held, force or moment on the top frame:
//     axial_stiffness, torsion_stiffness about z; shear_stiffness, bending_stiffness (means of x,
//     y)
//   both                mass
//
// Source: report "Optimization using Finite Element Models" (T. Dehaeze, 2025), 2.3 and 3.2.
#ifndef PB_PART_CHARACTERISTICS_H
#define PB_PART_CHARACTERISTICS_H

#include "part/part.h"
#include "part/reduce.h"

enum { PB_CHARACTERISTICS = 8 };

typedef struct pb_characteristic {
  const char *name, *unit;  // static; SI
  double value;
} pb_characteristic;

// Fills out[0 … *count). Fails with PB_ERR_MEMORY, PB_ERR_SINGULAR, PB_ERR_NUMERIC. [init]
pb_status pb_part_characteristics(const pb_part *part, const pb_reduction *element,
                                  pb_characteristic out[PB_CHARACTERISTICS], size_t *count,
                                  pb_error *err);

// Modes of an element with one frame held: hz [size − 6] ascending, shape size × (size − 6) with
// zeros at the held frame, mass-normalised. Fails with PB_ERR_MEMORY, PB_ERR_NUMERIC. [init]
pb_status pb_element_held_modes(const pb_reduction *element, size_t frame, double *hz,
                                double *shape, pb_error *err);

#endif
