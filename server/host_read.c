// Reading a request into the definition of an item: what all types share. See host_item.h.
#include "host_item.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "request_body.h"

typedef struct host_type {
  const char *name, *request;
  pb_status (*read)(const pb_host_reader *r, pb_error *err);
  const char *const *keys;  // NULL at the end
} host_type;

#define COMMON "channel", "type", "inputs"

static const char *const iff_keys[] = {COMMON,          "outputs",     "gain",
                                       "integrator_hz", "highpass_hz", NULL};
static const char *const lti_keys[] = {COMMON, "outputs", "a", "b", "c", "d", "dt", "method", NULL};
static const char *const white_keys[] = {COMMON, "rms", "seed", NULL};
static const char *const band_keys[] = {COMMON,    "rms",  "f1",     "f2",
                                        "seconds", "seed", "repeat", NULL};
static const char *const chirp_keys[] = {COMMON,    "amplitude", "f1", "f2",
                                         "seconds", "repeat",    NULL};
static const char *const sine_keys[] = {COMMON, "amplitude", "frequency", "phase", NULL};
static const char *const step_keys[] = {COMMON, "amplitude", "at", NULL};
static const char *const table_keys[] = {COMMON, "values", "repeat", NULL};

static const host_type type_of[] = {
    [PB_HOST_IFF] = {"iff", "host_controller", pb_host_read_iff, iff_keys},
    [PB_HOST_LTI] = {"lti", "host_controller", pb_host_read_lti, lti_keys},
    [PB_HOST_WHITE] = {"white", "excite", pb_host_read_white, white_keys},
    [PB_HOST_NOISE] = {"noise", "excite", pb_host_read_noise, band_keys},
    [PB_HOST_MULTISINE] = {"multisine", "excite", pb_host_read_multisine, band_keys},
    [PB_HOST_CHIRP] = {"chirp", "excite", pb_host_read_chirp, chirp_keys},
    [PB_HOST_SINE] = {"sine", "excite", pb_host_read_sine, sine_keys},
    [PB_HOST_STEP] = {"step", "excite", pb_host_read_step, step_keys},
    [PB_HOST_TABLE] = {"table", "excite", pb_host_read_table, table_keys},
};

enum { HOST_TYPES = sizeof type_of / sizeof *type_of };

pb_status pb_host_read_number(const cJSON *body, const char *key, bool required, double *out,
                              pb_error *err) {
  double value = required ? NAN : *out;
  const pb_status status = pb_body_number(body, key, &value, err);
  if (status) return status;
  if (!isfinite(value)) {
    char where[256];
    pb_json_pointer(where, sizeof where, "", key);
    return pb_fail(err, PB_ERR_SCHEMA, where, "expected a number");
  }
  *out = value;
  return PB_OK;
}

pb_status pb_host_read_positive(const cJSON *body, const char *key, bool required, double *out,
                                pb_error *err) {
  double value = *out;
  const pb_status status = pb_host_read_number(body, key, required, &value, err);
  if (status) return status;
  if (!(value > 0)) {
    char where[256];
    pb_json_pointer(where, sizeof where, "", key);
    return pb_fail(err, PB_ERR_SCHEMA, where, "expected a number above 0");
  }
  *out = value;
  return PB_OK;
}

pb_status pb_host_read_row(const cJSON *row, const char *key, size_t index, size_t columns,
                           double *out, size_t stride, pb_error *err) {
  char where[256];
  snprintf(where, sizeof where, "/%s/%zu", key, index);
  if (!cJSON_IsArray(row) || (size_t)cJSON_GetArraySize(row) != columns)
    return pb_fail(err, PB_ERR_SCHEMA, where, "expected a row of %zu numbers", columns);
  size_t k = 0;
  for (const cJSON *item = row->child; item; item = item->next, k++) {
    if (!cJSON_IsNumber(item) || !isfinite(item->valuedouble)) {
      snprintf(where, sizeof where, "/%s/%zu/%zu", key, index, k);
      return pb_fail(err, PB_ERR_SCHEMA, where, "expected a number");
    }
    out[k * stride] = item->valuedouble;
  }
  return PB_OK;
}

// Names of signals under "inputs" or "outputs" into index and name, each copied.
static pb_status names_read(const cJSON *body, const pb_model *model, bool input, uint32_t *index,
                            char **name, size_t *count, pb_error *err) {
  const char *key = input ? "inputs" : "outputs", *noun = input ? "input" : "output";
  const cJSON *list = pb_json_member(body, key);
  char where[64];
  snprintf(where, sizeof where, "/%s", key);
  *count = 0;
  if (!cJSON_IsArray(list) || !list->child)
    return pb_fail(err, PB_ERR_SCHEMA, where, "expected an array of names of %ss", noun);
  for (const cJSON *item = list->child; item; item = item->next) {
    snprintf(where, sizeof where, "/%s/%zu", key, *count);
    if (!cJSON_IsString(item)) return pb_fail(err, PB_ERR_SCHEMA, where, "expected a name");
    const char *text = item->valuestring;
    size_t i;
    pb_status status = pb_signal_find(input ? model->input : model->output,
                                      input ? model->nu : model->ny, noun, text, where, &i, err);
    if (status) return status;
    for (size_t k = 0; k < *count; k++)
      if (index[k] == (uint32_t)i)
        return pb_fail(err, PB_ERR_SCHEMA, where, "'%.64s' is named twice", text);
    index[*count] = (uint32_t)i;
    name[*count] = pb_text_copy(text);
    if (!name[*count]) return pb_fail_memory(err, where);
    ++*count;
  }
  return PB_OK;
}

