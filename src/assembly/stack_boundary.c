// Electrical boundaries of sensor stacks in the stacked equations: see plant/boundary.h.
//
// The stack's elongation e = δᵀq gets dk in parallel; with a resistor, dk acts on e − z. As a
// coordinate z has no mass and no place among second-order equations: it is held by a constraint,
// and acts as an input (force dk δ z) that the output e drives through τ ż = e − z (model/relax.c).
// In K, and with a mass of 1 that no motion ever moves, z is kept for energies and for the transfer
// of states.
#include <stdlib.h>

#include "assembly/stack.h"
#include "plant/boundary.h"

static pb_status add_relaxation(pb_stack_equations *s, pb_relaxation relaxation, pb_error *err) {
  pb_relaxation *list = realloc(s->relaxation, (s->relaxations + 1) * sizeof *list);
  if (!list) return pb_fail_memory(err, "/components");
  s->relaxation = list;
  list[s->relaxations++] = relaxation;
  return PB_OK;
}

// k += dk δ δᵀ
static void add_stiffness(double *k, size_t n, const double *delta, double dk) {
  for (size_t j = 0; j < n; j++) {
    if (delta[j] == 0) continue;
    for (size_t i = 0; i < n; i++)
      if (delta[i] != 0) k[i + j * n] += dk * delta[i] * delta[j];
  }
}

static pb_status add_boundary(pb_stack_equations *s, const pb_plant *plant, const pb_layout *layout,
                              size_t index, pb_error *err) {
  const pb_component *c = &plant->component[index];
  const double dk = pb_boundary_stiffening(&c->boundary);
  double *delta = calloc(s->n, sizeof *delta);
  if (!delta) return pb_fail_memory(err, c->pointer);
  pb_status st = PB_OK;
  pb_stack_sensor_elongation(plant, layout, (int)index, 1, delta);
  if (c->boundary.kind == PB_BOUNDARY_RESISTOR) {
    const size_t z = layout->component[index] + pb_component_motions(c);
    delta[z] = -1;
    s->m[z + z * s->n] = 1;
    st = add_relaxation(s, (pb_relaxation){z, dk, pb_boundary_time(&c->boundary)}, err);
    if (!st) st = pb_stack_lock(s, z, c->pointer, err);
  }
  if (!st) add_stiffness(s->k, s->n, delta, dk);
  free(delta);
  return st;
}

pb_status pb_stack_boundaries(const pb_plant *plant, const pb_layout *layout, pb_stack_equations *s,
                              pb_error *err) {
  pb_status st = PB_OK;
  for (size_t i = 0; i < plant->component_count && !st; i++)
    if (plant->component[i].boundary.kind != PB_BOUNDARY_SHORT)
      st = add_boundary(s, plant, layout, i, err);
  return st;
}
