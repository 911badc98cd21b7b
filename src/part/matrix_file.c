// Matrices from outside programs: see matrix_file.h.
#include "part/matrix_file.h"

#include <ctype.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "part/matrix_build.h"

const char *pb_matrix_format_name(pb_matrix_format format) {
  switch (format) {
  case PB_FORMAT_MATRIX_MARKET:
    return "Matrix Market";
  case PB_FORMAT_ANSYS_MMF:
    return "Ansys MMF";
  case PB_FORMAT_ANSYS_PRINT:
    return "Ansys *PRINT";
  case PB_FORMAT_CALCULIX:
    return "CalculiX";
  case PB_FORMAT_NASTRAN_DMIG:
    return "NASTRAN DMIG";
  case PB_FORMAT_ABAQUS_MTX:
    return "Abaqus .mtx";
  case PB_FORMAT_CSV:
    return "CSV";
  case PB_FORMAT_MAT5:
    return "MAT v5";
  case PB_FORMAT_UNKNOWN:
    break;
  }
  return "unknown";
}

// ---- detection ----------------------------------------------------------------------------------

static bool starts_with(const char *text, const char *word) {
  return !strncasecmp(text, word, strlen(word));
}

// Numbers of a line with any separators; −1: something else is in it. *commas counts those.
static int count_numbers(const char *text, int *commas) {
  char *at = (char *)text;
  int count = 0;
  double value;
  *commas = 0;
  for (const char *c = text; *c; c++) *commas += *c == ',' || *c == ';';
  while (pb_scan_real(&at, &value)) {
    count++;
    pb_scan_separator(&at, ",;");
  }
  return pb_scan_done(at) ? count : -1;
}

// "i j  v" as printed by CalculiX: blanks, and a value of 20 columns with 13 decimals.
static bool is_calculix_entry(const char *text) {
  size_t length = strlen(text);
  const char *point = strrchr(text, '.');
  return length > 23 && point && text + length - point == 18 &&
         strspn(point + 1, "0123456789") == 13;
}

static pb_matrix_format judge_numbers(const char *text) {
  int commas = 0, count = count_numbers(text, &commas);
  if (count == 3 && !commas && is_calculix_entry(text)) return PB_FORMAT_CALCULIX;
  if (count == 3 || count == 5) return PB_FORMAT_ABAQUS_MTX;
  return count >= 6 ? PB_FORMAT_CSV : PB_FORMAT_UNKNOWN;
}

static pb_matrix_format judge_line(const char *text) {
  while (*text == ' ' || *text == '\t') text++;
  if (starts_with(text, "%%MatrixMarket")) return PB_FORMAT_MATRIX_MARKET;
  if (starts_with(text, "DMIG")) return PB_FORMAT_NASTRAN_DMIG;
  if (starts_with(text, "*USER ELEMENT") || starts_with(text, "*MATRIX"))
    return PB_FORMAT_ABAQUS_MTX;
  if (text[0] == '[') return PB_FORMAT_ANSYS_PRINT;
  return judge_numbers(text);
}

static bool is_mat5(const char *path, bool *hdf) {
  char head[128] = {0};
  FILE *stream = fopen(path, "rb");
  size_t got = stream ? fread(head, 1, sizeof head, stream) : 0;
  if (stream) fclose(stream);
  *hdf = !memcmp(head, "MATLAB 7.3", 10);
  bool order = !memcmp(head + 126, "IM", 2) || !memcmp(head + 126, "MI", 2);
  return got == sizeof head && order && !*hdf;
}

enum { DETECTION_LINES = 1000 };

pb_status pb_matrix_file_detect(const char *path, pb_matrix_format *out, pb_error *err) {
  *out = PB_FORMAT_UNKNOWN;
  bool hdf = false;
  if (is_mat5(path, &hdf)) {
    *out = PB_FORMAT_MAT5;
    return PB_OK;
  }
  pb_lines in;
  pb_status st = pb_lines_open(&in, path, err);
  while (!st && !*out && in.number < DETECTION_LINES && pb_lines_next(&in))
    *out = judge_line(in.text);
  // Not a text, or cut: the reader tells, not the detection.
  if (!st && in.status != PB_ERR_SYNTAX) st = in.status;
  pb_lines_close(&in);
  return st;
}

// ---- reading ------------------------------------------------------------------------------------

static pb_matrix_reader *reader_of(pb_matrix_format format) {
  switch (format) {
  case PB_FORMAT_MATRIX_MARKET:
  case PB_FORMAT_ANSYS_MMF:
    return pb_read_matrix_market;
  case PB_FORMAT_CALCULIX:
    return pb_read_calculix;
  case PB_FORMAT_ANSYS_PRINT:
    return pb_read_ansys_print;
  case PB_FORMAT_NASTRAN_DMIG:
    return pb_read_dmig;
  case PB_FORMAT_ABAQUS_MTX:
    return pb_read_abaqus;
  case PB_FORMAT_CSV:
    return pb_read_csv;
  case PB_FORMAT_MAT5:
  case PB_FORMAT_UNKNOWN:
    break;
  }
  return NULL;
}

