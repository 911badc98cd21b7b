// Shared parts of the plant loader: elements, damping, orientations, models.
#include "plant/loader.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "plant/element_doctor.h"

static pb_status keep_element(pb_loader *loader, pb_element *e) {
  pb_element **list = realloc(loader->element, (loader->element_count + 1) * sizeof *list);
  if (!list) return pb_fail_memory(loader->err, e->file);
  loader->element = list;
  list[loader->element_count++] = e;
  return PB_OK;
}

// One line on its health to whoever wants to know.
static pb_status note_health(pb_loader *loader, const pb_element *e) {
  if (!loader->warnings || !loader->warnings->notes) return PB_OK;
  pb_diagnosis diagnosis;
  char text[sizeof((pb_warning *)0)->message];
  pb_status st = pb_element_check(e, &diagnosis, loader->err);
  if (st) return st;
  pb_diagnosis_summary(&diagnosis, text, sizeof text);
  return pb_warn(loader->warnings->notes, loader->err, e->file, "%s", text);
}

// From the store of those read for earlier plants, or else from its file.
static pb_status read_element(pb_loader *loader, const char *path, const char *where,
                              pb_element **out) {
  pb_element_file file;
  pb_error inner = {0};
  pb_element *e = pb_element_store_find(loader->store, path, &file);
  const bool kept = e != NULL;
  pb_status st = kept ? pb_element_warn(e, loader->warnings, &inner)
                      : pb_element_load(path, loader->warnings, &e, &inner);
  if (st) pb_fail(loader->err, st, where, "%.200s: %.280s", inner.where, inner.message);
  if (!st && !kept) st = note_health(loader, e);
  if (!st && !kept) pb_element_store_keep(loader->store, e, &file);
  if (!st) st = keep_element(loader, e);
  if (st)
    pb_element_free(e);
  else
    *out = pb_element_share(e);
  return st;
}

pb_status pb_loader_element(pb_loader *loader, const pb_reader *r, pb_element **out) {
  const char *file;
  char where[256];
  *out = NULL;
  pb_status st = pb_reader_string(r, "file", true, &file);
  if (st) return st;
  pb_reader_find(r, "file", where);
  pb_text path = {0};
  if (file[0] != '/' && loader->directory) pb_text_format(&path, "%s/", loader->directory);
  pb_text_append(&path, file);
  if (path.failed) return pb_fail_memory(loader->err, where);
  for (size_t i = 0; i < loader->element_count && !*out; i++)
    if (!strcmp(loader->element[i]->file, path.text)) *out = pb_element_share(loader->element[i]);
  if (!*out) st = read_element(loader, path.text, where, out);
  free(path.text);
  return st;
}

pb_status pb_loader_damping(const pb_reader *r, pb_super_element *super) {
  static const pb_field modal[] = {
      {"modal_damping", offsetof(pb_super_element, modal_damping), PB_NON_NEGATIVE, false, 0}};
  static const pb_field rayleigh[] = {
      {"alpha", offsetof(pb_super_element, alpha), PB_NON_NEGATIVE, false, 0},
      {"beta", offsetof(pb_super_element, beta), PB_NON_NEGATIVE, false, 0}};
  char where[256];
  pb_status st = pb_reader_fields(r, modal, 1, super, false);
  const cJSON *object = pb_reader_find(r, "rayleigh", where);
  if (st || !object) return st;
  pb_reader inner;
  st = pb_reader_open(object, where, NULL, &inner, r->err);
  if (!st) st = pb_reader_known(&inner, NULL, rayleigh, 2);
  return st ? st : pb_reader_fields(&inner, rayleigh, 2, super, false);
}

static void cross(const double a[3], const double b[3], double out[3]) {
  for (int i = 0; i < 3; i++)
    out[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}

// z exact, x the hint made orthogonal to z, y = z × x. False: the hint is parallel to z.
static bool rotation_from_axes(const double z[3], const double hint[3], double rotation[9]) {
  double y[3], x[3], along = 0, norm = 0;
  for (int i = 0; i < 3; i++) along += z[i] * hint[i];
  for (int i = 0; i < 3; i++) x[i] = hint[i] - along * z[i];
  for (int i = 0; i < 3; i++) norm += x[i] * x[i];
  norm = sqrt(norm);
  if (norm < 1e-9) return false;
  for (int i = 0; i < 3; i++) x[i] /= norm;
  cross(z, x, y);
  memcpy(rotation, x, sizeof x);
  memcpy(rotation + 3, y, sizeof y);
  memcpy(rotation + 6, z, 3 * sizeof *z);
  return true;
}

static pb_status rotation_from_quaternion(const pb_reader *r, const cJSON *value, const char *where,
                                          double rotation[9]) {
  double q[4], norm = 0;
  pb_status st = pb_json_numbers(value, where, 4, q, r->err);
  if (st) return st;
  for (int i = 0; i < 4; i++) norm += q[i] * q[i];
  norm = sqrt(norm);
  if (!(fabs(norm - 1) < 1e-3))
    return pb_fail(r->err, PB_ERR_SCHEMA, where,
                   "expected a unit quaternion [w,x,y,z], not one of "
                   "length %g",
                   norm);
  double w = q[0] / norm, x = q[1] / norm, y = q[2] / norm, z = q[3] / norm;
  const double out[9] = {1 - 2 * (y * y + z * z), 2 * (x * y + w * z),     2 * (x * z - w * y),
                         2 * (x * y - w * z),     1 - 2 * (x * x + z * z), 2 * (y * z + w * x),
                         2 * (x * z + w * y),     2 * (y * z - w * x),     1 - 2 * (x * x + y * y)};
  memcpy(rotation, out, sizeof out);
  return PB_OK;
}

pb_status pb_loader_orientation(const pb_reader *r, double rotation[9], bool *given) {
  char where[256];
  double z[3] = {0, 0, 1}, hint[3] = {1, 0, 0};
  bool has_z = false, has_x = false;
  const cJSON *quaternion = pb_reader_find(r, "quaternion", where);
  pb_status st = pb_reader_direction(r, "z_axis", false, z, &has_z);
  if (!st) st = pb_reader_direction(r, "x_axis", false, hint, &has_x);
  if (st) return st;
  if (given) *given = quaternion || has_z || has_x;
  if (quaternion && (has_z || has_x))
    return pb_fail(r->err, PB_ERR_SCHEMA, where, "give a quaternion or axes, not both");
  if (quaternion) return rotation_from_quaternion(r, quaternion, where, rotation);
  if (has_x && !has_z) {
    pb_reader_find(r, "x_axis", where);
    return pb_fail(r->err, PB_ERR_SCHEMA, where,
                   "x_axis is a hint beside z_axis, which is missing");
  }
  if (rotation_from_axes(z, hint, rotation)) return PB_OK;
  pb_reader_find(r, has_x ? "x_axis" : "z_axis", where);
  if (has_x) return pb_fail(r->err, PB_ERR_SCHEMA, where, "x_axis is parallel to z_axis");
  return pb_fail(r->err, PB_ERR_SCHEMA, where,
                 "z_axis is parallel to the default x_axis [1,0,0]: give an x_axis");
}
