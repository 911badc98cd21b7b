// Undamped modes of an assembled plant and everything else in modal coordinates.
//
//   K Φ = M Φ Ω²,  ΦᵀMΦ = I,  q = Φ η:   η̈ + Ĉ η̇ + Ω² η = Φᵀ F u
#ifndef PB_MODEL_MODES_H
#define PB_MODEL_MODES_H

#include "assembly/system.h"
#include "model/means.h"

typedef struct pb_modes {
  size_t n, nu, ny;
  double *omega;      // [n] rad/s, ascending; exactly 0 for rigid-body modes
  double *damping;    // n × n: Ĉ = ΦᵀCΦ
  double *force;      // n × nu: ΦᵀF
  double *output[3];  // ny × n: Y_0Φ, Y_1Φ, Y_2Φ
  size_t rigid;       // rigid-body modes, first in the list
  size_t stacked;     // stacked coordinates that are followed; 0: none
  double *motion;     // stacked × n: how they move with the modes
} pb_modes;

// Solves for the modes. Warns of rigid-body modes. Fails with PB_ERR_NUMERIC, PB_ERR_MEMORY and,
// where a mode's stiffness is negative beyond rounding, PB_ERR_SINGULAR naming its frequency.
// [init]
pb_status pb_modes_solve(const pb_system *system, const pb_means *means, pb_warnings *warnings,
                         pb_modes *out, pb_error *err);
void pb_modes_clear(pb_modes *modes);

#endif
