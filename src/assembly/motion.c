// How frames move: see motion.h.
#include "assembly/motion.h"

#include <stdlib.h>
#include <string.h>

static const size_t largest_size = 20000;  // as of one element: 3.2 GB a matrix

size_t pb_component_size(const pb_component *c) {
  return pb_component_motions(c) + (c->boundary.kind == PB_BOUNDARY_RESISTOR ? 1 : 0);
}

size_t pb_component_motions(const pb_component *c) {
  switch (c->type) {
  case PB_RIGID_BODY:
    return 6;
  case PB_STRUT_1DOF:
    return 7;
  case PB_APA_2DOF:
    return 8;
  case PB_SUPER_ELEMENT:
    return c->super.element->size;
  }
  return 0;
}

pb_status pb_layout_build(const pb_plant *plant, pb_layout *out, pb_error *err) {
  *out = (pb_layout){0};
  out->component = calloc(plant->component_count + 1, sizeof *out->component);
  out->connection = calloc(plant->connection_count + 1, sizeof *out->connection);
  if (!out->component || !out->connection) {
    pb_layout_clear(out);
    return pb_fail_memory(err, "/components");
  }
  for (size_t i = 0; i < plant->component_count; i++) {
    out->component[i] = out->size;
    out->size += pb_component_size(&plant->component[i]);
  }
  for (size_t i = 0; i < plant->connection_count; i++) {
    const pb_joint *joint = &plant->connection[i].joint;
    if (joint->type != PB_JOINT_ELEMENT) continue;
    out->connection[i] = out->size;
    out->size += joint->super.element->size;
  }
  if (out->size <= largest_size) return PB_OK;
  pb_status st =
      pb_fail(err, PB_ERR_SCHEMA, "/components",
              "%zu coordinates, elements' modes included, are more than the %zu that dense "
              "matrices can serve",
              out->size, largest_size);
  pb_layout_clear(out);
  return st;
}

void pb_layout_clear(pb_layout *layout) {
  free(layout->component);
  free(layout->connection);
  *layout = (pb_layout){0};
}

static void rotate(const double rotation[9], const double v[3], double out[3]) {
  for (int i = 0; i < 3; i++)
    out[i] = rotation[i] * v[0] + rotation[i + 3] * v[1] + rotation[i + 6] * v[2];
}

// Columns of u = axes·v + (axes·θ) × arm, θ_world = axes·θ, for v and θ at six consecutive columns.
static void rigid_columns(pb_motion *m, size_t start, const double axes[9], const double arm[3]) {
  for (size_t a = 0; a < 3; a++) {
    const double *e = axes + 3 * a;
    size_t t = m->count + a, r = m->count + 3 + a;
    m->column[t] = start + a;
    m->column[r] = start + 3 + a;
    for (int i = 0; i < 3; i++) {
      int j = (i + 1) % 3, k = (i + 2) % 3;
      m->value[i][t] = e[i];
      m->value[i][r] = e[j] * arm[k] - e[k] * arm[j];
      m->value[i + 3][r] = e[i];
    }
  }
  m->count += 6;
}

static const double world[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};

void pb_motion_frame(const pb_plant *plant, const pb_layout *layout, pb_anchor anchor,
                     pb_motion *out) {
  memset(out, 0, sizeof *out);
  if (anchor.component < 0) return;
  const pb_component *c = &plant->component[anchor.component];
  const pb_frame *frame = &c->frame[anchor.frame];
  size_t start = layout->component[anchor.component];
  double local[3], arm[3];
  memcpy(local, frame->position, sizeof local);
  if (c->type == PB_RIGID_BODY)
    for (int i = 0; i < 3; i++) local[i] -= c->body.center[i];
  rotate(c->pose.rotation, local, arm);
  if (c->type == PB_SUPER_ELEMENT) {
    rigid_columns(out, start + 6 * frame->node, c->pose.rotation, arm);
    return;
  }
  rigid_columns(out, start, world, arm);
  if (c->type == PB_RIGID_BODY || frame->half == 0) return;
  out->column[out->count] = start + 6;
  for (int i = 0; i < 3; i++) out->value[i][out->count] = c->pose.rotation[6 + i];
  out->count++;
}

void pb_motion_joint_node(const pb_connection *connection, size_t start, size_t node,
                          pb_motion *out) {
  const double arm[3] = {0};
  memset(out, 0, sizeof *out);
  rigid_columns(out, start + 6 * node, connection->rotation, arm);
}

void pb_frame_position(const pb_plant *plant, pb_anchor anchor, double position[3]) {
  const pb_component *c = &plant->component[anchor.component];
  const pb_frame *frame = &c->frame[anchor.frame];
  double local[3];
  memcpy(local, frame->position, sizeof local);
  if (c->type == PB_SUPER_ELEMENT)
    for (int i = 0; i < 3; i++) local[i] += c->super.element->position[i + 3 * frame->node];
  rotate(c->pose.rotation, local, position);
  for (int i = 0; i < 3; i++) position[i] += c->pose.position[i];
}

static void add_rotated(pb_motion *out, const pb_motion *m, const double rotation[9], double sign) {
  for (size_t j = 0; j < m->count; j++) {
    size_t at = out->count + j;
    out->column[at] = m->column[j];
    for (int i = 0; i < 3; i++) {
      double u = 0, r = 0;
      for (int k = 0; k < 3; k++) {
        u += rotation[k + 3 * i] * m->value[k][j];
        r += rotation[k + 3 * i] * m->value[k + 3][j];
      }
      out->value[i][at] = sign * u;
      out->value[i + 3][at] = sign * r;
    }
  }
  out->count += m->count;
}

void pb_motion_relative(const pb_motion *a, const pb_motion *b, const double rotation[9],
                        pb_motion *out) {
  memset(out, 0, sizeof *out);
  add_rotated(out, a, rotation, 1);
  add_rotated(out, b, rotation, -1);
}
