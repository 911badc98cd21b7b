// Numeric variables of MAT v5 files: see mat_array.h.
#include "plant/mat_array.h"

#include <matio.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "base/array.h"

static double entry(const void *data, enum matio_types type, size_t i, bool *ok) {
  switch (type) {
  case MAT_T_DOUBLE:
    return ((const double *)data)[i];
  case MAT_T_SINGLE:
    return (double)((const float *)data)[i];
  case MAT_T_INT8:
    return (double)((const mat_int8_t *)data)[i];
  case MAT_T_UINT8:
    return (double)((const mat_uint8_t *)data)[i];
  case MAT_T_INT16:
    return (double)((const mat_int16_t *)data)[i];
  case MAT_T_UINT16:
    return (double)((const mat_uint16_t *)data)[i];
  case MAT_T_INT32:
    return (double)((const mat_int32_t *)data)[i];
  case MAT_T_UINT32:
    return (double)((const mat_uint32_t *)data)[i];
  default:
    *ok = false;
    return 0;
  }
}

static bool copy_sparse(const matvar_t *v, pb_mat_array *out) {
  const mat_sparse_t *s = v->data;
  bool ok = s && s->data && s->jc && s->ir && s->njc == out->cols + 1;
  for (size_t j = 0; ok && j < out->cols; j++) {
    for (size_t at = (size_t)s->jc[j]; ok && at < (size_t)s->jc[j + 1]; at++) {
      ok = at < (size_t)s->ndata && at < (size_t)s->nir && (size_t)s->ir[at] < out->rows;
      if (ok) out->p[(size_t)s->ir[at] + j * out->rows] = entry(s->data, v->data_type, at, &ok);
    }
  }
  return ok;
}

static bool copy_full(const matvar_t *v, pb_mat_array *out) {
  bool ok = v->data != NULL;
  for (size_t i = 0; ok && i < out->rows * out->cols; i++)
    out->p[i] = entry(v->data, v->data_type, i, &ok);
  return ok;
}

static pb_status read_matrix(mat_t *mat, const char *file, const char *name, pb_mat_array *out,
                             pb_error *err) {
  *out = (pb_mat_array){0};
  if (Mat_Rewind(mat)) return pb_fail(err, PB_ERR_IO, file, "cannot be read again");
  matvar_t *v = Mat_VarReadInfo(mat, name);  // sizes first: a damaged file may claim any
  pb_status st = PB_OK;
  if (!v) return pb_fail(err, PB_ERR_SYNTAX, file, "has no variable %s", name);
  bool numeric = v->rank == 2 && !v->isComplex && v->class_type != MAT_C_CELL &&
                 v->class_type != MAT_C_STRUCT && v->class_type != MAT_C_OBJECT &&
                 v->class_type != MAT_C_CHAR;
  if (!numeric || v->dims[0] < 1 || v->dims[1] < 1 || v->dims[0] > 20000 || v->dims[1] > 20000) {
    st = pb_fail(err, PB_ERR_SYNTAX, file, "variable %s is not a real matrix", name);
    goto done;
  }
  if (Mat_VarReadDataAll(mat, v)) {
    st = pb_fail(err, PB_ERR_SYNTAX, file, "variable %s cannot be read: the file is damaged", name);
    goto done;
  }
  out->rows = v->dims[0];
  out->cols = v->dims[1];
  out->p = pb_array_zero(out->rows * out->cols, sizeof(double));
  if (!out->p) {
    st = pb_fail_memory(err, file);
    goto done;
  }
  bool ok = v->class_type == MAT_C_SPARSE ? copy_sparse(v, out) : copy_full(v, out);
  if (!ok) st = pb_fail(err, PB_ERR_SYNTAX, file, "variable %s is damaged or not numeric", name);
done:
  Mat_VarFree(v);
  if (st) {
    free(out->p);
    *out = (pb_mat_array){0};
  }
  return st;
}

static uint32_t word(const unsigned char *p, bool little) {
  return little ? (uint32_t)p[3] << 24 | (uint32_t)p[2] << 16 | (uint32_t)p[1] << 8 | p[0]
                : (uint32_t)p[0] << 24 | (uint32_t)p[1] << 16 | (uint32_t)p[2] << 8 | p[3];
}

// matio fills what a cut file lacks without a word. A MAT v5 file is a header of 128 bytes and
// elements, each with its length in front: they must end where the file ends. Other versions are
// left to matio.
static pb_status check_complete(const char *path, pb_error *err) {
  unsigned char header[128], tag[8];
  struct stat kind;  // a pipe would block whoever opens it, a device never end
  if (!stat(path, &kind) && !S_ISREG(kind.st_mode))
    return pb_fail(err, PB_ERR_IO, path, "is not a regular file");
  FILE *file = fopen(path, "rb");
  if (!file) return pb_fail(err, PB_ERR_IO, path, "cannot be opened: %m");
  pb_status st = PB_OK;
  if (fread(header, 1, sizeof header, file) != sizeof header) {
    st = pb_fail(err, PB_ERR_SYNTAX, path, "is too short for a MAT file");
    goto done;
  }
  bool little = header[126] == 'I' && header[127] == 'M';
  if (header[little ? 125 : 124] != 1) goto done;
  if (fseek(file, 0, SEEK_END)) goto done;
  long size = ftell(file), at = sizeof header;
  while (at < size && !st) {
    bool read = !fseek(file, at, SEEK_SET) && fread(tag, 1, sizeof tag, file) == sizeof tag;
    if (read) at += 8 + (long)word(tag + 4, little);
    if (!read || at > size)
      st = pb_fail(err, PB_ERR_SYNTAX, path, "is cut short: %ld bytes of at least %ld", size, at);
  }
done:
  fclose(file);
  return st;
}

pb_status pb_mat_arrays_read(const char *path, size_t count, const char *const *name,
                             pb_mat_array *out, pb_error *err) {
  for (size_t k = 0; k < count; k++) out[k] = (pb_mat_array){0};
  pb_status st = check_complete(path, err);
  if (st) return st;
  mat_t *mat = Mat_Open(path, MAT_ACC_RDONLY);
  if (!mat) return pb_fail(err, PB_ERR_SYNTAX, path, "is not a MAT file");
  for (size_t k = 0; !st && k < count; k++) st = read_matrix(mat, path, name[k], &out[k], err);
  Mat_Close(mat);
  if (st) pb_mat_arrays_clear(count, out);
  return st;
}

void pb_mat_arrays_clear(size_t count, pb_mat_array *array) {
  for (size_t k = 0; k < count; k++) {
    free(array[k].p);
    array[k] = (pb_mat_array){0};
  }
}
