// What the files of the reduction share. Vectors over the full model keep the row order of K:
// `full` numbers per column.
#ifndef PB_PART_REDUCE_INTERNAL_H
#define PB_PART_REDUCE_INTERNAL_H

#include "part/factor.h"
#include "part/reduce.h"

// A frame in terms of rows of K. The tie of its node i, 18 numbers from tie[18 i]:
//   averaged: C_i, 6 × 3, q = Σ C_i u_i;   rigid: R_i, 3 × 6, u_i = R_i q. Both column-major.
typedef struct reduce_frame {
  const pb_fem_frame *from;
  bool rigid;
  size_t border;  // averaged: its first multiplier, after the pins
  double *tie;
} reduce_frame;

// One number of the stiffness in the row of a pin.
typedef struct pin_entry {
  size_t row, pin;
  double value;
} pin_entry;

typedef struct reduce_work {
  const pb_fem *fem;
  const pb_reduce_options *options;
  size_t full, frames;
  size_t averaged;      // frames that are
  size_t boundary;      // 6 × frames
  reduce_frame *frame;  // [frames]
  size_t *node_of_row;  // [full]
  bool *rigid_row;      // [full] moves with a rigid frame
  bool *held;           // [full] left out of the factor: pinned or rigid
  size_t pins, pin[6];  // rows that a free part is held by while its border frees them again
  size_t pin_entries;
  pin_entry *pin_entry;
  bool triple;       // M = mass ⊗ I₃ …
  pb_sparse mass;    // … over the rows three by three; else empty
  pb_factor factor;  // of K without held rows
  // The border: B = [K(:, pins), Cᵀ], W = K⁻¹B, D = [K_pp, C_pᵀ; C_p, 0] − BᵀW, scaled and LU.
  size_t border;  // pins + 6 × averaged
  double *w;      // full × border
  double *d, *scale;
  int *pivot;
  // Results
  double *psi;        // full × boundary: constraint modes, with the rigid frames' own motion
  double *stiffness;  // boundary × boundary: ΨᵀKΨ
  double *phi;        // full × modes
  double *omega2;     // [modes]
  size_t modes;
  double next_omega2;  // estimate of the first mode that is not kept; ∞: there is none
  pb_reduction *out;
  pb_reduce_phase phase;  // the present one
  double began;           // when; 0: none has
} reduce_work;

// reduce_frames.c: everything up to the order of elimination.
pb_status reduce_set_up(reduce_work *w, pb_error *err);
// out [6 averaged × columns] (ld given) ← C u; u ← u + Cᵀ z.
void reduce_average(const reduce_work *w, size_t columns, const double *u, double *out, size_t ld);
void reduce_spread(const reduce_work *w, size_t columns, const double *z, size_t ld, double *u);
// u at the nodes of rigid frame f ← R e_d, added.
void reduce_move_rigid(const reduce_work *w, size_t f, size_t d, double *u);
// R of a point at x from the origin, 3 × 6 column-major: u = v + ω × x.
void reduce_rigid_tie(const double x[3], double tie[18]);

// reduce_pins.c: PB_ERR_SINGULAR where the part falls into pieces; w->pin and its entries of K
// (none where a rigid frame holds the part).
pb_status reduce_check_connected(const reduce_work *w, pb_error *err);
pb_status reduce_choose_pins(reduce_work *w, pb_error *err);

// reduce_mass.c: y ← M x.
pb_status reduce_mass_detect(reduce_work *w, pb_error *err);
void reduce_mass_multiply(const reduce_work *w, size_t columns, const double *x, double *y);

// reduce_factor.c: w->factor, of K without held rows. PB_ERR_SINGULAR where it has a mechanism.
pb_status reduce_factor(reduce_work *w, pb_error *err);

// reduce_border.c: factorisation and constraint modes; then u ← the response to forces u with every
// frame held.
pb_status reduce_static(reduce_work *w, pb_error *err);
pb_status reduce_respond(reduce_work *w, size_t columns, double *u, pb_error *err);

// reduce_modes.c
pb_status reduce_modes(reduce_work *w, pb_error *err);

// reduce_project.c: ΨᵀKΨ, after which only a proof and a check need the full K; then K and M of the
// element, masses, residual of rigid motions.
pb_status reduce_project_stiffness(reduce_work *w, pb_error *err);
pb_status reduce_project(reduce_work *w, pb_error *err);

// reduce_check.c: the count of modes, and the comparison with the full model.
pb_status reduce_count(reduce_work *w, double hz, size_t *fixed_below, size_t *free_below,
                       pb_error *err);
pb_status reduce_compare(reduce_work *w, pb_error *err);

// Tells the caller's progress function; PB_ERR_STATE when it wants to stop.
pb_status reduce_progress(const reduce_work *w, pb_reduce_phase phase, double done, double total,
                          pb_error *err);

// As reduce_progress at the start of a phase, whose time is taken until the next.
pb_status reduce_begin(reduce_work *w, pb_reduce_phase phase, pb_error *err);

#endif
