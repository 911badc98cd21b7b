// The coordinates of one plant by those of another: see transfer.h.
//
// Row r of L says how the new coordinate r follows from the old ones, q' = L q. Components that are
// the same in both keep their coordinates; of others the frames they share keep their motion, and
// the rest follows statically; what is new moves rigidly with what it is connected to.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/array.h"
#include "base/lapack.h"
#include "model/transfer.h"

typedef struct carrier {
  const pb_motion_map *old, *now;
  double *l;     // now->n rows of old->n
  double *lu;    // now->n rows of now->nu
  bool *known;   // [components of now] has its rows
  double *row;   // [6][old->n]: a motion under work
  double *next;  // the same again
  pb_error *err;
} carrier;

// Six motions (ux uy uz rx ry rz, world) by the old coordinates: rows of old->n.
static double *row_of(const carrier *c, double *rows, size_t r) {
  return rows + r * c->old->n;
}

static void old_frame(const carrier *c, pb_anchor anchor, double *rows) {
  pb_motion m;
  memset(rows, 0, 6 * c->old->n * sizeof *rows);
  pb_motion_frame(c->old->plant, &c->old->layout, anchor, &m);
  for (size_t r = 0; r < 6; r++)
    for (size_t i = 0; i < m.count; i++) row_of(c, rows, r)[m.column[i]] += m.value[r][i];
}

// Of a frame of the new plant, by the rows of L that are there.
static void new_frame(const carrier *c, pb_anchor anchor, double *rows) {
  pb_motion m;
  const size_t n = c->old->n;
  memset(rows, 0, 6 * n * sizeof *rows);
  if (anchor.component < 0) return;
  pb_motion_frame(c->now->plant, &c->now->layout, anchor, &m);
  for (size_t r = 0; r < 6; r++)
    for (size_t i = 0; i < m.count; i++)
      for (size_t j = 0; j < n; j++)
        row_of(c, rows, r)[j] += m.value[r][i] * c->l[m.column[i] * n + j];
}

// u + θ × arm, in place.
static void shift(const carrier *c, double *rows, const double arm[3]) {
  for (size_t i = 0; i < 3; i++) {
    const size_t j = (i + 1) % 3, k = (i + 2) % 3;
    for (size_t x = 0; x < c->old->n; x++)
      row_of(c, rows, i)[x] +=
          row_of(c, rows, 3 + j)[x] * arm[k] - row_of(c, rows, 3 + k)[x] * arm[j];
  }
}

static void set_row(const carrier *c, size_t coordinate, const double *row) {
  memcpy(c->l + coordinate * c->old->n, row, c->old->n * sizeof *row);
}

static void add_row(const carrier *c, size_t coordinate, double factor, const double *row) {
  for (size_t x = 0; x < c->old->n; x++) c->l[coordinate * c->old->n + x] += factor * row[x];
}

// --- the same component ---

static bool same_element(const pb_super_element *a, const pb_super_element *b) {
  if (a->element == b->element) return true;
  return a->element->size == b->element->size && a->element->frames == b->element->frames &&
         strcmp(a->element->file, b->element->file) == 0;
}

static void keep(const carrier *c, size_t to, size_t from, size_t count) {
  for (size_t i = 0; i < count; i++) c->l[(to + i) * c->old->n + from + i] = 1.0;
}

static void center_of(const pb_component *b, double out[3]) {
  for (int i = 0; i < 3; i++) {
    out[i] = b->pose.position[i];
    for (int a = 0; a < 3; a++) out[i] += b->pose.rotation[i + 3 * a] * b->body.center[a];
  }
}

// A centre of mass may lie elsewhere than it did: v' = v + θ × (c' − c).
static void keep_body(const carrier *c, const pb_component *now, size_t to, const pb_component *old,
                      size_t from) {
  double a[3], b[3], arm[3];
  center_of(now, a);
  center_of(old, b);
  for (int i = 0; i < 3; i++) arm[i] = a[i] - b[i];
  keep(c, to, from, 6);
  for (size_t i = 0; i < 3; i++) {
    const size_t j = (i + 1) % 3, k = (i + 2) % 3;
    c->l[(to + i) * c->old->n + from + 3 + j] += arm[k];
    c->l[(to + i) * c->old->n + from + 3 + k] -= arm[j];
  }
}

