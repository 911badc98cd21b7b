// Meshes of 20-node hexahedra: a section drawn through layers, its matrices and its faces.
#ifndef PB_PART_MESH_H
#define PB_PART_MESH_H

#include "part/fem.h"
#include "part/hex20.h"
#include "part/section.h"

typedef struct pb_mesh {
  size_t nodes, elements;
  double *xyz;         // 3 × nodes, m
  size_t (*node)[20];  // [elements], order of hex20.h
  int *region;         // [elements] which material
} pb_mesh;

// How a section becomes a solid. Half-levels 0 … 2·layers: even ones are element faces, odd ones
// carry the mid-side nodes between them.
typedef struct pb_extrusion {
  size_t layers;
  // Where section node `node` stands at a half-level, m.
  void (*place)(const void *context, size_t node, size_t half_level, double xyz[3]);
  // The region of a quadrilateral in a layer, or −1: there is no material.
  int (*region)(const void *context, size_t quad, size_t layer);
  const void *context;
} pb_extrusion;

// Nodes that no element uses are left out. *out is owned by the caller (pb_mesh_clear). Elements
// come layer by layer; their third local axis runs along the layers, or against them where that
// makes their Jacobian positive. Fails with PB_ERR_MEMORY, PB_ERR_GEOMETRY (an element is turned
// inside out; the message says where). [init]
pb_status pb_mesh_extrude(const pb_section *section, const pb_extrusion *extrusion, pb_mesh *out,
                          pb_error *err);
void pb_mesh_clear(pb_mesh *mesh);

// Assembles K and M of fem (which is otherwise zeroed: nodes, xyz, dof are filled too) with the
// material of each region. On failure fem is empty. Fails with PB_ERR_MEMORY, PB_ERR_ARGUMENT (a
// region without material). [init]
pb_status pb_mesh_assemble(const pb_mesh *mesh, size_t materials, const pb_material *material,
                           pb_fem *out, pb_error *err);

// A face of an element, by its number 0…5 in pb_hex20_face. Faces between two elements appear once.
typedef struct pb_mesh_face {
  size_t element;
  int face;
  bool surface;  // no second element has it
} pb_mesh_face;

// All faces. *out [*count] is owned by the caller. Fails with PB_ERR_MEMORY. [init]
pb_status pb_mesh_faces(const pb_mesh *mesh, pb_mesh_face **out, size_t *count, pb_error *err);

// Places of a face's eight nodes. [any]
void pb_mesh_face_places(const pb_mesh *mesh, const pb_mesh_face *face, double xyz[8][3]);

// Makes the faces that `wanted` accepts by the places of their nodes the node set of a frame, with
// face moments about frame->origin; *area (m²) receives their area. frame->node and ->moment are
// allocated. Fails with PB_ERR_MEMORY, PB_ERR_GEOMETRY (no such face). [init]
pb_status pb_mesh_frame(const pb_mesh *mesh, const pb_mesh_face *faces, size_t count,
                        bool (*wanted)(const void *context, double xyz[8][3]), const void *context,
                        pb_fem_frame *frame, double *area, pb_error *err);

// Volume of each region by the integration points, m³: volume [regions] (zeroed first). [any]
void pb_mesh_volume(const pb_mesh *mesh, size_t regions, double *volume);

#endif
