// Loading a plant file: see plant.h.
#include "plant/plant.h"

#include <libgen.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "plant/loader.h"

static const pb_field plant_fields[] = {
    {"sample_rate", offsetof(pb_plant, sample_rate), PB_POSITIVE, false, 10000},
};

// Sections that must be objects (or arrays) when present; cJSON's own look-ups would read anything.
static pb_status check_sections(const cJSON *file, pb_error *err) {
  static const char *const objects[] = {"models", "components", "connections"};
  static const char *const arrays[] = {"inputs", "outputs"};
  char where[64];
  for (size_t i = 0; i < 3; i++) {
    const cJSON *v = pb_json_member(file, objects[i]);
    snprintf(where, sizeof where, "/%s", objects[i]);
    if (v && !cJSON_IsObject(v))
      return pb_fail(err, PB_ERR_SCHEMA, where, "expected an object of named entries");
  }
  for (size_t i = 0; i < 2; i++) {
    const cJSON *v = pb_json_member(file, arrays[i]);
    snprintf(where, sizeof where, "/%s", arrays[i]);
    if (v && !cJSON_IsArray(v)) return pb_fail(err, PB_ERR_SCHEMA, where, "expected an array");
  }
  return PB_OK;
}

static pb_status read_header(const cJSON *file, pb_plant *p, pb_error *err) {
  static const char *const known[] = {"schema",     "name",        "max_frequency", "models",
                                      "components", "connections", "inputs",        "outputs",
                                      "template",   NULL};
  pb_reader r;
  const char *schema, *name;
  char where[256];
  pb_status st = pb_reader_open(file, "", NULL, &r, err);
  if (!st) st = pb_reader_string(&r, "schema", true, &schema);
  if (!st && strcmp(schema, "plantbus.plant/1"))
    st = pb_fail(err, PB_ERR_SCHEMA, "/schema",
                 "\"%s\" is not known; expected \"plantbus.plant/1\"", schema);
  if (!st) st = pb_reader_known(&r, known, plant_fields, 1);
  if (!st) st = pb_reader_string(&r, "name", true, &name);
  if (!st) st = pb_reader_fields(&r, plant_fields, 1, p, false);
  if (!st) st = check_sections(file, err);
  if (st) return st;
  const cJSON *limit = pb_reader_find(&r, "max_frequency", where);
  if (limit && !cJSON_IsNull(limit)) {
    static const pb_field field = {"max_frequency", 0, PB_POSITIVE, true, 0};
    st = pb_reader_number(&r, &field, &p->max_frequency);
    if (st) return st;
  }
  p->name = pb_text_copy(name);
  return p->name ? PB_OK : pb_fail_memory(err, "/name");
}

// calloc for `count` members, at least one.
static void *new_list(size_t count, size_t size) {
  return calloc(count ? count : 1, size);
}

static pb_status read_components(pb_loader *loader, const cJSON *object, pb_plant *p) {
  size_t count = (size_t)cJSON_GetArraySize(object);
  if (!count)
    return pb_fail(loader->err, PB_ERR_SCHEMA, "/components", "a plant has at least one component");
  p->component = new_list(count, sizeof *p->component);
  if (!p->component) return pb_fail_memory(loader->err, "/components");
  for (const cJSON *m = object->child; m; m = m->next) {
    pb_status st = pb_loader_component(loader, m, m->string, &p->component[p->component_count++]);
    if (st) return st;
  }
  return PB_OK;
}

static pb_status read_connections(pb_loader *loader, const cJSON *object, pb_plant *p) {
  size_t count = object ? (size_t)cJSON_GetArraySize(object) : 0;
  p->connection = new_list(count, sizeof *p->connection);
  if (!p->connection) return pb_fail_memory(loader->err, "/connections");
  for (const cJSON *m = object ? object->child : NULL; m; m = m->next) {
    pb_status st =
        pb_loader_connection(loader, m, m->string, p, &p->connection[p->connection_count++]);
    if (st) return st;
  }
  return PB_OK;
}