// --- another kind of component ---

// Motion of the frame of this name, at its place in the new plant; false when the old one lacks it.
static bool shared_frame(const carrier *c, size_t now, size_t old, const char *name, double *rows) {
  const pb_component *a = &c->now->plant->component[now], *b = &c->old->plant->component[old];
  const int at = pb_component_frame(a, name), was = pb_component_frame(b, name);
  double here[3], there[3], arm[3];
  if (at < 0 || was < 0) return false;
  const pb_anchor anchor = {(int)old, (size_t)was};
  pb_frame_position(c->now->plant, (pb_anchor){(int)now, (size_t)at}, here);
  pb_frame_position(c->old->plant, anchor, there);
  for (int i = 0; i < 3; i++) arm[i] = here[i] - there[i];
  old_frame(c, anchor, rows);
  shift(c, rows, arm);
  return true;
}

// The halves of a lumped strut between the motions of its two ends: both turn alike and slide on
// each other along z. With Δ = u_top − u_bottom over the length:
//   d = z·Δ,  θ = z × Δ / length + z (z·mean θ),  v = mean u − ½ d z,  w static between its
//   springs: (k_a + k_e) w = k_e d + f
static void strut_between(const carrier *c, size_t now, const double *bottom, const double *top) {
  const pb_component *s = &c->now->plant->component[now];
  const size_t n = c->old->n, start = c->now->layout.component[now];
  const double *z = s->pose.rotation + 6, length = s->strut.length;
  for (size_t x = 0; x < n; x++) {
    double delta[3], mean[3], d = 0.0, turn = 0.0;
    for (size_t i = 0; i < 3; i++) {
      delta[i] = top[i * n + x] - bottom[i * n + x];
      mean[i] = 0.5 * (top[i * n + x] + bottom[i * n + x]);
      d += z[i] * delta[i];
      turn += 0.5 * z[i] * (top[(3 + i) * n + x] + bottom[(3 + i) * n + x]);
    }
    for (size_t i = 0; i < 3; i++) {
      const size_t j = (i + 1) % 3, k = (i + 2) % 3;
      const double tilt = length > 0.0 ? (z[j] * delta[k] - z[k] * delta[j]) / length : 0.0;
      c->l[(start + i) * n + x] = mean[i] - 0.5 * d * z[i];
      c->l[(start + 3 + i) * n + x] = tilt + z[i] * turn;
    }
    c->l[(start + 6) * n + x] = d;
    if (s->type == PB_APA_2DOF) {
      const double springs = s->strut.k_a + s->strut.k_e;
      c->l[(start + 7) * n + x] = springs > 0.0 ? s->strut.k_e / springs * d : 0.0;
    }
  }
  if (s->type != PB_APA_2DOF || !(s->strut.k_a + s->strut.k_e > 0.0)) return;
  for (size_t j = 0; j < c->now->nu; j++)
    c->lu[(start + 7) * c->now->nu + j] =
        c->now->f[start + 7 + j * c->now->n] / (s->strut.k_a + s->strut.k_e);
}

// The rows of an element's interface frame out of a motion at that frame, world axes.
static void node_set(const carrier *c, size_t start, size_t node, const double rotation[9],
                     const double *rows) {
  for (size_t a = 0; a < 3; a++) {
    memset(c->l + (start + 6 * node + a) * c->old->n, 0, c->old->n * sizeof *c->l);
    memset(c->l + (start + 6 * node + 3 + a) * c->old->n, 0, c->old->n * sizeof *c->l);
    for (size_t i = 0; i < 3; i++) {
      add_row(c, start + 6 * node + a, rotation[i + 3 * a], rows + i * c->old->n);
      add_row(c, start + 6 * node + 3 + a, rotation[i + 3 * a], rows + (3 + i) * c->old->n);
    }
  }
}

