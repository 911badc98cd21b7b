// Carrying a running plant's state over to another model of it.
//
// What a component was doing it goes on doing: the motion q, q̇ of the old plant's components is
// given to those of the same name in the new one (the frames they share, where the kind has
// changed; what an element has inside follows its frames statically), and projected on the motions
// that the new plant can make (motion_map.h). Residual pairs (rates.h) rest under the held inputs.
// All of it is linear: x' = X x + U u, prepared in one thread and applied in another, which steps.
#ifndef PB_MODEL_TRANSFER_H
#define PB_MODEL_TRANSFER_H

#include "model/motion_map.h"

typedef struct pb_transfer {
  const pb_model *from, *to;
  const pb_motion_map *from_map, *to_map;
  double *x;         // to->nx × from->nx; NULL: the identity, as what moves is the same
  double *u;         // to->nx × from->nu
  int *input_from;   // [to->nu] the old input of that name; −1: none
  int *output_from;  // [to->ny]
  pb_state *before;  // copies of what was carried over, and of what it became
  pb_state *after;
} pb_transfer;

typedef struct pb_transfer_report {
  double energy_before, energy_after;  // J, kinetic and strain
  double output_jump;  // |y' − y| of the worst output, in its unit, before delays, noise and
                       // quantisation
  int worst_output;    // of the new plant: the largest jump beside the magnitudes that the output
                       // adds up from, as volts and metres do not compare; −1: none in common
} pb_transfer_report;

// Prepares the transfer between two compiled plants, which must outlive it; workers: threads to
// share it with, NULL: none. PB_ERR_STATE when one of the plants has no map. [init]
pb_status pb_transfer_new(const pb_model *from, const pb_motion_map *from_map, const pb_model *to,
                          const pb_motion_map *to_map, const pb_workers *workers, pb_transfer **out,
                          pb_error *err);
void pb_transfer_free(pb_transfer *transfer);  // NULL is allowed

// Fills `after`, a state of the new model, from `before`: motion, held inputs by name, the step.
// No allocation, no failure. [rt]
void pb_transfer_apply(pb_transfer *transfer, const pb_state *before, pb_state *after);

// The same where X x is known already: moved [to->nx]. [rt]
void pb_transfer_apply_moved(pb_transfer *transfer, const pb_state *before, const double *moved,
                             pb_state *after);

// What the last apply did. Fails with PB_ERR_MEMORY. [init]
pb_status pb_transfer_examine(const pb_transfer *transfer, pb_transfer_report *out, pb_error *err);

// The new plant's coordinates by the old one's and by the new plant's inputs, which deform what is
// new inside a component: q' = L q + L_u u'. l is to->n × from->n, lu is to->n × to->nu, both the
// caller's (free). [init]
pb_status pb_transfer_coordinates(const pb_motion_map *from, const pb_motion_map *to, double **l,
                                  double **lu, pb_error *err);

#endif
