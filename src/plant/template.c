// Reading the template "nano_hexapod": see template.h.
//
// Joint centres lie on two circles. Base pairs stand at 210°, 330°, 90° ± base_half_angle, top
// pairs at 270°, 30°, 150° ± top_half_angle; strut k joins base[k] to top[k] of the lists below. A
// strut's axes: z from base to top joint, y = ẑ_world × z.  [report 2.6; plant file, section
// "Template"]
#include "plant/template.h"

#include <math.h>
#include <string.h>

static const double degree = 3.14159265358979323846264338327950288 / 180;

static const pb_field geometry_fields[] = {
    {"base_radius", offsetof(pb_hexapod_geometry, base_radius), PB_POSITIVE, true, 0},
    {"base_half_angle", offsetof(pb_hexapod_geometry, base_half_angle), PB_ANY, true, 0},
    {"base_height", offsetof(pb_hexapod_geometry, base_height), PB_ANY, true, 0},
    {"top_radius", offsetof(pb_hexapod_geometry, top_radius), PB_POSITIVE, true, 0},
    {"top_half_angle", offsetof(pb_hexapod_geometry, top_half_angle), PB_ANY, true, 0},
    {"top_height", offsetof(pb_hexapod_geometry, top_height), PB_ANY, true, 0},
};

static const pb_field solid_fields[] = {
    {"mass", offsetof(pb_hexapod_solid, mass), PB_POSITIVE, true, 0},
    {"radius", offsetof(pb_hexapod_solid, radius), PB_POSITIVE, true, 0},
    {"height", offsetof(pb_hexapod_solid, height), PB_NON_NEGATIVE, true, 0},
    {"center_height", offsetof(pb_hexapod_solid, center_height), PB_ANY, true, 0},
};

static const pb_field template_fields[] = {
    {"point_of_interest_height", offsetof(pb_hexapod, point_of_interest_height), PB_ANY, true, 0},
};

static pb_status read_part(const pb_reader *r, const char *key, const pb_field *fields,
                           size_t count, void *out) {
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
static pb_status open_actuator(const pb_hexapod *h, const char *pointer, const cJSON *models,
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

static pb_status read_actuator(pb_hexapod *h, const cJSON *models, pb_error *err) {
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
  if (!ends)
    return pb_fail(err, PB_ERR_SCHEMA, where, "missing; a strut needs [bottom, top] nodes");
  return pb_json_numbers(ends, where, 2, h->ends, err);
}

static pb_status place_struts(pb_hexapod *h, pb_error *err) {
  const pb_hexapod_geometry *g = &h->geometry;
  const double b = g->base_half_angle, t = g->top_half_angle;
  const double base[6] = {210 + b, 330 - b, 330 + b, 90 - b, 90 + b, 210 - b};
  const double top[6] = {270 - t, 270 + t, 30 - t, 30 + t, 150 - t, 150 + t};
  for (int k = 0; k < 6; k++) {
    pb_hexapod_strut *s = &h->strut[k];
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

// One list of electronics: checked here, where the file says it, and read again in each signal.
static pb_status read_electronics_of(const pb_reader *r, const char *key, bool is_input,
                                     const cJSON **out) {
  char where[256];
  pb_electronics ignored;
  *out = pb_reader_find(r, key, where);
  return *out ? pb_loader_electronics(*out, where, is_input, &ignored, r->err) : PB_OK;
}

static pb_status read_electronics(const pb_reader *r, pb_hexapod_electronics *out) {
  static const char *const known[] = {"actuators", "sensors", "metrology", NULL};
  char where[256];
  pb_reader part;
  const cJSON *object = pb_reader_find(r, "electronics", where);
  if (!object) return PB_OK;
  pb_status st = pb_reader_open(object, where, NULL, &part, r->err);
  if (!st) st = pb_reader_known(&part, known, NULL, 0);
  if (!st) st = read_electronics_of(&part, "actuators", true, &out->actuators);
  if (!st) st = read_electronics_of(&part, "sensors", false, &out->sensors);
  if (!st) st = read_electronics_of(&part, "metrology", false, &out->metrology);
  return st;
}

pb_status pb_hexapod_read(const cJSON *file, pb_hexapod *h, pb_error *err) {
  static const char *const known[] = {"type",      "geometry",    "platform",
                                      "payload",   "actuator",    "bottom_joint",
                                      "top_joint", "electronics", NULL};
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
  if (!st) st = read_electronics(&r, &h->electronics);
  return st ? st : place_struts(h, err);
}