// K_oo [X Y] = [−K_ob F_o] for the coordinates o that are not given[]; shape comes with F_o in its
// last columns. False where K_oo is singular.
static bool static_shape(const pb_element *e, const bool *given, size_t count, size_t forces,
                         double *shape) {
  const size_t m = e->size, free_count = m - count;
  double *koo = pb_array_new(free_count * free_count + 1, sizeof *koo);
  int *pivot = malloc((free_count + 1) * sizeof *pivot), info = 1;
  if (koo && pivot) {
    size_t col = 0, b = 0;
    for (size_t j = 0; j < m; j++) {
      size_t row = 0;
      for (size_t i = 0; i < m; i++) {
        if (given[i]) continue;
        if (given[j])
          shape[row++ + b * free_count] = -e->k[i + j * m];
        else
          koo[row++ + col * free_count] = e->k[i + j * m];
      }
      given[j] ? b++ : col++;
    }
    int n = (int)free_count, nrhs = (int)(count + forces);
    info = 0;
    if (n > 0) dgesv_(&n, &nrhs, koo, &n, pivot, shape, &n, &info);
  }
  free(koo);
  free(pivot);
  return info == 0;
}

// What an element has beside the coordinates that are given follows them statically, and the forces
// that act inside it.
static pb_status element_follow(const carrier *c, const pb_element *e, size_t start,
                                const bool *given, size_t count) {
  const size_t m = e->size, n = c->old->n, free_count = m - count, nu = c->now->nu;
  double *shape = pb_array_zero(free_count * (count + nu) + 1, sizeof *shape);
  if (!shape) return pb_fail_memory(c->err, e->file);
  for (size_t j = 0, at = free_count * count; j < nu; j++)
    for (size_t i = 0; i < m; i++)
      if (!given[i]) shape[at++] = c->now->f[start + i + j * c->now->n];
  if (!static_shape(e, given, count, nu, shape)) {
    free(shape);
    return pb_fail(c->err, PB_ERR_SINGULAR, e->file,
                   "its ends alone do not hold the element: it cannot follow them");
  }
  size_t row = 0;
  for (size_t i = 0; i < m; i++) {
    if (given[i]) continue;
    size_t b = 0;
    memset(c->l + (start + i) * n, 0, n * sizeof *c->l);
    for (size_t j = 0; j < m; j++)
      if (given[j]) add_row(c, start + i, shape[row + free_count * b++], c->l + (start + j) * n);
    for (size_t j = 0; j < nu; j++)
      c->lu[(start + i) * nu + j] = shape[row + free_count * (count + j)];
    row++;
  }
  free(shape);
  return PB_OK;
}

static void mark(bool *given, size_t node, size_t *count) {
  if (given[6 * node]) return;
  for (size_t i = 0; i < 6; i++) given[6 * node + i] = true;
  *count += 6;
}

// An element whose frames the old component shared: those are given.
static pb_status element_between(const carrier *c, size_t now, size_t old, bool *found) {
  const pb_component *s = &c->now->plant->component[now];
  const size_t start = c->now->layout.component[now];
  bool *given = calloc(s->super.element->size, sizeof *given);
  size_t count = 0;
  if (!given) return pb_fail_memory(c->err, s->pointer);
  for (size_t f = 0; f < s->frame_count; f++) {
    const pb_frame *frame = &s->frame[f];
    double back[3];
    if (given[6 * frame->node] || !shared_frame(c, now, old, frame->name, c->row)) continue;
    for (int i = 0; i < 3; i++) {  // from the frame back to its node
      back[i] = 0.0;
      for (int a = 0; a < 3; a++) back[i] -= s->pose.rotation[i + 3 * a] * frame->position[a];
    }
    shift(c, c->row, back);
    node_set(c, start, frame->node, s->pose.rotation, c->row);
    mark(given, frame->node, &count);
  }
  *found = count > 0;
  pb_status st = count > 0 ? element_follow(c, s->super.element, start, given, count) : PB_OK;
  free(given);
  return st;
}

