// Matrix Market files, those that Ansys writes with *EXPORT,…,MMF too: a banner, comments, the
// sizes, then one entry per line ("coordinate": row, column, value) or column by column ("array").
//
//   %%MatrixMarket matrix coordinate|array real|integer|double general|symmetric
//
// Of a symmetric matrix one triangle is stored. Source: R. Boisvert, R. Pozo, K. Remington, "The
// Matrix Market Exchange Formats: Initial Design", NISTIR 5935, 1996.
#include <string.h>
#include <strings.h>

#include "part/matrix_build.h"

typedef struct banner {
  bool array, symmetric;
} banner;

static pb_status read_banner(pb_lines *in, banner *out) {
  char word[5][32] = {{0}};
  if (!pb_lines_next(in)) return in->status ? in->status : pb_lines_fail(in, "the file is empty");
  int words =
      sscanf(in->text, "%31s %31s %31s %31s %31s", word[0], word[1], word[2], word[3], word[4]);
  if (words < 5 || strcasecmp(word[0], "%%MatrixMarket") || strcasecmp(word[1], "matrix"))
    return pb_lines_fail(in, "expected the banner '%%%%MatrixMarket matrix FORM TYPE SYMMETRY'");
  out->array = !strcasecmp(word[2], "array");
  if (!out->array && strcasecmp(word[2], "coordinate"))
    return pb_lines_fail(in, "'%s' is neither coordinate nor array", word[2]);
  if (strcasecmp(word[3], "real") && strcasecmp(word[3], "double") &&
      strcasecmp(word[3], "integer"))
    return pb_lines_fail(in, "values of type '%s' are not real numbers", word[3]);
  out->symmetric = !strcasecmp(word[4], "symmetric");
  if (!out->symmetric && strcasecmp(word[4], "general"))
    return pb_lines_fail(in, "'%s' is neither general nor symmetric", word[4]);
  return PB_OK;
}

// Comments and blank lines aside; those that name Ansys tell who wrote the file.
static bool next_line(pb_lines *in, pb_matrix_file *f) {
  while (pb_lines_next_filled(in)) {
    if (in->text[0] != '%') return true;
    if (strcasestr(in->text, "ansys")) f->format = PB_FORMAT_ANSYS_MMF;
  }
  return false;
}

// Entries of at least `least` bytes each must fit into the file: a damaged size is found before
// memory is taken for it.
static pb_status read_sizes(pb_lines *in, const banner *form, pb_matrix_file *f, size_t *count) {
  int64_t size[3] = {0};
  char *at;
  if (!next_line(in, f))
    return in->status ? in->status : pb_lines_fail(in, "the line with the sizes is missing");
  at = in->text;
  int wanted = form->array ? 2 : 3;
  for (int k = 0; k < wanted; k++)
    if (!pb_scan_integer(&at, &size[k]) || size[k] < (k < 2) || size[k] > INT64_MAX / 4096)
      return pb_lines_fail(in, "expected %d positive sizes", wanted);
  if (!pb_scan_done(at)) return pb_lines_fail(in, "more than %d sizes", wanted);
  if (form->symmetric && size[0] != size[1])
    return pb_lines_fail(in, "a symmetric matrix cannot have %jd rows and %jd columns",
                         (intmax_t)size[0], (intmax_t)size[1]);
  f->rows = (size_t)size[0];
  f->cols = (size_t)size[1];
  *count = (size_t)size[2];
  if (form->array) {
    if (f->rows > UINT32_MAX / 2 || f->cols > UINT32_MAX / 2)
      return pb_lines_fail(in, "%zu × %zu is too large", f->rows, f->cols);
    *count = form->symmetric ? f->rows * (f->rows + 1) / 2 : f->rows * f->cols;
  }
  size_t least = form->array ? 2 : 6;
  if (in->bytes && *count > in->bytes / least + 1)
    return pb_lines_fail(in, "%zu entries are announced, more than the file can hold", *count);
  return PB_OK;
}

static pb_status bad_entry(pb_lines *in, const char *expected, size_t k, size_t count) {
  if (in->status) return in->status;
  return pb_lines_fail(in, "expected %s (entry %zu of %zu)", expected, k + 1, count);
}

static pb_status ended_early(pb_lines *in, size_t k, size_t count) {
  if (in->status) return in->status;
  return pb_lines_fail(in, "the file ends after %zu of %zu entries", k, count);
}

// Of a symmetric matrix one triangle is stored, either one: with both each entry would count twice.
static pb_status read_coordinate(pb_lines *in, pb_matrix_build *b, bool symmetric, size_t count) {
  pb_matrix_file *f = b->file;
  bool upper = false, lower = false;
  for (size_t k = 0; k < count; k++) {
    int64_t row, col;
    double value;
    if (!next_line(in, f)) return ended_early(in, k, count);
    char *at = in->text;
    bool ok = pb_scan_integer(&at, &row) && pb_scan_integer(&at, &col) && pb_scan_real(&at, &value);
    if (!ok || !pb_scan_done(at)) return bad_entry(in, "row, column and a real number", k, count);
    if (row < 1 || col < 1 || (size_t)row > f->rows || (size_t)col > f->cols)
      return pb_lines_fail(in, "entry (%jd, %jd) lies outside the %zu × %zu matrix", (intmax_t)row,
                           (intmax_t)col, f->rows, f->cols);
    upper |= row < col;
    lower |= row > col;
    if (symmetric && upper && lower)
      return pb_lines_fail(in, "entry (%jd, %jd) of a symmetric matrix, stored by its %s triangle",
                           (intmax_t)row, (intmax_t)col, row < col ? "lower" : "upper");
    pb_status st = pb_matrix_build_add(b, row - 1, col - 1, value, in->err);
    if (st) return st;
  }
  return PB_OK;
}

static pb_status read_array(pb_lines *in, pb_matrix_build *b, bool symmetric, size_t count) {
  pb_matrix_file *f = b->file;
  size_t k = 0;
  for (size_t col = 0; col < f->cols; col++) {
    for (size_t row = symmetric ? col : 0; row < f->rows; row++, k++) {
      double value;
      if (!next_line(in, f)) return ended_early(in, k, count);
      char *at = in->text;
      if (!pb_scan_real(&at, &value) || !pb_scan_done(at))
        return bad_entry(in, "one real number", k, count);
      pb_status st = PB_OK;
      if (value != 0) st = pb_matrix_build_add(b, (int64_t)row, (int64_t)col, value, in->err);
      if (st) return st;
    }
  }
  return PB_OK;
}

pb_status pb_read_matrix_market(pb_lines *in, const char *name, pb_matrix_build *b) {
  (void)name;
  banner form = {0};
  size_t count = 0;
  b->file->format = PB_FORMAT_MATRIX_MARKET;
  pb_status st = read_banner(in, &form);
  if (!st) st = read_sizes(in, &form, b->file, &count);
  b->file->half = form.symmetric;
  if (!st) st = pb_matrix_build_reserve(b, count + 1, in->err);
  if (!st)
    st = form.array ? read_array(in, b, form.symmetric, count)
                    : read_coordinate(in, b, form.symmetric, count);
  if (!st && next_line(in, b->file))
    st = pb_lines_fail(in, "more than the %zu entries that the header announces", count);
  return st ? st : in->status;
}
