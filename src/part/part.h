// Parts by their dimensions: part file → mesh → full model with its frames.
//
// A part file (schema "plantbus.part/1") names a type, its dimensions and materials, the density of
// the mesh, the number of modes and how frames are tied. Two types exist:
//   amplified_actuator  a lever-frame shell with three piezo stacks; x stack axis, y depth, z
//                       actuation. Frames: bottom, top (walls of the pads' hole), then the stack
//                       sections: sensor_start, sensor_end, actuator_start, actuator_middle,
//                       actuator_end
//   flexible_joint      a cylinder with two crossed wire-cut necks, axis z. Frames at its centre:
//                       top, bottom, each on one end face
// Source of the shapes: design note on parts (geometry of the APA300ML and of the joint).
#ifndef PB_PART_PART_H
#define PB_PART_PART_H

#include <cjson/cJSON.h>

#include "part/mesh.h"

typedef enum pb_part_type { PB_PART_AMPLIFIED_ACTUATOR, PB_PART_FLEXIBLE_JOINT } pb_part_type;

// Lengths in m. The profile is given in the quarter x ≥ 0, z ≥ 0 and mirrored.
typedef struct pb_actuator_shape {
  double stack_length, stack_side;  // three stacks, square sections
  double spacer_length;             // between the sensor stack and the two actuator stacks
  double depth;                     // of shell and spacer along y
  double half_height;               // z of the pad's face
  double half_length;               // x of the end flats
  double frame_height;              // z of the frames bottom (−) and top (+)
  double pad_half_width;
  double pad_hole_diameter;         // along z; meshed as a square of equal area
  double fillet_radius;             // pad wall to arm
  double arm_thickness, arm_angle;  // angle to the x axis in degrees
  double arm_radius;                // inner arc from pad to arm
  double slot_radius, slot_center;  // round end of the gap beside the stacks, x of its centre
  double end_flat;                  // half height of the end flat
} pb_actuator_shape;

typedef struct pb_joint_shape {
  double diameter, height;
  double neck;         // thickness of both necks
  double neck_radius;  // of the arcs that form the neck
  double slot_width;
  double slot_angle;  // degrees from the neck to where the slot leaves straight for the end face
  double slot_stop;   // degrees from the neck to the slot's round end
} pb_joint_shape;

enum { PB_PART_MATERIALS = 3, PB_PART_FRAMES = 7, PB_PART_PUBLISHED = 12 };

typedef struct pb_part_published {
  char name[48];
  double value;
} pb_part_published;

typedef struct pb_part {
  char *name;
  pb_part_type type;
  pb_actuator_shape actuator;
  pb_joint_shape joint;
  size_t materials;
  pb_material material[PB_PART_MATERIALS];  // actuator: shell, stack, spacer; joint: body
  double density;                           // of the mesh; 1: coarse, 2: half the element size
  size_t modes;
  pb_frame_tie tie;
  size_t published;  // characteristics told elsewhere, to compare with
  pb_part_published publication[PB_PART_PUBLISHED];
} pb_part;

// Reads a part from JSON; `pointer` is put before the places that errors name. Fails with
// PB_ERR_SCHEMA, PB_ERR_GEOMETRY (dimensions that do not fit together), PB_ERR_MEMORY. [init]
pb_status pb_part_read(const cJSON *json, pb_part *out, pb_error *err);
void pb_part_clear(pb_part *part);

const char *pb_part_type_name(pb_part_type type);
const char *pb_part_material_name(pb_part_type type, size_t material);

// Names of the frames in order; NULL beyond the last. [any]
const char *pb_part_frame_name(pb_part_type type, size_t frame);

// Whether a type of part has a characteristic of this name (characteristics.h). [any]
bool pb_characteristic_known(pb_part_type type, const char *name);

// Dimensions → mesh. Fails with PB_ERR_MEMORY, PB_ERR_GEOMETRY. [init]
pb_status pb_part_mesh(const pb_part *part, pb_mesh *out, pb_error *err);
pb_status pb_actuator_mesh(const pb_actuator_shape *shape, double density, pb_mesh *out,
                           pb_error *err);
pb_status pb_joint_mesh(const pb_joint_shape *shape, double density, pb_mesh *out, pb_error *err);

// Mesh → full model with the part's frames. Fails as pb_mesh_assemble and pb_mesh_frame do. [init]
pb_status pb_part_model(const pb_part *part, const pb_mesh *mesh, pb_fem *out, pb_error *err);

// Where a wall of the joint's slot stands at height z above the neck on its own side (z < 0: where
// the slot is open to the end face): [0] the neck side, [1] the far side, m. [any]
void pb_joint_walls(const pb_joint_shape *shape, double z, double wall[2]);

#endif
