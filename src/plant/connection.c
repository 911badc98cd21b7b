// Reading connections and their joints.
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "plant/loader.h"

enum { X, Y, Z, RX, RY, RZ };  // directions in joint axes

// Stiffness and damping as the file names them: bending, torsion, axial, shear.
typedef struct rates {
  double k_f, k_t, k_a, k_s;
  double c_f, c_t, c_a, c_s;
} rates;

#define PB_RATES(suffix)                                                    \
  {"k_" #suffix, offsetof(rates, k_##suffix), PB_NON_NEGATIVE, false, 0}, { \
    "c_" #suffix, offsetof(rates, c_##suffix), PB_NON_NEGATIVE, false, 0    \
  }

static const pb_field bending[] = {PB_RATES(f)};
static const pb_field axial[] = {PB_RATES(a)};
static const pb_field bending_torsion[] = {PB_RATES(f), PB_RATES(t)};
static const pb_field bending_axial[] = {PB_RATES(f), PB_RATES(a)};
static const pb_field bending_torsion_axial[] = {PB_RATES(f), PB_RATES(t), PB_RATES(a)};
static const pb_field all_rates[] = {PB_RATES(f), PB_RATES(t), PB_RATES(a), PB_RATES(s)};

static const char *const joint_keys[] = {"type", "model", NULL};
static const char *const element_keys[] = {"type",     "model", "file", "modal_damping",
                                           "rayleigh", "nodes", NULL};

typedef struct type_entry {
  const char *name;
  pb_joint_type type;
  unsigned free;  // bit d: direction d is free
  const pb_field *fields;
  size_t count;
} type_entry;

#define PB_COUNT(array) (sizeof(array) / sizeof *(array))
#define BIT(d) (1u << (d))
static const type_entry types[] = {
    {"weld", PB_WELD, 0, NULL, 0},
    {"universal", PB_UNIVERSAL, BIT(RX) | BIT(RY), bending, PB_COUNT(bending)},
    {"spherical", PB_SPHERICAL, BIT(RX) | BIT(RY) | BIT(RZ), bending_torsion,
     PB_COUNT(bending_torsion)},
    {"universal_axial", PB_UNIVERSAL_AXIAL, BIT(RX) | BIT(RY) | BIT(Z), bending_axial,
     PB_COUNT(bending_axial)},
    {"spherical_axial", PB_SPHERICAL_AXIAL, BIT(RX) | BIT(RY) | BIT(RZ) | BIT(Z),
     bending_torsion_axial, PB_COUNT(bending_torsion_axial)},
    {"bushing", PB_BUSHING, BIT(X) | BIT(Y) | BIT(Z) | BIT(RX) | BIT(RY) | BIT(RZ), all_rates,
     PB_COUNT(all_rates)},
    {"prismatic", PB_PRISMATIC, BIT(Z), axial, PB_COUNT(axial)},
    {"super_element", PB_JOINT_ELEMENT, 0, NULL, 0},
};

static const type_entry *find_type(const char *name) {
  for (size_t i = 0; i < PB_COUNT(types); i++)
    if (!strcmp(types[i].name, name)) return &types[i];
  return NULL;
}

static const char *const *keys_of(const type_entry *t) {
  return t->type == PB_JOINT_ELEMENT ? element_keys : joint_keys;
}

pb_status pb_loader_check_joint_model(const pb_reader *r, const char *type, bool *known) {
  const type_entry *t = find_type(type);
  *known = t != NULL;
  if (!t) return PB_OK;
  rates scratch;
  pb_status st = pb_reader_known(r, keys_of(t), t->fields, t->count);
  return st ? st : pb_reader_fields(r, t->fields, t->count, &scratch, true);
}

static pb_status read_nodes(const pb_reader *r, pb_joint *joint) {
  char where[256];
  const cJSON *nodes = pb_reader_find(r, "nodes", where);
  size_t frames = joint->super.element->frames, node[2] = {2, 1};
  if (nodes && (!cJSON_IsArray(nodes) || cJSON_GetArraySize(nodes) != 2))
    return pb_fail(r->err, PB_ERR_SCHEMA, where, "expected [node at from, node at to]");
  for (int i = 0; nodes && i < 2; i++) {
    pb_status st = pb_json_index(cJSON_GetArrayItem(nodes, i), where, 1, frames, &node[i], r->err);
    if (st) return st;
  }
  if (node[0] == node[1] || frames < 2)
    return pb_fail(r->err, PB_ERR_SCHEMA, where, "a joint needs two different interface frames");
  joint->node[0] = node[0] - 1;
  joint->node[1] = node[1] - 1;
  return PB_OK;
}