static pb_status read_text(const char *path, const char *name, pb_matrix_reader *read,
                           pb_matrix_file *out, pb_error *err) {
  pb_lines in;
  pb_matrix_build build = {.file = out};
  pb_status st = pb_lines_open(&in, path, err);
  if (!st) st = read(&in, name, &build);
  pb_matrix_build_end(&build);
  pb_lines_close(&in);
  return st;
}

pb_status pb_matrix_file_read(const char *path, const char *name, pb_matrix_file *out,
                              pb_error *err) {
  pb_matrix_format format;
  *out = (pb_matrix_file){0};
  pb_status st = pb_matrix_file_detect(path, &format, err);
  pb_matrix_reader *read = reader_of(format);
  if (st) return st;
  if (read) {
    st = read_text(path, name, read, out, err);
  } else if (format == PB_FORMAT_MAT5) {
    st = pb_read_mat5(path, name, out, err);
  } else {
    st = pb_fail(err, PB_ERR_SYNTAX, path, "is in no format that is known here");
  }
  if (!st && (!out->rows || !out->count))
    st = pb_fail(err, PB_ERR_SYNTAX, path, "holds no entries");
  if (st) pb_matrix_file_clear(out);
  return st;
}

void pb_matrix_file_clear(pb_matrix_file *file) {
  free(file->row);
  free(file->col);
  free(file->value);
  free(file->label);
  *file = (pb_matrix_file){0};
}

// ---- symmetric ----------------------------------------------------------------------------------

typedef struct triangles {
  size_t upper, lower;  // entries off the diagonal
} triangles;

static triangles count_triangles(const pb_matrix_file *f) {
  triangles t = {0};
  for (size_t k = 0; k < f->count; k++) {
    t.upper += f->row[k] < f->col[k];
    t.lower += f->row[k] > f->col[k];
  }
  return t;
}

// One triangle with the diagonal as a matrix.
static pb_status take_triangle(const pb_matrix_file *f, bool upper, pb_sparse *out, pb_error *err) {
  size_t kept = 0;
  int64_t *row = malloc((f->count + 1) * sizeof *row), *col = malloc((f->count + 1) * sizeof *col);
  double *value = malloc((f->count + 1) * sizeof *value);
  pb_status st = row && col && value ? PB_OK : pb_fail_memory(err, "matrix");
  for (size_t k = 0; !st && k < f->count; k++) {
    if (upper ? f->row[k] > f->col[k] : f->row[k] < f->col[k]) continue;
    row[kept] = f->row[k];
    col[kept] = f->col[k];
    value[kept++] = f->value[k];
  }
  if (!st) st = pb_sparse_from_entries(f->rows, kept, row, col, value, out, err);
  free(row);
  free(col);
  free(value);
  return st;
}

// The mean of two triangles into `up`; an entry that one of them lacks is zero there. Both have
// their rows ascending. Places of `low` alone only pass where they are negligible, and are dropped.
static pb_status average(pb_sparse *up, const pb_sparse *low, const char *path, pb_error *err) {
  for (size_t j = 0; j < up->n; j++) {
    int64_t a = up->start[j], b = low->start[j];
    while (a < up->start[j + 1] || b < low->start[j + 1]) {
      int64_t ra = a < up->start[j + 1] ? up->row[a] : INT64_MAX;
      int64_t rb = b < low->start[j + 1] ? low->row[b] : INT64_MAX;
      int64_t row = ra < rb ? ra : rb;
      double x = ra == row ? up->value[a] : 0, y = rb == row ? low->value[b] : 0;
      double size = sqrt(fabs(pb_sparse_diagonal(up, (size_t)row) * pb_sparse_diagonal(up, j)));
      if (fabs(x - y) > 1e-6 * size)
        return pb_fail(err, PB_ERR_ELEMENT, path,
                       "is not symmetric: entry (%jd, %zu) is %g, entry (%zu, %jd) is %g",
                       (intmax_t)row + 1, j + 1, x, j + 1, (intmax_t)row + 1, y);
      if (ra == row) up->value[a++] = 0.5 * (x + y);
      if (rb == row) b++;
    }
  }
  return PB_OK;
}

void pb_matrix_file_reorder(pb_matrix_file *file, const int64_t *to) {
  for (size_t k = 0; k < file->count; k++) {
    file->row[k] = to[file->row[k]];
    file->col[k] = to[file->col[k]];
  }
}

pb_status pb_matrix_file_symmetric(const pb_matrix_file *file, const char *path, pb_sparse *out,
                                   pb_error *err) {
  *out = (pb_sparse){0};
  if (file->rows != file->cols)
    return pb_fail(err, PB_ERR_ELEMENT, path, "is %zu × %zu, not square", file->rows, file->cols);
  triangles t = count_triangles(file);
  if (!file->half && !t.upper != !t.lower)
    return pb_fail(err, PB_ERR_ELEMENT, path,
                   "is not symmetric: there are entries on one side of the diagonal only (is it "
                   "half of a symmetric matrix?)");
  if (file->half)
    return pb_sparse_from_entries(file->rows, file->count, file->row, file->col, file->value, out,
                                  err);
  pb_sparse low = {0};
  pb_status st = take_triangle(file, true, out, err);
  if (!st) st = take_triangle(file, false, &low, err);
  if (!st) st = average(out, &low, path, err);
  pb_sparse_clear(&low);
  if (st) pb_sparse_clear(out);
  return st;
}