static pb_status read_signals(pb_loader *loader, const cJSON *list, bool is_input, pb_plant *p) {
  const char *section = is_input ? "/inputs" : "/outputs";
  size_t count = list ? (size_t)cJSON_GetArraySize(list) : 0;
  size_t limit = is_input ? PB_MAX_INPUTS : PB_MAX_OUTPUTS,
         *n = is_input ? &p->input_count : &p->output_count;
  if (!count || count > limit)
    return pb_fail(loader->err, PB_ERR_SCHEMA, section, "expected 1 to %zu signals, not %zu", limit,
                   count);
  pb_port *port = new_list(count, sizeof *port);
  if (!port) return pb_fail_memory(loader->err, section);
  *(is_input ? &p->input : &p->output) = port;
  for (const cJSON *m = list->child; m; m = m->next) {
    char pointer[64];
    snprintf(pointer, sizeof pointer, "%s/%zu", section, *n);
    pb_status st = pb_loader_signal(loader, m, pointer, is_input, p, &port[(*n)++]);
    if (st) return st;
    for (size_t i = 0; i + 1 < *n; i++)
      if (!strcmp(port[i].name, port[*n - 1].name))
        return pb_fail(loader->err, PB_ERR_SCHEMA, pointer, "the name \"%s\" is taken by %s/%zu",
                       port[i].name, section, i);
  }
  return PB_OK;
}

// Replaces a relative "file" of an object by its absolute path, so that the text loads from
// anywhere.
static pb_status absolute_file(cJSON *object, const char *directory, pb_error *err) {
  cJSON *file = cJSON_GetObjectItemCaseSensitive(object, "file");
  if (!cJSON_IsString(file) || file->valuestring[0] == '/') return PB_OK;
  pb_text path = {0};
  pb_text_format(&path, "%s/%s", directory ? directory : ".", file->valuestring);
  if (path.failed) return pb_fail_memory(err, "");
  char resolved[PATH_MAX];
  bool ok = realpath(path.text, resolved) && cJSON_SetValuestring(file, resolved);
  free(path.text);
  return ok ? PB_OK : pb_fail(err, PB_ERR_IO, file->valuestring, "cannot be resolved");
}

static pb_status absolute_files(cJSON *value, const char *directory, pb_error *err) {
  pb_status st = cJSON_IsObject(value) ? absolute_file(value, directory, err) : PB_OK;
  for (cJSON *m = value->child; m && !st; m = m->next) st = absolute_files(m, directory, err);
  return st;
}

// Canonical text: defaults of the header filled in, element paths absolute, numbers in full.
static pb_status write_text(const cJSON *file, const char *directory, pb_plant *p, pb_error *err) {
  cJSON *copy = cJSON_Duplicate(file, 1);
  if (!copy) return pb_fail_memory(err, "");
  bool ok = true;
  if (!pb_json_member(copy, "sample_rate"))
    ok = cJSON_AddNumberToObject(copy, "sample_rate", p->sample_rate) != NULL;
  if (ok && !pb_json_member(copy, "max_frequency"))
    ok = cJSON_AddNullToObject(copy, "max_frequency") != NULL;
  pb_status st = ok ? absolute_files(copy, directory, err) : pb_fail_memory(err, "");
  if (!st) st = pb_json_print(copy, &p->text, err);
  cJSON_Delete(copy);
  return st;
}

// Checks a model by itself: its type, its keys, its numbers; keys that are missing may come from
// the object that names it.
static pb_status check_model(pb_loader *loader, const cJSON *model, const char *pointer) {
  pb_reader r;
  const char *type;
  bool component = false, joint = false;
  pb_status st = pb_reader_open(model, pointer, NULL, &r, loader->err);
  if (!st) st = pb_reader_string(&r, "type", true, &type);
  if (!st) st = pb_loader_check_component_model(&r, type, &component);
  if (!st && !component) st = pb_loader_check_joint_model(&r, type, &joint);
  if (st || component || joint) return st;
  char where[256];
  pb_json_pointer(where, sizeof where, pointer, "type");
  return pb_fail(loader->err, PB_ERR_SCHEMA, where, "\"%s\" is no type of a component or joint",
                 type);
}

