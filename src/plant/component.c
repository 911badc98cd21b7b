// Reading components: rigid bodies, amplified actuators, struts and super-elements.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"
#include "base/text.h"
#include "plant/boundary.h"
#include "plant/loader.h"

static const pb_field apa_fields[] = {
    {"k_1", offsetof(pb_strut, k_1), PB_NON_NEGATIVE, true, 0},
    {"c_1", offsetof(pb_strut, c_1), PB_NON_NEGATIVE, false, 0},
    {"k_a", offsetof(pb_strut, k_a), PB_NON_NEGATIVE, true, 0},
    {"c_a", offsetof(pb_strut, c_a), PB_NON_NEGATIVE, false, 0},
    {"k_e", offsetof(pb_strut, k_e), PB_NON_NEGATIVE, true, 0},
    {"c_e", offsetof(pb_strut, c_e), PB_NON_NEGATIVE, false, 0},
    {"g_a", offsetof(pb_strut, g_a), PB_ANY, false, 0},
    {"g_s", offsetof(pb_strut, g_s), PB_ANY, false, 0},
    {"mass", offsetof(pb_strut, mass), PB_NON_NEGATIVE, true, 0},
    {"intermediate_mass", offsetof(pb_strut, intermediate_mass), PB_NON_NEGATIVE, true, 0},
    {"length", offsetof(pb_strut, length), PB_POSITIVE, true, 0},
    {"radius", offsetof(pb_strut, radius), PB_NON_NEGATIVE, true, 0},
};

static const pb_field strut_fields[] = {
    {"k", offsetof(pb_strut, k_1), PB_NON_NEGATIVE, true, 0},
    {"c", offsetof(pb_strut, c_1), PB_NON_NEGATIVE, false, 0},
    {"mass", offsetof(pb_strut, mass), PB_NON_NEGATIVE, true, 0},
    {"length", offsetof(pb_strut, length), PB_POSITIVE, true, 0},
    {"radius", offsetof(pb_strut, radius), PB_NON_NEGATIVE, true, 0},
};

static const pb_field body_fields[] = {
    {"mass", offsetof(pb_rigid_body, mass), PB_NON_NEGATIVE, true, 0},
};

static const pb_field super_fields[] = {
    {"g_a", offsetof(pb_super_element, g_a), PB_ANY, false, 0},
    {"g_s", offsetof(pb_super_element, g_s), PB_ANY, false, 0},
    {"polarity", offsetof(pb_super_element, polarity), PB_SIGN, false, 1},
    {"half_height", offsetof(pb_super_element, half_height), PB_POSITIVE, false, 0},
};

#define PB_PLACE_KEYS "type", "model", "position", "quaternion", "z_axis", "x_axis"
static const char *const strut_keys[] = {PB_PLACE_KEYS, NULL};
static const char *const apa_keys[] = {PB_PLACE_KEYS, "boundary", NULL};
static const char *const body_keys[] = {PB_PLACE_KEYS, "inertia", "center_of_mass", "frames", NULL};
#define PB_SUPER_KEYS \
  PB_PLACE_KEYS, "file", "modal_damping", "rayleigh", "frames", "stacks", "ends", "boundary"
static const char *const super_keys[] = {PB_SUPER_KEYS, NULL};
// A model may serve components and joints: only the latter know "nodes".
static const char *const super_model_keys[] = {PB_SUPER_KEYS, "nodes", NULL};

typedef struct type_entry {
  const char *name;
  pb_component_type type;
  const char *const *keys;
  const pb_field *fields;
  size_t count;
} type_entry;

#define PB_COUNT(array) (sizeof(array) / sizeof *(array))
static const type_entry types[] = {
    {"rigid_body", PB_RIGID_BODY, body_keys, body_fields, PB_COUNT(body_fields)},
    {"super_element", PB_SUPER_ELEMENT, super_keys, super_fields, PB_COUNT(super_fields)},
    {"apa_2dof", PB_APA_2DOF, apa_keys, apa_fields, PB_COUNT(apa_fields)},
    {"strut_1dof", PB_STRUT_1DOF, strut_keys, strut_fields, PB_COUNT(strut_fields)},
};

static const type_entry *find_type(const char *name) {
  for (size_t i = 0; i < PB_COUNT(types); i++)
    if (!strcmp(types[i].name, name)) return &types[i];
  return NULL;
}

