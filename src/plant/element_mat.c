// Reading a super-element from a MAT v5 file: variables K, M (m × m, full or sparse) and int_xyz
// (n × 3, metres).
#include <stdlib.h>
#include <string.h>

#include "plant/element.h"
#include "plant/mat_array.h"

static pb_status check_shapes(const pb_mat_array *k, const pb_mat_array *m, const pb_mat_array *xyz,
                              const char *file, pb_error *err) {
  if (k->rows != k->cols || m->rows != m->cols || k->rows != m->rows)
    return pb_fail(err, PB_ERR_SYNTAX, file,
                   "K is %zu × %zu and M is %zu × %zu; expected square matrices of one size",
                   k->rows, k->cols, m->rows, m->cols);
  if (xyz->cols != 3)
    return pb_fail(err, PB_ERR_SYNTAX, file, "int_xyz is %zu × %zu; expected n × 3", xyz->rows,
                   xyz->cols);
  if (k->rows < 6 * xyz->rows)
    return pb_fail(err, PB_ERR_SYNTAX, file,
                   "%zu × %zu matrices do not fit %zu interface frames (6 each, then modes)",
                   k->rows, k->rows, xyz->rows);
  return PB_OK;
}

pb_status pb_element_data_load(const char *path, pb_element_data *out, pb_error *err) {
  static const char *const name[] = {"K", "M", "int_xyz"};
  *out = (pb_element_data){0};
  pb_mat_array a[3];
  pb_status st = pb_mat_arrays_read(path, 3, name, a, err);
  if (!st) st = check_shapes(&a[0], &a[1], &a[2], path, err);
  double *position = st ? NULL : malloc(3 * a[2].rows * sizeof *position);
  if (!st && !position) st = pb_fail_memory(err, path);
  if (!st) {
    for (size_t i = 0; i < a[2].rows; i++)
      for (size_t x = 0; x < 3; x++) position[x + 3 * i] = a[2].p[i + x * a[2].rows];
    *out = (pb_element_data){
        .frames = a[2].rows, .size = a[0].rows, .position = position, .k = a[0].p, .m = a[1].p};
    a[0].p = a[1].p = NULL;
  }
  pb_mat_arrays_clear(3, a);
  return st;
}

void pb_element_data_clear(pb_element_data *data) {
  free(data->position);
  free(data->k);
  free(data->m);
  *data = (pb_element_data){0};
}

pb_status pb_element_load(const char *path, pb_warnings *warnings, pb_element **out,
                          pb_error *err) {
  *out = NULL;
  pb_element_data data;
  pb_status st = pb_element_data_load(path, &data, err);
  if (!st)
    st = pb_element_new(path, data.frames, data.size, data.position, data.k, data.m, warnings, out,
                        err);
  pb_element_data_clear(&data);
  return st;
}
