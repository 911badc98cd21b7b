// Models to characterise: see element_source.h.
#include "study/element_source.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "study/actuator_piezo.h"

pb_actuator_layout pb_actuator_layout_default(void) {
  const pb_piezo piezo = pb_piezo_default();
  return (pb_actuator_layout){.ends = {1, 2},
                              .actuator = {5, 7},
                              .sensor = {3, 4},
                              .axis = {1, 0, 0},
                              .polarity = -1,
                              .g_a = pb_piezo_force_constant(&piezo),
                              .g_s = pb_piezo_sensor_constant(&piezo),
                              .modal_damping = 0.01};
}

static bool type_is(const cJSON *model, const char *const *types) {
  const cJSON *type = pb_json_member(model, "type");
  for (; cJSON_IsString(type) && *types; types++)
    if (!strcmp(type->valuestring, *types)) return true;
  return false;
}

bool pb_element_is_actuator(const cJSON *model) {
  static const char *const lumped[] = {"apa_2dof", "strut_1dof", NULL};
  static const char *const element[] = {"super_element", NULL};
  if (type_is(model, lumped)) return true;
  return type_is(model, element) && pb_json_member(model, "stacks");
}

bool pb_element_is_joint(const cJSON *model) {
  static const char *const joints[] = {"universal",       "spherical", "universal_axial",
                                       "spherical_axial", "bushing",   NULL};
  static const char *const element[] = {"super_element", NULL};
  if (type_is(model, joints)) return true;
  return type_is(model, element) && !pb_json_member(model, "stacks");
}

void pb_element_source_clear(pb_element_source *s) {
  cJSON_Delete(s->model);
  free(s->directory);
  free(s->name);
  *s = (pb_element_source){0};
}

// Takes the model over.
static pb_status fill(cJSON *model, const char *directory, const char *name, size_t name_length,
                      pb_element_source *out, pb_error *err) {
  pb_text text = {0};
  pb_text_append_n(&text, name, name_length);
  *out = (pb_element_source){.model = model, .name = text.text};
  if (directory) out->directory = pb_text_copy(directory);
  if (model && out->name && (!directory || out->directory)) return PB_OK;
  pb_element_source_clear(out);
  return pb_fail_memory(err, name);
}

// ---- out of a plant file ------------------------------------------------------------------------

static pb_status choose(const cJSON *models, const char *file, pb_element_wanted *wanted,
                        const cJSON **out, pb_error *err) {
  pb_text names = {0};
  size_t count = 0;
  for (const cJSON *m = models ? models->child : NULL; m; m = m->next) {
    if (!wanted(m)) continue;
    pb_text_format(&names, " %s", m->string);
    *out = m;
    count++;
  }
  pb_status st = PB_OK;
  if (names.failed)
    st = pb_fail_memory(err, file);
  else if (count == 0)
    st = pb_fail(err, PB_ERR_REFERENCE, file, "none of its models is one of this kind");
  else if (count > 1)
    st = pb_fail(err, PB_ERR_REFERENCE, file, "several of its models would do:%s; name one",
                 names.text);
  free(names.text);
  return st;
}

// What says where a part stands belongs to the bench.
static const char *const place_keys[] = {"position", "quaternion", "z_axis", "x_axis"};

pb_status pb_element_source_plant(const char *text, const char *file, const char *directory,
                                  const char *name, pb_element_wanted *wanted,
                                  pb_element_source *out, pb_error *err) {
  cJSON *plant = NULL;
  const cJSON *model = NULL;
  *out = (pb_element_source){0};
  pb_status st = pb_json_parse(text, strlen(text), &plant, err);
  if (st) return st;
  const cJSON *models = pb_json_member(plant, "models");
  if (name) model = pb_json_member(models, name);
  if (name && !model)
    st = pb_fail(err, PB_ERR_REFERENCE, file, "has no model \"%s\"", name);
  else if (name && !wanted(model))
    st = pb_fail(err, PB_ERR_REFERENCE, file, "model \"%s\" is not one of this kind", name);
  else if (!name)
    st = choose(models, file, wanted, &model, err);
  if (!st) {
    cJSON *copy = cJSON_Duplicate(model, 1);
    for (size_t i = 0; copy && i < sizeof place_keys / sizeof *place_keys; i++)
      cJSON_DeleteItemFromObjectCaseSensitive(copy, place_keys[i]);
    st = fill(copy, directory, model->string, strlen(model->string), out, err);
  }
  cJSON_Delete(plant);
  return st;
}

