// All poles of a closed loop followed over its gain, each as one continuous curve.
//
// A plant up to PB_LOOP_DENSE states: from one gain to the next all its poles, of both half planes,
// are paired so that together they are nearest to where their last two points lead (assign.h): none
// is lost, and none is taken twice. Where exchanging two of them would cost little more the pairing
// is doubtful, and the step is halved.
//
// A larger one: the poles asked for are made exact from where their last two points lead, all at
// once and kept apart (loop.h). Where one moves too far to be sure of it the step is halved.
#ifndef PB_CONTROL_POLE_TRACK_H
#define PB_CONTROL_POLE_TRACK_H

#include <stdbool.h>

#include "control/assign.h"
#include "control/loop.h"

// Zero-initialise; free with pb_pole_track_clear.
typedef struct pb_pole_track {
  pb_loop_solver *solver;  // the caller's
  size_t count;            // poles under way: all of them, or those asked for
  double gain, gain_before;
  double complex *z;       // [count] at gain, in an order that stays
  double complex *before;  // [count] at gain_before
  double complex *guess;   // [count] work
  bool *watched;           // [count] asked for
  bool *lost;              // [count] at gain: z is a guess only
  pb_assignment assignment;
  size_t wanted;
  size_t *index;  // [wanted] of the poles asked for, in z
} pb_pole_track;

// Starts at a gain with the poles nearest to z[wanted], which are exact there. [init]
// PB_ERR_ARGUMENT (more than there are), and as pb_loop_solver_poles.
pb_status pb_pole_track_start(pb_loop_solver *solver, double gain, const double complex *z,
                              size_t wanted, pb_pole_track *out, pb_error *err);
void pb_pole_track_clear(pb_pole_track *track);

// Goes on to a larger gain. [init] Fails as pb_loop_solver_poles; the track is then of no use.
pb_status pb_pole_track_advance(pb_pole_track *track, double gain, pb_error *err);

// Pole k of those asked for, in the upper half plane; hz = NaN where it is lost. [any]
pb_pole pb_pole_track_get(const pb_pole_track *track, size_t k);

#endif