static pb_status read_joint(pb_loader *loader, const pb_reader *r, pb_joint *out) {
  const char *name;
  char where[256];
  pb_status st = pb_reader_string(r, "type", true, &name);
  if (st) return st;
  const type_entry *t = find_type(name);
  if (!t) {
    pb_reader_find(r, "type", where);
    return pb_fail(r->err, PB_ERR_SCHEMA, where,
                   "\"%s\" is no joint type; known: weld universal spherical universal_axial "
                   "spherical_axial bushing prismatic super_element",
                   name);
  }
  rates v = {0};
  st = pb_reader_known(r, keys_of(t), t->fields, t->count);
  if (!st) st = pb_reader_fields(r, t->fields, t->count, &v, false);
  if (st) return st;
  out->type = t->type;
  if (t->type == PB_JOINT_ELEMENT) {
    st = pb_loader_element(loader, r, &out->super.element);
    if (!st) st = pb_loader_damping(r, &out->super);
    return st ? st : read_nodes(r, out);
  }
  const double k[6] = {v.k_s, v.k_s, v.k_a, v.k_f, v.k_f, v.k_t};
  const double c[6] = {v.c_s, v.c_s, v.c_a, v.c_f, v.c_f, v.c_t};
  for (int d = 0; d < 6; d++) {
    out->locked[d] = !(t->free & BIT(d));
    out->k[d] = out->locked[d] ? 0 : k[d];
    out->c[d] = out->locked[d] ? 0 : c[d];
  }
  return PB_OK;
}

// "joint" is the name of a model or an object, which may name a model in turn.
static pb_status open_joint(pb_loader *loader, const pb_reader *connection, pb_reader *out) {
  char where[256];
  const cJSON *joint = pb_reader_find(connection, "joint", where);
  if (!joint)
    return pb_fail(loader->err, PB_ERR_SCHEMA, where,
                   "missing; expected a model's name or a joint");
  if (!cJSON_IsString(joint)) return pb_reader_open(joint, where, loader->models, out, loader->err);
  const cJSON *model = loader->models ? pb_json_member(loader->models, joint->valuestring) : NULL;
  if (!model)
    return pb_fail(loader->err, PB_ERR_REFERENCE, where, "there is no model \"%s\"",
                   joint->valuestring);
  char pointer[256];
  pb_json_pointer(pointer, sizeof pointer, "/models", joint->valuestring);
  return pb_reader_open(model, pointer, NULL, out, loader->err);
}

pb_status pb_loader_anchor(const pb_reader *r, const char *key, const pb_plant *plant,
                           pb_anchor *out) {
  char where[256], component[256];
  const char *text;
  pb_status st = pb_reader_string(r, key, true, &text);
  if (st) return st;
  pb_reader_find(r, key, where);
  *out = (pb_anchor){.component = -1};
  if (!strcmp(text, "ground")) return PB_OK;
  const char *dot = strchr(text, '.');
  size_t n = dot ? (size_t)(dot - text) : strlen(text);
  if (n >= sizeof component) n = sizeof component - 1;
  memcpy(component, text, n);
  component[n] = '\0';
  for (size_t i = 0; i < plant->component_count; i++) {
    const pb_component *c = &plant->component[i];
    if (strcmp(c->name, component)) continue;
    int frame = pb_component_frame(c, dot ? dot + 1 : "origin");
    if (frame >= 0) {
      *out = (pb_anchor){.component = (int)i, .frame = (size_t)frame};
      return PB_OK;
    }
    char list[300] = "";
    for (size_t f = 0; f < c->frame_count && strlen(list) < 240; f++) {
      strncat(list, " ", 2);
      strncat(list, c->frame[f].name, 40);
    }
    return pb_fail(r->err, PB_ERR_REFERENCE, where, "\"%s\" has no frame \"%s\"; it has:%s",
                   component, dot ? dot + 1 : "origin", list);
  }
  return pb_fail(r->err, PB_ERR_REFERENCE, where, "there is no component \"%s\"", component);
}

static pb_status read_axes(const pb_reader *r, const pb_plant *plant, pb_connection *c) {
  bool given = false;
  pb_status st = pb_loader_orientation(r, c->rotation, &given);
  if (st || given) return st;
  int owner = c->to.component >= 0 ? c->to.component : c->from.component;
  memcpy(c->rotation, plant->component[owner].pose.rotation, sizeof c->rotation);
  return PB_OK;
}

pb_status pb_loader_connection(pb_loader *loader, const cJSON *object, const char *name,
                               const pb_plant *plant, pb_connection *out) {
  static const char *const known[] = {"from",   "to",     "joint", "quaternion",
                                      "z_axis", "x_axis", NULL};
  char pointer[256];
  pb_json_pointer(pointer, sizeof pointer, "/connections", name);
  pb_reader r, joint;
  pb_status st = pb_reader_open(object, pointer, NULL, &r, loader->err);
  if (!st) st = pb_reader_known(&r, known, NULL, 0);
  if (st) return st;
  out->name = pb_text_copy(name);
  out->pointer = pb_text_copy(pointer);
  if (!out->name || !out->pointer) return pb_fail_memory(loader->err, pointer);
  st = pb_loader_anchor(&r, "from", plant, &out->from);
  if (!st) st = pb_loader_anchor(&r, "to", plant, &out->to);
  if (st) return st;
  bool same = out->from.component == out->to.component;
  if (same && (out->to.component < 0 || out->from.frame == out->to.frame))
    return pb_fail(loader->err, PB_ERR_REFERENCE, pointer, "connects a frame with itself");
  st = read_axes(&r, plant, out);
  if (!st) st = open_joint(loader, &r, &joint);
  return st ? st : read_joint(loader, &joint, &out->joint);
}

void pb_connection_clear(pb_connection *c) {
  if (c->joint.type == PB_JOINT_ELEMENT) pb_element_free(c->joint.super.element);
  free(c->name);
  free(c->pointer);
  *c = (pb_connection){0};
}
