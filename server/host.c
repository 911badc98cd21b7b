// Sets of items: making, changing, binding. See host.h; host_run.c for what they do in a step.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "host_set.h"
#include "request_body.h"

static void order_by_name(pb_host *host) {
  for (size_t i = 0; i < host->count; i++) {
    const char *name = host->item[i].def->info.channel;
    size_t k = i;
    for (; k > 0 && strcmp(host->item[host->order[k - 1]].def->info.channel, name) > 0; k--)
      host->order[k] = host->order[k - 1];
    host->order[k] = (uint8_t)i;
  }
}

static size_t widest_part(const pb_host *host) {
  size_t widest = 0;
  for (size_t i = 0; i < host->count; i++) {
    const pb_host_def *def = host->item[i].def;
    for (size_t p = 0; p < def->parts; p++)
      if (def->part[p].nx > widest) widest = def->part[p].nx;
  }
  return widest;
}

// A set of bound items, each of which gets a holder more; all states at the start.
static pb_status host_make(double sample_rate, const pb_host_item *const *item, size_t count,
                           pb_host **out, pb_error *err) {
  pb_host *host = calloc(1, sizeof *host);
  *out = NULL;
  if (!host) return pb_fail_memory(err, "host");
  host->sample_rate = sample_rate;
  for (size_t i = 0; i < count; i++) {
    pb_host_item *to = &host->item[i];
    to->def = item[i]->def;
    memcpy(to->input, item[i]->input, sizeof to->input);
    memcpy(to->output, item[i]->output, sizeof to->output);
    to->offset = host->bytes;
    to->bytes = pb_host_def_bytes(to->def);
    host->bytes += to->bytes;
    atomic_fetch_add(&to->def->holders, 1);
  }
  host->count = count;
  host->state = malloc(host->bytes + 1);
  host->scratch = malloc((widest_part(host) + 1) * sizeof *host->scratch);
  if (!host->state || !host->scratch) {
    pb_host_free(host);
    return pb_fail_memory(err, "host");
  }
  order_by_name(host);
  pb_host_reset(host);
  *out = host;
  return PB_OK;
}

void pb_host_free(pb_host *host) {
  if (!host) return;
  for (size_t i = 0; i < host->count; i++) pb_host_def_release(host->item[i].def);
  free(host->state);
  free(host->scratch);
  free(host);
}

static pb_status check_model(const pb_model *model, pb_error *err) {
  if (model->nu > PB_STEPPER_INPUTS || model->ny > PB_STEPPER_OUTPUTS)
    return pb_fail(err, PB_ERR_ARGUMENT, "host", "%zu inputs and %zu outputs, at most %d and %d",
                   model->nu, model->ny, PB_STEPPER_INPUTS, PB_STEPPER_OUTPUTS);
  return PB_OK;
}

static pb_status check_rate(const pb_host *host, const pb_model *model, pb_error *err) {
  if (host && host->count > 0 && host->sample_rate != model->sample_rate)
    return pb_fail(err, PB_ERR_STATE, "/sample_rate",
                   "%.12g Hz, but what runs inside the step was made for %.12g Hz",
                   model->sample_rate, host->sample_rate);
  return PB_OK;
}

static pb_status check_room(const pb_host *host, const char *channel, pb_error *err) {
  const size_t count = pb_host_count(host);
  for (size_t i = 0; i < count; i++)
    if (strcmp(host->item[i].def->info.channel, channel) == 0)
      return pb_fail(err, PB_ERR_STATE, "/channel", "'%s' is in use inside the step", channel);
  if (count == PB_HOST_ITEMS)
    return pb_fail(err, PB_ERR_STATE, "", "%d items run inside the step, which is the most",
                   PB_HOST_ITEMS);
  return PB_OK;
}

pb_status pb_host_add(const pb_host *host, const cJSON *body, const char *request,
                      const pb_model *model, const char *client_name, pb_host **out,
                      uint64_t *period_steps, pb_error *err) {
  const size_t count = pb_host_count(host);
  const pb_host_item *item[PB_HOST_ITEMS];
  pb_host_item added = {0};
  *out = NULL;
  pb_status status = check_model(model, err);
  if (!status) status = check_rate(host, model, err);
  if (!status) status = pb_host_def_read(body, request, model, client_name, &added, err);
  if (!status) status = check_room(host, added.def->info.channel, err);
  if (!status) {
    for (size_t i = 0; i < count; i++) item[i] = &host->item[i];
    item[count] = &added;
    status = host_make(model->sample_rate, item, count + 1, out, err);
  }
  if (!status && period_steps) *period_steps = added.def->info.period_steps;
  pb_host_def_release(added.def);
  return status;
}

