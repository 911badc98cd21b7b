// Stacking components and joints: see stack.h.
#include "assembly/stack.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

// a(n × n) += Σ weight[r] row_rᵀ row_r over the rows of a motion.
static void add_rows(double *a, size_t n, const pb_motion *m, const double weight[6]) {
  for (int r = 0; r < 6; r++) {
    if (weight[r] == 0) continue;
    for (size_t j = 0; j < m->count; j++)
      for (size_t i = 0; i < m->count; i++)
        a[m->column[i] + m->column[j] * n] += weight[r] * m->value[r][i] * m->value[r][j];
  }
}

// Adds a rigid body: mass at a motion's point and a full inertia (world axes) about it.
static void add_rigid(double *mass_matrix, size_t n, const pb_motion *m, double mass,
                      const double inertia[9]) {
  const double weight[6] = {mass, mass, mass, 0, 0, 0};
  add_rows(mass_matrix, n, m, weight);
  for (size_t j = 0; j < m->count; j++) {
    for (size_t i = 0; i < m->count; i++) {
      double value = 0;
      for (int r = 0; r < 3; r++)
        for (int s = 0; s < 3; s++)
          value += m->value[3 + r][i] * inertia[r + 3 * s] * m->value[3 + s][j];
      mass_matrix[m->column[i] + m->column[j] * n] += value;
    }
  }
}

// R I Rᵀ
static void rotate_inertia(const double r[9], const double inertia[9], double out[9]) {
  for (int i = 0; i < 3; i++) {
    for (int j = 0; j < 3; j++) {
      double value = 0;
      for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) value += r[i + 3 * a] * inertia[a + 3 * b] * r[j + 3 * b];
      out[i + 3 * j] = value;
    }
  }
}

// The motion of a point at height z on a lumped strut's axis, of its lower or upper half.
static void strut_motion(const pb_component *c, size_t start, double z, bool upper,
                         pb_motion *out) {
  pb_frame frame = {.position = {0, 0, z}, .half = upper};
  pb_component point = *c;
  point.frame = &frame;
  const pb_plant plant = {.component = &point};
  const pb_layout layout = {.component = &start};
  pb_motion_frame(&plant, &layout, (pb_anchor){0, 0}, out);
}

static void add_pair(double *a, size_t n, size_t i, size_t j, double value) {
  a[i + i * n] += value;
  a[j + j * n] += value;
  a[i + j * n] -= value;
  a[j + i * n] -= value;
}

// apa_2dof and strut_1dof [report 2.4]. With d the motion of the upper half and w that of the
// intermediate mass against the lower half: shell on d, actuator stacks on w, sensor stack on d −
// w.
static void stack_strut(pb_stack_equations *s, const pb_component *c, size_t start) {
  const pb_strut *p = &c->strut;
  size_t n = s->n, d = start + 6, w = start + 7;
  double half = 0.5 * p->mass, height = 0.5 * p->length, inertia[9] = {0}, turned[9];
  inertia[0] = inertia[4] = half * (3 * p->radius * p->radius + height * height) / 12;
  inertia[8] = 0.5 * half * p->radius * p->radius;
  rotate_inertia(c->pose.rotation, inertia, turned);
  pb_motion m;
  for (int upper = 0; upper < 2; upper++) {
    strut_motion(c, start, (upper ? 0.5 : -0.5) * height, upper, &m);
    add_rigid(s->m, n, &m, half, turned);
  }
  s->k[d + d * n] += p->k_1;
  s->c[d + d * n] += p->c_1;
  if (c->type != PB_APA_2DOF) return;
  s->k[w + w * n] += p->k_a;
  s->c[w + w * n] += p->c_a;
  add_pair(s->k, n, d, w, p->k_e);
  add_pair(s->c, n, d, w, p->c_e);
  // The intermediate mass moves along z: only that component of its motion carries its inertia.
  strut_motion(c, start, 0, false, &m);
  const double *z = c->pose.rotation + 6;
  pb_motion along = {.count = m.count + 1};
  for (size_t i = 0; i < m.count; i++) {
    along.column[i] = m.column[i];
    for (int a = 0; a < 3; a++) along.value[0][i] += z[a] * m.value[a][i];
  }
  along.column[m.count] = w;
  along.value[0][m.count] = 1;
  const double weight[6] = {p->intermediate_mass};
  add_rows(s->m, n, &along, weight);
}

