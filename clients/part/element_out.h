// An element as files: what every command of plantbus-part that makes one writes.
//
// MAT v5: K, M (m × m), int_xyz (n × 3, m) as the library reads them, and for people and MATLAB:
//   int_i        n × 1   numbers of the frames, from 1
//   int_name     n × 1   cell, names of the frames
//   dof_name     m × 1   cell, "top.ux" … "top.rz", then "mode 1" …
//   fixed_hz     p × 1   fixed-interface frequencies, where known
//   name, units, provenance      texts
// Matrix Market: three files beside each other, part.mtx standing for part.K.mtx, part.M.mtx (real
// symmetric, dense ones as coordinate entries) and part.int_xyz.mtx (real general array), with the
// same names and texts in their comments.
// The same element gives the same bytes: there is no date in either.
#ifndef PB_CLIENTS_PART_ELEMENT_OUT_H
#define PB_CLIENTS_PART_ELEMENT_OUT_H

#include <stdbool.h>
#include <stddef.h>

#include "base/status.h"

typedef enum pb_element_format {
  PB_ELEMENT_BY_SUFFIX,  // .mtx: Matrix Market, anything else: MAT v5
  PB_ELEMENT_MAT5,
  PB_ELEMENT_MATRIX_MARKET,
} pb_element_format;

// Everything is borrowed.
typedef struct pb_element_out {
  const char *name;               // of the part
  size_t frames, size;            // n, m = 6n + p
  const double *position;         // 3 × n, m
  const double *k, *m;            // size × size, symmetric; N/m, N, N m / rad; kg, kg m, kg m²
  const char *const *frame_name;  // [n]; NULL: "1", "2", …
  const double *fixed_hz;         // [m − 6n], or NULL: not known
  const char *provenance;         // where the matrices come from; lines; NULL: nothing is said
} pb_element_out;

// Judges "mat", "mtx"; false: neither.
bool pb_element_format_parse(const char *text, pb_element_format *out);

// Writes the element to path; files appear whole. Fails with PB_ERR_IO, PB_ERR_MEMORY.
pb_status pb_element_write(const pb_element_out *element, const char *path,
                           pb_element_format format, pb_error *err);

#endif
