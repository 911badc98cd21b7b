// The equations before elimination: stacked component coordinates q with constraints G q = 0.
//
//   M q̈ + C q̇ + K q = F u + Gᵀλ,   G q = 0,   y = Y_0 q + Y_1 q̇ + Y_2 q̈ + D u
#ifndef PB_ASSEMBLY_STACK_H
#define PB_ASSEMBLY_STACK_H

#include "assembly/motion.h"

typedef struct pb_stack_equations {
  size_t n, nu, ny;   // stacked coordinates, inputs, outputs
  double *m, *c, *k;  // n × n
  double *f;          // n × nu
  double *y[3];       // n × ny: transposed Y_0, Y_1, Y_2
  double *d;          // ny × nu
  size_t constraints, capacity;
  double *g;           // n × constraints: one constraint a column, of unit norm
  const char **owner;  // [constraints] JSON pointer of the connection behind each
} pb_stack_equations;

// Stacks components, joints and signals of the plant. [init]
// Fails with PB_ERR_GEOMETRY (frames that do not coincide), PB_ERR_MEMORY.
pb_status pb_stack_build(const pb_plant *plant, const pb_layout *layout, pb_warnings *warnings,
                         pb_stack_equations *out, pb_error *err);
void pb_stack_clear(pb_stack_equations *stack);

// Fills f, y and d. Called by pb_stack_build.
pb_status pb_stack_signals(const pb_plant *plant, const pb_layout *layout, pb_warnings *warnings,
                           pb_stack_equations *stack, pb_error *err);

#endif
