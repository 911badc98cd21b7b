// The assembled plant: second-order equations in minimal coordinates.
//
//   M q̈ + C q̇ + K q = F u
//   y = Y_0 q + Y_1 q̇ + Y_2 q̈ + D u
//
// Built from a pb_plant: component coordinates are stacked, locked joint directions give G q = 0,
// and with N an orthonormal basis of null(G), q = N q_r: M_r = NᵀMN and so on. Column-major
// matrices.
#ifndef PB_ASSEMBLY_SYSTEM_H
#define PB_ASSEMBLY_SYSTEM_H

#include <stddef.h>

#include "base/phase.h"
#include "base/status.h"
#include "assembly/motion.h"
#include "plant/plant.h"

typedef struct pb_system {
  size_t n, nu, ny;       // degrees of freedom, inputs, outputs
  double *m, *c, *k;      // n × n; m positive definite
  double *f;              // n × nu
  double *y0, *y1, *y2;   // ny × n
  double *d;              // ny × nu
  const pb_plant *plant;  // names and rates; must outlive the system
  // How the stacked coordinates follow, when that was asked for: q_stack = expand q + expand_u u.
  size_t stacked;    // 0: not asked for
  double *expand;    // stacked × n
  double *expand_u;  // stacked × nu: what inputs hold statically (condensed motions)
  // The last `relaxations` inputs z and outputs e belong together: τ ż = e − z. None without
  // resistors across sensor stacks (assembly/stack_boundary.c).
  size_t relaxations;
  double *relaxation_time;       // [relaxations] τ, s
  double *relaxation_stiffness;  // [relaxations] dk, N/m: z moves nothing but by the force dk z
  size_t *relaxation_place;      // [relaxations] stacked coordinate of z
  double *relaxation_output;     // ny × relaxations: what outputs see of z itself
} pb_system;

// The stacked equations that a system was made from, kept beside it.
typedef struct pb_system_stack {
  pb_layout layout;
  double *m, *k;  // layout.size squared
  double *f;      // layout.size × inputs of the plant
} pb_system_stack;

// Assembles. [init] Fails with PB_ERR_SINGULAR (a massless motion without stiffness, naming its
// component; no degree of freedom left), PB_ERR_GEOMETRY (frames of a connection that do not
// coincide), PB_ERR_MEMORY, PB_ERR_NUMERIC.
pb_status pb_system_assemble(const pb_plant *plant, pb_warnings *warnings, pb_system **out,
                             pb_error *err);

// The same with what may be asked for besides; both may be NULL. *stack is the caller's: layout
// (pb_layout_clear), m, k and f (free); with it the system tells how stacked coordinates follow.
// The observer is told of the phases. [init]
pb_status pb_system_assemble_observed(const pb_plant *plant, const pb_observer *observer,
                                      pb_warnings *warnings, pb_system **out,
                                      pb_system_stack *stack, pb_error *err);

void pb_system_free(pb_system *system);

#endif
