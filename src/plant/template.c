// The template "nano_hexapod": six struts between a base and a platform, a payload on top.
//
// Joint centres lie on two circles. Base pairs stand at 210°, 330°, 90° ± base_half_angle, top pairs
// at 270°, 30°, 150° ± top_half_angle; strut k joins base[k] to top[k] of the lists below. A strut's
// axes: z from base to top joint, y = ẑ_world × z.  [report 2.6; plant file, section "Template"]
//
// The expansion is JSON again: components, connections and signals as a user could have written them,
// over which the file's own entries of the same name are merged ("strut 3 only").
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "plant/loader.h"

static const double degree = 3.14159265358979323846264338327950288 / 180;

typedef struct geometry {
  double base_radius, base_half_angle, base_height;
  double top_radius, top_half_angle, top_height;
} geometry;

typedef struct solid {
  double mass, radius, height, center_height;
} solid;

typedef struct strut {
  double bottom[3], top[3];  // joint centres, m
  double z[3], x[3];         // axes
  double length;             // joint to joint, m
} strut;

typedef struct hexapod {
  geometry geometry;
  solid platform, payload;
  bool has_payload;
  double point_of_interest_height;
  const cJSON *actuator, *bottom_joint, *top_joint;  // model names or objects
  const char *actuator_type;
  double half_height;  // of a super-element actuator
  double ends[2];      // its end nodes, 1-based as in the file
  strut strut[6];
} hexapod;

static const pb_field geometry_fields[] = {
    {"base_radius", offsetof(geometry, base_radius), PB_POSITIVE, true, 0},
    {"base_half_angle", offsetof(geometry, base_half_angle), PB_ANY, true, 0},
    {"base_height", offsetof(geometry, base_height), PB_ANY, true, 0},
    {"top_radius", offsetof(geometry, top_radius), PB_POSITIVE, true, 0},
    {"top_half_angle", offsetof(geometry, top_half_angle), PB_ANY, true, 0},
    {"top_height", offsetof(geometry, top_height), PB_ANY, true, 0},
};

static const pb_field solid_fields[] = {
    {"mass", offsetof(solid, mass), PB_POSITIVE, true, 0},
    {"radius", offsetof(solid, radius), PB_POSITIVE, true, 0},
    {"height", offsetof(solid, height), PB_NON_NEGATIVE, true, 0},
    {"center_height", offsetof(solid, center_height), PB_ANY, true, 0},
};

static const pb_field template_fields[] = {
    {"point_of_interest_height", offsetof(hexapod, point_of_interest_height), PB_ANY, true, 0},
};

static pb_status read_part(const pb_reader *r, const char *key, const pb_field *fields, size_t count,
                           void *out) {
  char where[256];
  pb_reader part;
  const cJSON *object = pb_reader_find(r, key, where);
  if (!object) return pb_fail(r->err, PB_ERR_SCHEMA, where, "missing; expected an object");
  pb_status st = pb_reader_open(object, where, NULL, &part, r->err);
  if (!st) st = pb_reader_known(&part, NULL, fields, count);
  return st ? st : pb_reader_fields(&part, fields, count, out, false);
}

static pb_status read_model(const pb_reader *r, const char *key, const cJSON **out) {
  char where[256];
  *out = pb_reader_find(r, key, where);
  if (*out && (cJSON_IsString(*out) || cJSON_IsObject(*out))) return PB_OK;
  return pb_fail(r->err, PB_ERR_SCHEMA, where, "%sexpected the name of a model or an object",
                 *out ? "" : "missing; ");
}

// A key of the actuator, whether it is a model's name, an object, or an object naming a model.
static pb_status open_actuator(const hexapod *h, const char *pointer, const cJSON *models,
                               pb_reader *out, pb_error *err) {
  char where[256];
  pb_json_pointer(where, sizeof where, pointer, "actuator");
  if (!cJSON_IsString(h->actuator)) return pb_reader_open(h->actuator, where, models, out, err);
  const cJSON *model = models ? pb_json_member(models, h->actuator->valuestring) : NULL;
  if (!model)
    return pb_fail(err, PB_ERR_REFERENCE, where, "there is no model \"%s\"",
                   h->actuator->valuestring);
  pb_json_pointer(where, sizeof where, "/models", h->actuator->valuestring);
  return pb_reader_open(model, where, NULL, out, err);
}

