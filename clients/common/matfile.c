// MAT v5 files by way of matio: see matfile.h.
//
// matio does not tell when a write fails (it patches the size of each element to what reached the
// file), so the bytes that the variables need are counted and the file is measured at the end. As
// it also goes back in the file, what is no regular file (a pipe, a device) gets a copy of one.
#include "matfile.h"

#include <ctype.h>
#include <errno.h>
#include <matio.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "outfile.h"

struct pb_matfile {
  pb_outfile file;
  char scratch[32];  // what is copied to file at the end; "": file itself is written
  mat_t *mat;
  size_t needed;   // bytes of data handed to matio, at least
  pb_error error;  // the first failure; code PB_OK: none
};

enum { HEADER = 128 };

static pb_status make_scratch(pb_matfile *mat, pb_error *err) {
  snprintf(mat->scratch, sizeof mat->scratch, "/tmp/plantbus-XXXXXX");
  int fd = mkstemp(mat->scratch);
  if (fd >= 0) close(fd);
  if (fd >= 0) return PB_OK;
  mat->scratch[0] = 0;
  return pb_fail(err, PB_ERR_IO, mat->file.path, "no temporary file: %s", strerror(errno));
}

static const char *written_path(const pb_matfile *mat) {
  return mat->scratch[0] ? mat->scratch : mat->file.temp;
}

