// Assembling a plant: see system.h.
#include "assembly/system.h"

#include <stdlib.h>
#include <string.h>

#include "assembly/eliminate.h"
#include "assembly/stack.h"
#include "base/array.h"

static pb_status stack_keep(const pb_stack_equations *s, pb_system_stack *kept, pb_error *err) {
  const size_t bytes = s->n * s->n * sizeof(double), forces = s->n * s->nu * sizeof(double);
  kept->m = pb_array_new(1, bytes);
  kept->k = pb_array_new(1, bytes);
  kept->f = pb_array_new(1, forces);
  if (!kept->m || !kept->k || !kept->f) return pb_fail_memory(err, "/components");
  memcpy(kept->m, s->m, bytes);
  memcpy(kept->k, s->k, bytes);
  memcpy(kept->f, s->f, forces);
  return PB_OK;
}

// The equations of the stack, in minimal coordinates.
static pb_status eliminate(pb_stack_equations *stack, const pb_layout *layout, bool expand,
                           pb_warnings *warnings, pb_system *system, pb_error *err) {
  pb_null_basis basis = {0};
  pb_status st = pb_null_build(stack, warnings, &basis, err);
  if (!st && basis.rank == basis.n)
    st = pb_fail(err, PB_ERR_SINGULAR, "/connections",
                 "the constraints leave no degree of freedom: nothing can move");
  if (!st) st = pb_null_project(&basis, stack, system, err);
  if (!st && expand) {
    system->stacked = basis.n;
    system->expand_u = pb_array_zero(basis.n * system->nu, sizeof(double));
    st = system->expand_u ? pb_null_matrix(&basis, &system->expand, err)
                          : pb_fail_memory(err, "/components");
  }
  if (!st) st = pb_condense(system, &basis, layout, warnings, err);
  if (!st && !system->n)
    st = pb_fail(err, PB_ERR_SINGULAR, "/components", "nothing that can move has a mass");
  pb_null_clear(&basis);
  return st;
}

pb_status pb_system_assemble_observed(const pb_plant *plant, const pb_observer *observer,
                                      pb_warnings *warnings, pb_system **out, pb_system_stack *kept,
                                      pb_error *err) {
  *out = NULL;
  if (kept) *kept = (pb_system_stack){0};
  pb_layout layout = {0};
  pb_stack_equations stack = {0};
  pb_system *system = calloc(1, sizeof *system);
  pb_status st = system ? PB_OK : pb_fail_memory(err, "");
  if (!st) system->plant = plant;
  pb_phase_begin(observer, PB_PHASE_ASSEMBLE);
  if (!st) st = pb_layout_build(plant, &layout, err);
  if (!st) st = pb_stack_build(plant, &layout, warnings, &stack, err);
  if (!st && kept) st = stack_keep(&stack, kept, err);
  if (!st) st = pb_relaxations_append(&stack, system, err);
  pb_phase_begin(observer, PB_PHASE_ELIMINATE);
  if (!st) st = eliminate(&stack, &layout, kept != NULL, warnings, system, err);
  pb_stack_clear(&stack);
  if (kept)
    kept->layout = layout;
  else
    pb_layout_clear(&layout);
  if (st) {
    pb_system_free(system);
  } else {
    *out = system;
  }
  return st;
}

pb_status pb_system_assemble(const pb_plant *plant, pb_warnings *warnings, pb_system **out,
                             pb_error *err) {
  return pb_system_assemble_observed(plant, NULL, warnings, out, NULL, err);
}

void pb_system_free(pb_system *system) {
  if (!system) return;
  free(system->m);
  free(system->c);
  free(system->k);
  free(system->f);
  free(system->y0);
  free(system->y1);
  free(system->y2);
  free(system->d);
  free(system->expand);
  free(system->expand_u);
  free(system->relaxation_time);
  free(system->relaxation_stiffness);
  free(system->relaxation_place);
  free(system->relaxation_output);
  free(system);
}