pb_status pb_host_remove(const pb_host *host, const char *channel, pb_host **out, pb_error *err) {
  const size_t count = pb_host_count(host);
  const pb_host_item *item[PB_HOST_ITEMS];
  size_t kept = 0;
  *out = NULL;
  for (size_t i = 0; i < count; i++)
    if (strcmp(host->item[i].def->info.channel, channel) != 0) item[kept++] = &host->item[i];
  if (kept == count)
    return pb_fail(err, PB_ERR_REFERENCE, "/channel", "nothing inside the step is called '%.64s'",
                   channel);
  return host_make(host->sample_rate, item, kept, out, err);
}

static pb_status item_bind(pb_host_item *item, const pb_model *model, pb_error *err) {
  const pb_host_def *def = item->def;
  for (size_t i = 0; i < def->inputs + def->outputs; i++) {
    const bool input = i < def->inputs;
    const char *name = def->name[i];
    const int at = input ? pb_model_input(model, name) : pb_model_output(model, name);
    if (at < 0)
      return pb_fail(err, PB_ERR_REFERENCE, def->info.channel, "the plant has no %s '%s' any more",
                     input ? "input" : "output", name);
    *(input ? &item->input[i] : &item->output[i - def->inputs]) = (uint32_t)at;
  }
  return PB_OK;
}

pb_status pb_host_rebind(const pb_host *host, const pb_model *model, pb_host **out, pb_error *err) {
  const size_t count = pb_host_count(host);
  pb_host_item bound[PB_HOST_ITEMS];
  const pb_host_item *item[PB_HOST_ITEMS];
  *out = NULL;
  pb_status status = check_model(model, err);
  if (!status) status = check_rate(host, model, err);
  for (size_t i = 0; i < count && !status; i++) {
    bound[i] = (pb_host_item){.def = host->item[i].def};
    item[i] = &bound[i];
    status = item_bind(&bound[i], model, err);
  }
  return status ? status : host_make(model->sample_rate, item, count, out, err);
}

pb_status pb_host_text(const pb_host *host, char **json, pb_error *err) {
  pb_text text = {0};
  *json = NULL;
  pb_text_append(&text, "[");
  for (size_t i = 0; i < pb_host_count(host); i++) {
    if (i > 0) pb_text_append(&text, ",");
    pb_text_append(&text, host->item[i].def->text);
  }
  pb_text_append(&text, "]");
  if (text.failed) return pb_fail_memory(err, "host");
  *json = text.text;
  return PB_OK;
}

// One entry of the array that pb_host_text gives, added to *host in place.
static pb_status entry_add(pb_host **host, const cJSON *entry, const pb_model *model,
                           pb_error *err) {
  static const char *const keys[] = {"request", "client_name", "body", NULL};
  const char *request = NULL, *client_name = "";
  pb_host *more = NULL;
  if (!cJSON_IsObject(entry)) return pb_fail(err, PB_ERR_SCHEMA, "", "expected an object");
  pb_status status = pb_body_known(entry, keys, err);
  if (!status) status = pb_body_string(entry, "request", true, &request, err);
  if (status) return status;
  const cJSON *name = pb_json_member(entry, "client_name");  // may be empty
  if (cJSON_IsString(name)) client_name = name->valuestring;
  status = pb_host_add(*host, pb_json_member(entry, "body"), request, model, client_name, &more,
                       NULL, err);
  if (status) return status;
  pb_host_free(*host);
  *host = more;
  return PB_OK;
}

pb_status pb_host_parse(const char *json, const pb_model *model, pb_host **out, pb_error *err) {
  cJSON *list = NULL;
  pb_host *host = NULL;
  *out = NULL;
  pb_status status = pb_json_parse(json, strlen(json), &list, err);
  if (!status && !cJSON_IsArray(list))
    status = pb_fail(err, PB_ERR_SCHEMA, "", "expected an array of what runs inside the step");
  if (!status) status = host_make(model->sample_rate, NULL, 0, &host, err);
  size_t k = 0;
  for (const cJSON *entry = status ? NULL : list->child; entry && !status; entry = entry->next) {
    pb_error inner = {0};
    status = entry_add(&host, entry, model, &inner);
    if (status) pb_fail(err, status, "", "item %zu: %s: %s", k, inner.where, inner.message);
    k++;
  }
  cJSON_Delete(list);
  if (status) {
    pb_host_free(host);
    return status;
  }
  *out = host;
  return PB_OK;
}

size_t pb_host_count(const pb_host *host) {
  return host ? host->count : 0;
}

const pb_host_item_info *pb_host_info(const pb_host *host, size_t i) {
  return &host->item[i].def->info;
}

bool pb_host_done(const pb_host *host, size_t i) {
  return atomic_load_explicit(&host->item[i].done, memory_order_relaxed);
}