// The counts are set also on failure: they say which names are to be freed.
static pb_status signals_read(const cJSON *body, const pb_model *model, bool outputs,
                              pb_host_item *item, pb_error *err) {
  pb_host_def *def = item->def;
  def->name = calloc(model->nu + model->ny, sizeof *def->name);
  if (!def->name) return pb_fail_memory(err, "host");
  pb_status status = names_read(body, model, true, item->input, def->name, &def->inputs, err);
  if (!status && outputs)
    status =
        names_read(body, model, false, item->output, def->name + def->inputs, &def->outputs, err);
  return status;
}

// "expected one of …"
static pb_status refuse_type(const char *request, pb_error *err) {
  pb_text names = {0};
  for (int k = 0; k < HOST_TYPES; k++)
    if (strcmp(type_of[k].request, request) == 0)
      pb_text_format(&names, "%s%s", names.length ? ", " : "", type_of[k].name);
  if (names.failed) return pb_fail_memory(err, "host");
  const pb_status status =
      names.text ? pb_fail(err, PB_ERR_SCHEMA, "/type", "expected one of %s", names.text)
                 : pb_fail(err, PB_ERR_ARGUMENT, "host", "no request '%.64s'", request);
  free(names.text);
  return status;
}

static pb_status type_read(const cJSON *body, const char *request, pb_host_kind *kind,
                           pb_error *err) {
  const char *name = NULL;
  const pb_status status = pb_body_string(body, "type", true, &name, err);
  if (status) return status;
  for (int k = 0; k < HOST_TYPES; k++) {
    if (strcmp(type_of[k].request, request) != 0 || strcmp(type_of[k].name, name) != 0) continue;
    *kind = (pb_host_kind)k;
    return PB_OK;
  }
  return refuse_type(request, err);
}

static pb_status channel_read(const cJSON *body, const char **channel, pb_error *err) {
  const pb_status status = pb_body_string(body, "channel", true, channel, err);
  if (status) return status;
  if (strlen(*channel) >= PB_HOST_NAME)
    return pb_fail(err, PB_ERR_SCHEMA, "/channel", "expected 1 to %d octets", PB_HOST_NAME - 1);
  return PB_OK;
}

// What makes the item again in another process: {"request", "client_name", "body"}. The body, which
// may be large, is printed, not copied into the object.
static pb_status entry_print(const cJSON *body, const char *request, const char *client_name,
                             char **out, pb_error *err) {
  char *head = NULL, *tail = NULL;
  cJSON *entry = cJSON_CreateObject();
  pb_status status = entry && cJSON_AddStringToObject(entry, "request", request) &&
                             cJSON_AddStringToObject(entry, "client_name", client_name)
                         ? pb_json_print_compact(entry, &head, err)
                         : pb_fail_memory(err, "host");
  if (!status) status = pb_json_print_compact(body, &tail, err);
  if (!status) {
    pb_text text = {0};
    pb_text_append_n(&text, head, strlen(head) - 1);  // open at its end
    pb_text_append(&text, ",\"body\":");
    pb_text_append(&text, tail);
    pb_text_append(&text, "}");
    if (text.failed) status = pb_fail_memory(err, "host");
    *out = text.text;
  }
  cJSON_Delete(entry);
  free(head);
  free(tail);
  return status;
}

static pb_status texts_keep(pb_host_def *def, const cJSON *body, const char *channel,
                            const char *client_name, pb_error *err) {
  def->info.kind = type_of[def->kind].name;
  def->info.request = type_of[def->kind].request;
  def->info.channel = pb_text_copy(channel);
  def->info.client_name = pb_text_copy(client_name);
  if (!def->info.channel || !def->info.client_name) return pb_fail_memory(err, "host");
  return entry_print(body, def->info.request, client_name, &def->text, err);
}

static pb_status def_read(const cJSON *body, const char *request, const pb_model *model,
                          const char *client_name, pb_host_item *item, pb_error *err) {
  pb_host_def *def = item->def;
  const char *channel = NULL;
  pb_status status = type_read(body, request, &def->kind, err);
  if (status) return status;
  const host_type *type = &type_of[def->kind];
  const pb_host_reader reader = {.body = body, .sample_rate = model->sample_rate, .def = def};
  status = pb_body_known(body, type->keys, err);
  if (!status) status = channel_read(body, &channel, err);
  if (!status) status = signals_read(body, model, def->kind <= PB_HOST_LTI, item, err);
  if (!status) status = type->read(&reader, err);
  if (!status) status = texts_keep(def, body, channel, client_name, err);
  return status;
}

pb_status pb_host_def_read(const cJSON *body, const char *request, const pb_model *model,
                           const char *client_name, pb_host_item *out, pb_error *err) {
  *out = (pb_host_item){0};
  if (!cJSON_IsObject(body)) return pb_fail(err, PB_ERR_SCHEMA, "", "expected an object");
  pb_host_item item = {.def = calloc(1, sizeof *item.def)};
  if (!item.def) return pb_fail_memory(err, "host");
  atomic_init(&item.def->holders, 1);
  const pb_status status =
      def_read(body, request, model, client_name ? client_name : "", &item, err);
  if (status) {
    pb_host_def_release(item.def);
    return status;
  }
  *out = item;
  return PB_OK;
}

void pb_host_def_release(pb_host_def *def) {
  if (!def || atomic_fetch_sub(&def->holders, 1) != 1) return;
  for (size_t i = 0; i < def->inputs + def->outputs; i++) free(def->name[i]);
  for (size_t i = 0; i < def->parts; i++) pb_lti_free(&def->part[i]);
  free(def->name);
  free(def->part);
  free(def->table);
  free(def->text);
  free((char *)def->info.channel);
  free((char *)def->info.client_name);
  free(def);
}
