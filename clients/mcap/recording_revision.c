// The metadata of one revision, read from a recording. See recording.h.
#include <stdlib.h>
#include <string.h>

#include "base/json.h"
#include "recording_internal.h"

// Lists end with NULL.
static void texts_free(char **list) {
  for (char **text = list; text && *text; text++) free(*text);
  free(list);
}

void pb_recorded_revision_free(pb_recorded_revision *r) {
  texts_free(r->inputs.name);
  texts_free(r->inputs.unit);
  texts_free(r->outputs.name);
  texts_free(r->outputs.unit);
  free(r->sha256);
  free(r->software);
  free(r->attachment);
  free(r->plant_text);
  free(r->model);
  free(r->packed);
}

// A JSON array of texts.
static pb_status texts_read(pb_view value, char ***out, size_t *count, pb_error *err) {
  cJSON *json = NULL;
  pb_status status = pb_json_parse((const char *)value.p, value.size, &json, err);
  if (status) return status;
  const size_t n = cJSON_IsArray(json) ? (size_t)cJSON_GetArraySize(json) : 0;
  size_t filled = 0;
  *out = calloc(n + 1, sizeof **out);
  const cJSON *item;
  if (!*out) status = pb_fail_memory(err, "names");
  cJSON_ArrayForEach(item, json) {
    if (status) break;
    if (!cJSON_IsString(item) || filled == n)
      status = pb_fail(err, PB_ERR_SYNTAX, PB_RECORDING_REVISION, "a name is not a text");
    else if (!((*out)[filled++] = strdup(item->valuestring)))
      status = pb_fail_memory(err, "names");
  }
  cJSON_Delete(json);
  *count = n;
  return status;
}

static pb_status copy(pb_view value, char **out, pb_error *err) {
  if (*out) return pb_fail(err, PB_ERR_SYNTAX, PB_RECORDING_REVISION, "a key stands twice");
  *out = pb_view_copy(value);
  return *out ? PB_OK : pb_fail_memory(err, PB_RECORDING_REVISION);
}

typedef struct revision_counts {
  size_t inputs, input_units, outputs, output_units;
} revision_counts;

static pb_status names_pair(pb_recorded_revision *r, revision_counts *n, pb_view key, pb_view value,
                            bool *known, pb_error *err) {
  struct {
    const char *key;
    char ***list;
    size_t *count;
  } row[] = {{"inputs", &r->inputs.name, &n->inputs},
             {"input_units", &r->inputs.unit, &n->input_units},
             {"outputs", &r->outputs.name, &n->outputs},
             {"output_units", &r->outputs.unit, &n->output_units}};
  *known = true;
  for (size_t i = 0; i < sizeof row / sizeof *row; i++) {
    if (!pb_view_is(key, row[i].key)) continue;
    if (*row[i].list) return pb_fail(err, PB_ERR_SYNTAX, row[i].key, "the key stands twice");
    return texts_read(value, row[i].list, row[i].count, err);
  }
  *known = false;
  return PB_OK;
}

static pb_status pair_read(pb_recorded_revision *r, revision_counts *n, char **plant, pb_view key,
                           pb_view value, pb_error *err) {
  bool known;
  const pb_status status = names_pair(r, n, key, value, &known, err);
  if (known || status) return status;
  char number[64] = "";
  if (value.size < sizeof number) memcpy(number, value.p, value.size);
  if (pb_view_is(key, "plant")) return copy(value, plant, err);
  if (pb_view_is(key, "revision")) r->revision = (uint32_t)strtoul(number, NULL, 10);
  if (pb_view_is(key, "sample_rate")) r->sample_rate = strtod(number, NULL);
  if (pb_view_is(key, "sha256")) return copy(value, &r->sha256, err);
  if (pb_view_is(key, "software")) return copy(value, &r->software, err);
  if (pb_view_is(key, "attachment")) return copy(value, &r->attachment, err);
  if (pb_view_is(key, "model")) return copy(value, &r->model, err);
  return PB_OK;
}

pb_status pb_recorded_revision_read(pb_view pairs, pb_recorded_revision *r, char **plant,
                                    pb_error *err) {
  pb_cursor c = {pairs.p, pairs.size, false};
  revision_counts n = {0};
  pb_view key, value;
  pb_status status = PB_OK;
  while (!status && pb_mcap_pair_next(&c, &key, &value))
    status = pair_read(r, &n, plant, key, value, err);
  r->inputs.count = n.inputs;
  r->outputs.count = n.outputs;
  if (!status && (c.bad || n.inputs != n.input_units || n.outputs != n.output_units ||
                  n.inputs > plantbus_MAX_INPUTS || n.outputs > plantbus_MAX_OUTPUTS))
    status = pb_fail(err, PB_ERR_SYNTAX, PB_RECORDING_REVISION, "names and units do not fit");
  if (!status && (!*plant || !r->sha256 || !r->software || !r->attachment || !r->model ||
                  !(r->sample_rate > 0.0)))
    status = pb_fail(err, PB_ERR_SYNTAX, PB_RECORDING_REVISION, "a key is missing");
  return status;
}
