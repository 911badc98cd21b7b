// MAT v5 files: see matfile.h.
//
// Written here and not by a library so that a full disk is noticed: matio patches each element's
// size to what reached the file, and says nothing. Format: MathWorks, "MAT-File Format", level 5: a
// header of 128 bytes, then one miMATRIX element a variable, made of flags, dimensions, name and
// data; every element is a type, a size and its bytes, padded to a multiple of eight. Byte order:
// this machine's.
#include "matfile.h"

#include <ctype.h>
#include <errno.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "outfile.h"

enum { MI_INT8 = 1, MI_INT32 = 5, MI_UINT32 = 6, MI_DOUBLE = 9, MI_MATRIX = 14, MI_UTF8 = 16 };
enum { MX_CELL = 1, MX_CHAR = 4, MX_DOUBLE = 6, COMPLEX = 0x0800 };

struct pb_matfile {
  pb_outfile file;
  FILE *stream;
  pb_error error; // the first failure; code PB_OK: none
};

pb_status pb_matfile_open(const char *path, pb_matfile **out, pb_error *err) {
  *out = NULL;
  pb_matfile *made = calloc(1, sizeof *made);
  if (!made) return pb_fail_memory(err, path);
  pb_status status = pb_outfile_create(path, &made->file, err);
  if (!status) {
    made->stream = fopen(made->file.temp, "wb");
    if (!made->stream) {
      status = pb_fail(err, PB_ERR_IO, path, "cannot be written: %s", strerror(errno));
    }
  }
  if (status) {
    pb_matfile_discard(made);
    return status;
  }
  // No date: the same data gives the same bytes.
  const uint16_t version[2] = {0x0100, 'M' << 8 | 'I'};
  fprintf(made->stream, "%-116.116s%8s", "MATLAB 5.0 MAT-file, created by plantbus " PB_VERSION,
          "");
  fwrite(version, sizeof version, 1, made->stream);
  *out = made;
  return PB_OK;
}

// ---- elements -----------------------------------------------------------------------------------

static size_t padded(size_t bytes) {
  return (bytes + 7) / 8 * 8;
}

static void put_tag(FILE *stream, uint32_t type, size_t bytes) {
  const uint32_t tag[2] = {type, (uint32_t)bytes};
  fwrite(tag, sizeof tag, 1, stream);
}

static void put_padding(FILE *stream, size_t bytes) {
  static const char zeros[8];
  fwrite(zeros, 1, padded(bytes) - bytes, stream);
}

static void put_element(FILE *stream, uint32_t type, const void *data, size_t bytes) {
  put_tag(stream, type, bytes);
  if (bytes) fwrite(data, 1, bytes, stream);
  put_padding(stream, bytes);
}

// Bytes of a matrix element after its tag, for `data` bytes of data elements with their tags.
static size_t matrix_size(const char *name, int rank, size_t data) {
  return 16 + 8 + padded(4 * (size_t)rank) + 8 + padded(strlen(name)) + data;
}

static void put_matrix_head(FILE *stream, const char *name, uint32_t flags, int rank,
                            const size_t *dims, size_t data) {
  const uint32_t array_flags[2] = {flags, 0};
  int32_t size[3];
  for (int i = 0; i < rank; i++) size[i] = (int32_t)dims[i];
  put_tag(stream, MI_MATRIX, matrix_size(name, rank, data));
  put_element(stream, MI_UINT32, array_flags, sizeof array_flags);
  put_element(stream, MI_INT32, size, 4 * (size_t)rank);
  put_element(stream, MI_INT8, name, strlen(name));
}

static bool is_identifier(const char *name) {
  if (!isalpha((unsigned char)name[0]) || strlen(name) > 63) return false;
  for (; *name; name++) {
    if (!isalnum((unsigned char)*name) && *name != '_') return false;
  }
  return true;
}

// Checks what the format can hold: a name, and sizes of 31 bits.
static bool may_write(pb_matfile *mat, const char *name, size_t bytes) {
  if (mat->error.code) return false;
  if (!is_identifier(name)) {
    pb_fail(&mat->error, PB_ERR_ARGUMENT, mat->file.path, "'%s' is not a MATLAB identifier", name);
  } else if (bytes > INT32_MAX - 1024) {
    pb_fail(&mat->error, PB_ERR_ARGUMENT, mat->file.path, "variable '%s' is larger than 2 GB",
            name);
  }
  return mat->error.code == PB_OK;
}

// ---- numbers ------------------------------------------------------------------------------------

