// A pb_matrix_file while it is read: entries one by one, rows by index or by label. For readers.
#ifndef PB_PART_MATRIX_BUILD_H
#define PB_PART_MATRIX_BUILD_H

#include "part/lines.h"
#include "part/matrix_file.h"

enum { PB_SECTIONS = 64 };

// One of several matrices in a file.
typedef struct pb_matrix_section {
  char name[64];
  size_t begin;  // its first entry
  bool full;     // both triangles by the file's own word
} pb_matrix_section;

typedef struct pb_matrix_build {
  pb_matrix_file *file;
  size_t capacity;  // of the entries
  size_t label_capacity;
  size_t *slot;  // hash table of labels: index + 1, 0: empty; [slots] a power of two
  size_t slots;
  size_t sections;
  pb_matrix_section section[PB_SECTIONS];
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

// Sets `half` where no entry off the diagonal has a mirror image, for formats that store a
// symmetric matrix by one triangle of an order of their own; puts the entries above the diagonal
// then. Fails with PB_ERR_MEMORY. [init]
pb_status pb_matrix_build_judge_half(pb_matrix_build *b, pb_error *err);

// Starts another matrix of the file. Fails with PB_ERR_SYNTAX: there are too many, or the name is
// there already. [init]
pb_status pb_matrix_build_section(pb_matrix_build *b, pb_lines *in, const char *name);

// Keeps the entries of one matrix: of the only one, of the one of exactly this name, or, with "K"
// or "M", of the one whose name stands for stiffness or mass (K, MAT_K, KAAX, STIFFNESS …). *chosen
// may be NULL. Fails with PB_ERR_SYNTAX, listing the names. [init]
pb_status pb_matrix_build_choose(pb_matrix_build *b, const char *path, const char *name,
                                 pb_matrix_section *chosen, pb_error *err);

void pb_matrix_build_end(pb_matrix_build *b);  // frees what only reading needs

// One format's reader: fills the builder from the open lines. name: which matrix, may be NULL.
typedef pb_status pb_matrix_reader(pb_lines *in, const char *name, pb_matrix_build *b);

pb_matrix_reader pb_read_matrix_market, pb_read_calculix, pb_read_ansys_print, pb_read_dmig,
    pb_read_abaqus, pb_read_csv;

// MAT v5 files are no text. name NULL: K or M, whichever is there.
pb_status pb_read_mat5(const char *path, const char *name, pb_matrix_file *out, pb_error *err);

#endif
