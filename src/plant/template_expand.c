// Expanding the template "nano_hexapod": six struts between a base and a platform, a payload on
// top.
//
// The expansion is JSON again: components, connections and signals as a user could have written
// them, over which the file's own entries of the same name are merged ("strut 3 only").
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "plant/template.h"

// Building the expansion. Each helper returns the new object or NULL (out of memory); NULL parents
// are passed over, so that failures are noticed once, by `ok`.
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
static cJSON *add_solid(builder *b, const char *name, const pb_hexapod_solid *s) {
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

static void add_bodies(builder *b, const pb_hexapod *h) {
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

static void add_strut(builder *b, const pb_hexapod *h, int k) {
  char name[24];
  snprintf(name, sizeof name, "strut%d", k + 1);
  const pb_hexapod_strut *s = &h->strut[k];
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
                      const cJSON *joint, const pb_hexapod_strut *axes) {
  cJSON *connection = add_object(b, b->connections, name);
  add_string(b, connection, "from", from);
  add_string(b, connection, "to", to);
  add_copy(b, connection, "joint", joint);
  add_vector(b, connection, "z_axis", axes->z);
  add_vector(b, connection, "x_axis", axes->x);
}

static void add_struts(builder *b, const pb_hexapod *h) {
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

static void add_electronics(builder *b, cJSON *signal, const cJSON *electronics) {
  if (electronics) add_copy(b, signal, "electronics", electronics);
}

static void add_strut_signals(builder *b, const pb_hexapod *h) {
  bool force = !strcmp(h->actuator_type, "strut_1dof");
  char name[16], component[16], frame[24];
  for (int k = 1; k <= 6; k++) {
    snprintf(component, sizeof component, "strut%d", k);
    snprintf(name, sizeof name, force ? "f%d" : "Va%d", k);
    cJSON *input = add_signal(b, b->inputs, name, force ? "actuator_force" : "actuator_voltage");
    add_string(b, input, "component", component);
    add_electronics(b, input, h->electronics.actuators);
    snprintf(name, sizeof name, force ? "fm%d" : "Vs%d", k);
    cJSON *output = add_signal(b, b->outputs, name, force ? "sensor_force" : "sensor_voltage");
    add_string(b, output, "component", component);
    add_electronics(b, output, h->electronics.sensors);
  }
  for (int k = 1; k <= 6; k++) {
    snprintf(name, sizeof name, "dL%d", k);
    snprintf(frame, sizeof frame, "platform.joint%d", k);
    cJSON *metrology = add_signal(b, b->outputs, name, "displacement");
    add_string(b, metrology, "frame", frame);
    add_vector(b, metrology, "direction", h->strut[k - 1].z);
    add_electronics(b, metrology, h->electronics.metrology);
  }
}

static void add_point_of_interest(builder *b, const pb_hexapod *h) {
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
    add_electronics(b, output, h->electronics.metrology);
  }
}

// Index of the signal of this name in a list, or −1.
static int find_signal(const cJSON *list, const char *name) {
  int index = 0;
  for (const cJSON *signal = list ? list->child : NULL; signal; signal = signal->next, index++) {
    const cJSON *n = pb_json_member(signal, "name");
    if (cJSON_IsString(n) && !strcmp(n->valuestring, name)) return index;
  }
  return -1;
}

// The template's signals, those that the file defines itself in their place, then the file's
// others.
static bool merge_signals(cJSON *out, const char *key, const cJSON *generated) {
  cJSON *own = cJSON_DetachItemFromObjectCaseSensitive(out, key);
  cJSON *list = cJSON_CreateArray();
  bool ok = list && (!own || cJSON_IsArray(own));
  const cJSON *signal;
  cJSON_ArrayForEach(signal, generated) {
    int index = find_signal(own, pb_json_member(signal, "name")->valuestring);
    cJSON *item = index >= 0 ? cJSON_DetachItemFromArray(own, index) : cJSON_Duplicate(signal, 1);
    bool added = ok && item && cJSON_AddItemToArray(list, item);
    if (!added) cJSON_Delete(item);
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
  pb_hexapod h = {0};
  pb_status st = expand ? pb_hexapod_read(file, &h, err) : PB_OK;
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
    add_point_of_interest(&b, &h);
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
