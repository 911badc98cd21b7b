// The equations before elimination: stacked component coordinates q with constraints G q = 0.
//
//   M q̈ + C q̇ + K q = F u + Gᵀλ,   G q = 0,   y = Y_0 q + Y_1 q̇ + Y_2 q̈ + D u
#ifndef PB_ASSEMBLY_STACK_H
#define PB_ASSEMBLY_STACK_H

#include "assembly/motion.h"

// A resistor across a sensor stack of elongation e = δᵀq: a force F_z z with τ ż = e − z, and the
// coordinate z itself held still by a constraint. F_z = dk δ.
typedef struct pb_relaxation {
  size_t coordinate;  // z in q
  double stiffness;   // dk: what an open stack has more than a short-circuited one, N/m
  double time;        // τ, s
} pb_relaxation;

typedef struct pb_stack_equations {
  size_t n, nu, ny;   // stacked coordinates, inputs, outputs
  double *m, *c, *k;  // n × n
  double *f;          // n × nu
  double *y[3];       // n × ny: transposed Y_0, Y_1, Y_2
  double *d;          // ny × nu
  size_t constraints, capacity;
  double *g;           // n × constraints: one constraint a column, of unit norm
  const char **owner;  // [constraints] JSON pointer of the connection behind each
  size_t relaxations;
  pb_relaxation *relaxation;
} pb_stack_equations;

// Stacks components, joints and signals of the plant. [init]
// Fails with PB_ERR_GEOMETRY (frames that do not coincide), PB_ERR_MEMORY.
pb_status pb_stack_build(const pb_plant *plant, const pb_layout *layout, pb_warnings *warnings,
                         pb_stack_equations *out, pb_error *err);
void pb_stack_clear(pb_stack_equations *stack);

// Fills f, y and d. Called by pb_stack_build.
pb_status pb_stack_signals(const pb_plant *plant, const pb_layout *layout, pb_warnings *warnings,
                           pb_stack_equations *stack, pb_error *err);

// Adds the electrical boundaries of the components' sensor stacks: stiffness, and relaxations with
// the constraints on their z. Called by pb_stack_build.
pb_status pb_stack_boundaries(const pb_plant *plant, const pb_layout *layout,
                              pb_stack_equations *stack, pb_error *err);

// column += gain × elongation of the component's sensor stack as a function of q. [any]
void pb_stack_sensor_elongation(const pb_plant *plant, const pb_layout *layout, int component,
                                double gain, double *column);

// Locks one coordinate: a constraint q_i = 0.
pb_status pb_stack_lock(pb_stack_equations *stack, size_t coordinate, const char *owner,
                        pb_error *err);

#endif
