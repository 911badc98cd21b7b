// Meshes of flexible joints: a cylinder with two crossed wire-cut necks.
//
// Cut 1 lies in the yz plane and is drawn along x; it is open at the bottom. Cut 2 is the same,
// turned upside down and by 90° about z. On each side of the axis a slot of constant width follows
// a circle of radius `neck_radius` about (neck/2 + neck_radius, 0); from −slot_angle it leaves
// tangentially on a straight line to the end face, at slot_stop it ends round.
//
// The mesh is a disc's pattern of quadrilaterals (core | slot | rest in x and in y, three
// quadrilaterals in each corner) drawn through levels of z. In the pattern's own coordinates the
// lines between core, slot and rest are |ξ| = 1, 2 and the circle is 3; where a line stands in
// space follows from the height: on a wall of its slot where there is one, and beyond the slot's
// end wherever suits. Elements in a slot are left out. At the level where a slot ends, the pattern
// bulges along the slot's round end.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "part/part.h"

static const double degree = 3.14159265358979323846 / 180;

enum tag { SLOT_X = 1, SLOT_Y = 2 };  // columns of cut 2, rows of cut 1

// One cut in its own coordinates: r from the axis, ζ upwards from the neck, open at ζ < 0.
typedef struct cut {
  pb_joint_shape shape;
  double center;         // r of the arcs' centre
  double near_r, far_r;  // radii of the wall on the neck's side and of the other
  pb_point2 round;       // centre (r, ζ) of the round end
  double begin, end;     // angles of the round end at the pattern's lines
  pb_point2 corner[2];   // where the lines meet the round end
} cut;

typedef struct drawing {
  const pb_section *section;
  cut cut;
  size_t near, beyond;  // layers from the neck's level to a slot's end, and from there to the face
} drawing;

static cut cut_of(const pb_joint_shape *d) {
  double stop = d->slot_stop * degree, middle = d->neck_radius - 0.5 * d->slot_width;
  cut c = {.shape = *d, .center = 0.5 * d->neck + d->neck_radius};
  c.near_r = d->neck_radius;
  c.far_r = d->neck_radius - d->slot_width;
  c.round = (pb_point2){c.center - middle * cos(stop), middle * sin(stop)};
  c.begin = 180 * degree - stop;
  c.end = c.begin - 105 * degree;
  double angle[2] = {c.begin, c.end};
  for (int i = 0; i < 2; i++)
    c.corner[i] = (pb_point2){c.round.x + 0.5 * d->slot_width * cos(angle[i]),
                              c.round.y + 0.5 * d->slot_width * sin(angle[i])};
  return c;
}

// r of a wall at ζ, up to the corners at the round end.
static double wall(const cut *c, bool far, double z) {
  double radius = far ? c->far_r : c->near_r, angle = c->shape.slot_angle * degree;
  double leave = -radius * sin(angle);
  if (z < leave) return c->center - radius * cos(angle) + (leave - z) / tan(angle);
  double junction = radius * sin(c->shape.slot_stop * degree);
  double half = 0.5 * c->shape.slot_width, off = z - c->round.y;
  if (far && z > junction) return c->round.x + sqrt(fmax(0, half * half - off * off));
  return c->center - sqrt(fmax(0, radius * radius - z * z));
}

// Where the pattern's line 1 (near) or 2 (far) stands at ζ.
static double line(const cut *c, bool far, double z) {
  const pb_point2 *end = &c->corner[far];
  if (z <= end->y) return wall(c, far, z);
  double last = (far ? 0.22 : 0.11) * c->shape.diameter, top = 0.5 * c->shape.height;
  return end->x + (fmax(last, end->x) - end->x) * (z - end->y) / (top - end->y);
}

void pb_joint_walls(const pb_joint_shape *shape, double z, double out[2]) {
  cut c = cut_of(shape);
  out[0] = wall(&c, false, z);
  out[1] = wall(&c, true, z);
}

// Height of a level where nothing bulges, from the middle level upwards.
static double level_height(const drawing *d, size_t half) {
  double end = d->cut.corner[0].y, top = 0.5 * d->cut.shape.height;
  if (half <= 2 * d->near) return end * pb_block_fraction(d->near, 1.35, half);
  return end + (top - end) * pb_block_fraction(d->beyond, 1.3, half - 2 * d->near);
}

