// A square matrix as a table: one row per line, numbers apart by commas, semicolons, tabs or
// blanks; the first line may be a header without numbers.
#include <string.h>

#include "part/matrix_build.h"

static pb_status read_row(pb_lines *in, pb_matrix_build *b) {
  pb_matrix_file *f = b->file;
  char *at = in->text;
  size_t col = 0;
  double value;
  while (pb_scan_real(&at, &value)) {
    pb_status st = PB_OK;
    if (value != 0) st = pb_matrix_build_add(b, (int64_t)f->rows, (int64_t)col, value, in->err);
    if (st) return st;
    col++;
    if (!pb_scan_separator(&at, ",;")) break;
  }
  if (!pb_scan_done(at)) return pb_lines_fail(in, "expected a number at '%.20s'", at);
  if (!f->rows) f->cols = col;
  if (col != f->cols)
    return pb_lines_fail(in, "%zu numbers where the rows before have %zu", col, f->cols);
  f->rows++;
  return PB_OK;
}

pb_status pb_read_csv(pb_lines *in, const char *name, pb_matrix_build *b) {
  (void)name;
  b->file->format = PB_FORMAT_CSV;
  while (pb_lines_next_filled(in)) {
    if (in->number == 1 && !strpbrk(in->text, "0123456789")) continue;
    pb_status st = read_row(in, b);
    if (st) return st;
  }
  if (in->status) return in->status;
  if (b->file->rows != b->file->cols)
    return pb_lines_fail(in, "the file ends after %zu rows of %zu numbers, not a square matrix",
                         b->file->rows, b->file->cols);
  return PB_OK;
}