pb_status pb_loader_check_component_model(const pb_reader *r, const char *type, bool *known) {
  const type_entry *t = find_type(type);
  *known = t != NULL;
  if (!t) return PB_OK;
  pb_component scratch = {0};
  const char *const *keys = t->type == PB_SUPER_ELEMENT ? super_model_keys : t->keys;
  pb_status st = pb_reader_known(r, keys, t->fields, t->count);
  void *base = t->type == PB_RIGID_BODY      ? (void *)&scratch.body
               : t->type == PB_SUPER_ELEMENT ? (void *)&scratch.super
                                             : (void *)&scratch.strut;
  return st ? st : pb_reader_fields(r, t->fields, t->count, base, true);
}

// Adds a frame; the name is copied.
static pb_status add_frame(pb_component *c, const char *name, const double position[3], size_t node,
                           int half, pb_error *err) {
  pb_frame *frame = realloc(c->frame, (c->frame_count + 1) * sizeof *frame);
  if (!frame) return pb_fail_memory(err, c->pointer);
  c->frame = frame;
  pb_frame *f = &frame[c->frame_count];
  *f = (pb_frame){.name = pb_text_copy(name), .node = node, .half = half};
  if (!f->name) return pb_fail_memory(err, c->pointer);
  memcpy(f->position, position, sizeof f->position);
  c->frame_count++;
  return PB_OK;
}

int pb_component_frame(const pb_component *c, const char *name) {
  for (size_t i = 0; i < c->frame_count; i++)
    if (!strcmp(c->frame[i].name, name)) return (int)i;
  return -1;
}

static pb_status check_frame_name(const pb_component *c, const char *name, const char *where,
                                  pb_error *err) {
  if (!name[0] || strchr(name, '.'))
    return pb_fail(err, PB_ERR_SCHEMA, where, "a frame's name is not empty and has no dot");
  if (pb_component_frame(c, name) >= 0)
    return pb_fail(err, PB_ERR_SCHEMA, where, "the component already has a frame \"%s\"", name);
  return PB_OK;
}

// "frames" of a rigid body ({name: {"position"}}) or of an element ({name: {"node", "offset"}}).
static pb_status read_frames(const pb_reader *r, pb_component *c) {
  static const char *const body_frame[] = {"position", NULL};
  static const char *const element_frame[] = {"node", "offset", NULL};
  char where[256];
  const cJSON *frames = pb_reader_find(r, "frames", where);
  if (!frames) return PB_OK;
  if (!cJSON_IsObject(frames))
    return pb_fail(r->err, PB_ERR_SCHEMA, where, "expected an object of named frames");
  bool element = c->type == PB_SUPER_ELEMENT;
  for (const cJSON *m = frames->child; m; m = m->next) {
    char at[256], key[256];
    double position[3] = {0};
    size_t node = 1;
    pb_reader fr;
    pb_json_pointer(at, sizeof at, where, m->string);
    pb_status st = check_frame_name(c, m->string, at, r->err);
    if (!st) st = pb_reader_open(m, at, NULL, &fr, r->err);
    if (!st) st = pb_reader_known(&fr, element ? element_frame : body_frame, NULL, 0);
    if (!st) st = pb_reader_vector(&fr, element ? "offset" : "position", !element, position, NULL);
    if (!st && element)
      st = pb_json_index(pb_reader_find(&fr, "node", key), key, 1, c->super.element->frames, &node,
                         r->err);
    if (!st) st = add_frame(c, m->string, position, node - 1, 0, r->err);
    if (st) return st;
  }
  return PB_OK;
}

// Refuses an inertia that no body can have; warns about none: eigenvalues below zero only.
static pb_status check_inertia(const double *inertia, const char *where, pb_error *err) {
  double a[9], w[3], work[64];
  int n = 3, lwork = 64, liwork = 32, iwork[32], info = 0;
  memcpy(a, inertia, sizeof a);
  dsyevd_("N", "U", &n, a, &n, w, work, &lwork, iwork, &liwork, &info);
  if (info || w[0] < -1e-12 * fabs(w[2]))
    return pb_fail(err, PB_ERR_SCHEMA, where,
                   "the inertia has a negative principal moment (%g kg m²)", w[0]);
  return PB_OK;
}