static pb_status read_actuator(hexapod *h, const cJSON *models, pb_error *err) {
  static const pb_field half = {"half_height", 0, PB_POSITIVE, true, 0};
  pb_reader r;
  char where[256];
  pb_status st = open_actuator(h, "/template", models, &r, err);
  if (!st) st = pb_reader_string(&r, "type", true, &h->actuator_type);
  if (st) return st;
  const char *type = h->actuator_type;
  if (!strcmp(type, "apa_2dof") || !strcmp(type, "strut_1dof")) return PB_OK;
  if (strcmp(type, "super_element")) {
    pb_reader_find(&r, "type", where);
    return pb_fail(err, PB_ERR_SCHEMA, where,
                   "\"%s\" is no actuator; expected apa_2dof, strut_1dof or super_element", type);
  }
  st = pb_reader_number(&r, &half, &h->half_height);
  if (st) return st;
  const cJSON *ends = pb_reader_find(&r, "ends", where);
  if (!ends) return pb_fail(err, PB_ERR_SCHEMA, where, "missing; a strut needs [bottom, top] nodes");
  return pb_json_numbers(ends, where, 2, h->ends, err);
}

static pb_status place_struts(hexapod *h, pb_error *err) {
  const geometry *g = &h->geometry;
  const double b = g->base_half_angle, t = g->top_half_angle;
  const double base[6] = {210 + b, 330 - b, 330 + b, 90 - b, 90 + b, 210 - b};
  const double top[6] = {270 - t, 270 + t, 30 - t, 30 + t, 150 - t, 150 + t};
  for (int k = 0; k < 6; k++) {
    strut *s = &h->strut[k];
    const double bottom[3] = {g->base_radius * cos(base[k] * degree),
                              g->base_radius * sin(base[k] * degree), g->base_height};
    const double upper[3] = {g->top_radius * cos(top[k] * degree),
                             g->top_radius * sin(top[k] * degree), g->top_height};
    double length = 0;
    for (int i = 0; i < 3; i++) length += (upper[i] - bottom[i]) * (upper[i] - bottom[i]);
    length = sqrt(length);
    if (!(length > 1e-6))
      return pb_fail(err, PB_ERR_GEOMETRY, "/template/geometry",
                     "strut %d has no length: its joint centres coincide", k + 1);
    memcpy(s->bottom, bottom, sizeof bottom);
    memcpy(s->top, upper, sizeof upper);
    s->length = length;
    for (int i = 0; i < 3; i++) s->z[i] = (upper[i] - bottom[i]) / length;
    // y = ẑ × z = (−z_y, z_x, 0), x = y × z; a vertical strut takes the world's axes.
    double norm = hypot(s->z[0], s->z[1]);
    double y[3] = {norm > 1e-9 ? -s->z[1] / norm : 0, norm > 1e-9 ? s->z[0] / norm : 1, 0};
    for (int i = 0; i < 3; i++)
      s->x[i] = y[(i + 1) % 3] * s->z[(i + 2) % 3] - y[(i + 2) % 3] * s->z[(i + 1) % 3];
  }
  return PB_OK;
}

static pb_status read_template(const cJSON *file, hexapod *h, pb_error *err) {
  static const char *const known[] = {"type",     "geometry",     "platform",  "payload",
                                      "actuator", "bottom_joint", "top_joint", NULL};
  const char *type, *pointer = "/template";
  char where[256];
  pb_reader r;
  const cJSON *models = pb_json_member(file, "models");
  pb_status st = pb_reader_open(pb_json_member(file, "template"), pointer, NULL, &r, err);
  if (!st) st = pb_reader_string(&r, "type", true, &type);
  if (!st && strcmp(type, "nano_hexapod"))
    st = pb_fail(err, PB_ERR_SCHEMA, "/template/type", "\"%s\" is no template; known: nano_hexapod",
                 type);
  if (!st) st = pb_reader_known(&r, known, template_fields, 1);
  if (!st) st = pb_reader_fields(&r, template_fields, 1, h, false);
  if (!st) st = read_part(&r, "geometry", geometry_fields, 6, &h->geometry);
  if (!st) st = read_part(&r, "platform", solid_fields, 4, &h->platform);
  const cJSON *payload = pb_reader_find(&r, "payload", where);
  h->has_payload = payload && !cJSON_IsNull(payload);
  if (!st && h->has_payload) st = read_part(&r, "payload", solid_fields, 4, &h->payload);
  if (!st) st = read_model(&r, "actuator", &h->actuator);
  if (!st) st = read_model(&r, "bottom_joint", &h->bottom_joint);
  if (!st) st = read_model(&r, "top_joint", &h->top_joint);
  if (!st) st = read_actuator(h, models, err);
  return st ? st : place_struts(h, err);
}

