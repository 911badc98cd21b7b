// McInroy's condition: see struts.h. The stiffnesses are static gains of a single part, fixed at
// one end and loaded at the other, so that parameters and elements are judged alike.
#include "study/struts.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "plant/template.h"
#include "study/file_model.h"
#include "study/variation.h"

pb_strut_condition pb_strut_condition_make(double k, double length, double bending) {
  pb_strut_condition c = {.k = k, .length = length, .bending = bending};
  c.limit = k * length * length;
  c.margin = bending > 0 ? c.limit / bending : INFINITY;
  c.held = c.margin >= PB_STRUT_MARGIN;
  return c;
}

// How a part is loaded: frames by name, a force or a torque.
typedef struct test_bench {
  char fixed[24], loaded[24];
  bool torque;
  double direction[3];
} test_bench;

static cJSON *signal_of(const test_bench *b, bool input) {
  char frame[40];
  cJSON *s = cJSON_CreateObject();
  snprintf(frame, sizeof frame, "part.%s", b->loaded);
  cJSON_AddStringToObject(s, "name", input ? "load" : "motion");
  cJSON_AddStringToObject(s, "type",
                          input       ? (b->torque ? "torque" : "force")
                          : b->torque ? "rotation"
                                      : "displacement");
  cJSON_AddStringToObject(s, "frame", frame);
  cJSON_AddItemToObject(s, "direction", cJSON_CreateDoubleArray(b->direction, 3));
  return s;
}

// A plant of one part; takes the part over. What lack of memory leaves out, the plant's loader
// misses.
static cJSON *make_bench(cJSON *part, const test_bench *b) {
  char to[40];
  cJSON *file = cJSON_CreateObject();
  snprintf(to, sizeof to, "part.%s", b->fixed);
  cJSON_AddStringToObject(file, "schema", "plantbus.plant/1");
  cJSON_AddStringToObject(file, "name", "part");
  cJSON *components = cJSON_AddObjectToObject(file, "components");
  if (!cJSON_AddItemToObject(components, "part", part)) cJSON_Delete(part);
  cJSON *base = cJSON_AddObjectToObject(cJSON_AddObjectToObject(file, "connections"), "base");
  cJSON_AddStringToObject(base, "from", "ground");
  cJSON_AddStringToObject(base, "to", to);
  cJSON_AddStringToObject(cJSON_AddObjectToObject(base, "joint"), "type", "weld");
  cJSON_AddItemToArray(cJSON_AddArrayToObject(file, "inputs"), signal_of(b, true));
  cJSON_AddItemToArray(cJSON_AddArrayToObject(file, "outputs"), signal_of(b, false));
  return file;
}

// Static motion per load of a part, m/N or rad/Nm; takes the part over.
static pb_status compliance(cJSON *part, const test_bench *b, const char *directory, double *out,
                            pb_error *err) {
  cJSON *file = make_bench(part, b);
  pb_model *model = NULL;
  pb_status status = pb_file_model(file, directory, &model, err);
  if (!status) status = pb_model_dc(model, out, err);
  pb_model_free(model);
  cJSON_Delete(file);
  return status;
}

static bool is_element(const cJSON *part) {
  const cJSON *type = pb_json_member(part, "type");
  return cJSON_IsString(type) && !strcmp(type->valuestring, "super_element");
}

// Frames "1", "2" … of an element out of a pair of numbers.
static void element_frames(const cJSON *pair, int first, int second, test_bench *b) {
  const cJSON *one = cJSON_GetArrayItem(pair, 0), *two = cJSON_GetArrayItem(pair, 1);
  if (cJSON_IsNumber(one)) first = one->valueint;
  if (cJSON_IsNumber(two)) second = two->valueint;
  snprintf(b->fixed, sizeof b->fixed, "%d", first);
  snprintf(b->loaded, sizeof b->loaded, "%d", second);
}

static pb_status axial_stiffness(const cJSON *file, const char *directory, double length, double *k,
                                 pb_error *err) {
  test_bench b = {"bottom", "top", false, {0, 0, 1}};
  cJSON *part;
  double per_newton = NAN;
  pb_status status = pb_template_part(file, "actuator", &part, err);
  if (status) return status;
  if (is_element(part))
    element_frames(pb_json_member(part, "ends"), 1, 2, &b);
  else if (!pb_json_member(part, "length"))
    cJSON_AddNumberToObject(part, "length", length);
  status = compliance(part, &b, directory, &per_newton, err);
  *k = 1 / per_newton;
  return status;
}

// Bending stiffness of a joint about its stiffer axis, by its key or as an element.
static pb_status bending_stiffness(const cJSON *file, const char *key, const char *directory,
                                   double *k, pb_error *err) {
  cJSON *joint;
  pb_status status = pb_template_part(file, key, &joint, err);
  if (status) return status;
  if (!is_element(joint)) {
    const cJSON *k_f = pb_json_member(joint, "k_f"), *type = pb_json_member(joint, "type");
    bool stiff = cJSON_IsString(type) &&
                 (!strcmp(type->valuestring, "weld") || !strcmp(type->valuestring, "prismatic"));
    *k = stiff ? INFINITY : cJSON_IsNumber(k_f) ? k_f->valuedouble : 0;
    cJSON_Delete(joint);
    return PB_OK;
  }
  double most = 0;
  for (int axis = 0; axis < 2 && !status; axis++) {
    test_bench b = {.torque = true, .direction = {axis == 0, axis == 1, 0}};
    double per_newtonmetre = NAN;
    cJSON *part = cJSON_Duplicate(joint, 1);
    if (!part) {
      status = pb_fail_memory(err, key);
      break;
    }
    element_frames(pb_json_member(part, "nodes"), 2, 1, &b);
    cJSON_DeleteItemFromObjectCaseSensitive(part, "nodes");
    status = compliance(part, &b, directory, &per_newtonmetre, err);
    most = fmax(most, 1 / per_newtonmetre);
  }
  cJSON_Delete(joint);
  *k = most;
  return status;
}

pb_status pb_strut_condition_find(const cJSON *file, const char *directory, pb_strut_condition *out,
                                  pb_error *err) {
  pb_hexapod h = {0};
  double k = 0, bottom = 0, top = 0;
  *out = (pb_strut_condition){0};
  pb_status status = pb_hexapod_read(file, &h, err);
  if (!status) status = axial_stiffness(file, directory, h.strut[0].length, &k, err);
  if (!status) status = bending_stiffness(file, "bottom_joint", directory, &bottom, err);
  if (!status) status = bending_stiffness(file, "top_joint", directory, &top, err);
  if (!status) *out = pb_strut_condition_make(k, h.strut[0].length, fmax(bottom, top));
  return status;
}