static double signed_height(const drawing *d, long half) {
  return half < 0 ? -level_height(d, (size_t)-half) : level_height(d, (size_t)half);
}

// Place (r, ζ) of the pattern's coordinate 1 ≤ η ≤ 2 above the neck: on the round end at its level,
// half-way to the next level between them.
static pb_point2 slot_point(const drawing *d, double eta, long half) {
  const cut *c = &d->cut;
  long end = 2 * (long)d->near;
  double t = eta - 1, z = signed_height(d, half);
  if (half == end) {
    double angle = c->begin + t * (c->end - c->begin), radius = 0.5 * c->shape.slot_width;
    return (pb_point2){c->round.x + radius * cos(angle), c->round.y + radius * sin(angle)};
  }
  if (half == end + 1) {
    pb_point2 a = slot_point(d, eta, end), b = slot_point(d, eta, end + 2);
    return (pb_point2){0.5 * (a.x + b.x), 0.5 * (a.y + b.y)};
  }
  if (half == end - 1) z += 0.5 * t * (c->corner[1].y - c->corner[0].y);
  double near = line(c, false, z), far = line(c, true, z);
  return (pb_point2){near + t * (far - near), z};
}

// How far the pattern bulges at η: upwards from the level's own height.
static double bulge(const drawing *d, double eta, long half) {
  if (labs(half - 2 * (long)d->near) > 1 || eta <= 1) return 0;
  double edge = slot_point(d, fmin(eta, 2), half).y - signed_height(d, half);
  return eta <= 2 ? edge : edge * (3 - eta);
}

// r of a pattern coordinate ≤ 2 at height ζ (of the actual place).
static double row(const drawing *d, double eta, long half, double z) {
  const cut *c = &d->cut;
  long end = 2 * (long)d->near;
  if (eta <= 1) return eta * line(c, false, z);
  if (half == end || half == end + 1) return slot_point(d, eta, half).x;
  return line(c, false, z) + (eta - 1) * (line(c, true, z) - line(c, false, z));
}

// The corner between the lines x = b, y = c and the circle: three quadrilaterals that meet in the
// middle.
static pb_point2 corner_point(double xi, double eta, double b, double c, double radius) {
  pb_point2 right = {sqrt(radius * radius - c * c), c}, top = {b, sqrt(radius * radius - b * b)};
  double angle = 0.5 * (atan2(right.y, right.x) + atan2(top.y, top.x));
  pb_point2 arc = {radius * cos(angle), radius * sin(angle)};
  pb_point2 low = {0.5 * (b + right.x), c}, left = {b, 0.5 * (c + top.y)};
  pb_point2 middle = {(low.x + left.x + arc.x) / 3, (low.y + left.y + arc.y) / 3};
  double u = xi - 2, v = eta - 2;
  pb_block block = {.corner = {{b, c}, low, middle, left}};
  if (u <= 0.5 && v <= 0.5) return pb_block_point(&block, 2 * u, 2 * v);
  if (u >= v) {
    block = (pb_block){.corner = {low, right, arc, middle}, .edge = {[1] = {true, {0, 0}}}};
    return pb_block_point(&block, 2 * u - 1, v / u);
  }
  block = (pb_block){.corner = {left, middle, arc, top}, .edge = {[2] = {true, {0, 0}}}};
  return pb_block_point(&block, u / v, 2 * v - 1);
}

static void place(const void *context, size_t node, size_t half_level, double xyz[3]) {
  const drawing *d = context;
  pb_point2 at = d->section->at[node];
  double xi = fabs(at.x), eta = fabs(at.y), radius = 0.5 * d->cut.shape.diameter;
  long half = (long)half_level - 2 * (long)(d->near + d->beyond);
  double z = signed_height(d, half) + bulge(d, eta, half) - bulge(d, xi, -half);
  double x = row(d, fmin(xi, 2), -half, -z), y = row(d, fmin(eta, 2), half, z);
  pb_point2 p = {x, y};
  if (xi > 2 && eta > 2) {
    p = corner_point(xi, eta, x, y, radius);
  } else if (xi > 2) {
    p.x = x + (xi - 2) * (sqrt(radius * radius - y * y) - x);
  } else if (eta > 2) {
    p.y = y + (eta - 2) * (sqrt(radius * radius - x * x) - y);
  }
  xyz[0] = copysign(p.x, at.x);
  xyz[1] = copysign(p.y, at.y);
  xyz[2] = z;
}

