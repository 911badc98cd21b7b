// Beam elements for tests: see beam.h.
#include "support/beam.h"

#include <matio.h>
#include <stdlib.h>
#include <string.h>

static void put(double *a, int i, int j, double value) {
  a[i + 12 * j] = value;
  a[j + 12 * i] = value;
}

// Bending in the plane of u (displacement DoF) and r (rotation DoF); sign: +1 where du/dz = r.
static void bending(double *a, int u, int r, double sign, const double c[6]) {
  int u2 = u + 6, r2 = r + 6;
  put(a, u, u, c[0]), put(a, u2, u2, c[0]);
  put(a, u, u2, c[1]);
  put(a, r, r, c[2]), put(a, r2, r2, c[2]);
  put(a, r, r2, c[3]);
  put(a, u, r, sign * c[4]), put(a, u2, r2, -sign * c[4]);
  put(a, u, r2, sign * c[5]), put(a, u2, r, -sign * c[5]);
}

void beam_matrices(const beam *b, double k[144], double m[144], double position[6]) {
  double l = b->length, ei = b->ei, mass = b->mass;
  memset(k, 0, 144 * sizeof *k);
  memset(m, 0, 144 * sizeof *m);
  const double kb[6] = {12 * ei / (l * l * l), -12 * ei / (l * l * l), 4 * ei / l, 2 * ei / l,
                        6 * ei / (l * l),      6 * ei / (l * l)};
  const double mb[6] = {156 * mass / 420,        54 * mass / 420,     4 * l * l * mass / 420,
                        -3 * l * l * mass / 420, 22 * l * mass / 420, -13 * l * mass / 420};
  bending(k, 0, 4, 1, kb), bending(k, 1, 3, -1, kb);
  bending(m, 0, 4, 1, mb), bending(m, 1, 3, -1, mb);
  const double axial[2] = {b->ea / l, b->gj / l}, inertia[2] = {mass, b->polar_inertia};
  for (int d = 0; d < 2; d++) {
    int i = d ? 5 : 2, j = i + 6;
    put(k, i, i, axial[d]), put(k, j, j, axial[d]), put(k, i, j, -axial[d]);
    put(m, i, i, inertia[d] / 3), put(m, j, j, inertia[d] / 3), put(m, i, j, inertia[d] / 6);
  }
  const double p[6] = {0, 0, -l / 2, 0, 0, l / 2};
  memcpy(position, p, sizeof p);
}

void beam_chain(const beam *whole, size_t parts, double *k, double *m, double *position) {
  size_t n = 6 * (parts + 1);
  double ke[144], me[144], pe[6];
  beam part = *whole;
  part.length /= (double)parts, part.mass /= (double)parts, part.polar_inertia /= (double)parts;
  beam_matrices(&part, ke, me, pe);
  memset(k, 0, n * n * sizeof *k);
  memset(m, 0, n * n * sizeof *m);
  memset(position, 0, 3 * (parts + 1) * sizeof *position);
  for (size_t e = 0; e < parts; e++)
    for (size_t j = 0; j < 12; j++)
      for (size_t i = 0; i < 12; i++) {
        k[6 * e + i + (6 * e + j) * n] += ke[i + 12 * j];
        m[6 * e + i + (6 * e + j) * n] += me[i + 12 * j];
      }
  for (size_t f = 0; f <= parts; f++)
    position[2 + 3 * f] = -whole->length / 2 + part.length * (double)f;
}

static int write_matrix(mat_t *mat, const char *name, size_t rows, size_t cols, const double *p) {
  size_t dims[2] = {rows, cols};
  matvar_t *v = Mat_VarCreate(name, MAT_C_DOUBLE, MAT_T_DOUBLE, 2, dims, (void *)p, 0);
  if (!v) return -1;
  int failed = Mat_VarWrite(mat, v, MAT_COMPRESSION_NONE);
  Mat_VarFree(v);
  return failed ? -1 : 0;
}

int beam_write(const char *path, size_t frames, size_t size, const double *k, const double *m,
               const double *position) {
  mat_t *mat = Mat_CreateVer(path, NULL, MAT_FT_MAT5);
  double *xyz = malloc(3 * frames * sizeof *xyz);
  int failed = !mat || !xyz;
  for (size_t f = 0; !failed && f < frames; f++)
    for (size_t a = 0; a < 3; a++) xyz[f + a * frames] = position[a + 3 * f];
  const double ignored[2] = {1, 2};
  if (!failed) failed = write_matrix(mat, "note", 1, 2, ignored);
  if (!failed) failed = write_matrix(mat, "K", size, size, k);
  if (!failed) failed = write_matrix(mat, "int_xyz", frames, 3, xyz);
  if (!failed) failed = write_matrix(mat, "M", size, size, m);
  if (mat) Mat_Close(mat);
  free(xyz);
  return failed ? -1 : 0;
}

int beam_joint_write(const char *path) {
  const beam bar = {
      .length = 0.014, .ea = 1.4e6, .ei = 0.07, .gj = 3.6, .mass = 0.029, .polar_inertia = 1.5e-6};
  double k[18 * 18], m[18 * 18], position[9];
  beam_chain(&bar, 2, k, m, position);
  return beam_write(path, 3, 18, k, m, position);
}
