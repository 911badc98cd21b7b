// Relaxations as signals: see eliminate.h, and stack_boundary.c for what they are.
#include <stdlib.h>
#include <string.h>

#include "assembly/eliminate.h"
#include "base/array.h"

// rows × cols in the top left of a zeroed array with more rows and columns; *a is replaced.
static bool widen(double **a, size_t rows, size_t cols, size_t more_rows, size_t more_cols) {
  const size_t ld = rows + more_rows;
  double *wide = pb_array_zero(ld * (cols + more_cols), sizeof *wide);
  if (!wide) return false;
  for (size_t j = 0; j < cols; j++) memcpy(wide + j * ld, *a + j * rows, rows * sizeof *wide);
  free(*a);
  *a = wide;
  return true;
}

static bool allocate(pb_stack_equations *s, pb_system *system) {
  const size_t r = s->relaxations, n = s->n, nu = s->nu, ny = s->ny;
  system->relaxation_time = malloc(r * sizeof(double));
  system->relaxation_stiffness = malloc(r * sizeof(double));
  system->relaxation_place = malloc(r * sizeof(size_t));
  system->relaxation_output = calloc((ny + r) * r, sizeof(double));
  bool ok = system->relaxation_time && system->relaxation_stiffness && system->relaxation_place &&
            system->relaxation_output && widen(&s->f, n, nu, 0, r) && widen(&s->d, ny, nu, r, r);
  for (int i = 0; i < 3 && ok; i++) ok = widen(&s->y[i], n, ny, 0, r);
  return ok;
}

pb_status pb_relaxations_append(pb_stack_equations *s, pb_system *system, pb_error *err) {
  const size_t r = s->relaxations, n = s->n, nu = s->nu, ny = s->ny;
  if (r == 0) return PB_OK;
  if (!allocate(s, system)) return pb_fail_memory(err, "/components");
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
