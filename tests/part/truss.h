// Small full models for tests of the reduction, and Craig–Bampton on dense matrices as its oracle.
#ifndef PB_TESTS_TRUSS_H
#define PB_TESTS_TRUSS_H

#include "part/reduce.h"

// A net of axial springs between `nodes` random points in a box of 1 × 0.4 × 0.3 m, every pair
// closer than `reach` joined: free, no mechanism for a reach of 0.45 or more. scalar: M = m ⊗ I₃
// (with couplings between neighbours), else directions differ. Returns nonzero when out of memory.
int truss_build(size_t nodes, double reach, bool scalar, unsigned seed, pb_fem *fem);

// A frame on the nodes with lo ≤ x_axis ≤ hi, weights one each. Returns 0 or nonzero.
int truss_frame(pb_fem *fem, const char *name, pb_frame_tie tie, size_t axis, double lo, double hi);

// The same, from a list of nodes, about an origin; weight: NULL or one for each.
int truss_frame_of(pb_fem *fem, const char *name, pb_frame_tie tie, const double origin[3],
                   const size_t *node, size_t nodes, const double *weight);

void truss_drop_frame(pb_fem *fem);  // the last one

// Adds `count` masses (kg), each on three springs (N/m) along x, y and z to a
// node.
int truss_hang(pb_fem *fem, size_t count, size_t node, double stiffness, double mass);

// Adds a mass coupling (kg) between two nodes, which no spring needs to connect.
int truss_couple(pb_fem *fem, size_t i, size_t j, double mass);

// Adds one node on a single spring.
int truss_swing(pb_fem *fem);

// Adds a copy of the whole net that nothing connects with it.
int truss_twin(pb_fem *fem);

// A bar along x of square section, y and z in ± side/2: E 200 GPa, no lateral contraction, 7800
// kg/m³; 20-node elements, `along` × `across`².
int bar_build(double length, double side, size_t along, size_t across, pb_fem *fem);

// Dense K, M [size²] of the element with p modes, ω² [p] ascending, by a null space of the
// constraints (SVD) and dense eigenvalues. The caller frees them. Returns 0 or nonzero.
int dense_reduce(const pb_fem *fem, size_t p, double **k, double **m, double **omega2);

// All modes of the full model with the frames held, ascending: *count of them, the caller frees.
int dense_fixed(const pb_fem *fem, double **omega2, size_t *count);

#endif
