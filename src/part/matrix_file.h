// Matrices from outside programs, as entries with what the file says of their rows.
//
// Readers exist for Matrix Market, Ansys MMF and *PRINT listings, CalculiX .sti/.mas with .dof,
// NASTRAN DMIG punch files, Abaqus .mtx (matrix input and coordinate form), CSV; a file is
// recognised by its content. Big ones (10⁷ entries) are read in one pass. Errors name file and
// line.
#ifndef PB_PART_MATRIX_FILE_H
#define PB_PART_MATRIX_FILE_H

#include <stdbool.h>
#include <stdint.h>

#include "base/status.h"
#include "part/sparse.h"

typedef enum pb_matrix_format {
  PB_FORMAT_UNKNOWN,
  PB_FORMAT_MATRIX_MARKET,
  PB_FORMAT_ANSYS_MMF,
  PB_FORMAT_ANSYS_PRINT,
  PB_FORMAT_CALCULIX,
  PB_FORMAT_NASTRAN_DMIG,
  PB_FORMAT_ABAQUS_MTX,
  PB_FORMAT_CSV,
  PB_FORMAT_MAT5,
} pb_matrix_format;

// One row's label: the node's number in the outside program and the direction 1…6, or 0 for a
// generalised (modal) coordinate.
typedef struct pb_row_label {
  int64_t node;
  int direction;
} pb_row_label;

typedef struct pb_matrix_file {
  pb_matrix_format format;
  size_t rows, cols;
  size_t count;        // entries
  int64_t *row, *col;  // [count] from 0
  double *value;       // [count]
  bool
      half;  // one triangle of a symmetric matrix is stored: each entry stands for its mirror image
  pb_row_label *label;  // [rows], or NULL where the format tells none
} pb_matrix_file;

const char *pb_matrix_format_name(pb_matrix_format format);

// Judges by the first part of the content. PB_FORMAT_UNKNOWN is not an error. Fails with PB_ERR_IO.
// [init]
pb_status pb_matrix_file_detect(const char *path, pb_matrix_format *out, pb_error *err);

// Reads one matrix; `name` picks one where a file holds several (DMIG, MAT, *PRINT: "K", "M"), else
// it may be NULL. Fails with PB_ERR_IO, PB_ERR_SYNTAX (where = "file:line"), PB_ERR_MEMORY. [init]
pb_status pb_matrix_file_read(const char *path, const char *name, pb_matrix_file *out,
                              pb_error *err);
void pb_matrix_file_clear(pb_matrix_file *file);

// Row i becomes row to[i], columns alike. Labels stay. [any]
void pb_matrix_file_reorder(pb_matrix_file *file, const int64_t *to);

// As a symmetric sparse matrix: of a `half` file its entries as they are; of another one the mean
// of both triangles where they agree to 1e-6 of √(x_ii x_jj), else PB_ERR_ELEMENT, which says so
// where only one triangle is there. Entries of equal place are added up. Fails with PB_ERR_MEMORY,
// too. path names the file in errors. [init]
pb_status pb_matrix_file_symmetric(const pb_matrix_file *file, const char *path, pb_sparse *out,
                                   pb_error *err);

// Labels of the rows of a matrix in their order. Readers: Ansys MLIST listings (the masters),
// CalculiX .dof files, CSV (node, direction).
typedef struct pb_dof_file {
  size_t count;
  pb_row_label *label;  // [count]
} pb_dof_file;

// Whether a file, of nodes as a rule, has an Ansys list of masters in it. [init]
pb_status pb_dof_file_has_masters(const char *path, bool *out, pb_error *err);

// Fails with PB_ERR_IO, PB_ERR_SYNTAX, PB_ERR_MEMORY. [init]
pb_status pb_dof_file_read(const char *path, pb_dof_file *out, pb_error *err);
void pb_dof_file_clear(pb_dof_file *file);

// A node list: numbers and coordinates. Readers: Ansys NLIST and MLIST listings, CalculiX/Abaqus
// *NODE blocks, CSV (node, x, y, z), Matrix Market and MAT n × 3 arrays (numbered from 1).
typedef struct pb_node_file {
  size_t count;
  int64_t *number;  // [count] ascending
  double *xyz;      // 3 × count
} pb_node_file;

// Place of a number in an ascending list; SIZE_MAX: it is not there. [any]
size_t pb_node_index(const int64_t *number, size_t count, int64_t wanted);

pb_status pb_node_file_read(const char *path, pb_node_file *out, pb_error *err);
void pb_node_file_clear(pb_node_file *file);

#endif