// Building the expansion. Each helper returns the new object or NULL (out of memory); NULL parents are
// passed over, so that failures are noticed once, by `ok`.
typedef struct builder {
  cJSON *components, *connections, *inputs, *outputs;
  bool ok;
} builder;

static cJSON *add_object(builder *b, cJSON *parent, const char *name) {
  cJSON *object = parent ? cJSON_AddObjectToObject(parent, name) : NULL;
  b->ok = b->ok && object;
  return object;
}

static void add_copy(builder *b, cJSON *parent, const char *name, const cJSON *value) {
  cJSON *copy = cJSON_Duplicate(value, 1);
  bool added = parent && copy && cJSON_AddItemToObject(parent, name, copy);
  if (!added) cJSON_Delete(copy);
  b->ok = b->ok && added;
}

static void add_string(builder *b, cJSON *parent, const char *name, const char *value) {
  b->ok = b->ok && parent && cJSON_AddStringToObject(parent, name, value);
}

static void add_number(builder *b, cJSON *parent, const char *name, double value) {
  b->ok = b->ok && parent && cJSON_AddNumberToObject(parent, name, value);
}

static void add_vector(builder *b, cJSON *parent, const char *name, const double v[3]) {
  cJSON *array = cJSON_CreateDoubleArray(v, 3);
  bool added = parent && array && cJSON_AddItemToObject(parent, name, array);
  if (!added) cJSON_Delete(array);
  b->ok = b->ok && added;
}

static void add_frame(builder *b, cJSON *frames, const char *name, double x, double y, double z) {
  const double position[3] = {x, y, z};
  add_vector(b, add_object(b, frames, name), "position", position);
}

// A uniform cylinder standing on z, its centre of mass at its origin.
static cJSON *add_solid(builder *b, const char *name, const solid *s) {
  double across = s->mass * (3 * s->radius * s->radius + s->height * s->height) / 12;
  const double inertia[3] = {across, across, 0.5 * s->mass * s->radius * s->radius};
  const double position[3] = {0, 0, s->center_height};
  cJSON *body = add_object(b, b->components, name);
  add_string(b, body, "type", "rigid_body");
  add_number(b, body, "mass", s->mass);
  add_vector(b, body, "inertia", inertia);
  add_vector(b, body, "position", position);
  return body;
}

static void add_bodies(builder *b, const hexapod *h) {
  cJSON *platform = add_solid(b, "platform", &h->platform);
  cJSON *frames = add_object(b, platform, "frames");
  double z0 = h->platform.center_height;
  for (int k = 0; k < 6; k++) {
    char name[16];
    snprintf(name, sizeof name, "joint%d", k + 1);
    const double *top = h->strut[k].top;
    add_frame(b, frames, name, top[0], top[1], top[2] - z0);
  }
  add_frame(b, frames, "point_of_interest", 0, 0, h->point_of_interest_height - z0);
  if (!h->has_payload) return;
  add_frame(b, frames, "payload", 0, 0, h->payload.center_height - z0);
  add_solid(b, "payload", &h->payload);
  cJSON *mount = add_object(b, b->connections, "payload_mount");
  add_string(b, mount, "from", "platform.payload");
  add_string(b, mount, "to", "payload");
  add_string(b, add_object(b, mount, "joint"), "type", "weld");
}