static pb_status read_body(const pb_reader *r, pb_component *c) {
  char where[256];
  double v[6] = {0};
  const cJSON *inertia = pb_reader_find(r, "inertia", where);
  int size = cJSON_IsArray(inertia) ? cJSON_GetArraySize(inertia) : 0;
  if (size != 3 && size != 6)
    return pb_fail(r->err, PB_ERR_SCHEMA, where,
                   "%sexpected [Ixx,Iyy,Izz] or [Ixx,Iyy,Izz,Ixy,Ixz,Iyz]",
                   inertia ? "" : "missing; ");
  pb_status st = pb_json_numbers(inertia, where, (size_t)size, v, r->err);
  if (st) return st;
  pb_rigid_body *b = &c->body;
  const double full[9] = {v[0], v[3], v[4], v[3], v[1], v[5], v[4], v[5], v[2]};
  memcpy(b->inertia, full, sizeof full);
  st = check_inertia(full, where, r->err);
  if (!st) st = pb_reader_vector(r, "center_of_mass", false, b->center, NULL);
  const double origin[3] = {0};
  if (!st) st = add_frame(c, "origin", origin, 0, 0, r->err);
  return st ? st : read_frames(r, c);
}

static pb_status read_strut(const pb_reader *r, pb_component *c) {
  const double bottom[3] = {0, 0, -0.5 * c->strut.length}, top[3] = {0, 0, 0.5 * c->strut.length};
  pb_status st = add_frame(c, "bottom", bottom, 0, 0, r->err);
  if (!st) st = add_frame(c, "top", top, 0, 1, r->err);
  return st || c->type != PB_APA_2DOF ? st : pb_loader_boundary(r, c);
}

// One of "stacks": {"frames": [A, B], "axis": [..]}.
static pb_status read_stack(const pb_reader *stacks, const char *key, const pb_component *c,
                            pb_stack *out) {
  static const char *const known[] = {"frames", "axis", NULL};
  char where[256], at[256];
  pb_reader r;
  const cJSON *object = pb_reader_find(stacks, key, where);
  if (!object) return PB_OK;
  pb_status st = pb_reader_open(object, where, NULL, &r, stacks->err);
  if (!st) st = pb_reader_known(&r, known, NULL, 0);
  if (st) return st;
  const cJSON *frames = pb_reader_find(&r, "frames", at);
  if (!cJSON_IsArray(frames) || cJSON_GetArraySize(frames) != 2)
    return pb_fail(r.err, PB_ERR_SCHEMA, at, "expected the names of two frames");
  for (int i = 0; i < 2; i++) {
    const cJSON *name = cJSON_GetArrayItem(frames, i);
    int index = cJSON_IsString(name) ? pb_component_frame(c, name->valuestring) : -1;
    if (index < 0)
      return pb_fail(r.err, cJSON_IsString(name) ? PB_ERR_REFERENCE : PB_ERR_SCHEMA, at,
                     "expected names of the component's frames (\"1\" to \"%zu\" and its own)",
                     c->super.element->frames);
    out->frame[i] = (size_t)index;
  }
  if (out->frame[0] == out->frame[1])
    return pb_fail(r.err, PB_ERR_SCHEMA, at, "a stack lies between two different frames");
  out->axis[0] = 1;
  st = pb_reader_direction(&r, "axis", false, out->axis, NULL);
  out->present = st == PB_OK;
  return st;
}

static pb_status read_stacks(const pb_reader *r, pb_component *c) {
  static const char *const known[] = {"actuator", "sensor", NULL};
  char where[256];
  pb_reader stacks;
  const cJSON *object = pb_reader_find(r, "stacks", where);
  if (!object) return PB_OK;
  pb_status st = pb_reader_open(object, where, NULL, &stacks, r->err);
  if (!st) st = pb_reader_known(&stacks, known, NULL, 0);
  if (!st) st = read_stack(&stacks, "actuator", c, &c->super.actuator);
  return st ? st : read_stack(&stacks, "sensor", c, &c->super.sensor);
}

