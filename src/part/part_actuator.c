// Meshes of amplified piezo actuators: a plane section in blocks, mirrored twice, drawn through the
// depth.
//
// The arm's inner edge touches the slot's round end and, at the pad, an arc of `arm_radius` about
// A; its outer edge is `arm_thickness` away and touches the corner arc that ends in the end flat.
// With n = (sin α, cos α) the normal of the arm:
//   A_z: n·S + slot_radius = n·A + arm_radius,   corner radius R: n·C + R = n·A + arm_radius + t,
//   C = (half_length − R, end_flat),   S = (slot_center, stack_side/2 + slot_radius).
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "part/part.h"

static const double degree = 3.14159265358979323846 / 180;

enum tag { SHELL, PAD_CORE, STACK_OUTER, STACK_MIDDLE, STACK_INNER };

// What the dimensions imply.
typedef struct outline {
  pb_actuator_shape shape;
  double sine, cosine, hole, stack, tongue;  // half widths; x of the tongue's face
  double outer_radius, corner_radius, wall;  // wall: z where the pad's side ends
  pb_point2 arc, slot, corner;               // centres A, S, C
  pb_point2 arm_in[2], arm_out[2];           // arm's edges: at the arc, at the corner
  pb_point2 touch, turned;                   // on the slot's round end: arm's edge, beyond the end
  pb_point2 opposite;                        // on the corner arc, across from `touch`
} outline;

static pb_point2 offset(pb_point2 p, double radius, double sine, double cosine) {
  return (pb_point2){p.x + radius * sine, p.y + radius * cosine};
}

static outline outline_of(const pb_actuator_shape *d) {
  outline o = {
      .shape = *d, .sine = sin(d->arm_angle * degree), .cosine = cos(d->arm_angle * degree)};
  double s = o.sine, c = o.cosine;
  o.hole = 0.25 * sqrt(180 * degree) * d->pad_hole_diameter;
  o.stack = 0.5 * d->stack_side;
  o.tongue = 1.5 * d->stack_length + 0.5 * d->spacer_length;
  o.outer_radius = d->arm_radius + d->arm_thickness;
  o.slot = (pb_point2){d->slot_center, o.stack + d->slot_radius};
  o.arc.x = d->pad_half_width + d->fillet_radius;
  o.arc.y = (s * (o.slot.x - o.arc.x) + d->slot_radius - d->arm_radius) / c + o.slot.y;
  o.wall = o.arc.y + o.outer_radius + d->fillet_radius;
  double reach = s * o.arc.x + c * o.arc.y + o.outer_radius;
  o.corner_radius = (reach - s * d->half_length - c * d->end_flat) / (1 - s);
  o.corner = (pb_point2){d->half_length - o.corner_radius, d->end_flat};
  o.arm_in[0] = offset(o.arc, d->arm_radius, s, c);
  o.arm_out[0] = offset(o.arc, o.outer_radius, s, c);
  o.arm_out[1] = offset(o.corner, o.corner_radius, s, c);
  o.arm_in[1] = offset(o.arm_out[1], -d->arm_thickness, s, c);
  o.touch = offset(o.slot, d->slot_radius, s, c);
  o.turned = offset(o.slot, d->slot_radius, cos(40 * degree), -sin(40 * degree));
  // From `touch` along the arm's normal to the corner arc.
  double x = o.touch.x - o.corner.x, z = o.touch.y - o.corner.y, along = x * s + z * c;
  double square = along * along - x * x - z * z + o.corner_radius * o.corner_radius;
  o.opposite = offset(o.touch, square > 0 ? sqrt(square) - along : 0, s, c);
  return o;
}

static pb_status check(const outline *o, pb_error *err) {
  const pb_actuator_shape *d = &o->shape;
  double pad = o->arc.y + d->arm_radius;
  const struct {
    bool fits;
    const char *else_say;
  } rule[] = {
      {o->hole < 0.9 * d->pad_half_width, "pad_hole_diameter is too wide for the pad"},
      {o->hole < o->stack, "pad_hole_diameter is wider than the stacks"},
      {o->stack < 0.5 * d->depth, "stack_side is not smaller than depth"},
      {o->tongue < d->slot_center, "slot_center lies beside the stacks"},
      {pad > o->stack, "the pad touches the stacks"},
      {o->wall < d->half_height, "half_height is below the root of the arms"},
      {o->corner_radius > 0, "half_length leaves no room for the corner of the arm"},
      {o->arm_in[0].x < o->arm_in[1].x, "the arm has no length"},
      {o->arm_in[1].x < o->touch.x, "the corner of the arm ends before the slot does"},
      {o->turned.x < d->half_length, "slot_center lies beyond half_length"},
      {d->frame_height > pad && d->frame_height <= d->half_height,
       "frame_height is not inside the pad"},
  };
  for (size_t i = 0; i < sizeof rule / sizeof *rule; i++)
    if (!rule[i].fits) return pb_fail(err, PB_ERR_GEOMETRY, "/dimensions", "%s", rule[i].else_say);
  return PB_OK;
}

