// A part's full finite-element model: sparse K and M over nodes with three translations each, and
// the interface frames that a reduction keeps.
//
// A frame has six degrees of freedom (ux uy uz rx ry rz at its origin) and is tied to a node set in
// one of two ways:
//   averaged  the frame moves as the weighted mean of its nodes, which stay free to deform:
//             q = (RᵀGR)⁻¹RᵀG u, R the rigid motions of the set about the frame's origin, G its
//             (face) mass matrix, or diagonal weights;
//   rigid     the nodes move with the frame: u = R q.
// G = g ⊗ I₃, and only G times the functions 1, x, y, z is ever needed: these are the `moment`s.
// Source: design note on interfaces (remote points of Ansys are averaged); report 1.1.
#ifndef PB_PART_FEM_H
#define PB_PART_FEM_H

#include "part/sparse.h"

typedef enum pb_frame_tie { PB_TIE_AVERAGED, PB_TIE_RIGID } pb_frame_tie;

typedef struct pb_fem_frame {
  char *name;        // unique in the part
  double origin[3];  // m, part axes
  pb_frame_tie tie;
  size_t nodes;
  size_t *node;    // [nodes] indices of mesh nodes
  double *moment;  // 4 × nodes: Σ_j g_ij · (1, x_j, y_j, z_j), x from the frame's origin; for a
                   // face ∫ N_i · (1, x, y, z) dA. Not used (may be NULL) with PB_TIE_RIGID
} pb_fem_frame;

typedef struct pb_fem {
  char *name;
  size_t nodes;
  double *xyz;      // 3 × nodes, m, part axes
  int64_t *number;  // [nodes] the nodes' numbers in messages and reports; NULL: index + 1
  int64_t *dof;     // 3 × nodes: row of K and M of ux, uy, uz of each node; −1: there is none
  pb_sparse k, m;   // n × n, N/m and kg
  size_t frames;
  pb_fem_frame *frame;
} pb_fem;

void pb_fem_clear(pb_fem *fem);  // frees all that it holds; a zeroed one is allowed [init]

// Moments of diagonal weights (w [nodes], all > 0; NULL: 1 each) for frame->node and frame->origin
// from fem->xyz. Fails with PB_ERR_MEMORY. [init]
pb_status pb_fem_frame_weights(const pb_fem *fem, pb_fem_frame *frame, const double *w,
                               pb_error *err);

// Moments of the mass that M has between the frame's nodes, direction by direction the same:
// weights that follow the area of the faces they stand on where elements are of one depth. Fails
// with PB_ERR_MEMORY, PB_ERR_ARGUMENT (no mass at these nodes). [init]
pb_status pb_fem_frame_mass(const pb_fem *fem, pb_fem_frame *frame, pb_error *err);

// The number by which messages name a node. [any]
int64_t pb_fem_node_number(const pb_fem *fem, size_t node);

#endif
