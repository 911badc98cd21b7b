// Root locus of a sampled loop: its poles over a list of gains, as curves.
#ifndef PB_CONTROL_ROOTLOCUS_H
#define PB_CONTROL_ROOTLOCUS_H

#include "control/loop.h"

// Zero-initialise; free with pb_rootlocus_clear.
typedef struct pb_rootlocus {
  size_t gains, branches;
  double *gain;      // [gains]
  pb_pole *pole;     // [branches][gains]; hz = NaN where it is lost
  bool *is_mode;     // [branches] starts at an oscillatory pole of the plant (damping < 0.7)
  double *smallest;  // [gains] smallest damping of the modes; −1 where one is lost
} pb_rootlocus;

// Branches start at the poles with f1 ≤ |s|/2π ≤ f2 of the loop at zero gain, and are continued
// along ascending gain[0..gains−1] (the first is usually 0), wherever they lead (pole_track.h). Of
// a pair that meets on the real axis a branch goes on with one of the two real poles. A pole is
// lost where it vanishes in z = 0, or where the iteration on a large plant leads nowhere. [init]
// PB_ERR_ARGUMENT (gains not ascending, empty band), and as pb_loop_solver_poles.
pb_status pb_rootlocus_compute(pb_loop_solver *solver, const double *gain, size_t gains, double f1,
                               double f2, pb_rootlocus *out, pb_error *err);

void pb_rootlocus_clear(pb_rootlocus *locus);

// The gain at which the loop gain is about 1 in a band: the largest row sum of |L|, averaged
// geometrically. A search for gains begins around it. [init] PB_ERR_STATE: the loop has no gain.
pb_status pb_loop_unit_gain(const pb_loop *loop, double f1, double f2, double *gain, pb_error *err);

// The gain that gives the modes of the band their largest smallest damping.
typedef struct pb_best_gain {
  double gain;
  double smallest_damping;  // at that gain
  size_t modes;             // of the band
  double *attainable;       // [modes] largest damping of each mode over all gains tried, owned
  double *attained_at;      // [modes] the gain of it, owned
  size_t left_out;          // modes of the band that do not count
  double *out_hz, *out_damping, *out_most;  // [left_out] without the loop; the most of any gain
} pb_best_gain;

// Searches a logarithmic range of gains around the one where the loop gain is 1, over `decades`
// either side (0: 2), then refines to 1 %. sign of the gain: positive (the loop's sign says the
// rest). Only gains are considered that can be doubled without instability. Modes that no gain
// damps beyond 1 % and three times their own damping do not count, unless there are no others.
// [init] PB_ERR_STATE: no mode in the band, or no gain that keeps the loop stable.
pb_status pb_best_gain_find(pb_loop_solver *solver, double f1, double f2, double decades,
                            pb_best_gain *out, pb_error *err);

void pb_best_gain_clear(pb_best_gain *best);

#endif