// A frame of a super-element strut: the end node, extended rigidly to the joint centre.
static void add_extension(builder *b, cJSON *frames, const char *name, double node, double z) {
  const double offset[3] = {0, 0, z};
  cJSON *frame = add_object(b, frames, name);
  add_number(b, frame, "node", node);
  add_vector(b, frame, "offset", offset);
}

static void add_strut(builder *b, const hexapod *h, int k) {
  char name[24];
  snprintf(name, sizeof name, "strut%d", k + 1);
  const strut *s = &h->strut[k];
  cJSON *component = NULL;
  if (cJSON_IsString(h->actuator)) {
    component = add_object(b, b->components, name);
    add_copy(b, component, "model", h->actuator);
  } else {
    add_copy(b, b->components, name, h->actuator);
    component = cJSON_GetObjectItemCaseSensitive(b->components, name);
  }
  double center[3];
  for (int i = 0; i < 3; i++) center[i] = 0.5 * (s->bottom[i] + s->top[i]);
  add_vector(b, component, "position", center);
  add_vector(b, component, "z_axis", s->z);
  add_vector(b, component, "x_axis", s->x);
  if (!strcmp(h->actuator_type, "super_element")) {
    double extension = 0.5 * s->length - h->half_height;
    cJSON *frames = add_object(b, component, "frames");
    add_extension(b, frames, "bottom", h->ends[0], -extension);
    add_extension(b, frames, "top", h->ends[1], extension);
  } else {
    add_number(b, component, "length", s->length);
  }
}

static void add_joint(builder *b, const char *name, const char *from, const char *to,
                      const cJSON *joint, const strut *axes) {
  cJSON *connection = add_object(b, b->connections, name);
  add_string(b, connection, "from", from);
  add_string(b, connection, "to", to);
  add_copy(b, connection, "joint", joint);
  add_vector(b, connection, "z_axis", axes->z);
  add_vector(b, connection, "x_axis", axes->x);
}

static void add_struts(builder *b, const hexapod *h) {
  for (int k = 0; k < 6; k++) {
    char bottom[24], top[24], from[24], to[24], platform[24];
    snprintf(bottom, sizeof bottom, "bottom_joint%d", k + 1);
    snprintf(top, sizeof top, "top_joint%d", k + 1);
    snprintf(to, sizeof to, "strut%d.bottom", k + 1);
    snprintf(from, sizeof from, "strut%d.top", k + 1);
    snprintf(platform, sizeof platform, "platform.joint%d", k + 1);
    add_strut(b, h, k);
    add_joint(b, bottom, "ground", to, h->bottom_joint, &h->strut[k]);
    add_joint(b, top, from, platform, h->top_joint, &h->strut[k]);
  }
}

static cJSON *add_signal(builder *b, cJSON *list, const char *name, const char *type) {
  cJSON *signal = cJSON_CreateObject();
  bool added = signal && cJSON_AddItemToArray(list, signal);
  if (!added) cJSON_Delete(signal);
  b->ok = b->ok && added;
  if (!added) return NULL;
  add_string(b, signal, "name", name);
  add_string(b, signal, "type", type);
  return signal;
}

static void add_strut_signals(builder *b, const hexapod *h) {
  bool force = !strcmp(h->actuator_type, "strut_1dof");
  char name[16], component[16], frame[24];
  for (int k = 1; k <= 6; k++) {
    snprintf(component, sizeof component, "strut%d", k);
    snprintf(name, sizeof name, force ? "f%d" : "Va%d", k);
    cJSON *input =
        add_signal(b, b->inputs, name, force ? "actuator_force" : "actuator_voltage");
    add_string(b, input, "component", component);
    snprintf(name, sizeof name, force ? "fm%d" : "Vs%d", k);
    cJSON *output = add_signal(b, b->outputs, name, force ? "sensor_force" : "sensor_voltage");
    add_string(b, output, "component", component);
  }
  for (int k = 1; k <= 6; k++) {
    snprintf(name, sizeof name, "dL%d", k);
    snprintf(frame, sizeof frame, "platform.joint%d", k);
    cJSON *metrology = add_signal(b, b->outputs, name, "displacement");
    add_string(b, metrology, "frame", frame);
    add_vector(b, metrology, "direction", h->strut[k - 1].z);
  }
}

