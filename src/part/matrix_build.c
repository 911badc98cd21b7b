// A matrix while it is read: see matrix_build.h.
#include "part/matrix_build.h"

#include <stdlib.h>
#include <string.h>

static bool grow(void *field, size_t count, size_t size) {
  void **array = field;
  void *larger = realloc(*array, count * size);
  if (larger) *array = larger;
  return larger != NULL;
}

pb_status pb_matrix_build_reserve(pb_matrix_build *b, size_t count, pb_error *err) {
  pb_matrix_file *f = b->file;
  if (count <= b->capacity) return PB_OK;
  if (count > SIZE_MAX / 64 || !grow(&f->row, count, sizeof *f->row) ||
      !grow(&f->col, count, sizeof *f->col) || !grow(&f->value, count, sizeof *f->value))
    return pb_fail_memory(err, "matrix entries");
  b->capacity = count;
  return PB_OK;
}

static size_t label_hash(pb_row_label label) {
  uint64_t h = (uint64_t)label.node * 8 + (uint64_t)label.direction;
  h *= UINT64_C(0x9E3779B97F4A7C15);
  return (size_t)(h >> 20);
}

static bool same_label(pb_row_label a, pb_row_label b) {
  return a.node == b.node && a.direction == b.direction;
}

// The slot that holds the label, or the empty one where it belongs.
static size_t *find_slot(const pb_matrix_build *b, pb_row_label label) {
  size_t mask = b->slots - 1, at = label_hash(label) & mask;
  while (b->slot[at] && !same_label(b->file->label[b->slot[at] - 1], label)) at = (at + 1) & mask;
  return &b->slot[at];
}

static pb_status grow_labels(pb_matrix_build *b, pb_error *err) {
  size_t capacity = b->label_capacity ? 2 * b->label_capacity : 256;
  size_t *slot = calloc(4 * capacity, sizeof *slot);
  if (!slot || !grow(&b->file->label, capacity, sizeof *b->file->label)) {
    free(slot);
    return pb_fail_memory(err, "matrix rows");
  }
  free(b->slot);
  b->slot = slot;
  b->slots = 4 * capacity;
  b->label_capacity = capacity;
  for (size_t i = 0; i < b->file->rows; i++) *find_slot(b, b->file->label[i]) = i + 1;
  return PB_OK;
}

pb_status pb_matrix_build_label(pb_matrix_build *b, pb_row_label label, int64_t *row,
                                pb_error *err) {
  if (b->file->rows == b->label_capacity) {
    pb_status st = grow_labels(b, err);
    if (st) return st;
  }
  size_t *slot = find_slot(b, label);
  if (!*slot) {
    b->file->label[b->file->rows++] = label;
    *slot = b->file->rows;
  }
  *row = (int64_t)*slot - 1;
  return PB_OK;
}

typedef struct placed_label {
  pb_row_label label;
  size_t from;
} placed_label;

static int label_order(const void *a, const void *b) {
  const pb_row_label *x = &((const placed_label *)a)->label, *y = &((const placed_label *)b)->label;
  int modal = !x->direction - !y->direction;
  if (modal) return modal;
  if (x->node != y->node) return x->node < y->node ? -1 : 1;
  return x->direction - y->direction;
}

pb_status pb_matrix_build_sort(pb_matrix_build *b, pb_error *err) {
  pb_matrix_file *f = b->file;
  f->cols = f->rows;
  if (!f->rows) return PB_OK;
  placed_label *placed = malloc(f->rows * sizeof *placed);
  int64_t *to = malloc(f->rows * sizeof *to);
  pb_status st = placed && to ? PB_OK : pb_fail_memory(err, "matrix rows");
  if (!st) {
    for (size_t i = 0; i < f->rows; i++) placed[i] = (placed_label){f->label[i], i};
    qsort(placed, f->rows, sizeof *placed, label_order);
    for (size_t i = 0; i < f->rows; i++) {
      f->label[i] = placed[i].label;
      to[placed[i].from] = (int64_t)i;
    }
    for (size_t k = 0; k < f->count; k++) {
      f->row[k] = to[f->row[k]];
      f->col[k] = to[f->col[k]];
    }
  }
  free(placed);
  free(to);
  return st;
}

void pb_matrix_build_judge_half(pb_matrix_build *b) {
  bool upper = false, lower = false;
  for (size_t k = 0; k < b->file->count && !(upper && lower); k++) {
    upper |= b->file->row[k] < b->file->col[k];
    lower |= b->file->row[k] > b->file->col[k];
  }
  b->file->half = upper != lower;
}

void pb_matrix_build_end(pb_matrix_build *b) {
  free(b->slot);
  b->slot = NULL;
}