// The whole component moves as a rigid body with the motion `rows` at `point`.
static void rigid_set(const carrier *c, size_t now, const double *rows, const double point[3]) {
  const pb_component *s = &c->now->plant->component[now];
  const size_t start = c->now->layout.component[now], n = c->old->n;
  double place[3], arm[3];
  const size_t nodes = s->type == PB_SUPER_ELEMENT ? s->super.element->frames : 1;
  for (size_t node = 0; node < nodes; node++) {
    memcpy(place, s->pose.position, sizeof place);
    if (s->type == PB_RIGID_BODY) center_of(s, place);
    for (int i = 0; i < 3 && s->type == PB_SUPER_ELEMENT; i++)
      for (int a = 0; a < 3; a++)
        place[i] += s->pose.rotation[i + 3 * a] * s->super.element->position[a + 3 * node];
    for (int i = 0; i < 3; i++) arm[i] = place[i] - point[i];
    memcpy(c->next, rows, 6 * n * sizeof *rows);
    shift(c, c->next, arm);
    if (s->type == PB_SUPER_ELEMENT)
      node_set(c, start, node, s->pose.rotation, c->next);
    else
      for (size_t r = 0; r < 6; r++) set_row(c, start + r, row_of(c, c->next, r));
  }
}

static bool is_lumped(const pb_component *s) {
  return s->type == PB_APA_2DOF || s->type == PB_STRUT_1DOF;
}

static pb_status changed_component(const carrier *c, size_t now, size_t old) {
  const pb_component *s = &c->now->plant->component[now];
  const pb_component *was = &c->old->plant->component[old];
  double point[3];
  if (is_lumped(s) && shared_frame(c, now, old, "bottom", c->row) &&
      shared_frame(c, now, old, "top", c->next)) {
    strut_between(c, now, c->row, c->next);
    return PB_OK;
  }
  if (s->type == PB_SUPER_ELEMENT) {
    bool found = false;
    pb_status st = element_between(c, now, old, &found);
    if (st || found) return st;
  }
  if (was->frame_count == 0) return PB_OK;
  const pb_anchor anchor = {(int)old, 0};
  pb_frame_position(c->old->plant, anchor, point);
  old_frame(c, anchor, c->row);
  rigid_set(c, now, c->row, point);
  return PB_OK;
}

static int find_component(const pb_plant *plant, const char *name) {
  for (size_t i = 0; i < plant->component_count; i++)
    if (strcmp(plant->component[i].name, name) == 0) return (int)i;
  return -1;
}

// What has relaxed in a stack with a resistor goes on where it was; where the resistor takes the
// place of an open end nothing has, else everything: δᵀq, by the row of z in K (stack_boundary.c).
static void relaxation_carry(const carrier *c, size_t now, size_t old, bool same) {
  const pb_component *s = &c->now->plant->component[now], *was = &c->old->plant->component[old];
  const size_t z = c->now->layout.component[now] + pb_component_motions(s), n = c->old->n;
  if (s->boundary.kind != PB_BOUNDARY_RESISTOR || was->boundary.kind == PB_BOUNDARY_OPEN) return;
  if (was->boundary.kind == PB_BOUNDARY_RESISTOR && same) {
    keep(c, z, c->old->layout.component[old] + pb_component_motions(was), 1);
    return;
  }
  const double *k = c->now->k + z * c->now->n;
  for (size_t i = 0; i < c->now->n; i++) {
    if (i == z || k[i] == 0) continue;
    add_row(c, z, -k[i] / k[z], c->l + i * n);
    for (size_t j = 0; j < c->now->nu; j++)
      c->lu[z * c->now->nu + j] -= k[i] / k[z] * c->lu[i * c->now->nu + j];
  }
}

static pb_status component_carry(const carrier *c, size_t now) {
  const pb_component *s = &c->now->plant->component[now];
  const int old = find_component(c->old->plant, s->name);
  if (old < 0) return PB_OK;
  c->known[now] = true;
  const pb_component *was = &c->old->plant->component[old];
  const size_t to = c->now->layout.component[now], from = c->old->layout.component[old];
  pb_status st = PB_OK;
  const bool same =
      s->type == was->type && (s->type != PB_SUPER_ELEMENT || same_element(&s->super, &was->super));
  if (!same)
    st = changed_component(c, now, (size_t)old);
  else if (s->type == PB_RIGID_BODY)
    keep_body(c, s, to, was, from);
  else
    keep(c, to, from, pb_component_motions(s));
  if (!st) relaxation_carry(c, now, (size_t)old, same);
  return st;
}