static void add_point_of_interest(builder *b) {
  static const char *const load[6] = {"Fx", "Fy", "Fz", "Mx", "My", "Mz"};
  static const char *const motion[6] = {"Dx", "Dy", "Dz", "Rx", "Ry", "Rz"};
  for (int i = 0; i < 6; i++) {
    double direction[3] = {i % 3 == 0, i % 3 == 1, i % 3 == 2};
    cJSON *input = add_signal(b, b->inputs, load[i], i < 3 ? "force" : "torque");
    cJSON *output = add_signal(b, b->outputs, motion[i], i < 3 ? "displacement" : "rotation");
    add_string(b, input, "frame", "platform.point_of_interest");
    add_string(b, output, "frame", "platform.point_of_interest");
    add_vector(b, input, "direction", direction);
    add_vector(b, output, "direction", direction);
  }
}

static bool has_name(const cJSON *list, const char *name) {
  const cJSON *signal;
  cJSON_ArrayForEach(signal, list) {
    const cJSON *n = pb_json_member(signal, "name");
    if (cJSON_IsString(n) && !strcmp(n->valuestring, name)) return true;
  }
  return false;
}

// The template's signals that the file does not define itself, then the file's own.
static bool merge_signals(cJSON *out, const char *key, const cJSON *generated) {
  cJSON *own = cJSON_DetachItemFromObjectCaseSensitive(out, key);
  cJSON *list = cJSON_CreateArray();
  bool ok = list && (!own || cJSON_IsArray(own));
  const cJSON *signal;
  cJSON_ArrayForEach(signal, generated) {
    if (has_name(own, pb_json_member(signal, "name")->valuestring)) continue;
    cJSON *copy = cJSON_Duplicate(signal, 1);
    bool added = ok && copy && cJSON_AddItemToArray(list, copy);
    if (!added) cJSON_Delete(copy);
    ok = ok && added;
  }
  while (ok && own && own->child)
    ok = cJSON_AddItemToArray(list, cJSON_DetachItemViaPointer(own, own->child));
  cJSON_Delete(own);
  ok = ok && cJSON_AddItemToObject(out, key, list);
  if (!ok) cJSON_Delete(list);
  return ok;
}

static bool merge_section(cJSON *out, const char *key, const cJSON *generated) {
  const cJSON *own = pb_json_member(out, key);
  cJSON *merged = own ? pb_json_merge(generated, own) : cJSON_Duplicate(generated, 1);
  if (!merged) return false;
  cJSON_DeleteItemFromObjectCaseSensitive(out, key);
  if (cJSON_AddItemToObject(out, key, merged)) return true;
  cJSON_Delete(merged);
  return false;
}

pb_status pb_loader_expand(const cJSON *file, cJSON **out, pb_error *err) {
  *out = NULL;
  const cJSON *template = pb_json_member(file, "template");
  bool expand = template && !cJSON_IsNull(template);
  hexapod h = {0};
  pb_status st = expand ? read_template(file, &h, err) : PB_OK;
  if (st) return st;
  cJSON *copy = cJSON_Duplicate(file, 1);
  if (!copy) return pb_fail_memory(err, "");
  if (!expand) {
    *out = copy;
    return PB_OK;
  }
  builder b = {cJSON_CreateObject(), cJSON_CreateObject(), cJSON_CreateArray(), cJSON_CreateArray(),
               true};
  b.ok = b.components && b.connections && b.inputs && b.outputs;
  if (b.ok) {
    add_bodies(&b, &h);
    add_struts(&b, &h);
    add_strut_signals(&b, &h);
    add_point_of_interest(&b);
  }
  bool ok = b.ok && merge_section(copy, "components", b.components) &&
            merge_section(copy, "connections", b.connections) &&
            merge_signals(copy, "inputs", b.inputs) && merge_signals(copy, "outputs", b.outputs);
  cJSON_Delete(b.components);
  cJSON_Delete(b.connections);
  cJSON_Delete(b.inputs);
  cJSON_Delete(b.outputs);
  if (ok) {
    cJSON_DeleteItemFromObjectCaseSensitive(copy, "template");
    *out = copy;
    return PB_OK;
  }
  cJSON_Delete(copy);
  return pb_fail_memory(err, "/template");
}