pb_status pb_matfile_open(const char *path, pb_matfile **out, pb_error *err) {
  *out = NULL;
  pb_matfile *made = calloc(1, sizeof *made);
  if (!made) return pb_fail_memory(err, path);
  made->needed = HEADER;
  pb_status status = pb_outfile_create(path, &made->file, err);
  if (!status && made->file.direct) status = make_scratch(made, err);
  if (!status) {
    // A header of our own has no date in it: the same data give the same bytes.
    made->mat = Mat_CreateVer(written_path(made),
                              "MATLAB 5.0 MAT-file, created by plantbus " PB_VERSION, MAT_FT_MAT5);
    if (!made->mat) status = pb_fail(err, PB_ERR_IO, path, "cannot be written");
  }
  if (status) {
    pb_matfile_discard(made);
    return status;
  }
  *out = made;
  return PB_OK;
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

// Writes the variable (NULL: it could not be made) and frees it. data: bytes of its numbers.
static void put(pb_matfile *mat, matvar_t *v, const char *name, size_t data) {
  if (!v) {
    pb_fail_memory(&mat->error, mat->file.path);
  } else if (Mat_VarWrite(mat->mat, v, MAT_COMPRESSION_NONE)) {
    pb_fail(&mat->error, PB_ERR_IO, mat->file.path, "variable '%s' cannot be written", name);
  }
  mat->needed += data;
  Mat_VarFree(v);
}

// ---- numbers ------------------------------------------------------------------------------------

// Tags, flags, sizes and a name of at least one character: what matio writes before the numbers.
enum { MATRIX_HEAD = 8 + 16 + 16 + 8 + 8 };

void pb_matfile_scalar(pb_matfile *mat, const char *name, double value) {
  pb_matfile_real(mat, name, 1, 1, &value);
}

void pb_matfile_real(pb_matfile *mat, const char *name, size_t rows, size_t cols,
                     const double *data) {
  size_t dims[2] = {rows, cols}, bytes = 8 * rows * cols;
  if (!may_write(mat, name, bytes)) return;
  double none = 0;
  matvar_t *v =
      Mat_VarCreate(name, MAT_C_DOUBLE, MAT_T_DOUBLE, 2, dims, data ? (void *)data : &none, 0);
  put(mat, v, name, MATRIX_HEAD + bytes);
}

// Splits `count` complex numbers, the k-th at index order(k), into the two arrays that matio wants.
static void put_complex(pb_matfile *mat, const char *name, int rank, size_t *dims, size_t count,
                        const double complex *data, size_t (*order)(size_t, const size_t *)) {
  if (count == 0) {  // matio frees what it never allocated of an empty complex variable
    pb_matfile_real(mat, name, dims[0], dims[1], NULL);
    return;
  }
  if (!may_write(mat, name, 16 * count)) return;
  double *part = malloc((2 * count + 1) * sizeof *part);
  if (!part) {
    pb_fail_memory(&mat->error, mat->file.path);
    return;
  }
  for (size_t k = 0; k < count; k++) {
    double complex value = data[order(k, dims)];
    part[k] = creal(value);
    part[count + k] = cimag(value);
  }
  mat_complex_split_t split = {part, part + count};
  matvar_t *v = Mat_VarCreate(name, MAT_C_DOUBLE, MAT_T_DOUBLE, rank, dims, &split, MAT_F_COMPLEX);
  put(mat, v, name, MATRIX_HEAD + 8 + 16 * count);
  free(part);
}

static size_t same_order(size_t k, const size_t *dims) {
  (void)dims;
  return k;
}

// From [ny][nu][nf], first index fastest, to [nf][ny][nu], last index fastest.
static size_t response_order(size_t k, const size_t *dims) {
  size_t ny = dims[0], nu = dims[1], o = k % ny, i = k / ny % nu, f = k / ny / nu;
  return (f * ny + o) * nu + i;
}

void pb_matfile_complex(pb_matfile *mat, const char *name, size_t rows, size_t cols,
                        const double complex *data) {
  size_t dims[2] = {rows, cols};
  put_complex(mat, name, 2, dims, rows * cols, data, same_order);
}

void pb_matfile_frf(pb_matfile *mat, const char *name, size_t nf, size_t ny, size_t nu,
                    const double complex *h) {
  size_t dims[3] = {ny, nu, nf};
  put_complex(mat, name, 3, dims, nf * ny * nu, h, response_order);
}

// ---- texts --------------------------------------------------------------------------------------

// Characters of UTF-8: every byte but the continuation bytes.
static size_t character_count(const char *text) {
  size_t count = 0;
  for (; *text; text++) count += (*text & 0xC0) != 0x80;
  return count;
}

static matvar_t *new_text(const char *name, const char *text) {
  size_t dims[2] = {text[0] != 0, character_count(text)};
  return Mat_VarCreate(name, MAT_C_CHAR, MAT_T_UTF8, 2, dims, (void *)text, 0);
}

void pb_matfile_text(pb_matfile *mat, const char *name, const char *text) {
  if (may_write(mat, name, strlen(text))) put(mat, new_text(name, text), name, strlen(text));
}

void pb_matfile_names(pb_matfile *mat, const char *name, const char *const *text, size_t count) {
  size_t bytes = 0, dims[2] = {count, 1};
  for (size_t i = 0; i < count; i++) bytes += strlen(text[i]);
  if (!may_write(mat, name, bytes)) return;
  matvar_t *v = Mat_VarCreate(name, MAT_C_CELL, MAT_T_CELL, 2, dims, NULL, 0);
  for (size_t i = 0; v && i < count; i++) Mat_VarSetCell(v, (int)i, new_text(NULL, text[i]));
  put(mat, v, name, bytes);
}

// ---- end ----------------------------------------------------------------------------------------

static void check_size(pb_matfile *mat) {
  struct stat info;
  if (mat->error.code) return;
  if (stat(written_path(mat), &info) || (size_t)info.st_size < mat->needed) {
    pb_fail(&mat->error, PB_ERR_IO, mat->file.path, "cannot be written: is the disk full?");
  }
}

static pb_status copy_scratch(pb_matfile *mat, pb_error *err) {
  pb_outfile out;
  char part[4096];
  size_t n;
  pb_status status = pb_outfile_open(mat->file.path, &out, err);
  if (status) return status;
  FILE *from = fopen(mat->scratch, "rb");
  while (from && (n = fread(part, 1, sizeof part, from)) > 0) fwrite(part, 1, n, out.stream);
  bool read = from && !ferror(from);
  if (from) fclose(from);
  if (read) return pb_outfile_close(&out, err);
  pb_outfile_discard(&out);
  return pb_fail(err, PB_ERR_IO, mat->file.path, "its temporary file cannot be read");
}

pb_status pb_matfile_close(pb_matfile *mat, pb_error *err) {
  Mat_Close(mat->mat);
  mat->mat = NULL;
  check_size(mat);
  pb_status status = mat->error.code;
  if (status && err) *err = mat->error;
  if (!status && mat->scratch[0]) status = copy_scratch(mat, err);
  if (!status) status = pb_outfile_commit(&mat->file, err);
  pb_matfile_discard(mat);
  return status;
}

void pb_matfile_discard(pb_matfile *mat) {
  if (!mat) return;
  if (mat->mat) Mat_Close(mat->mat);
  if (mat->scratch[0]) unlink(mat->scratch);
  pb_outfile_discard(&mat->file);
  free(mat);
}
