// A pb_matrix_file while it is read: entries one by one, rows by index or by label. For readers.
#ifndef PB_PART_MATRIX_BUILD_H
#define PB_PART_MATRIX_BUILD_H

#include "part/lines.h"
#include "part/matrix_file.h"

// One format's reader: fills the builder from the open lines. name: which matrix, may be NULL.
typedef struct pb_matrix_build {
  pb_matrix_file *file;
  size_t capacity;  // of the entries
  size_t label_capacity;
  size_t *slot;  // hash table of labels: index + 1, 0: empty; [slots] a power of two
  size_t slots;
} pb_matrix_build;

// Room for `count` entries in all. Fails with PB_ERR_MEMORY. [init]
pb_status pb_matrix_build_reserve(pb_matrix_build *b, size_t count, pb_error *err);

// Appends an entry (rows from 0); rows and cols of the file are the caller's to set. [init]
static inline pb_status pb_matrix_build_add(pb_matrix_build *b, int64_t row, int64_t col,
                                            double value, pb_error *err) {
  pb_matrix_file *f = b->file;
  if (f->count == b->capacity) {
    pb_status st = pb_matrix_build_reserve(b, f->count < 512 ? 1024 : 2 * f->count, err);
    if (st) return st;
  }
  f->row[f->count] = row;
  f->col[f->count] = col;
  f->value[f->count++] = value;
  return PB_OK;
}

// The row of a label, in the order of first appearance; a new one is appended. [init]
pb_status pb_matrix_build_label(pb_matrix_build *b, pb_row_label label, int64_t *row,
                                pb_error *err);

// Puts the rows in the order of their labels: by node and direction, those of direction 0 last.
// Sets rows and cols. [init]
pb_status pb_matrix_build_sort(pb_matrix_build *b, pb_error *err);

// Sets `half` where all entries off the diagonal, one at least, lie in a single triangle: for
// formats that do not say what they store. [any]
void pb_matrix_build_judge_half(pb_matrix_build *b);

void pb_matrix_build_end(pb_matrix_build *b);  // frees what only reading needs

typedef pb_status pb_matrix_reader(pb_lines *in, const char *name, pb_matrix_build *b);

pb_matrix_reader pb_read_matrix_market, pb_read_calculix;

#endif