// Adds an element's M, K and its damping: modal, and Rayleigh C = αM + βK.
static pb_status stack_element(pb_stack_equations *s, const pb_super_element *super, size_t start,
                               pb_error *err) {
  const pb_element *e = super->element;
  size_t m = e->size, n = s->n;
  double *c = calloc(m * m, sizeof *c);
  if (!c) return pb_fail_memory(err, e->file);
  pb_status st =
      super->modal_damping > 0 ? pb_element_damping(e, super->modal_damping, c, err) : PB_OK;
  for (size_t j = 0; j < m && !st; j++) {
    for (size_t i = 0; i < m; i++) {
      size_t at = start + i + (start + j) * n, from = i + j * m;
      s->m[at] += e->m[from];
      s->k[at] += e->k[from];
      s->c[at] += c[from] + super->alpha * e->m[from] + super->beta * e->k[from];
    }
  }
  free(c);
  return st;
}

static pb_status stack_component(pb_stack_equations *s, const pb_component *c, size_t start,
                                 pb_error *err) {
  switch (c->type) {
  case PB_RIGID_BODY: {
    double inertia[9];
    const double here[3] = {c->body.center[0], c->body.center[1], c->body.center[2]};
    pb_frame center = {.position = {here[0], here[1], here[2]}};
    pb_component body = *c;
    body.frame = &center;
    const pb_plant plant = {.component = &body};
    const pb_layout layout = {.component = &start};
    pb_motion m;
    pb_motion_frame(&plant, &layout, (pb_anchor){0, 0}, &m);
    rotate_inertia(c->pose.rotation, c->body.inertia, inertia);
    add_rigid(s->m, s->n, &m, c->body.mass, inertia);
    return PB_OK;
  }
  case PB_STRUT_1DOF:
  case PB_APA_2DOF:
    stack_strut(s, c, start);
    return PB_OK;
  case PB_SUPER_ELEMENT:
    return stack_element(s, &c->super, start, err);
  }
  return PB_OK;
}

// Appends the rows of a motion as constraints; rows that are zero constrain nothing.
static pb_status add_constraints(pb_stack_equations *s, const pb_motion *m, const bool locked[6],
                                 const char *owner, pb_error *err) {
  if (s->constraints + 6 > s->capacity) {
    size_t capacity = 2 * s->capacity + 48;
    double *g = realloc(s->g, capacity * s->n * sizeof *g);
    if (g) s->g = g;
    const char **list = realloc(s->owner, capacity * sizeof *list);
    if (list) s->owner = list;
    if (!g || !list) return pb_fail_memory(err, owner);
    s->capacity = capacity;
  }
  for (int r = 0; r < 6; r++) {
    double *row = s->g + s->constraints * s->n, norm = 0;
    if (!locked[r]) continue;
    memset(row, 0, s->n * sizeof *row);
    for (size_t i = 0; i < m->count; i++) row[m->column[i]] += m->value[r][i];
    for (size_t i = 0; i < m->count; i++) norm = hypot(norm, m->value[r][i]);
    if (norm == 0) continue;
    double scale = 0;
    for (size_t i = 0; i < s->n; i++) scale += row[i] * row[i];
    scale = sqrt(scale);
    if (scale <= 1e-14 * norm) continue;  // both frames on one rigid part
    for (size_t i = 0; i < s->n; i++) row[i] /= scale;
    s->owner[s->constraints++] = owner;
  }
  return PB_OK;
}

pb_status pb_stack_lock(pb_stack_equations *s, size_t coordinate, const char *owner,
                        pb_error *err) {
  const bool first[6] = {true};
  const pb_motion m = {.count = 1, .column = {coordinate}, .value = {{1}}};
  return add_constraints(s, &m, first, owner, err);
}

static const bool all_locked[6] = {true, true, true, true, true, true};