static pb_status read_plant(pb_loader *loader, const cJSON *file, cJSON **expanded, pb_plant *p) {
  pb_error *err = loader->err;
  pb_status st = read_header(file, p, err);
  loader->models = pb_json_member(file, "models");
  for (const cJSON *m = loader->models ? loader->models->child : NULL; m && !st; m = m->next) {
    char pointer[256];
    pb_json_pointer(pointer, sizeof pointer, "/models", m->string);
    st = check_model(loader, m, pointer);
  }
  if (!st) st = pb_loader_expand(file, expanded, err);
  if (st) return st;
  const cJSON *components = pb_json_member(*expanded, "components");
  if (!components) return pb_fail(err, PB_ERR_SCHEMA, "/components", "missing; expected an object");
  st = read_components(loader, components, p);
  if (!st) st = read_connections(loader, pb_json_member(*expanded, "connections"), p);
  if (!st) st = read_signals(loader, pb_json_member(*expanded, "inputs"), true, p);
  if (!st) st = read_signals(loader, pb_json_member(*expanded, "outputs"), false, p);
  return st ? st : write_text(file, loader->directory, p, err);
}

pb_status pb_plant_parse_stored(const char *text, size_t length, const char *directory,
                                pb_element_store *store, pb_warnings *warnings, pb_plant **out,
                                pb_error *err) {
  *out = NULL;
  cJSON *file = NULL, *expanded = NULL;
  pb_loader loader = {.directory = directory, .warnings = warnings, .err = err, .store = store};
  pb_status st = pb_json_parse(text, length, &file, err);
  if (st) return st;
  pb_plant *p = calloc(1, sizeof *p);
  st = p ? read_plant(&loader, file, &expanded, p) : pb_fail_memory(err, "");
  for (size_t i = 0; i < loader.element_count; i++) pb_element_free(loader.element[i]);
  free(loader.element);
  cJSON_Delete(file);
  cJSON_Delete(expanded);
  if (st) {
    pb_plant_free(p);
  } else {
    *out = p;
  }
  return st;
}

pb_status pb_plant_parse(const char *text, size_t length, const char *directory,
                         pb_warnings *warnings, pb_plant **out, pb_error *err) {
  return pb_plant_parse_stored(text, length, directory, NULL, warnings, out, err);
}

pb_status pb_plant_load(const char *path, pb_warnings *warnings, pb_plant **out, pb_error *err) {
  *out = NULL;
  char *text = NULL, *copy = NULL;
  size_t length;
  pb_status st = pb_text_read(path, &text, &length, err);
  if (st) return st;
  copy = pb_text_copy(path);
  st = copy ? pb_plant_parse(text, length, dirname(copy), warnings, out, err)
            : pb_fail_memory(err, path);
  if (st == PB_ERR_SYNTAX && err && !err->where[0])
    snprintf(err->where, sizeof err->where, "%s", path);
  free(copy);
  free(text);
  return st;
}

void pb_plant_free(pb_plant *p) {
  if (!p) return;
  for (size_t i = 0; i < p->component_count; i++) pb_component_clear(&p->component[i]);
  for (size_t i = 0; i < p->connection_count; i++) pb_connection_clear(&p->connection[i]);
  for (size_t i = 0; i < p->input_count; i++) pb_port_clear(&p->input[i]);
  for (size_t i = 0; i < p->output_count; i++) pb_port_clear(&p->output[i]);
  free(p->component);
  free(p->connection);
  free(p->input);
  free(p->output);
  free(p->name);
  free(p->text);
  free(p);
}
