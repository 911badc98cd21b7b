// Numeric variables of MAT v5 files, full or sparse, of any number class; other variables, MATLAB
// objects too, are passed over.
#ifndef PB_PLANT_MAT_ARRAY_H
#define PB_PLANT_MAT_ARRAY_H

#include <stddef.h>

#include "base/status.h"

typedef struct pb_mat_array {
  size_t rows, cols;  // at most 20000 each
  double *p;          // column-major
} pb_mat_array;

// Reads `count` variables by name; the file must be complete. Fails with PB_ERR_IO (file),
// PB_ERR_SYNTAX (not a MAT file, cut, a variable missing or not a real matrix), PB_ERR_MEMORY; the
// error names the file, all arrays are empty then. Freed with pb_mat_arrays_clear. [init]
pb_status pb_mat_arrays_read(const char *path, size_t count, const char *const *name,
                             pb_mat_array *out, pb_error *err);

void pb_mat_arrays_clear(size_t count, pb_mat_array *array);

#endif
