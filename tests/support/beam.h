// A super-element that tests can compute by hand: a straight Euler–Bernoulli beam along z.
#ifndef PB_TESTS_BEAM_H
#define PB_TESTS_BEAM_H

#include "base/status.h"

// 12 × 12 stiffness and consistent mass, frames at z = ∓length/2, column-major.
typedef struct beam {
  double length;               // m
  double ea, ei, gj;           // N, N m², N m²
  double mass, polar_inertia;  // kg, kg m² (about z)
} beam;

void beam_matrices(const beam *b, double k[144], double m[144], double position[6]);

// `parts` such beams in a row, all nodes kept as interface frames: size 6 (parts + 1).
// k, m: caller's arrays of that size squared; position 3 × (parts + 1).
void beam_chain(const beam *whole, size_t parts, double *k, double *m, double *position);

// Writes K, M and int_xyz (and variables that a reader must ignore) as a MAT v5 file. 0 or −1.
int beam_write(const char *path, size_t frames, size_t size, const double *k, const double *m,
               const double *position);

// A slender bar 14 mm long with the mass of a flexible joint, of three frames and 18 coordinates,
// as such a file. 0 or −1.
int beam_joint_write(const char *path);

#endif
