// Square matrices, and n × 3 coordinates, of MAT v5 files.
#include "part/matrix_build.h"
#include "plant/mat_array.h"

static pb_status take(const pb_mat_array *a, pb_matrix_file *out, pb_error *err) {
  pb_matrix_build b = {.file = out};
  pb_status st = PB_OK;
  *out = (pb_matrix_file){.format = PB_FORMAT_MAT5, .rows = a->rows, .cols = a->cols};
  for (size_t j = 0; !st && j < a->cols; j++) {
    for (size_t i = 0; !st && i < a->rows; i++) {
      double value = a->p[i + j * a->rows];
      if (value != 0) st = pb_matrix_build_add(&b, (int64_t)i, (int64_t)j, value, err);
    }
  }
  pb_matrix_build_end(&b);
  return st;
}

pb_status pb_read_mat5(const char *path, const char *name, pb_matrix_file *out, pb_error *err) {
  static const char *const both[] = {"K", "M"};
  pb_mat_array a[2] = {{0}};
  pb_status st;
  if (name) {
    st = pb_mat_arrays_read(path, 1, &name, a, err);
  } else {
    if (!pb_mat_arrays_read(path, 2, both, a, NULL)) {
      pb_mat_arrays_clear(2, a);
      return pb_fail(err, PB_ERR_SYNTAX, path, "holds K and M: name one");
    }
    st = pb_mat_arrays_read(path, 1, &both[0], a, NULL);
    if (st && st != PB_ERR_MEMORY) st = pb_mat_arrays_read(path, 1, &both[1], a, err);
  }
  if (!st) st = take(&a[0], out, err);
  pb_mat_arrays_clear(1, a);
  return st;
}
