// From a part to its full model: see part.h.
#include "part/part.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"

static const char *const actuator_frames[] = {
    "bottom",          "top",         "sensor_start", "sensor_end", "actuator_start",
    "actuator_middle", "actuator_end"};
static const char *const joint_frames[] = {"top", "bottom"};

const char *pb_part_type_name(pb_part_type type) {
  return type == PB_PART_FLEXIBLE_JOINT ? "flexible_joint" : "amplified_actuator";
}

const char *pb_part_material_name(pb_part_type type, size_t material) {
  static const char *const actuator[] = {"shell", "stack", "spacer"};
  if (type == PB_PART_FLEXIBLE_JOINT) return material == 0 ? "body" : NULL;
  return material < 3 ? actuator[material] : NULL;
}

const char *pb_part_frame_name(pb_part_type type, size_t frame) {
  if (type == PB_PART_FLEXIBLE_JOINT) return frame < 2 ? joint_frames[frame] : NULL;
  return frame < 7 ? actuator_frames[frame] : NULL;
}

pb_status pb_part_mesh(const pb_part *part, pb_mesh *out, pb_error *err) {
  if (part->type == PB_PART_FLEXIBLE_JOINT)
    return pb_joint_mesh(&part->joint, part->density, out, err);
  return pb_actuator_mesh(&part->actuator, part->density, out, err);
}

// Which faces a frame is tied to: those with all nodes in a box, and, for a hole, on its four
// walls.
typedef struct seat {
  double low[3], high[3];
  double hole;  // half width of the square hole about z; 0: any face in the box
  double tolerance;
} seat;

static bool all_at(double xyz[8][3], int axis, double value, double tolerance) {
  for (int i = 0; i < 8; i++)
    if (fabs(xyz[i][axis] - value) > tolerance) return false;
  return true;
}

static bool on_seat(const void *context, double xyz[8][3]) {
  const seat *s = context;
  for (int i = 0; i < 8; i++)
    for (int a = 0; a < 3; a++)
      if (xyz[i][a] < s->low[a] - s->tolerance || xyz[i][a] > s->high[a] + s->tolerance)
        return false;
  if (s->hole == 0) return true;
  for (int a = 0; a < 2; a++)
    if (all_at(xyz, a, s->hole, s->tolerance) || all_at(xyz, a, -s->hole, s->tolerance))
      return true;
  return false;
}

static seat box(double x0, double x1, double y0, double y1, double z0, double z1) {
  return (seat){.low = {x0, y0, z0}, .high = {x1, y1, z1}, .tolerance = 1e-8};
}

static seat actuator_seat(const pb_actuator_shape *d, size_t frame, double origin[3]) {
  double stack = 0.5 * d->stack_side, tongue = 1.5 * d->stack_length + 0.5 * d->spacer_length;
  double hole = 0.25 * sqrt(3.14159265358979323846) * d->pad_hole_diameter;
  double section[5] = {-tongue, d->stack_length - tongue, tongue - 2 * d->stack_length,
                       tongue - d->stack_length, tongue};
  memset(origin, 0, 3 * sizeof *origin);
  if (frame < 2) {
    double sign = frame == 0 ? -1 : 1, face = sign * d->half_height;
    origin[2] = sign * d->frame_height;
    seat s = box(-hole, hole, -hole, hole, fmin(face, sign * stack), fmax(face, sign * stack));
    s.hole = hole;
    return s;
  }
  origin[0] = section[frame - 2];
  return box(origin[0], origin[0], -stack, stack, -stack, stack);
}

static seat joint_seat(const pb_joint_shape *d, size_t frame, double origin[3]) {
  double face = 0.5 * d->height, radius = 0.5 * d->diameter, wall[2];
  memset(origin, 0, 3 * sizeof *origin);
  pb_joint_walls(d, -face, wall);
  return frame == 0 ? box(-wall[0], wall[0], -radius, radius, face, face)
                    : box(-radius, radius, -wall[0], wall[0], -face, -face);
}

static pb_status add_frame(const pb_part *part, const pb_mesh *mesh, const pb_mesh_face *faces,
                           size_t count, pb_fem *fem, pb_error *err) {
  pb_fem_frame *frame = fem->frame + fem->frames;
  size_t number = fem->frames++;
  seat s = part->type == PB_PART_FLEXIBLE_JOINT
               ? joint_seat(&part->joint, number, frame->origin)
               : actuator_seat(&part->actuator, number, frame->origin);
  frame->tie = part->tie;
  frame->name = pb_text_copy(pb_part_frame_name(part->type, number));
  if (!frame->name) return pb_fail_memory(err, "frame");
  return pb_mesh_frame(mesh, faces, count, on_seat, &s, frame, NULL, err);
}

pb_status pb_part_model(const pb_part *part, const pb_mesh *mesh, pb_fem *out, pb_error *err) {
  pb_mesh_face *faces = NULL;
  size_t count = 0, frames = part->type == PB_PART_FLEXIBLE_JOINT ? 2 : 7;
  pb_status st = pb_mesh_assemble(mesh, part->materials, part->material, out, err);
  if (!st) st = pb_mesh_faces(mesh, &faces, &count, err);
  char *name = st ? NULL : pb_text_copy(part->name);
  if (!st) out->frame = calloc(frames, sizeof *out->frame);
  if (!st && (!name || !out->frame)) st = pb_fail_memory(err, part->name);
  if (name) {
    free(out->name);
    out->name = name;
  }
  for (size_t i = 0; !st && i < frames; i++) st = add_frame(part, mesh, faces, count, out, err);
  free(faces);
  if (st) pb_fem_clear(out);
  return st;
}
