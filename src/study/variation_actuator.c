// Models of a hexapod's actuators: see variation.h.
#include <string.h>

#include "study/template_part.h"
#include "study/variation_internal.h"

// Sets or replaces a member; takes the value over.
pb_status pb_object_put(cJSON *object, const char *key, cJSON *value, pb_error *err) {
  cJSON_DeleteItemFromObjectCaseSensitive(object, key);
  if (value && cJSON_AddItemToObject(object, key, value)) return PB_OK;
  cJSON_Delete(value);
  return pb_fail_memory(err, key);
}

pb_status pb_object_put_number(cJSON *object, const char *key, double value, pb_error *err) {
  return pb_object_put(object, key, cJSON_CreateNumber(value), err);
}

// ---- actuator models ----------------------------------------------------------------------------

// The file's model of a type, the actuator itself if it is one. Fails where there is none, or more.
static pb_status find_actuator(const cJSON *file, const char *type, cJSON **out, pb_error *err) {
  const cJSON *models = pb_json_member(file, "models"), *found = NULL;
  size_t count = 0;
  pb_status status = pb_template_part(file, "actuator", out, err);
  if (status || !strcmp(pb_part_type(*out), type)) return status;
  cJSON_Delete(*out);
  *out = NULL;
  for (const cJSON *m = models ? models->child : NULL; m; m = m->next)
    if (!strcmp(pb_part_type(m), type)) found = m, count++;
  if (count != 1)
    return pb_fail(err, PB_ERR_STATE, "/models", "%s of type %s; name the one that is meant",
                   count ? "there are several models" : "neither the actuator nor a model is",
                   type);
  *out = cJSON_Duplicate(found, 1);
  return *out ? PB_OK : pb_fail_memory(err, "/models");
}

static double number_of(const cJSON *part, const char *key) {
  const cJSON *item = pb_json_member(part, key);
  return cJSON_IsNumber(item) ? item->valuedouble : 0;
}

// The strut that a 2-DoF actuator is below the motion of its intermediate mass: shell and stacks in
// parallel, the stacks' springs in series, dampers weighed by the static shape.
static pb_status simplify(const cJSON *apa, cJSON **out, pb_error *err) {
  double ka = number_of(apa, "k_a"), ke = number_of(apa, "k_e");
  double lower = ke / (ka + ke), upper = ka / (ka + ke);  // share of the elongation
  cJSON *strut = cJSON_CreateObject();
  *out = strut;
  if (!strut) return pb_fail_memory(err, "actuator");
  pb_status status = pb_object_put(strut, "type", cJSON_CreateString("strut_1dof"), err);
  if (!status) status = pb_object_put_number(strut, "k", number_of(apa, "k_1") + ka * lower, err);
  double c = number_of(apa, "c_1") + number_of(apa, "c_a") * lower * lower +
             number_of(apa, "c_e") * upper * upper;
  if (!status) status = pb_object_put_number(strut, "c", c, err);
  double mass = number_of(apa, "mass") + number_of(apa, "intermediate_mass");
  if (!status) status = pb_object_put_number(strut, "mass", mass, err);
  return status ? status : pb_object_put_number(strut, "radius", number_of(apa, "radius"), err);
}

static pb_status make_1dof(const cJSON *file, cJSON **out, pb_error *err) {
  cJSON *own = NULL;
  pb_status status = pb_template_part(file, "actuator", &own, err);
  if (!status && !strcmp(pb_part_type(own), "strut_1dof")) {
    *out = own;
    return PB_OK;
  }
  cJSON_Delete(own);
  own = NULL;
  if (!status) status = find_actuator(file, "apa_2dof", &own, err);
  if (!status) status = simplify(own, out, err);
  cJSON_Delete(own);
  return status;
}

pb_status pb_vary_actuator_model(const cJSON *file, cJSON *template, const char *name,
                                 pb_error *err) {
  cJSON *actuator = NULL;
  const cJSON *model;
  pb_status status;
  if (!strcmp(name, "1dof"))
    status = make_1dof(file, &actuator, err);
  else if (!strcmp(name, "2dof"))
    status = find_actuator(file, "apa_2dof", &actuator, err);
  else {
    status = pb_file_model_find(file, name, &model, err);
    actuator = cJSON_CreateString(name);
  }
  if (!status) return pb_object_put(template, "actuator", actuator, err);
  cJSON_Delete(actuator);
  return status;
}
