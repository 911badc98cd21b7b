// Component mode synthesis (Craig–Bampton) of a full finite-element model to its interface frames.
//
//   Ψ = −K_ii⁻¹ K_ib,   K_ii φ = ω² M_ii φ,   T = [[I, 0], [Ψ, Φ]],   K = TᵀK T, M = TᵀM T
//
// b are the 6 DoFs of each of the n frames, Φ holds p fixed-interface modes (ΦᵀM_iiΦ = I): the
// result has m = 6n + p DoFs, ordered frame by frame (ux uy uz rx ry rz), modes last. One
// factorisation of the stiffness serves the constraint modes and the shift-invert block Lanczos for
// the modes. Source: report "Optimization using Finite Element Models" (T. Dehaeze, 2025),
// section 1.1.
#ifndef PB_PART_REDUCE_H
#define PB_PART_REDUCE_H

#include <stdbool.h>

#include "part/fem.h"

typedef enum pb_reduce_phase {
  PB_REDUCE_ORDER,    // ordering and symbolic analysis
  PB_REDUCE_FACTOR,   // numeric factorisation
  PB_REDUCE_STATIC,   // constraint modes
  PB_REDUCE_MODES,    // fixed-interface modes
  PB_REDUCE_PROJECT,  // K and M of the element
  PB_REDUCE_CHECK,    // comparison with the full model
  PB_REDUCE_PHASES
} pb_reduce_phase;

typedef struct pb_reduce_options {
  size_t modes;  // p by count …
  double max_hz;  // … or, when > 0, all fixed-interface modes up to this frequency (at most `modes`
                  // of them where modes > 0): their number is proven by a count
  bool prove;  // prove by a count that no mode is missing where they are asked for by number, too
  size_t check_points;  // frequencies at which the element is compared with the full model; 0: none
  double check_to_hz;   // highest of them; 0: half the last kept mode's frequency
  pb_sparse *spend;     // NULL, or the K of fem: freed (left empty) as soon as no phase needs it
  // Called when a phase starts (done = 0) and as it goes; total ≤ 0: unknown. Returning false stops
  // the reduction with PB_ERR_STATE. May be NULL.
  bool (*progress)(void *context, pb_reduce_phase phase, double done, double total);
  void *context;
} pb_reduce_options;

typedef struct pb_reduce_check {
  double hz;
  size_t fixed_below, free_below;  // modes of the full model below hz, frames held and free
  double error;  // largest |difference| of the 6n × 6n dynamic stiffness response, relative to the
                 // full model's largest entry of the same units, over all pairs of frame DoFs
} pb_reduce_check;

typedef struct pb_reduction {
  size_t frames, modes, size;  // n, p, m = 6n + p
  double *position;            // 3 × n, m
  double *k, *m;               // size × size, column-major, symmetric
  double *fixed_hz;            // [modes] fixed-interface frequencies, ascending
  double *shape;          // dof × size: T, so that u = shape × q gives the full motion; row order
                          // of K. NULL unless asked for with pb_reduce_shapes
  size_t full_dof;        // rows of the full K
  size_t factor_entries;  // of the Cholesky factor
  double seconds[PB_REDUCE_PHASES];
  double rigid_residual;  // ‖K R‖ relative to K's own size (of a single frame, whose K vanishes, to
                          // M's at the first mode), R the six rigid motions of the element
  double mass, full_mass;  // kg: RᵀMR of the element; of the full model
  double proven_hz;  // all modes below are kept, by a count of the full model's; 0: not counted
  size_t checks;
  pb_reduce_check *check;  // [checks]
} pb_reduction;

const char *pb_reduce_phase_name(pb_reduce_phase phase);

// Reduces fem to its frames. keep_shapes: also fill *shape (dof × size doubles). *out is owned by
// the caller. Fails with PB_ERR_MEMORY; PB_ERR_ARGUMENT (no frame, a frame whose nodes lie on a
// line, two rigid frames that share a node, a frame's node without DoFs); PB_ERR_SINGULAR (the part
// falls into pieces or has a mechanism: the message names a node); PB_ERR_NUMERIC (modes not
// found); PB_ERR_STATE (stopped). [init]
pb_status pb_reduce(const pb_fem *fem, const pb_reduce_options *options, bool keep_shapes,
                    pb_reduction **out, pb_error *err);

void pb_reduction_free(pb_reduction *reduction);

#endif