// A joint sits at its two frames, which coincide in the nominal pose; an element fills the way
// between them.
static pb_status check_coincidence(const pb_plant *plant, const pb_connection *c, pb_error *err) {
  if (c->from.component < 0 || c->to.component < 0) return PB_OK;
  double from[3], to[3], span[3] = {0}, gap = 0;
  pb_frame_position(plant, c->from, from);
  pb_frame_position(plant, c->to, to);
  if (c->joint.type == PB_JOINT_ELEMENT) {
    const double *p = c->joint.super.element->position;
    for (int i = 0; i < 3; i++)
      for (int a = 0; a < 3; a++)
        span[i] +=
            c->rotation[i + 3 * a] * (p[a + 3 * c->joint.node[1]] - p[a + 3 * c->joint.node[0]]);
  }
  for (int i = 0; i < 3; i++) gap = hypot(gap, to[i] - from[i] - span[i]);
  if (gap <= 1e-6) return PB_OK;
  return pb_fail(err, PB_ERR_GEOMETRY, c->pointer,
                 "its frames are at [%.6g, %.6g, %.6g] and [%.6g, %.6g, %.6g] m: %.3g mm away from "
                 "where the joint joins them",
                 from[0], from[1], from[2], to[0], to[1], to[2], 1e3 * gap);
}

static pb_status stack_joint_element(pb_stack_equations *s, const pb_plant *plant,
                                     const pb_layout *layout, const pb_connection *c, size_t start,
                                     pb_error *err) {
  pb_status st = stack_element(s, &c->joint.super, start, err);
  const pb_anchor end[2] = {c->from, c->to};
  for (int i = 0; i < 2 && !st; i++) {
    pb_motion frame, node, relative;
    pb_motion_frame(plant, layout, end[i], &frame);
    pb_motion_joint_node(c, start, c->joint.node[i], &node);
    pb_motion_relative(&node, &frame, c->rotation, &relative);
    st = add_constraints(s, &relative, all_locked, c->pointer, err);
  }
  return st;
}

static pb_status stack_connection(pb_stack_equations *s, const pb_plant *plant,
                                  const pb_layout *layout, size_t index, pb_error *err) {
  const pb_connection *c = &plant->connection[index];
  pb_status st = check_coincidence(plant, c, err);
  if (st) return st;
  if (c->joint.type == PB_JOINT_ELEMENT)
    return stack_joint_element(s, plant, layout, c, layout->connection[index], err);
  pb_motion from, to, relative;
  pb_motion_frame(plant, layout, c->from, &from);
  pb_motion_frame(plant, layout, c->to, &to);
  pb_motion_relative(&to, &from, c->rotation, &relative);
  add_rows(s->k, s->n, &relative, c->joint.k);
  add_rows(s->c, s->n, &relative, c->joint.c);
  return add_constraints(s, &relative, c->joint.locked, c->pointer, err);
}

static pb_status allocate(pb_stack_equations *s, pb_error *err) {
  size_t n = s->n;
  s->m = calloc(n * n, sizeof(double));
  s->c = calloc(n * n, sizeof(double));
  s->k = calloc(n * n, sizeof(double));
  s->f = calloc(n * s->nu, sizeof(double));
  s->d = calloc(s->ny * s->nu, sizeof(double));
  bool ok = s->m && s->c && s->k && s->f && s->d;
  for (int i = 0; i < 3; i++) {
    s->y[i] = calloc(n * s->ny, sizeof(double));
    ok = ok && s->y[i];
  }
  return ok ? PB_OK : pb_fail_memory(err, "/components");
}

pb_status pb_stack_build(const pb_plant *plant, const pb_layout *layout, pb_warnings *warnings,
                         pb_stack_equations *out, pb_error *err) {
  *out =
      (pb_stack_equations){.n = layout->size, .nu = plant->input_count, .ny = plant->output_count};
  pb_status st = allocate(out, err);
  for (size_t i = 0; i < plant->component_count && !st; i++)
    st = stack_component(out, &plant->component[i], layout->component[i], err);
  for (size_t i = 0; i < plant->connection_count && !st; i++)
    st = stack_connection(out, plant, layout, i, err);
  if (!st) st = pb_stack_boundaries(plant, layout, out, err);
  if (!st) st = pb_stack_signals(plant, layout, warnings, out, err);
  if (st) pb_stack_clear(out);
  return st;
}

void pb_stack_clear(pb_stack_equations *s) {
  free(s->m);
  free(s->c);
  free(s->k);
  free(s->f);
  for (int i = 0; i < 3; i++) free(s->y[i]);
  free(s->d);
  free(s->g);
  free(s->owner);
  free(s->relaxation);
  *s = (pb_stack_equations){0};
}