// Components that are new move with what holds them, found from the known ones outwards; what hangs
// on nothing known, or on the ground, is at rest.
static void newcomers_follow(const carrier *c) {
  const pb_plant *p = c->now->plant;
  for (bool more = true; more;) {
    more = false;
    for (size_t i = 0; i < p->connection_count; i++) {
      const pb_anchor end[2] = {p->connection[i].from, p->connection[i].to};
      for (int e = 0; e < 2; e++) {
        const pb_anchor here = end[e], there = end[1 - e];
        double point[3];
        if (here.component < 0 || c->known[here.component] || there.component < 0 ||
            !c->known[there.component])
          continue;
        new_frame(c, there, c->row);
        pb_frame_position(p, there, point);
        rigid_set(c, (size_t)here.component, c->row, point);
        c->known[here.component] = more = true;
      }
    }
  }
}

static const pb_connection *find_connection(const pb_plant *plant, const char *name, size_t *at) {
  for (size_t i = 0; i < plant->connection_count; i++) {
    if (strcmp(plant->connection[i].name, name) != 0) continue;
    *at = i;
    return &plant->connection[i];
  }
  return NULL;
}

static pb_status joint_carry(const carrier *c, size_t now) {
  const pb_connection *j = &c->now->plant->connection[now];
  size_t old = 0;
  if (j->joint.type != PB_JOINT_ELEMENT) return PB_OK;
  const size_t start = c->now->layout.connection[now];
  const pb_element *e = j->joint.super.element;
  const pb_connection *was = find_connection(c->old->plant, j->name, &old);
  if (was && was->joint.type == PB_JOINT_ELEMENT &&
      same_element(&j->joint.super, &was->joint.super)) {
    keep(c, start, c->old->layout.connection[old], e->size);
    return PB_OK;
  }
  bool *given = calloc(e->size, sizeof *given);
  size_t count = 0;
  if (!given) return pb_fail_memory(c->err, j->pointer);
  const pb_anchor end[2] = {j->from, j->to};
  for (int i = 0; i < 2; i++) {
    new_frame(c, end[i], c->row);
    node_set(c, start, j->joint.node[i], j->rotation, c->row);
    mark(given, j->joint.node[i], &count);
  }
  pb_status st = element_follow(c, e, start, given, count);
  free(given);
  return st;
}

static pb_status carry(carrier *c) {
  pb_status st = PB_OK;
  for (size_t i = 0; i < c->now->plant->component_count && !st; i++) st = component_carry(c, i);
  if (!st) newcomers_follow(c);
  for (size_t i = 0; i < c->now->plant->connection_count && !st; i++) st = joint_carry(c, i);
  return st;
}

static void transpose(const double *a, size_t rows, size_t cols, double *out) {
  for (size_t r = 0; r < rows; r++)
    for (size_t x = 0; x < cols; x++) out[r + x * rows] = a[r * cols + x];
}

// L and L_u are made by rows and handed out column-major.
pb_status pb_transfer_coordinates(const pb_motion_map *from, const pb_motion_map *to, double **l,
                                  double **lu, pb_error *err) {
  const size_t n = from->n, rows = to->n;
  carrier c = {.old = from, .now = to, .err = err};
  *l = pb_array_new(n * rows, sizeof **l);
  *lu = pb_array_new(to->nu * rows, sizeof **lu);
  c.l = pb_array_zero(n * rows, sizeof *c.l);
  c.lu = pb_array_zero(to->nu * rows, sizeof *c.lu);
  c.row = pb_array_new(6 * n, sizeof *c.row);
  c.next = pb_array_new(6 * n, sizeof *c.next);
  c.known = calloc(to->plant->component_count + 1, sizeof *c.known);
  const bool ok = *l && *lu && c.l && c.lu && c.row && c.next && c.known;
  pb_status st = ok ? carry(&c) : pb_fail_memory(err, "transfer");
  if (!st) {
    transpose(c.l, rows, n, *l);
    transpose(c.lu, rows, to->nu, *lu);
  }
  free(c.l);
  free(c.lu);
  free(c.row);
  free(c.next);
  free(c.known);
  if (st) {
    free(*l);
    free(*lu);
    *l = *lu = NULL;
  }
  return st;
}
