// A group of weakly coupled modes by its damped modes: see group.h, damped.h, group_shapes.h.
#include <stdlib.h>
#include <string.h>

#include "base/array.h"
#include "model/group.h"
#include "model/group_shapes.h"

// ---- damped modes, kept or solved for -----------------------------------------------------------

typedef struct damped {
  const pb_damped *d;  // of a store, or `own`; empty: the method does not serve
  pb_damped *own;
} damped;

static void damped_free(void *value) {
  pb_damped *d = value;
  if (d) pb_damped_clear(d);
  free(d);
}

// Keeps what was found, also that the method does not serve.
static void keep(damped *d, pb_mode_store *store, const pb_mode_key *key) {
  d->d = pb_mode_store_keep(store, PB_MODES_DAMPED, key, d->own, damped_free);
  if (d->d)
    d->own = NULL;
  else
    d->d = d->own;
}

static pb_status solve(size_t n, const double *omega, const double *damping, const pb_means *means,
                       damped *out, pb_error *err) {
  const pb_mode_key key = {omega, damping, n, n * n};
  bool solved;
  out->d = pb_mode_store_find(means->modes, PB_MODES_DAMPED, &key);
  if (out->d) return PB_OK;
  out->own = calloc(1, sizeof *out->own);
  if (!out->own) return pb_fail_memory(err, "");
  pb_status st = pb_damped_solve(n, omega, damping, means->workers, out->own, &solved, err);
  if (!st) keep(out, means->modes, &key);
  return st;
}

static pb_status find_damped(const pb_modes *m, const size_t *mode, size_t count,
                             const pb_means *means, damped *out, pb_error *err) {
  double *omega = malloc(count * sizeof *omega),
         *damping = pb_array_new(count * count, sizeof *damping);
  pb_status st = omega && damping ? PB_OK : pb_fail_memory(err, "");
  for (size_t j = 0; j < count && !st; j++) {
    omega[j] = m->omega[mode[j]];
    for (size_t i = 0; i < count; i++)
      damping[i + j * count] = m->damping[mode[i] + mode[j] * m->n];
  }
  if (!st) st = solve(count, omega, damping, means, out, err);
  free(omega);
  free(damping);
  return st;
}

// ---- blocks -------------------------------------------------------------------------------------

// A block in real form: of the complex pair j, or of the real eigenvalues j and k; of j alone where
// both are the same.
typedef struct real_block {
  size_t j, k;
  bool pair;
  double a[4], frequency;
} real_block;

static size_t size_of(const real_block *block) {
  return block->pair || block->j != block->k ? 2 : 1;
}

static real_block pair_block(const pb_damped *d, size_t k) {
  const double re = creal(d->cluster.lambda[k]), im = cimag(d->cluster.lambda[k]);
  real_block block = {.j = k, .k = k, .pair = true, .a = {re, -im, im, re}};
  block.frequency = pb_block_frequency(block.a, 2);
  return block;
}

static real_block lone_block(const pb_damped *d, size_t j, size_t k) {
  const double a = creal(d->cluster.lambda[j]), b = creal(d->cluster.lambda[k]);
  real_block block = {.j = j, .k = k, .a = {a, 0, 0, b}};
  block.frequency = pb_block_frequency(block.a, size_of(&block));
  return block;
}

// In the order that the builder wants in the end, so that it need not move them.
static int block_order(const void *a, const void *b) {
  const real_block *x = a, *y = b;
  if (size_of(x) != size_of(y)) return size_of(x) == 2 ? -1 : 1;
  if (x->frequency != y->frequency) return x->frequency < y->frequency ? -1 : 1;
  return (x->j > y->j) - (x->j < y->j);
}

static size_t list_blocks(const pb_damped *d, real_block *list) {
  const pb_clusters *c = &d->cluster;
  size_t count = 0, waiting = d->columns;  // a real eigenvalue without a partner yet
  for (size_t i = 0; i < c->count; i++)
    for (size_t k = c->column[i]; k < c->column[i + 1]; k++) {
      if (k - c->column[i] < c->pairs[i]) {
        list[count++] = pair_block(d, k);
      } else if (waiting == d->columns) {
        waiting = k;
      } else {
        list[count++] = lone_block(d, waiting, k);
        waiting = d->columns;
      }
    }
  if (waiting < d->columns) list[count++] = lone_block(d, waiting, waiting);
  qsort(list, count, sizeof *list, block_order);
  return count;
}

// Room in the model for the blocks, and their state matrices; place[k]: first state of eigenpair k.
static pb_status place_blocks(const real_block *list, size_t count, pb_model_builder *builder,
                              size_t *place, pb_error *err) {
  size_t *size = malloc((count + 1) * sizeof *size), first = 0;
  if (!size) return pb_fail_memory(err, "");
  for (size_t at = 0; at < count; at++) size[at] = size_of(&list[at]);
  pb_status st = pb_model_builder_reserve(builder, size, count, &first, err);
  pb_model *m = builder->model;
  for (size_t at = 0; at < count && !st; at++) {
    const real_block *block = &list[at];
    memcpy(m->a + m->block_value[first + at], block->a, size[at] * size[at] * sizeof *m->a);
    place[block->j] = m->block_start[first + at];
    if (block->k != block->j) place[block->k] = place[block->j] + 1;
  }
  free(size);
  return st;
}

static pb_status place_pairs(const pb_damped *d, pb_model_builder *builder, size_t *place,
                             pb_error *err) {
  real_block *list = malloc(d->columns * sizeof *list);
  if (!list) return pb_fail_memory(err, "");
  const size_t count = list_blocks(d, list);
  pb_status st = place_blocks(list, count, builder, place, err);
  free(list);
  return st;
}

pb_status pb_group_build_damped(const pb_modes *m, const size_t *mode, size_t count,
                                const pb_means *lent, pb_model_builder *builder, bool *done,
                                pb_error *err) {
  const pb_means means = pb_means_of(lent);
  const size_t blocks = builder->model->blocks;
  damped found = {0};
  size_t *place = NULL;
  pb_status st = find_damped(m, mode, count, &means, &found, err);
  *done = !st && found.d->columns > 0;
  if (*done) {
    place = malloc(found.d->columns * sizeof *place);
    st = place ? place_pairs(found.d, builder, place, err) : pb_fail_memory(err, "");
    const pb_group_shapes shapes = {m, mode, found.d, place};
    if (!st) st = pb_group_shapes_fill(&shapes, means.workers, builder->model, done, err);
    if (!*done) builder->model->blocks = blocks;
  }
  free(place);
  damped_free(found.own);
  return st;
}