static pb_status read_ends(const pb_reader *r, pb_super_element *s) {
  char where[256];
  const cJSON *ends = pb_reader_find(r, "ends", where);
  if (!ends) return PB_OK;
  if (!cJSON_IsArray(ends) || cJSON_GetArraySize(ends) != 2)
    return pb_fail(r->err, PB_ERR_SCHEMA, where, "expected [bottom node, top node]");
  for (int i = 0; i < 2; i++) {
    pb_status st = pb_json_index(cJSON_GetArrayItem(ends, i), where, 1, s->element->frames,
                                 &s->ends[i], r->err);
    if (st) return st;
    s->ends[i]--;
  }
  s->has_ends = true;
  return PB_OK;
}

static pb_status read_super(pb_loader *loader, const pb_reader *r, pb_component *c) {
  const double zero[3] = {0};
  pb_status st = pb_loader_element(loader, r, &c->super.element);
  if (!st) st = pb_loader_damping(r, &c->super);
  for (size_t i = 0; !st && i < c->super.element->frames; i++) {
    char name[24];
    snprintf(name, sizeof name, "%zu", i + 1);
    st = add_frame(c, name, zero, i, 0, r->err);
  }
  if (!st) st = read_frames(r, c);
  if (!st) st = read_stacks(r, c);
  if (!st) st = read_ends(r, &c->super);
  if (!st) st = pb_loader_boundary(r, c);
  // Its ends are also its bottom and top, as those of the lumped actuators, unless the file says
  // else.
  if (!st && c->super.has_ends && pb_component_frame(c, "bottom") < 0)
    st = add_frame(c, "bottom", zero, c->super.ends[0], 0, r->err);
  if (!st && c->super.has_ends && pb_component_frame(c, "top") < 0)
    st = add_frame(c, "top", zero, c->super.ends[1], 0, r->err);
  return st;
}

static pb_status read_place(const pb_reader *r, pb_pose *pose) {
  pb_status st = pb_reader_vector(r, "position", false, pose->position, NULL);
  return st ? st : pb_loader_orientation(r, pose->rotation, NULL);
}

static pb_status read_type(const pb_reader *r, const type_entry **out) {
  const char *name;
  char where[256];
  pb_status st = pb_reader_string(r, "type", true, &name);
  if (st) return st;
  *out = find_type(name);
  if (*out) return PB_OK;
  pb_reader_find(r, "type", where);
  return pb_fail(r->err, PB_ERR_SCHEMA, where,
                 "\"%s\" is no component type; known: rigid_body super_element apa_2dof strut_1dof",
                 name);
}

pb_status pb_loader_component(pb_loader *loader, const cJSON *object, const char *name,
                              pb_component *out) {
  char pointer[256];
  pb_json_pointer(pointer, sizeof pointer, "/components", name);
  pb_reader r;
  const type_entry *type = NULL;
  pb_status st = pb_reader_open(object, pointer, loader->models, &r, loader->err);
  if (!st && (!name[0] || strchr(name, '.') || !strcmp(name, "ground")))
    st = pb_fail(loader->err, PB_ERR_SCHEMA, pointer,
                 "a component's name is not empty, has no dot and is not \"ground\"");
  if (!st) st = read_type(&r, &type);
  if (!st) st = pb_reader_known(&r, type->keys, type->fields, type->count);
  if (st) return st;
  out->type = type->type;
  out->name = pb_text_copy(name);
  out->pointer = pb_text_copy(pointer);
  if (!out->name || !out->pointer) return pb_fail_memory(loader->err, pointer);
  void *base = type->type == PB_RIGID_BODY      ? (void *)&out->body
               : type->type == PB_SUPER_ELEMENT ? (void *)&out->super
                                                : (void *)&out->strut;
  st = read_place(&r, &out->pose);
  if (!st) st = pb_reader_fields(&r, type->fields, type->count, base, false);
  if (st) return st;
  switch (type->type) {
  case PB_RIGID_BODY:
    return read_body(&r, out);
  case PB_SUPER_ELEMENT:
    return read_super(loader, &r, out);
  case PB_APA_2DOF:
  case PB_STRUT_1DOF:
    return read_strut(&r, out);
  }
  return PB_OK;
}

void pb_component_clear(pb_component *c) {
  if (c->type == PB_SUPER_ELEMENT) pb_element_free(c->super.element);
  for (size_t i = 0; i < c->frame_count; i++) free(c->frame[i].name);
  free(c->frame);
  free(c->name);
  free(c->pointer);
  *c = (pb_component){0};
}
