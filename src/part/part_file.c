// Part files, schema "plantbus.part/1": see part.h and docs/parts.md.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "part/part.h"
#include "plant/reader.h"

#define FIELD(type, key) \
  { #key, offsetof(type, key), PB_POSITIVE, true, 0 }

static const pb_field actuator_fields[] = {
    FIELD(pb_actuator_shape, stack_length),      FIELD(pb_actuator_shape, stack_side),
    FIELD(pb_actuator_shape, spacer_length),     FIELD(pb_actuator_shape, depth),
    FIELD(pb_actuator_shape, half_height),       FIELD(pb_actuator_shape, half_length),
    FIELD(pb_actuator_shape, frame_height),      FIELD(pb_actuator_shape, pad_half_width),
    FIELD(pb_actuator_shape, pad_hole_diameter), FIELD(pb_actuator_shape, fillet_radius),
    FIELD(pb_actuator_shape, arm_thickness),     FIELD(pb_actuator_shape, arm_angle),
    FIELD(pb_actuator_shape, arm_radius),        FIELD(pb_actuator_shape, slot_radius),
    FIELD(pb_actuator_shape, slot_center),       FIELD(pb_actuator_shape, end_flat)};

static const pb_field joint_fields[] = {
    FIELD(pb_joint_shape, diameter),   FIELD(pb_joint_shape, height),
    FIELD(pb_joint_shape, neck),       FIELD(pb_joint_shape, neck_radius),
    FIELD(pb_joint_shape, slot_width), FIELD(pb_joint_shape, slot_angle),
    FIELD(pb_joint_shape, slot_stop)};

static const pb_field material_fields[] = {FIELD(pb_material, youngs_modulus),
                                           FIELD(pb_material, poisson_ratio),
                                           FIELD(pb_material, density)};

#define COUNT(array) (sizeof(array) / sizeof *(array))

// Opens the object that `key` of `parent` holds.
static pb_status open_member(const pb_reader *parent, const char *key, pb_reader *out) {
  char where[256];
  const cJSON *value = pb_reader_find(parent, key, where);
  if (!value) return pb_fail(parent->err, PB_ERR_SCHEMA, where, "missing; expected an object");
  return pb_reader_open(value, where, NULL, out, parent->err);
}

static pb_status read_type(const pb_reader *r, pb_part *part) {
  const char *schema, *type, *name;
  char where[256];
  pb_status st = pb_reader_string(r, "schema", true, &schema);
  if (!st) st = pb_reader_string(r, "name", true, &name);
  if (!st) st = pb_reader_string(r, "type", true, &type);
  if (st) return st;
  if (strcmp(schema, "plantbus.part/1"))
    return pb_fail(r->err, PB_ERR_SCHEMA, "/schema", "expected \"plantbus.part/1\"");
  pb_reader_find(r, "type", where);
  if (!strcmp(type, "amplified_actuator")) {
    part->type = PB_PART_AMPLIFIED_ACTUATOR;
  } else if (!strcmp(type, "flexible_joint")) {
    part->type = PB_PART_FLEXIBLE_JOINT;
  } else {
    return pb_fail(r->err, PB_ERR_SCHEMA, where,
                   "expected \"amplified_actuator\" or \"flexible_joint\"");
  }
  part->name = pb_text_copy(name);
  return part->name ? PB_OK : pb_fail_memory(r->err, name);
}

static pb_status read_dimensions(const pb_reader *r, pb_part *part) {
  bool joint = part->type == PB_PART_FLEXIBLE_JOINT;
  const pb_field *fields = joint ? joint_fields : actuator_fields;
  size_t count = joint ? COUNT(joint_fields) : COUNT(actuator_fields);
  void *base = joint ? (void *)&part->joint : (void *)&part->actuator;
  pb_reader dimensions;
  pb_status st = open_member(r, "dimensions", &dimensions);
  if (!st) st = pb_reader_known(&dimensions, NULL, fields, count);
  return st ? st : pb_reader_fields(&dimensions, fields, count, base, false);
}

static pb_status read_materials(const pb_reader *r, pb_part *part) {
  pb_reader materials, material;
  const char *known[PB_PART_MATERIALS + 1] = {0};
  pb_status st = open_member(r, "materials", &materials);
  while (part->materials < PB_PART_MATERIALS &&
         pb_part_material_name(part->type, part->materials)) {
    known[part->materials] = pb_part_material_name(part->type, part->materials);
    part->materials++;
  }
  if (!st) st = pb_reader_known(&materials, known, NULL, 0);
  for (size_t i = 0; !st && i < part->materials; i++) {
    st = open_member(&materials, known[i], &material);
    if (!st) st = pb_reader_known(&material, NULL, material_fields, COUNT(material_fields));
    if (!st)
      st = pb_reader_fields(&material, material_fields, COUNT(material_fields), &part->material[i],
                            false);
    if (!st && part->material[i].poisson_ratio >= 0.5) {
      char where[256];
      pb_reader_find(&material, "poisson_ratio", where);
      st = pb_fail(r->err, PB_ERR_SCHEMA, where, "expected a number below 0.5");
    }
  }
  return st;
}

static pb_status read_numbers(const pb_reader *r, pb_part *part) {
  static const char *const mesh_keys[] = {"density", NULL}, *const frame_keys[] = {"tie", NULL};
  static const pb_field density = {"density", 0, PB_POSITIVE, true, 0};
  pb_reader mesh, frames;
  const char *tie = NULL;
  char where[256];
  pb_status st = open_member(r, "mesh", &mesh);
  if (!st) st = pb_reader_known(&mesh, mesh_keys, NULL, 0);
  if (!st) st = pb_reader_number(&mesh, &density, &part->density);
  if (!st && !(part->density >= 0.5 && part->density <= 6))
    st = pb_fail(r->err, PB_ERR_SCHEMA, "/mesh/density", "expected a number from 0.5 to 6");
  const cJSON *modes = pb_reader_find(r, "modes", where);
  if (!st) st = pb_json_index(modes, where, 1, 1000, &part->modes, r->err);
  if (!st) st = open_member(r, "frames", &frames);
  if (!st) st = pb_reader_known(&frames, frame_keys, NULL, 0);
  if (!st) st = pb_reader_string(&frames, "tie", true, &tie);
  if (st) return st;
  if (strcmp(tie, "averaged") && strcmp(tie, "rigid"))
    return pb_fail(r->err, PB_ERR_SCHEMA, "/frames/tie", "expected \"averaged\" or \"rigid\"");
  part->tie = !strcmp(tie, "rigid") ? PB_TIE_RIGID : PB_TIE_AVERAGED;
  return PB_OK;
}

// Names are judged by those who compare: characteristics.c knows which there are.
static pb_status read_published(const pb_reader *r, pb_part *part) {
  char where[256], item[256];
  const cJSON *published = pb_reader_find(r, "published", where);
  if (!published) return PB_OK;
  if (!cJSON_IsObject(published))
    return pb_fail(r->err, PB_ERR_SCHEMA, where, "expected an object of numbers");
  for (const cJSON *m = published->child; m; m = m->next) {
    pb_json_pointer(item, sizeof item, where, m->string);
    pb_part_published *p = part->publication + part->published;
    if (!pb_characteristic_known(part->type, m->string))
      return pb_fail(r->err, PB_ERR_SCHEMA, item, "this type of part has no such characteristic");
    if (!cJSON_IsNumber(m)) return pb_fail(r->err, PB_ERR_SCHEMA, item, "expected a number");
    p->value = m->valuedouble;
    snprintf(p->name, sizeof p->name, "%s", m->string);
    part->published++;
  }
  return PB_OK;
}

pb_status pb_part_read(const cJSON *json, pb_part *out, pb_error *err) {
  static const char *const known[] = {"schema",     "name",      "type",      "description",
                                      "source",     "mesh",      "modes",     "frames",
                                      "dimensions", "materials", "published", NULL};
  *out = (pb_part){0};
  pb_reader r;
  const char *text;
  pb_status st = pb_reader_open(json, "", NULL, &r, err);
  if (!st) st = pb_reader_known(&r, known, NULL, 0);
  if (!st) st = pb_reader_string(&r, "description", false, &text);
  if (!st) st = pb_reader_string(&r, "source", false, &text);
  if (!st) st = read_type(&r, out);
  if (!st) st = read_dimensions(&r, out);
  if (!st) st = read_materials(&r, out);
  if (!st) st = read_numbers(&r, out);
  if (!st) st = read_published(&r, out);
  if (st) pb_part_clear(out);
  return st;
}

void pb_part_clear(pb_part *part) {
  free(part->name);
  *part = (pb_part){0};
}