static size_t count(double density, double base) {
  return (size_t)fmax(1, round(density * base));
}

static pb_point2 point(double x, double z) {
  return (pb_point2){x, z};
}

// Adds a block of straight edges, the arcs named by their centres (NULL: straight).
static pb_status add(pb_section *s, int tag, size_t nu, size_t nv, const pb_point2 corner[4],
                     const pb_point2 *bottom, const pb_point2 *top, pb_error *err) {
  pb_block block = {.cells = {nu, nv}, .tag = tag};
  memcpy(block.corner, corner, sizeof block.corner);
  if (bottom) block.edge[0] = (pb_edge2){true, *bottom};
  if (top) block.edge[2] = (pb_edge2){true, *top};
  return pb_section_add(s, &block, true, true, err);
}

static pb_status add_pad(const outline *o, double density, pb_section *s, pb_error *err) {
  const pb_actuator_shape *d = &o->shape;
  double h = o->hole, w = d->pad_half_width, low = o->arc.y + d->arm_radius, top = d->half_height;
  double foot = w - 0.45 * (w - h);
  size_t through = count(density, 2), one = count(density, 1);
  pb_point2 fillet = point(o->arc.x, o->wall);
  pb_point2 upper_core[4] = {point(0, o->wall), point(h, o->wall), point(h, top), point(0, top)};
  pb_point2 upper_side[4] = {point(h, o->wall), point(w, o->wall), point(w, top), point(h, top)};
  pb_point2 lower_core[4] = {point(0, low), point(h, low), point(h, o->wall), point(0, o->wall)};
  pb_point2 lower_side[4] = {point(h, low), point(foot, low), point(w, o->wall), point(h, o->wall)};
  pb_point2 root[4] = {point(foot, low), point(o->arc.x, low),
                       point(o->arc.x, o->arc.y + o->outer_radius), point(w, o->wall)};
  pb_status st = add(s, PAD_CORE, one, one, upper_core, NULL, NULL, err);
  if (!st) st = add(s, SHELL, one, one, upper_side, NULL, NULL, err);
  if (!st) st = add(s, PAD_CORE, one, through, lower_core, NULL, NULL, err);
  if (!st) st = add(s, SHELL, one, through, lower_side, NULL, NULL, err);
  if (!st) st = add(s, SHELL, count(density, 2), through, root, NULL, &fillet, err);
  return st;
}

static pb_status add_arm(const outline *o, double density, pb_section *s, pb_error *err) {
  const pb_actuator_shape *d = &o->shape;
  size_t through = count(density, 2);
  double low = o->arc.y + d->arm_radius;
  pb_point2 bend[4] = {point(o->arc.x, low), o->arm_in[0], o->arm_out[0],
                       point(o->arc.x, o->arc.y + o->outer_radius)};
  pb_point2 arm[4] = {o->arm_in[0], o->arm_in[1], o->arm_out[1], o->arm_out[0]};
  pb_point2 shoulder[4] = {o->arm_in[1], o->touch, o->opposite, o->arm_out[1]};
  pb_point2 flat = point(d->half_length, d->end_flat);
  pb_point2 turn[4] = {o->touch, o->turned, flat, o->opposite};
  double length = hypot(o->arm_in[1].x - o->arm_in[0].x, o->arm_in[1].y - o->arm_in[0].y);
  size_t along = count(density, fmin(12, fmax(2, length / (3.2 * d->arm_thickness))));
  pb_status st = add(s, SHELL, count(density, 1), through, bend, &o->arc, &o->arc, err);
  if (!st) st = add(s, SHELL, along, through, arm, NULL, NULL, err);
  if (!st) st = add(s, SHELL, count(density, 1), through, shoulder, NULL, &o->corner, err);
  if (!st) st = add(s, SHELL, count(density, 3), through, turn, &o->slot, &o->corner, err);
  return st;
}

