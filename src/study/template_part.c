// Parts of the template: see template_part.h.
#include "study/template_part.h"

#include <math.h>
#include <string.h>

#include "base/text.h"

pb_status pb_template_find(const cJSON *file, const cJSON **out, pb_error *err) {
  *out = pb_json_member(file, "template");
  if (cJSON_IsObject(*out)) return PB_OK;
  return pb_fail(err, PB_ERR_STATE, "/template", "the plant has no template nano_hexapod to vary");
}

pb_status pb_file_model_find(const cJSON *file, const char *name, const cJSON **out,
                             pb_error *err) {
  const cJSON *models = pb_json_member(file, "models");
  *out = models ? pb_json_member(models, name) : NULL;
  if (cJSON_IsObject(*out)) return PB_OK;
  return pb_fail(err, PB_ERR_REFERENCE, "/models", "there is no model \"%s\"", name);
}

// A model's name, an object, or an object that names a model, as one flat object.
static pb_status flatten(const cJSON *file, const cJSON *value, const char *where, cJSON **out,
                         pb_error *err) {
  const cJSON *model = NULL, *name = cJSON_IsString(value) ? value : pb_json_member(value, "model");
  pb_status status = PB_OK;
  if (cJSON_IsString(name)) status = pb_file_model_find(file, name->valuestring, &model, err);
  if (status) return status;
  if (!cJSON_IsString(value) && !cJSON_IsObject(value))
    return pb_fail(err, PB_ERR_STATE, where, "expected the name of a model or an object");
  cJSON *flat = cJSON_IsString(value) ? cJSON_Duplicate(model, 1)
                : model               ? pb_json_merge(model, value)
                                      : cJSON_Duplicate(value, 1);
  if (!flat) return pb_fail_memory(err, where);
  cJSON_DeleteItemFromObjectCaseSensitive(flat, "model");
  *out = flat;
  return PB_OK;
}

pb_status pb_template_part(const cJSON *file, const char *key, cJSON **out, pb_error *err) {
  const cJSON *template;
  char where[256];
  *out = NULL;
  pb_status status = pb_template_find(file, &template, err);
  if (status) return status;
  pb_json_pointer(where, sizeof where, "/template", key);
  const cJSON *value = pb_json_member(template, key);
  if (!value) return pb_fail(err, PB_ERR_STATE, where, "missing");
  return flatten(file, value, where, out, err);
}

pb_status pb_template_source(const cJSON *file, const char *key, const char *directory,
                             pb_element_source *out, pb_error *err) {
  *out = (pb_element_source){0};
  pb_status status = pb_template_part(file, key, &out->model, err);
  if (status) return status;
  out->directory = directory ? pb_text_copy(directory) : NULL;
  out->name = pb_text_copy(key);
  if (out->name && (out->directory || !directory)) return PB_OK;
  pb_element_source_clear(out);
  return pb_fail_memory(err, key);
}

const char *pb_part_type(const cJSON *part) {
  const cJSON *type = pb_json_member(part, "type");
  return cJSON_IsString(type) ? type->valuestring : "";
}

// A weld has nothing to characterise.
pb_status pb_template_joint(const cJSON *file, const char *key, const char *directory, double k[6],
                            pb_error *err) {
  pb_element_source source;
  pb_bench_model bench = {0};
  pb_joint_character c = {.k = {INFINITY, INFINITY, INFINITY, INFINITY, INFINITY, INFINITY}};
  pb_status status = pb_template_source(file, key, directory, &source, err);
  if (status) return status;
  if (strcmp(pb_part_type(source.model), "weld"))
    status = pb_joint_characterize(&source, NULL, &bench, &c, err);
  memcpy(k, c.k, sizeof c.k);
  pb_bench_model_clear(&bench);
  pb_element_source_clear(&source);
  return status;
}
