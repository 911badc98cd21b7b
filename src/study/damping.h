// How much damping a decentralised controller can give to each mode of a plant.
//
// The root locus of a loop (the same gain in all its channels) is followed over the gain; of each
// mode the largest damping on it is what is attainable, at the gain where it is reached. Branches
// end in the transmission zeros of the loop's channels: where one is close to the mode, little
// damping can be had. Modes outside the band may become unstable before: up to which gain the whole
// loop is stable is told apart, with the damping that can be had below. A. Preumont, "Vibration
// Control of Active Structures", 7.5; "Optimization using Finite Element Models" (T. Dehaeze,
// 2025), section 3.2.
#ifndef PB_STUDY_DAMPING_H
#define PB_STUDY_DAMPING_H

#include "control/rootlocus.h"

typedef struct pb_attainable_mode {
  pb_pole open;    // at zero gain
  double damping;  // largest on the locus
  double gain;     // where it is reached; 0: no gain adds damping
} pb_attainable_mode;

// A gain, and the damping of the least damped pole up to f2 with it, the controller's included.
typedef struct pb_gain_choice {
  double gain, smallest;
} pb_gain_choice;

// Zero-initialise; free with pb_attainable_clear.
typedef struct pb_attainable {
  size_t modes;
  pb_attainable_mode *mode;  // [modes] by frequency
  pb_gain_choice best;       // the largest smallest damping
  pb_gain_choice stable;  // … among gains that keep the whole loop stable; gain 0: there is none
  double stable_to;       // largest gain tried that keeps the whole loop stable; 0: none
  pb_rootlocus locus;     // gain 0, then two decades below and above a loop gain of 1
  size_t chosen;          // index of best.gain in locus.gain
} pb_attainable;

// Looks at the modes with f1 ≤ f ≤ f2 (Hz, undamped plant). solver follows the locus; whole, which
// may be the same, judges the stability: of a large plant solver's is a truncated model
// (pb_model_lowest), whose poles are all at hand at each gain, so that no branch is lost. [init]
// Fails with PB_ERR_STATE where no mode is in the band, and as pb_rootlocus_compute,
// pb_loop_solver_stable.
pb_status pb_attainable_find(pb_loop_solver *solver, pb_loop_solver *whole, double f1, double f2,
                             pb_attainable *out, pb_error *err);

// A copy of a model with the lowest of its modes, as many as PB_DAMPING_STATES states hold without
// parting modes that lie together, and the static contribution of the others; NULL for a model that
// is not larger than that. *out is the caller's. [init] Fails as pb_model_truncate.
enum { PB_DAMPING_STATES = 120 };
pb_status pb_model_lowest(const pb_model *model, pb_model **out, pb_error *err);

void pb_attainable_clear(pb_attainable *attainable);

#endif
