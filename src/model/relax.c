// Sensor stacks with a resistor: first-order states beside the modes.
//
//   ẋ = A_0 x + B_0 u + B_z z,  e = C_e x + D_eu u + D_ez z,  τ ż = e − z
//   y = C_0 x + D u + (D_yz + Y_z) z
//
// The states ζ = √dk z weigh as energies, like the modes' do. Then
//
//   d/dt [x; ζ] = [[A_0, B_z/√dk], [√dk C_e/τ, (D_ez − 1)/τ]] [x; ζ] + [B_0; √dk D_eu/τ] u
//
// is block-diagonalised anew: the resistor couples modes. Stacks: plant/boundary.h.
#include "model/relax.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"
#include "model/block.h"

typedef struct loop {
  const pb_system *system;
  const pb_model *open;  // has r inputs z and r outputs e, behind those of the plant
  size_t nx, nu, ny, r;  // of the closed model: nx with the r states
  size_t z, e;           // first of the inputs z and of the outputs e: those of the plant's file
  size_t *place;         // [open->nx + r] where each of the states stands in the closed model
  double *a, *v;         // nx × nx
  double *b, *c;         // nx × nu, ny × nx
  size_t *size, blocks;  // [nx] of the diagonal blocks
} loop;

static void loop_clear(loop *l) {
  free(l->place);
  free(l->a);
  free(l->v);
  free(l->b);
  free(l->c);
  free(l->size);
}

static pb_status loop_new(const pb_system *s, const pb_model *open, loop *l, pb_error *err) {
  const size_t r = s->relaxations, nx = open->nx + r;
  *l = (loop){.system = s, .open = open, .r = r, .nx = nx, .nu = open->nu - r, .ny = open->ny - r};
  l->z = s->nu - r;
  l->e = s->ny - r;
  l->place = malloc(nx * sizeof *l->place);
  l->a = calloc(nx * nx, sizeof(double));
  l->v = malloc(nx * nx * sizeof(double));
  l->b = calloc(nx * l->nu + 1, sizeof(double));
  l->c = calloc(nx * l->ny + 1, sizeof(double));
  l->size = malloc(nx * sizeof *l->size);
  if (l->place && l->a && l->v && l->b && l->c && l->size) return PB_OK;
  loop_clear(l);
  return pb_fail_memory(err, "/components");
}

// Inputs and outputs of the closed model among those of the open one: stacked coordinates that are
// followed stand behind z and e.
static size_t open_input(const loop *l, size_t i) {
  return i < l->z ? i : i + l->r;
}

static size_t open_output(const loop *l, size_t o) {
  return o < l->e ? o : o + l->r;
}

// ---- order: the fastest first, for the accuracy of the slow eigenvalues (compile.c) -------------

typedef struct unit {
  double rate;
  size_t first, count;  // states of the open model, then the relaxations
} unit;

static int unit_order(const void *a, const void *b) {
  const unit *x = a, *y = b;
  if (x->rate != y->rate) return x->rate > y->rate ? -1 : 1;
  return (x->first > y->first) - (x->first < y->first);
}

static pb_status place_states(loop *l, pb_error *err) {
  const pb_model *m = l->open;
  const size_t units = m->blocks + l->r;
  unit *list = malloc(units * sizeof *list);
  if (!list) return pb_fail_memory(err, "/components");
  for (size_t k = 0; k < m->blocks; k++) {
    const size_t first = m->block_start[k], count = m->block_start[k + 1] - first;
    list[k] = (unit){pb_block_frequency(m->a + m->block_value[k], count), first, count};
  }
  for (size_t j = 0; j < l->r; j++)
    list[m->blocks + j] = (unit){1 / l->system->relaxation_time[j], m->nx + j, 1};
  qsort(list, units, sizeof *list, unit_order);
  size_t at = 0;
  for (size_t k = 0; k < units; k++)
    for (size_t i = 0; i < list[k].count; i++) l->place[list[k].first + i] = at++;
  free(list);
  return PB_OK;
}

// ---- the closed equations -----------------------------------------------------------------------

static void fill_modes(loop *l) {
  const pb_model *m = l->open;
  for (size_t k = 0; k < m->blocks; k++) {
    const size_t first = m->block_start[k], n = m->block_start[k + 1] - first;
    for (size_t j = 0; j < n; j++)
      for (size_t i = 0; i < n; i++)
        l->a[l->place[first + i] + l->place[first + j] * l->nx] =
            m->a[m->block_value[k] + i + j * n];
  }
  for (size_t x = 0; x < m->nx; x++) {
    for (size_t i = 0; i < l->nu; i++)
      l->b[l->place[x] + i * l->nx] = m->b[x + open_input(l, i) * m->nx];
    for (size_t o = 0; o < l->ny; o++)
      l->c[o + l->place[x] * l->ny] = m->c[open_output(l, o) + x * m->ny];
  }
}

