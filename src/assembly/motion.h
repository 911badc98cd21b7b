// How the frames of components move with the stacked coordinates q.
//
// Coordinates of each component, in this order:
//   rigid_body     v (centre of mass, world), θ (world)
//   strut_1dof     v (point of the lower half at the centre, world), θ, d (upper half against
//   lower, z) apa_2dof       v, θ, d, w (intermediate mass against lower half, z) super_element the
//   element's own, in part axes
// After these, where a resistor lies across the sensor stack: z, what has relaxed of the stack's
// elongation (stack_boundary.c).
// A connection that is an element has the element's coordinates, in joint axes.
#ifndef PB_ASSEMBLY_MOTION_H
#define PB_ASSEMBLY_MOTION_H

#include "plant/plant.h"

#define PB_MOTION_COLUMNS 16  // of two frames at most: 6 + d each, or 6 of an element

// Six motions (ux uy uz rx ry rz) as linear functions of q: row r is Σ value[r][i] q[column[i]].
typedef struct pb_motion {
  size_t count;
  size_t column[PB_MOTION_COLUMNS];
  double value[6][PB_MOTION_COLUMNS];
} pb_motion;

// Where the coordinates of each component and each element joint start in q.
typedef struct pb_layout {
  size_t size;         // of q
  size_t *component;   // [component_count]
  size_t *connection;  // [connection_count], of element joints
} pb_layout;

// Number of coordinates of a component.
size_t pb_component_size(const pb_component *component);

// The same without z.
size_t pb_component_motions(const pb_component *component);

pb_status pb_layout_build(const pb_plant *plant, pb_layout *out, pb_error *err);
void pb_layout_clear(pb_layout *layout);

// Motion of a frame in world axes; ground does not move.
void pb_motion_frame(const pb_plant *plant, const pb_layout *layout, pb_anchor anchor,
                     pb_motion *out);

// Motion, in world axes, of interface frame `node` of the element between the connection's frames.
void pb_motion_joint_node(const pb_connection *connection, size_t start, size_t node,
                          pb_motion *out);

// Position of a frame in the nominal pose, world axes, m. Not for ground.
void pb_frame_position(const pb_plant *plant, pb_anchor anchor, double position[3]);

// out = rotationᵀ (a − b): a relative motion in the axes of `rotation`.
void pb_motion_relative(const pb_motion *a, const pb_motion *b, const double rotation[9],
                        pb_motion *out);

#endif