static int region(const void *context, size_t quad, size_t layer) {
  const drawing *d = context;
  int tag = d->section->tag[quad];
  size_t slots = 2 * d->near + d->beyond;  // layers that a slot crosses, from its open end
  if ((tag & SLOT_Y) && layer < slots) return -1;
  if ((tag & SLOT_X) && 2 * (d->near + d->beyond) - 1 - layer < slots) return -1;
  return 0;
}

// Quarter of the pattern: 3 × 3 blocks, the corner one in three.
static pb_status add_pattern(double density, pb_section *s, pb_error *err) {
  size_t core = (size_t)fmax(1, round(density)), half_rest = (size_t)fmax(1, round(2 * density));
  size_t cells[3] = {core, core, 2 * half_rest};  // two elements or more across a neck
  pb_status st = PB_OK;
  for (int j = 0; j < 3; j++) {
    for (int i = 0; !st && i < (j == 2 ? 2 : 3); i++) {
      double x = i, y = j;
      pb_block block = {.corner = {{x, y}, {x + 1, y}, {x + 1, y + 1}, {x, y + 1}},
                        .cells = {cells[i], cells[j]},
                        .tag = (i == 1 ? SLOT_X : 0) | (j == 1 ? SLOT_Y : 0)};
      st = pb_section_add(s, &block, true, true, err);
    }
  }
  static const pb_point2 corner[3][4] = {{{2, 2}, {2.5, 2}, {2.5, 2.5}, {2, 2.5}},
                                         {{2.5, 2}, {3, 2}, {3, 3}, {2.5, 2.5}},
                                         {{2, 2.5}, {2.5, 2.5}, {3, 3}, {2, 3}}};
  for (int i = 0; !st && i < 3; i++) {
    pb_block block = {.cells = {half_rest, half_rest}};
    memcpy(block.corner, corner[i], sizeof block.corner);
    st = pb_section_add(s, &block, true, true, err);
  }
  return st;
}

static pb_status check(const cut *c, pb_error *err) {
  const pb_joint_shape *d = &c->shape;
  double face = -0.5 * d->height, top = fmax(c->corner[0].y, c->round.y + 0.5 * d->slot_width);
  const struct {
    bool fits;
    const char *else_say;
  } rule[] = {
      {d->slot_angle > 10 && d->slot_angle < 80, "slot_angle is not between 10° and 80°"},
      {d->slot_stop > 10 && d->slot_stop < 80, "slot_stop is not between 10° and 80°"},
      {d->slot_width < 0.9 * d->neck_radius, "slot_width is too large for neck_radius"},
      {top < 0.45 * d->height, "height leaves no room above the slot's end"},
      {face < -c->near_r * sin(d->slot_angle * degree),
       "height ends before the slot leaves its arc"},
      {wall(c, true, face) < 0.45 * d->diameter,
       "the slot leaves through the side, not through the end face: raise diameter or slot_angle, "
       "or lower height"},
  };
  for (size_t i = 0; i < sizeof rule / sizeof *rule; i++)
    if (!rule[i].fits) return pb_fail(err, PB_ERR_GEOMETRY, "/dimensions", "%s", rule[i].else_say);
  return PB_OK;
}

pb_status pb_joint_mesh(const pb_joint_shape *shape, double density, pb_mesh *out, pb_error *err) {
  *out = (pb_mesh){0};
  pb_section section = {.tolerance = 1e-9};
  drawing d = {&section, cut_of(shape), (size_t)fmax(2, round(5 * density)),
               (size_t)fmax(1, round(2 * density))};
  pb_status st = check(&d.cut, err);
  if (!st) st = add_pattern(density, &section, err);
  if (!st) {
    pb_extrusion extrusion = {2 * (d.near + d.beyond), place, region, &d};
    st = pb_mesh_extrude(&section, &extrusion, out, err);
  }
  pb_section_clear(&section);
  return st;
}
