// Assembling a plant: see system.h.
#include "assembly/system.h"

#include <stdlib.h>

#include "assembly/eliminate.h"
#include "assembly/stack.h"

pb_status pb_system_assemble(const pb_plant *plant, pb_warnings *warnings, pb_system **out,
                             pb_error *err) {
  *out = NULL;
  pb_layout layout = {0};
  pb_stack_equations stack = {0};
  pb_null_basis basis = {0};
  pb_system *system = calloc(1, sizeof *system);
  pb_status st = system ? PB_OK : pb_fail_memory(err, "");
  if (!st) system->plant = plant;
  if (!st) st = pb_layout_build(plant, &layout, err);
  if (!st) st = pb_stack_build(plant, &layout, warnings, &stack, err);
  if (!st) st = pb_null_build(&stack, warnings, &basis, err);
  if (!st && basis.rank == basis.n)
    st = pb_fail(err, PB_ERR_SINGULAR, "/connections",
                 "the constraints leave no degree of freedom: nothing can move");
  if (!st) st = pb_null_project(&basis, &stack, system, err);
  if (!st) st = pb_condense(system, &basis, &layout, warnings, err);
  if (!st && !system->n)
    st = pb_fail(err, PB_ERR_SINGULAR, "/components", "nothing that can move has a mass");
  pb_null_clear(&basis);
  pb_stack_clear(&stack);
  pb_layout_clear(&layout);
  if (st) {
    pb_system_free(system);
  } else {
    *out = system;
  }
  return st;
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
  free(system);
}
