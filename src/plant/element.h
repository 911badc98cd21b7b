// Super-elements: reduced mass and stiffness matrices of a part between interface frames.
//
// Component mode synthesis (Craig–Bampton) leaves n interface frames of six degrees of freedom each
// (ux uy uz rx ry rz, frame by frame) and p fixed-interface modes: M and K are m × m, m = 6n + p.
// Source: report "Optimization using Finite Element Models" (T. Dehaeze, 2025), section 1.1.
#ifndef PB_PLANT_ELEMENT_H
#define PB_PLANT_ELEMENT_H

#include <stdatomic.h>
#include <stddef.h>

#include "base/status.h"

// What a look at the matrices says. Frequencies carry the sign of the eigenvalue: −5 Hz stands for
// ω² = −(2π·5)², a motion that the matrices push away instead of pulling back.
typedef struct pb_element_health {
  double asymmetry_k, asymmetry_m;  // largest |X_ij − X_ji| / √(X_ii X_jj)
  double mass;                      // kg, mean of the three translations' RᵀMR
  double center[3];                 // m, centre of mass in part axes
  double rigid_hz;                  // largest of the six smallest free frequencies (by magnitude)
  double flexible_hz;               // the next one: first free mode that deforms the part
} pb_element_health;

// Never changes once made, apart from the count of its users: threads may share it, each taking and
// giving back uses of its own.
typedef struct pb_element {
  atomic_size_t users;
  char *file;        // path as resolved
  size_t frames;     // n
  size_t size;       // m = 6n + p
  double *position;  // 3 × n, column-major: interface frames in part axes, m
  double *k, *m;     // size × size, symmetric
  double *omega2;    // [size] eigenvalues of the free element, (rad/s)², ascending
  double *shape;     // size × size, ΦᵀMΦ = I
  pb_element_health health;
} pb_element;

// What a file says, before anything is checked or made symmetric.
typedef struct pb_element_data {
  size_t frames, size;  // n, m
  double *position;     // 3 × n, m
  double *k, *m;        // size × size
} pb_element_data;

// Reads K, M and int_xyz from a MAT v5 file as they are. Fails with PB_ERR_IO, PB_ERR_SYNTAX,
// PB_ERR_MEMORY. *out is owned by the caller. [init]
pb_status pb_element_data_load(const char *path, pb_element_data *out, pb_error *err);
void pb_element_data_clear(pb_element_data *data);

// Reads K, M and int_xyz from a MAT v5 file (other variables, MATLAB objects too, are ignored) and
// checks them. Warnings: asymmetry, rigid-body residual. [init]
// Fails with PB_ERR_IO (file), PB_ERR_SYNTAX (not a MAT file, variables missing or of the wrong
// shape), PB_ERR_ELEMENT (not finite, M not positive definite), PB_ERR_MEMORY; the error names the
// file.
pb_status pb_element_load(const char *path, pb_warnings *warnings, pb_element **out, pb_error *err);

// The same from matrices in memory (copied): position 3 × frames, k and m size × size. [init]
pb_status pb_element_new(const char *name, size_t frames, size_t size, const double *position,
                         const double *k, const double *m, pb_warnings *warnings, pb_element **out,
                         pb_error *err);

pb_element *pb_element_share(pb_element *element);   // one more user [any]
size_t pb_element_users(const pb_element *element);  // [any]
void pb_element_free(pb_element *element);           // one user less; NULL is allowed

// The warnings of pb_element_load again, of an element that was read before. PB_ERR_MEMORY. [init]
pb_status pb_element_warn(const pb_element *element, pb_warnings *warnings, pb_error *err);

// C of modal damping: C = MΦ diag(2ξω) ΦᵀM, eigenvalues below zero counted as zero; added to
// c (size × size). [init]
pb_status pb_element_damping(const pb_element *element, double ratio, double *c, pb_error *err);

#endif