// √dk times what an input drives of z; a displacement of the coordinate z itself (motion_map.h)
// sets it.
static double drive(const loop *l, size_t j, size_t input) {
  const pb_system *s = l->system;
  const double root = sqrt(s->relaxation_stiffness[j]);
  if (input < l->z)
    return root * l->open->d[l->e + j + input * l->open->ny] / s->relaxation_time[j];
  return input == l->z + s->relaxation_place[j] ? root : 0;
}

// What an output sees of z itself, besides what z does to the plant.
static double seen(const loop *l, size_t j, size_t output) {
  const pb_system *s = l->system;
  if (output < l->e) return s->relaxation_output[output + j * s->ny];
  return output == l->e + s->relaxation_place[j] ? 1 : 0;
}

static void fill_relaxations(loop *l) {
  const pb_model *m = l->open;
  const pb_system *s = l->system;
  for (size_t j = 0; j < l->r; j++) {
    const size_t z = l->place[m->nx + j];
    const double root = sqrt(s->relaxation_stiffness[j]), rate = 1 / s->relaxation_time[j];
    for (size_t x = 0; x < m->nx; x++) {
      l->a[l->place[x] + z * l->nx] = m->b[x + (l->z + j) * m->nx] / root;
      l->a[z + l->place[x] * l->nx] = root * rate * m->c[l->e + j + x * m->ny];
    }
    for (size_t k = 0; k < l->r; k++)
      l->a[z + l->place[m->nx + k] * l->nx] =
          rate * root / sqrt(s->relaxation_stiffness[k]) * m->d[l->e + j + (l->z + k) * m->ny];
    l->a[z + z * l->nx] -= rate;
    for (size_t i = 0; i < l->nu; i++) l->b[z + i * l->nx] = drive(l, j, i);
    for (size_t o = 0; o < l->ny; o++)
      l->c[o + z * l->ny] = (m->d[open_output(l, o) + (l->z + j) * m->ny] + seen(l, j, o)) / root;
  }
}

// b ← V⁻¹ b, c ← c V, a ← diag(blocks).
static pb_status diagonalize(loop *l, pb_error *err) {
  pb_status st = pb_block_diagonalize(l->nx, l->a, l->v, &l->blocks, l->size, "/components", err);
  if (st) return st;
  int n = (int)l->nx, nu = (int)l->nu, ny = (int)l->ny, info = 0;
  const double one = 1, zero = 0;
  double *c = malloc((l->nx * l->ny + 1) * sizeof *c);
  int *pivot = malloc(l->nx * sizeof *pivot);
  if (c && pivot) {
    if (ny) dgemm_("N", "N", &ny, &n, &n, &one, l->c, &ny, l->v, &n, &zero, c, &ny);
    memcpy(l->c, c, l->nx * l->ny * sizeof *c);
    dgesv_(&n, &nu, l->v, &n, pivot, l->b, &n, &info);
    if (info) st = pb_fail(err, PB_ERR_NUMERIC, "", "the modal transformation is singular");
  } else {
    st = pb_fail_memory(err, "/components");
  }
  free(c);
  free(pivot);
  return st;
}

// Two real eigenvalues share a 2 × 2 block.
static pb_status emit(const loop *l, pb_model_builder *builder, pb_error *err) {
  pb_status st = PB_OK;
  size_t at = 0;
  for (size_t k = 0; k < l->blocks && !st; k++) {
    size_t size = l->size[k];
    if (size == 1 && k + 1 < l->blocks && l->size[k + 1] == 1) size = 2, k++;
    const pb_model_part part = {.size = size,
                                .a = l->a + at + at * l->nx,
                                .lda = l->nx,
                                .b = l->b + at,
                                .ldb = l->nx,
                                .c = l->c + at * l->ny,
                                .ldc = l->ny};
    st = pb_model_builder_add(builder, &part, err);
    at += size;
  }
  return st;
}

pb_status pb_model_relax(const pb_system *s, pb_model_builder *builder, pb_model **out,
                         pb_error *err) {
  *out = NULL;
  const pb_model *open = builder->model;
  pb_model_builder closed = {0};
  loop l;
  pb_status st = loop_new(s, open, &l, err);
  if (st) return st;
  st = place_states(&l, err);
  if (!st) {
    fill_modes(&l);
    fill_relaxations(&l);
    st = diagonalize(&l, err);
  }
  if (!st) st = pb_model_builder_open(&closed, l.nx, l.nu, l.ny, open->modes, err);
  closed.plain = builder->plain;
  closed.direct = l.z;
  closed.rest = builder->rest;
  closed.rest_rows = builder->rest_rows;
  if (!st) st = pb_model_copy_header(open, closed.model, err);
  for (size_t i = 0; i < l.nu && !st; i++)
    for (size_t o = 0; o < l.ny; o++)
      closed.model->d[o + i * l.ny] = open->d[open_output(&l, o) + open_input(&l, i) * open->ny];
  if (!st) st = emit(&l, &closed, err);
  if (!st) st = pb_model_builder_close(&closed, s->plant->max_frequency, out, err);
  pb_model_builder_discard(&closed);
  loop_clear(&l);
  if (!st) pb_model_builder_discard(builder);
  return st;
}
