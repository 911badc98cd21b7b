// Plane meshes of 8-node quadrilaterals in blocks, for parts that are a section extruded.
//
// A block is a quadrilateral with four straight or circular edges, filled by transfinite
// interpolation:
//   P(u,v) = (1−v) B(u) + v T(u) + (1−u) L(v) + u R(v)
//            − (1−u)(1−v) P_00 − u(1−v) P_10 − (1−u) v P_01 − uv P_11.
// Every node, mid-side nodes too, lies on its edge's arc. Blocks whose edges carry the same nodes
// join: nodes at one place are one node.
// Source: W. J. Gordon, C. A. Hall, Int. J. Numer. Meth. Engng 7 (1973), 461–477.
#ifndef PB_PART_SECTION_H
#define PB_PART_SECTION_H

#include <stdbool.h>
#include <stddef.h>

#include "base/status.h"

typedef struct pb_point2 {
  double x, y;
} pb_point2;

// An edge between two corners: straight, or the shorter arc about a centre.
typedef struct pb_edge2 {
  bool arc;
  pb_point2 centre;
} pb_edge2;

// Corners in turn: (u,v) = (0,0), (1,0), (1,1), (0,1); edges bottom, right, top, left, from corner
// i to corner i + 1. Spacing: u and v run over their `cells` with sizes growing by `grow` from one
// cell to the next (1: equal).
typedef struct pb_block {
  pb_point2 corner[4];
  pb_edge2 edge[4];
  size_t cells[2];
  double grow[2];  // 0 counts as 1
  int tag;         // what the quadrilaterals belong to
} pb_block;

typedef struct pb_section {
  size_t nodes, quads, node_capacity, quad_capacity;
  pb_point2 *at;      // [nodes], m
  bool *middle;       // [nodes] a mid-side node
  size_t (*quad)[8];  // [quads] corners in turn, then the mid-side nodes 12 23 34 41
  int *tag;           // [quads]
  double tolerance;   // m, below which two places are one
} pb_section;

// The place of (u, v) in a block. [any]
pb_point2 pb_block_point(const pb_block *block, double u, double v);

// Node 0…2·cells of a graded row of cells, ends and middles, as a fraction. [any]
double pb_block_fraction(size_t cells, double grow, size_t index);

// Adds a block's quadrilaterals, and with mirror_x / mirror_y also their mirror images about the
// axes x = 0 and y = 0 (tags alike). Fails with PB_ERR_MEMORY; the section is then to be cleared.
// [init]
pb_status pb_section_add(pb_section *section, const pb_block *block, bool mirror_x, bool mirror_y,
                         pb_error *err);

void pb_section_clear(pb_section *section);

#endif