static void put_real(pb_matfile *mat, const char *name, int rank, const size_t *dims, size_t count,
                     const double *data) {
  if (!may_write(mat, name, 8 * count)) return;
  put_matrix_head(mat->stream, name, MX_DOUBLE, rank, dims, 8 + 8 * count);
  put_element(mat->stream, MI_DOUBLE, data, 8 * count);
}

void pb_matfile_scalar(pb_matfile *mat, const char *name, double value) {
  pb_matfile_real(mat, name, 1, 1, &value);
}

void pb_matfile_real(pb_matfile *mat, const char *name, size_t rows, size_t cols,
                     const double *data) {
  const size_t dims[2] = {rows, cols};
  put_real(mat, name, 2, dims, rows * cols, data);
}

void pb_matfile_complex(pb_matfile *mat, const char *name, size_t rows, size_t cols,
                        const double complex *data) {
  const size_t count = rows * cols, dims[2] = {rows, cols};
  if (!may_write(mat, name, 16 * count)) return;
  put_matrix_head(mat->stream, name, MX_DOUBLE | COMPLEX, 2, dims, 16 + 16 * count);
  for (int part = 0; part < 2; part++) {
    put_tag(mat->stream, MI_DOUBLE, 8 * count);
    for (size_t i = 0; i < count; i++) fwrite((const double *)&data[i] + part, 8, 1, mat->stream);
  }
}

void pb_matfile_frf(pb_matfile *mat, const char *name, size_t nf, size_t ny, size_t nu,
                    const double complex *h) {
  const size_t count = nf * ny * nu, dims[3] = {ny, nu, nf};
  if (!may_write(mat, name, 16 * count)) return;
  put_matrix_head(mat->stream, name, MX_DOUBLE | COMPLEX, 3, dims, 16 + 16 * count);
  for (int part = 0; part < 2; part++) {
    put_tag(mat->stream, MI_DOUBLE, 8 * count);
    for (size_t k = 0; k < count; k++) {
      size_t o = k % ny, i = k / ny % nu, f = k / ny / nu;
      fwrite((const double *)&h[(f * ny + o) * nu + i] + part, 8, 1, mat->stream);
    }
  }
}

// ---- texts --------------------------------------------------------------------------------------

// Characters of UTF-8: every byte but the continuation bytes.
static size_t character_count(const char *text) {
  size_t count = 0;
  for (; *text; text++) count += (*text & 0xC0) != 0x80;
  return count;
}

static size_t text_data_size(const char *text) {
  return 8 + padded(strlen(text));
}

// Dimensions count characters, the data element counts bytes.
static void put_text(pb_matfile *mat, const char *name, const char *text) {
  size_t dims[2] = {text[0] != 0, character_count(text)};
  put_matrix_head(mat->stream, name, MX_CHAR, 2, dims, text_data_size(text));
  put_element(mat->stream, MI_UTF8, text, strlen(text));
}

void pb_matfile_text(pb_matfile *mat, const char *name, const char *text) {
  if (may_write(mat, name, strlen(text))) put_text(mat, name, text);
}

void pb_matfile_names(pb_matfile *mat, const char *name, const char *const *text, size_t count) {
  size_t bytes = 0, dims[2] = {count, 1};
  for (size_t i = 0; i < count; i++) bytes += 8 + matrix_size("", 2, text_data_size(text[i]));
  if (!may_write(mat, name, bytes)) return;
  put_matrix_head(mat->stream, name, MX_CELL, 2, dims, bytes);
  for (size_t i = 0; i < count; i++) put_text(mat, "", text[i]);
}

// ---- end ----------------------------------------------------------------------------------------

pb_status pb_matfile_close(pb_matfile *mat, pb_error *err) {
  bool bad = ferror(mat->stream) != 0;
  bool written = fclose(mat->stream) == 0 && !bad;
  mat->stream = NULL;
  if (!written && !mat->error.code) {
    pb_fail(&mat->error, PB_ERR_IO, mat->file.path, "cannot be written: %s", strerror(errno));
  }
  pb_status status = mat->error.code;
  if (status) {
    if (err) *err = mat->error;
  } else {
    status = pb_outfile_commit(&mat->file, err);
  }
  pb_matfile_discard(mat);
  return status;
}

void pb_matfile_discard(pb_matfile *mat) {
  if (!mat) return;
  if (mat->stream) fclose(mat->stream);
  pb_outfile_discard(&mat->file);
  free(mat);
}
