// Reading signals: the plant's inputs and outputs.
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "plant/loader.h"

// What a signal type needs besides "name" and "type".
typedef enum needs { COMPONENT, FRAME, TWO_FRAMES } needs;

typedef struct type_entry {
  const char *name;
  pb_signal_type type;
  bool input;
  needs needs;
  const char *unit;
} type_entry;

static const type_entry types[] = {
    {"actuator_voltage", PB_ACTUATOR_VOLTAGE, true, COMPONENT, "V"},
    {"actuator_force", PB_ACTUATOR_FORCE, true, COMPONENT, "N"},
    {"force", PB_FORCE, true, FRAME, "N"},
    {"torque", PB_TORQUE, true, FRAME, "Nm"},
    {"sensor_voltage", PB_SENSOR_VOLTAGE, false, COMPONENT, "V"},
    {"sensor_force", PB_SENSOR_FORCE, false, COMPONENT, "N"},
    {"strut_elongation", PB_STRUT_ELONGATION, false, COMPONENT, "m"},
    {"displacement", PB_DISPLACEMENT, false, FRAME, "m"},
    {"rotation", PB_ROTATION, false, FRAME, "rad"},
    {"velocity", PB_VELOCITY, false, FRAME, "m/s"},
    {"acceleration", PB_ACCELERATION, false, FRAME, "m/s^2"},
    {"relative_displacement", PB_RELATIVE_DISPLACEMENT, false, TWO_FRAMES, "m"},
};
#define PB_COUNT(array) (sizeof(array) / sizeof *(array))

const char *pb_signal_unit(pb_signal_type type) {
  for (size_t i = 0; i < PB_COUNT(types); i++)
    if (types[i].type == type) return types[i].unit;
  return "";
}

static pb_status read_type(const pb_reader *r, bool is_input, const type_entry **out) {
  const char *name;
  char where[256], list[300] = "";
  pb_status st = pb_reader_string(r, "type", true, &name);
  if (st) return st;
  pb_reader_find(r, "type", where);
  for (size_t i = 0; i < PB_COUNT(types); i++) {
    if (types[i].input != is_input) continue;
    if (!strcmp(types[i].name, name)) {
      *out = &types[i];
      return PB_OK;
    }
    strncat(list, " ", 2);
    strncat(list, types[i].name, 30);
  }
  return pb_fail(r->err, PB_ERR_SCHEMA, where, "\"%s\" is no type of an %s; known:%s", name,
                 is_input ? "input" : "output", list);
}

// Tells whether the component can carry the signal; *why says what is missing.
static bool can_carry(const pb_component *c, pb_signal_type type, const char **why) {
  const pb_super_element *s = c->type == PB_SUPER_ELEMENT ? &c->super : NULL;
  bool lumped = c->type == PB_APA_2DOF || c->type == PB_STRUT_1DOF;
  *why =
      "the component is no actuator: expected apa_2dof, strut_1dof or a super_element with stacks";
  if (!lumped && !s) return false;
  switch (type) {
  case PB_ACTUATOR_VOLTAGE:
    *why = "the component has no g_a (N/V), so no voltage drives it";
    if (c->type == PB_STRUT_1DOF || (s ? s->g_a : c->strut.g_a) == 0) return false;
    // fall through
  case PB_ACTUATOR_FORCE:
    if (s && !s->actuator.present) *why = "the element has no stacks/actuator";
    return !s || s->actuator.present;
  case PB_SENSOR_VOLTAGE:
    *why = "the component has no g_s (V/m), so it has no sensor voltage";
    if (c->type == PB_STRUT_1DOF || (s ? s->g_s : c->strut.g_s) == 0) return false;
    if (s && !s->sensor.present) *why = "the element has no stacks/sensor";
    return !s || s->sensor.present;
  case PB_SENSOR_FORCE:
    *why = "only strut_1dof and apa_2dof have a sensor force";
    return lumped;
  default:
    *why = "the element has no ends, so no elongation";
    return lumped || s->has_ends;
  }
}

static pb_status read_component(const pb_reader *r, const pb_plant *plant, pb_port *out) {
  const char *name, *why;
  char where[256];
  pb_status st = pb_reader_string(r, "component", true, &name);
  if (st) return st;
  pb_reader_find(r, "component", where);
  for (size_t i = 0; i < plant->component_count; i++) {
    if (strcmp(plant->component[i].name, name)) continue;
    if (!can_carry(&plant->component[i], out->type, &why))
      return pb_fail(r->err, PB_ERR_REFERENCE, where, "\"%s\": %s", name, why);
    out->component = (int)i;
    return PB_OK;
  }
  return pb_fail(r->err, PB_ERR_REFERENCE, where, "there is no component \"%s\"", name);
}

static pb_status read_frames(const pb_reader *r, const pb_plant *plant, bool two, pb_port *out) {
  pb_status st = pb_loader_anchor(r, two ? "to" : "frame", plant, &out->frame);
  if (!st && two) st = pb_loader_anchor(r, "from", plant, &out->from);
  return st ? st : pb_reader_direction(r, "direction", true, out->direction, NULL);
}

static pb_status read_electronics(const pb_reader *r, bool is_input, pb_port *out) {
  char where[256];
  const cJSON *object = pb_reader_find(r, "electronics", where);
  out->has_electronics = object != NULL;
  if (!object) return PB_OK;
  return pb_loader_electronics(object, where, is_input, &out->electronics, r->err);
}

pb_status pb_loader_signal(pb_loader *loader, const cJSON *object, const char *pointer,
                           bool is_input, const pb_plant *plant, pb_port *out) {
  static const char *const with_component[] = {"name", "type", "component", "electronics", NULL};
  static const char *const with_frame[] = {"name",      "type",        "frame",
                                           "direction", "electronics", NULL};
  static const char *const with_two[] = {"name",      "type",        "from", "to",
                                         "direction", "electronics", NULL};
  static const char *const *const known[] = {with_component, with_frame, with_two};
  pb_reader r;
  const char *name;
  const type_entry *type = NULL;
  *out = (pb_port){.component = -1, .frame.component = -1, .from.component = -1};
  pb_status st = pb_reader_open(object, pointer, NULL, &r, loader->err);
  if (!st) st = pb_reader_string(&r, "name", true, &name);
  if (!st) st = read_type(&r, is_input, &type);
  if (!st) st = pb_reader_known(&r, known[type->needs], NULL, 0);
  if (st) return st;
  out->type = type->type;
  out->name = pb_text_copy(name);
  out->pointer = pb_text_copy(pointer);
  if (!out->name || !out->pointer) return pb_fail_memory(loader->err, pointer);
  st = read_electronics(&r, is_input, out);
  if (st) return st;
  if (type->needs == COMPONENT) return read_component(&r, plant, out);
  return read_frames(&r, plant, type->needs == TWO_FRAMES, out);
}

void pb_port_clear(pb_port *port) {
  free(port->name);
  free(port->pointer);
  *port = (pb_port){0};
}