// The end between slot and flat, the tongue and the stacks.
static pb_status add_middle(const outline *o, double density, pb_section *s, pb_error *err) {
  const pb_actuator_shape *d = &o->shape;
  size_t through = count(density, 2), high = count(density, 2), one = count(density, 1);
  double top = o->stack, half_spacer = 0.5 * (d->stack_length - d->spacer_length);
  double inner = half_spacer, middle = half_spacer + d->spacer_length;
  pb_point2 flat = point(d->half_length, d->end_flat);
  pb_point2 end[4] = {point(o->turned.x, 0), point(d->half_length, 0), flat, o->turned};
  pb_point2 round[4] = {point(o->slot.x, 0), point(o->turned.x, 0), o->turned,
                        point(o->slot.x, top)};
  double x[5] = {0, inner, middle, o->tongue, o->slot.x};
  static const int tags[4] = {STACK_INNER, STACK_MIDDLE, STACK_OUTER, SHELL};
  static const double base[4] = {1.5, 1, 3, 1};
  pb_status st = add(s, SHELL, through, high, end, NULL, NULL, err);
  if (!st) st = add(s, SHELL, one, high, round, NULL, &o->slot, err);
  for (int i = 0; !st && i < 4; i++) {
    pb_point2 box[4] = {point(x[i], 0), point(x[i + 1], 0), point(x[i + 1], top), point(x[i], top)};
    st = add(s, tags[i], count(density, base[i]), high, box, NULL, NULL, err);
  }
  return st;
}

typedef struct drawing {
  const pb_section *section;
  outline outline;
  size_t cells[3];  // over the depth from the middle: hole, stack, rest
} drawing;

// y at a half-level; half-levels run from +depth/2 to −depth/2, which keeps (x, z, −y)
// right-handed.
static double depth_at(const drawing *d, size_t half) {
  size_t middle = 2 * (d->cells[0] + d->cells[1] + d->cells[2]);
  size_t steps = half > middle ? half - middle : middle - half;
  double edge[4] = {0, d->outline.hole, d->outline.stack, 0.5 * d->outline.shape.depth};
  double y = edge[3];
  for (int i = 2; i >= 0; i--) {
    size_t begin = 0;
    for (int j = 0; j < i; j++) begin += 2 * d->cells[j];
    if (steps < begin) continue;
    double t = (double)(steps - begin) / (double)(2 * d->cells[i]);
    y = edge[i] + t * (edge[i + 1] - edge[i]);
    break;
  }
  return half > middle ? -y : y;
}

static void place(const void *context, size_t node, size_t half, double xyz[3]) {
  const drawing *d = context;
  xyz[0] = d->section->at[node].x;
  xyz[1] = depth_at(d, half);
  xyz[2] = d->section->at[node].y;
}

// Materials: 0 shell, 1 stack, 2 spacer.
static int region(const void *context, size_t quad, size_t layer) {
  const drawing *d = context;
  double y = fabs(depth_at(d, 2 * layer + 1)), x = 0;
  for (int i = 0; i < 4; i++) x += d->section->at[d->section->quad[quad][i]].x;
  bool in_stack = y < d->outline.stack;
  switch (d->section->tag[quad]) {
  case PAD_CORE:
    return y < d->outline.hole ? -1 : 0;
  case STACK_MIDDLE:
    if (x < 0) return 2;
    return in_stack ? 1 : -1;
  case STACK_INNER:
  case STACK_OUTER:
    return in_stack ? 1 : -1;
  default:
    return 0;
  }
}

pb_status pb_actuator_mesh(const pb_actuator_shape *shape, double density, pb_mesh *out,
                           pb_error *err) {
  *out = (pb_mesh){0};
  outline o = outline_of(shape);
  pb_section section = {.tolerance = 1e-7 * shape->half_length};
  pb_status st = check(&o, err);
  if (!st) st = add_pad(&o, density, &section, err);
  if (!st) st = add_arm(&o, density, &section, err);
  if (!st) st = add_middle(&o, density, &section, err);
  if (!st) {
    drawing d = {&section, o, {count(density, 1), count(density, 1), count(density, 1)}};
    pb_extrusion extrusion = {2 * (d.cells[0] + d.cells[1] + d.cells[2]), place, region, &d};
    st = pb_mesh_extrude(&section, &extrusion, out, err);
  }
  pb_section_clear(&section);
  return st;
}
