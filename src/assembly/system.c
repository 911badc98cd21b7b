// Assembling a plant: see system.h.
#include "assembly/system.h"

#include <stdlib.h>
#include <string.h>

#include "assembly/eliminate.h"
#include "assembly/stack.h"

// rows × cols in the top left of a zeroed rows × cols array, plus more; a is replaced.
static bool widen(double **a, size_t rows, size_t cols, size_t more_rows, size_t more_cols) {
  const size_t ld = rows + more_rows;
  double *wide = calloc(ld * (cols + more_cols) + 1, sizeof *wide);
  if (!wide) return false;
  for (size_t j = 0; j < cols; j++) memcpy(wide + j * ld, *a + j * rows, rows * sizeof *wide);
  free(*a);
  *a = wide;
  return true;
}

// f = [F I I], Y_0 = [Y_0; I; 0], Y_1 = [Y_1; 0; I]; y is stored transposed.
static pb_status extend(pb_stack_equations *s, pb_error *err) {
  const size_t n = s->n, nu = s->nu, ny = s->ny;
  bool ok = widen(&s->f, n, nu, 0, 2 * n) && widen(&s->d, ny, nu, 2 * n, 2 * n);
  for (int i = 0; i < 3 && ok; i++) ok = widen(&s->y[i], n, ny, 0, 2 * n);
  if (!ok) return pb_fail_memory(err, "/components");
  for (size_t i = 0; i < n; i++) {
    s->f[i + (nu + i) * n] = s->f[i + (nu + n + i) * n] = 1.0;
    s->y[0][i + (ny + i) * n] = s->y[1][i + (ny + n + i) * n] = 1.0;
  }
  s->nu += 2 * n;
  s->ny += 2 * n;
  return PB_OK;
}

static pb_status stack_keep(const pb_stack_equations *s, pb_system_stack *kept, pb_error *err) {
  const size_t bytes = s->n * s->n * sizeof(double), forces = s->n * s->nu * sizeof(double);
  kept->m = malloc(bytes);
  kept->k = malloc(bytes);
  kept->f = malloc(forces);
  if (!kept->m || !kept->k || !kept->f) return pb_fail_memory(err, "/components");
  memcpy(kept->m, s->m, bytes);
  memcpy(kept->k, s->k, bytes);
  memcpy(kept->f, s->f, forces);
  return PB_OK;
}

// Each relaxation becomes an input (its force dk δ z, which is −K's column of z) and an output
// (δᵀq); what the outputs so far see of z itself is taken down.
static pb_status relaxations_append(pb_stack_equations *s, pb_system *system, pb_error *err) {
  const size_t r = s->relaxations, n = s->n, nu = s->nu, ny = s->ny;
  if (r == 0) return PB_OK;
  system->relaxation_time = malloc(r * sizeof(double));
  system->relaxation_stiffness = malloc(r * sizeof(double));
  system->relaxation_place = malloc(r * sizeof(size_t));
  system->relaxation_output = calloc((ny + r) * r, sizeof(double));
  bool ok = system->relaxation_time && system->relaxation_stiffness && system->relaxation_place &&
            system->relaxation_output && widen(&s->f, n, nu, 0, r) && widen(&s->d, ny, nu, r, r);
  for (int i = 0; i < 3 && ok; i++) ok = widen(&s->y[i], n, ny, 0, r);
  if (!ok) return pb_fail_memory(err, "/components");
  for (size_t j = 0; j < r; j++) {
    const pb_relaxation *x = &s->relaxation[j];
    const double *column = s->k + x->coordinate * n;
    system->relaxation_time[j] = x->time;
    system->relaxation_stiffness[j] = x->stiffness;
    system->relaxation_place[j] = x->coordinate;
    for (size_t o = 0; o < ny; o++)
      system->relaxation_output[o + j * (ny + r)] = s->y[0][x->coordinate + o * n];
    for (size_t i = 0; i < n; i++) {
      if (i == x->coordinate) continue;
      s->f[i + (nu + j) * n] = -column[i];
      s->y[0][i + (ny + j) * n] = -column[i] / x->stiffness;
    }
  }
  system->relaxations = r;
  s->nu += r;
  s->ny += r;
  return PB_OK;
}

// With `kept` the equations are extended, and what they were is kept.
static pb_status assemble(const pb_plant *plant, pb_warnings *warnings, pb_system **out,
                          pb_system_stack *kept, pb_error *err) {
  *out = NULL;
  pb_layout layout = {0};
  pb_stack_equations stack = {0};
  pb_null_basis basis = {0};
  pb_system *system = calloc(1, sizeof *system);
  pb_status st = system ? PB_OK : pb_fail_memory(err, "");
  if (!st) system->plant = plant;
  if (!st) st = pb_layout_build(plant, &layout, err);
  if (!st) st = pb_stack_build(plant, &layout, warnings, &stack, err);
  if (!st && kept) st = stack_keep(&stack, kept, err);
  if (!st && kept) {
    system->displacing = stack.nu;
    system->displacings = stack.n;
    st = extend(&stack, err);
  }
  if (!st) st = relaxations_append(&stack, system, err);
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
  return assemble(plant, warnings, out, NULL, err);
}

pb_status pb_system_assemble_extended(const pb_plant *plant, pb_warnings *warnings, pb_system **out,
                                      pb_system_stack *stack, pb_error *err) {
  *stack = (pb_system_stack){0};
  return assemble(plant, warnings, out, stack, err);
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
  free(system->relaxation_time);
  free(system->relaxation_stiffness);
  free(system->relaxation_place);
  free(system->relaxation_output);
  free(system);
}
