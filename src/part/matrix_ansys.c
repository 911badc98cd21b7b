// Matrices as Ansys prints them (*PRINT of a *DMAT or *SMAT to a file): a title and entries, many
// to a line, four digits or more:
//
//   MAT_K:
//   [  1,  1]: 1.650e+08 [  1,  2]: 2.568e+04 [  1,  3]:-1.416e+03 …
//
// Of sparse matrices only what is not zero is there. A file may hold several. Layout as in the
// examples of T. Dehaeze, fem_matlab_toolbox, github.com/tdehaeze.
#include <string.h>

#include "part/matrix_build.h"

static bool scan_character(char **at, char c) {
  char *p = *at + strspn(*at, " \t");
  if (*p != c) return false;
  *at = p + 1;
  return true;
}

// "NAME:" or "NAME :"; further words behind the colon are left aside.
static bool is_title(const char *text, char name[64]) {
  text += strspn(text, " \t");
  size_t length = strcspn(text, " \t:");
  const char *behind = text + length + strspn(text + length, " \t");
  if (!length || *behind != ':' || length > 63 || strpbrk(text, "[]")) return false;
  memcpy(name, text, length);
  name[length] = 0;
  return true;
}

// Places go on row by row or, of sparse matrices, column by column: at least never back.
static bool goes_on(const pb_matrix_file *f, size_t k, bool by_columns) {
  int64_t row = f->row[k] - f->row[k - 1], col = f->col[k] - f->col[k - 1];
  return row > 0 || (row == 0 && col > 0) || (by_columns && col > 0);
}

static pb_status read_entries(pb_lines *in, pb_matrix_build *b) {
  char *at = in->text;
  while (!pb_scan_done(at)) {
    int64_t row, col;
    double value;
    bool ok = scan_character(&at, '[') && pb_scan_integer(&at, &row) && scan_character(&at, ',') &&
              pb_scan_integer(&at, &col) && scan_character(&at, ']') && scan_character(&at, ':') &&
              pb_scan_real(&at, &value);
    if (!ok) return pb_lines_fail(in, "expected entries '[row, column]: value', at '%.20s'", at);
    if (row < 1 || col < 1 || row > UINT32_MAX || col > UINT32_MAX)
      return pb_lines_fail(in, "[%jd, %jd] is no place in a matrix", (intmax_t)row, (intmax_t)col);
    pb_status st = pb_matrix_build_add(b, row - 1, col - 1, value, in->err);
    if (st) return st;
    const pb_matrix_file *f = b->file;
    size_t last = f->count - 1;
    if (last > b->section[b->sections - 1].begin && !goes_on(f, last, true))
      return pb_lines_fail(in, "entry [%jd, %jd] follows on [%jd, %jd]", (intmax_t)row,
                           (intmax_t)col, (intmax_t)f->row[last - 1] + 1,
                           (intmax_t)f->col[last - 1] + 1);
  }
  return PB_OK;
}

// A dense matrix has its places row by row, and all of them: what is missing is found.
static pb_status check_order(const pb_matrix_build *b, const char *path, pb_error *err) {
  const pb_matrix_file *f = b->file;
  if (f->rows > 65536 || f->count <= f->rows * f->cols / 2) return PB_OK;
  for (size_t k = 1; k < f->count; k++)
    if (!goes_on(f, k, false))
      return pb_fail(err, PB_ERR_SYNTAX, path, "entry [%jd, %jd] follows on [%jd, %jd]",
                     (intmax_t)f->row[k] + 1, (intmax_t)f->col[k] + 1, (intmax_t)f->row[k - 1] + 1,
                     (intmax_t)f->col[k - 1] + 1);
  if (f->half || (f->count == f->rows * f->cols && f->rows == f->cols)) return PB_OK;
  return pb_fail(err, PB_ERR_SYNTAX, path,
                 "holds %zu entries of a %zu × %zu matrix: it is cut or not square", f->count,
                 f->rows, f->cols);
}

pb_status pb_read_ansys_print(pb_lines *in, const char *name, pb_matrix_build *b) {
  pb_matrix_file *f = b->file;
  char title[64];
  f->format = PB_FORMAT_ANSYS_PRINT;
  while (pb_lines_next_filled(in)) {
    pb_status st;
    if (is_title(in->text, title)) {
      st = pb_matrix_build_section(b, in, title);
    } else {
      st = b->sections ? PB_OK : pb_matrix_build_section(b, in, "unnamed");
      if (!st) st = read_entries(in, b);
    }
    if (st) return st;
  }
  if (in->status) return in->status;
  pb_status st = pb_matrix_build_choose(b, in->path, name, NULL, in->err);
  for (size_t k = 0; !st && k < f->count; k++) {
    if ((size_t)f->row[k] >= f->rows) f->rows = (size_t)f->row[k] + 1;
    if ((size_t)f->col[k] >= f->cols) f->cols = (size_t)f->col[k] + 1;
  }
  if (!st) st = pb_matrix_build_judge_half(b, in->err);
  if (!st) st = check_order(b, in->path, in->err);
  return st;
}
