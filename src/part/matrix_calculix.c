// Matrices as CalculiX stores them (*FREQUENCY, SOLVER=MATRIXSTORAGE): NAME.sti and NAME.mas hold
// "row column value" from 1, the upper triangle column by column; NAME.dof says of each row the
// node and direction as "node.direction". Observed with version 2.20.
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "part/matrix_build.h"

// NAME.dof beside NAME.sti or NAME.mas, owned by the caller; NULL: out of memory.
static char *dof_path(const char *path) {
  const char *slash = strrchr(path, '/'), *dot = strrchr(path, '.');
  size_t stem = dot && (!slash || dot > slash) ? (size_t)(dot - path) : strlen(path);
  pb_text text = {0};
  pb_text_append_n(&text, path, stem);
  pb_text_append(&text, ".dof");
  return text.failed ? NULL : text.text;
}

// Labels of the rows where there is a .dof file, which then has to fit.
static pb_status add_labels(pb_lines *in, pb_matrix_file *f) {
  char *path = dof_path(in->path);
  if (!path) return pb_fail_memory(in->err, in->path);
  FILE *there = fopen(path, "rb");
  pb_dof_file dofs = {0};
  pb_status st = PB_OK;
  if (there) {
    fclose(there);
    st = pb_dof_file_read(path, &dofs, in->err);
    if (!st && dofs.count != f->rows)
      st = pb_fail(in->err, PB_ERR_SYNTAX, path, "tells of %zu rows, the matrix %s has %zu",
                   dofs.count, in->path, f->rows);
    if (!st) {
      f->label = dofs.label;
      dofs.label = NULL;
    }
  }
  pb_dof_file_clear(&dofs);
  free(path);
  return st;
}

// Every row has its diagonal entry and columns ascend, so a file that was cut at a line's end is
// found by the diagonal entry that its last column lacks.
pb_status pb_read_calculix(pb_lines *in, const char *name, pb_matrix_build *b) {
  (void)name;
  pb_matrix_file *f = b->file;
  f->format = PB_FORMAT_CALCULIX;
  f->half = true;
  int64_t column = 0, last_row = 0;
  pb_status st = in->bytes ? pb_matrix_build_reserve(b, in->bytes / 24 + 1, in->err) : PB_OK;
  while (!st && pb_lines_next(in)) {
    int64_t row, col;
    double value;
    char *at = in->text;
    bool ok = pb_scan_integer(&at, &row) && pb_scan_integer(&at, &col) && pb_scan_real(&at, &value);
    if (!ok || !pb_scan_done(at))
      st = pb_lines_fail(in, "expected row, column and a real number");
    else if (row < 1 || row > col)
      st = pb_lines_fail(in, "entry (%jd, %jd) is not in the upper triangle", (intmax_t)row,
                         (intmax_t)col);
    else if (col != column && (col != column + 1 || last_row != column))
      st = pb_lines_fail(in, "column %jd follows on column %jd, row %jd: lines are missing",
                         (intmax_t)col, (intmax_t)column, (intmax_t)last_row);
    else
      st = pb_matrix_build_add(b, row - 1, col - 1, value, in->err);
    column = col;
    last_row = row;
  }
  if (!st) st = in->status;
  if (!st && (!column || last_row != column))
    st = pb_lines_fail(in, "the file ends within column %jd", (intmax_t)column);
  f->rows = f->cols = (size_t)column;
  return st ? st : add_labels(in, f);
}