pb_status pb_element_source_patch(const pb_element_source *source, const cJSON *patch,
                                  pb_element_source *out, pb_error *err) {
  return fill(pb_json_merge(source->model, patch), source->directory, source->name,
              strlen(source->name), out, err);
}

// ---- around an element file ---------------------------------------------------------------------

static bool add_item(cJSON *object, const char *key, cJSON *item) {
  if (object && item && cJSON_AddItemToObject(object, key, item)) return true;
  cJSON_Delete(item);
  return false;
}

static cJSON *pair(const size_t value[2]) {
  return cJSON_CreateDoubleArray((const double[2]){(double)value[0], (double)value[1]}, 2);
}

static bool add_stack(cJSON *stacks, const char *key, const size_t frame[2], const double axis[3]) {
  char text[2][24];
  snprintf(text[0], sizeof text[0], "%zu", frame[0]);
  snprintf(text[1], sizeof text[1], "%zu", frame[1]);
  const char *names[2] = {text[0], text[1]};
  cJSON *stack = stacks ? cJSON_AddObjectToObject(stacks, key) : NULL;
  return add_item(stack, "frames", cJSON_CreateStringArray(names, 2)) &&
         add_item(stack, "axis", cJSON_CreateDoubleArray(axis, 3));
}

static pb_status fill_file(cJSON *model, bool ok, const char *path, pb_element_source *out,
                           pb_error *err) {
  const char *slash = strrchr(path, '/'), *name = slash ? slash + 1 : path;
  const char *dot = strrchr(name, '.');
  if (!ok) {
    cJSON_Delete(model);
    model = NULL;
  }
  return fill(model, NULL, name, dot ? (size_t)(dot - name) : strlen(name), out, err);
}

static cJSON *new_element(const char *path, double modal_damping) {
  cJSON *model = cJSON_CreateObject();
  if (model && cJSON_AddStringToObject(model, "type", "super_element") &&
      cJSON_AddStringToObject(model, "file", path) &&
      cJSON_AddNumberToObject(model, "modal_damping", modal_damping))
    return model;
  cJSON_Delete(model);
  return NULL;
}

pb_status pb_element_source_actuator(const char *path, const pb_actuator_layout *l,
                                     pb_element_source *out, pb_error *err) {
  cJSON *model = new_element(path, l->modal_damping);
  cJSON *stacks = model ? cJSON_AddObjectToObject(model, "stacks") : NULL;
  bool ok = add_item(model, "ends", pair(l->ends)) &&
            add_stack(stacks, "actuator", l->actuator, l->axis) &&
            cJSON_AddNumberToObject(model, "g_a", l->g_a) &&
            cJSON_AddNumberToObject(model, "polarity", l->polarity);
  if (ok && l->sensor[0])
    ok = add_stack(stacks, "sensor", l->sensor, l->axis) &&
         cJSON_AddNumberToObject(model, "g_s", l->g_s);
  return fill_file(model, ok, path, out, err);
}

pb_status pb_element_source_joint(const char *path, const size_t nodes[2], double modal_damping,
                                  pb_element_source *out, pb_error *err) {
  cJSON *model = new_element(path, modal_damping);
  return fill_file(model, add_item(model, "nodes", pair(nodes)), path, out, err);
}
