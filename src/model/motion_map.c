// See motion_map.h.
#include "model/motion_map.h"

#include <stdlib.h>
#include <string.h>

#include "assembly/system.h"
#include "base/array.h"
#include "base/lapack.h"
#include "base/text.h"
#include "model/build.h"

void pb_motion_map_free(pb_motion_map *map) {
  if (!map) return;
  pb_plant_free(map->plant);
  pb_layout_clear(&map->layout);
  free(map->m);
  free(map->k);
  free(map->f);
  free(map->dq);
  free(map->b);
  free(map->c);
  free(map);
}

static double *rows(const double *a, size_t ld, size_t first, size_t count, size_t cols) {
  double *out = pb_array_new(count * cols + 1, sizeof *out);
  for (size_t j = 0; out && j < cols; j++)
    memcpy(out + j * count, a + first + j * ld, count * sizeof *out);
  return out;
}

// What belongs to the map of the extended model, whose B and C are large and become the map's.
static pb_status map_fill(pb_model *x, pb_motion_map *map, pb_error *err) {
  const size_t n = map->n, ny = x->ny - 2 * n, nu = x->nu - 2 * n;
  map->nx = x->nx;
  map->nu = nu;
  map->dq = rows(x->d, x->ny, ny, n, nu);
  map->b = x->b;
  map->bq = map->b + nu * x->nx;
  map->bv = map->bq + n * x->nx;
  map->c = x->c;
  map->cq = map->c + ny;
  map->cv = map->cq + n;
  map->ldc = x->ny;
  x->b = x->c = NULL;
  return map->dq ? PB_OK : pb_fail_memory(err, "motion map");
}

static pb_status extended_compile(pb_plant *plant, const pb_means *means, pb_warnings *warnings,
                                  pb_model **out, pb_motion_map *map, pb_error *err) {
  pb_system *system = NULL;
  pb_model *extended = NULL;
  pb_system_stack stack = {0};
  pb_status st =
      pb_system_assemble_observed(plant, means->observer, warnings, &system, &stack, err);
  map->layout = stack.layout;
  map->n = stack.layout.size;
  map->m = stack.m;
  map->k = stack.k;
  map->f = stack.f;
  if (!st) st = pb_model_compile_with(system, means, warnings, &extended, err);
  pb_system_free(system);
  if (!st) st = pb_model_narrow(extended, plant->input_count, plant->output_count, out, err);
  if (!st) st = map_fill(extended, map, err);
  pb_model_free(extended);
  return st;
}

static pb_status plain_compile(const pb_plant *plant, const pb_means *means, pb_warnings *warnings,
                               pb_model **out, pb_error *err) {
  pb_system *system = NULL;
  pb_status st = pb_system_assemble_observed(plant, means->observer, warnings, &system, NULL, err);
  if (!st) st = pb_model_compile_with(system, means, warnings, out, err);
  pb_system_free(system);
  return st;
}

static pb_status size_of(const pb_plant *plant, size_t *size, pb_error *err) {
  pb_layout layout = {0};
  pb_status st = pb_layout_build(plant, &layout, err);
  *size = layout.size;
  pb_layout_clear(&layout);
  return st;
}

pb_status pb_model_parse(const char *text, size_t length, const char *directory,
                         pb_warnings *warnings, pb_model **out, pb_motion_map **map,
                         char **canonical, pb_error *err) {
  return pb_model_parse_with(text, length, directory, NULL, warnings, out, map, canonical, err);
}

pb_status pb_model_parse_with(const char *text, size_t length, const char *directory,
                              const pb_means *lent, pb_warnings *warnings, pb_model **out,
                              pb_motion_map **map, char **canonical, pb_error *err) {
  const pb_means means = pb_means_of(lent);
  pb_motion_map *made = calloc(1, sizeof *made);
  pb_plant *plant = NULL;
  size_t size = 0;
  *out = NULL;
  *map = NULL;
  if (canonical) *canonical = NULL;
  pb_phase_begin(means.observer, PB_PHASE_READ);
  pb_status st =
      made ? pb_plant_parse_stored(text, length, directory, means.elements, warnings, &plant, err)
           : pb_fail_memory(err, "motion map");
  if (!st) made->plant = plant;
  if (!st) st = size_of(plant, &size, err);
  const bool mapped = size <= PB_MOTION_MAP_LARGEST;
  if (!st && mapped) st = extended_compile(plant, &means, warnings, out, made, err);
  if (!st && !mapped) st = plain_compile(plant, &means, warnings, out, err);
  if (!st && canonical) {
    *canonical = pb_text_copy(plant->text);
    if (!*canonical) st = pb_fail_memory(err, "plant file");
  }
  if (!st && mapped) {
    *map = made;
    return PB_OK;
  }
  if (st) {
    pb_model_free(*out);
    *out = NULL;
  }
  pb_motion_map_free(made);
  return st;
}

// out(n) = op(a) x
static void apply(size_t rows_count, size_t cols, const double *a, size_t lda, const double *x,
                  double beta, double *out) {
  int m = (int)rows_count, n = (int)cols, ld = (int)lda, one = 1;
  double alpha = 1.0;
  dgemv_("N", &m, &n, &alpha, a, &ld, x, &one, &beta, out, &one);
}

static double quadratic(size_t n, const double *a, const double *x, double *work) {
  double sum = 0.0;
  apply(n, n, a, n, x, 0.0, work);
  for (size_t i = 0; i < n; i++) sum += x[i] * work[i];
  return sum;
}

pb_status pb_motion_map_energy(const pb_motion_map *map, const double *x, const double *u,
                               double *energy, pb_error *err) {
  double *q = malloc(map->n * sizeof *q), *v = malloc(map->n * sizeof *v);
  double *work = malloc(map->n * sizeof *work);
  const bool ok = q && v && work;
  if (ok) {
    apply(map->n, map->nx, map->cq, map->ldc, x, 0.0, q);
    apply(map->n, map->nu, map->dq, map->n, u, 1.0, q);
    apply(map->n, map->nx, map->cv, map->ldc, x, 0.0, v);
    *energy = 0.5 * (quadratic(map->n, map->m, v, work) + quadratic(map->n, map->k, q, work));
  }
  free(q);
  free(v);
  free(work);
  return ok ? PB_OK : pb_fail_memory(err, "energy");
}
