// Requests about the model: configure, revert, history, get_revision.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "daemon.h"
#include "request_body.h"

// The name a client attached with, else what it says, else the beginning of its id.
void pb_request_client_name(pb_daemon *d, const pb_request *request, const char *said,
                            char name[PB_ENGINE_NAME]) {
  const uint8_t *c = request->client;
  snprintf(name, PB_ENGINE_NAME, "%02x%02x%02x%02x%02x%02x%02x%02x", c[0], c[1], c[2], c[3], c[4],
           c[5], c[6], c[7]);
  pthread_mutex_lock(&d->lock);
  for (uint32_t i = 0; i < d->engine.places; i++) {
    const pb_member *m = &d->engine.member[i];
    if (m->id && memcmp(m->client, c, sizeof m->client) == 0)
      snprintf(name, PB_ENGINE_NAME, "%s", m->client_name);
  }
  pthread_mutex_unlock(&d->lock);
  if (said) snprintf(name, PB_ENGINE_NAME, "%s", said);
}

static pb_status at_step_read(const cJSON *body, uint64_t *at_step, pb_error *err) {
  double step = 0.0;
  pb_status status = pb_body_integer(body, "at_step", false, 0.0, 9007199254740992.0, &step, err);
  *at_step = (uint64_t)step;
  return status;
}

// The live plant file with the patch applied, as text.
static pb_status patched(pb_daemon *d, const cJSON *patch, char **out, pb_error *err) {
  cJSON *plant = NULL;
  const char *text = pb_daemon_live(d)->text;
  pb_status status = pb_json_parse(text, strlen(text), &plant, err);
  if (status) return status;
  cJSON *merged = pb_json_merge(plant, patch);
  status = merged ? pb_json_print(merged, out, err) : pb_fail_memory(err, "/patch");
  cJSON_Delete(merged);
  cJSON_Delete(plant);
  return status;
}

static void order_clear(pb_configure_order *order) {
  free(order->text);
  free(order->patch);
  free(order->comment);
}

static pb_status order_common(pb_daemon *d, const pb_request *request, pb_configure_order *order,
                              char name[PB_ENGINE_NAME], pb_error *err) {
  const char *comment = "", *said = NULL;
  pb_status status = at_step_read(request->body, &order->at_step, err);
  if (!status) status = pb_body_string(request->body, "comment", false, &comment, err);
  if (!status) status = pb_body_string(request->body, "name", false, &said, err);
  if (!status) status = pb_configure_idle(d, err);
  if (status) return status;
  pb_request_client_name(d, request, said, name);
  order->client_name = name;
  order->comment = pb_text_copy(comment);
  return order->comment ? PB_OK : pb_fail_memory(err, "/comment");
}

pb_status pb_request_configure(pb_daemon *d, pb_request *request, pb_error *err) {
  static const char *const keys[] = {"patch", "at_step", "comment", "name", NULL};
  pb_configure_order order = {0};
  char name[PB_ENGINE_NAME];
  pb_status status = pb_body_known(request->body, keys, err);
  const cJSON *patch = pb_json_member(request->body, "patch");
  if (!status && !cJSON_IsObject(patch))
    status = pb_fail(err, PB_ERR_SCHEMA, "/patch", "expected an object, a patch of the plant file");
  if (!status) status = order_common(d, request, &order, name, err);
  if (!status) status = patched(d, patch, &order.text, err);
  if (!status) status = pb_json_print_compact(patch, &order.patch, err);
  if (!status) return pb_configure_begin(d, request, &order, err);
  order_clear(&order);
  return status;
}

pb_status pb_request_cancel(pb_daemon *d, pb_request *request, pb_error *err) {
  static const char *const keys[] = {NULL};
  pb_status status = pb_body_known(request->body, keys, err);
  return status ? status : pb_configure_cancel(d, err);
}

static const pb_history_entry *history_find(const pb_daemon *d, uint32_t revision) {
  for (uint32_t i = 0; i < d->history_count && i < PB_CONFIGURE_HISTORY; i++)
    if (d->history[i].revision == revision) return &d->history[i];
  return NULL;
}

static pb_status entry_read(const pb_daemon *d, const cJSON *body, const pb_history_entry **out,
                            pb_error *err) {
  double revision = 0.0;
  pb_status status = pb_body_integer(body, "revision", true, 1.0, 4294967295.0, &revision, err);
  if (status) return status;
  *out = history_find(d, (uint32_t)revision);
  if (*out && (*out)->text) return PB_OK;
  return pb_fail(err, PB_ERR_REFERENCE, "/revision", "there is no revision %.0f (%d are kept)",
                 revision, PB_CONFIGURE_HISTORY);
}

pb_status pb_request_revert(pb_daemon *d, pb_request *request, pb_error *err) {
  static const char *const keys[] = {"revision", "at_step", "comment", "name", NULL};
  pb_configure_order order = {0};
  char name[PB_ENGINE_NAME];
  const pb_history_entry *entry = NULL;
  pb_status status = pb_body_known(request->body, keys, err);
  if (!status) status = entry_read(d, request->body, &entry, err);
  if (!status) status = order_common(d, request, &order, name, err);
  if (!status && !order.comment[0]) {
    char text[64];
    snprintf(text, sizeof text, "back to revision %u", entry->revision);
    free(order.comment);
    order.comment = pb_text_copy(text);
    if (!order.comment) status = pb_fail_memory(err, "/comment");
  }
  if (!status) {
    order.text = pb_text_copy(entry->text);
    if (!order.text) status = pb_fail_memory(err, "/revision");
  }
  if (!status) return pb_configure_begin(d, request, &order, err);
  order_clear(&order);
  return status;
}

static cJSON *entry_json(const pb_history_entry *e) {
  cJSON *item = cJSON_CreateObject();
  cJSON *patch = e->patch ? cJSON_Parse(e->patch) : cJSON_CreateNull();
  if (item && patch && cJSON_AddNumberToObject(item, "revision", e->revision) &&
      cJSON_AddNumberToObject(item, "time", (double)e->time) &&
      cJSON_AddNumberToObject(item, "epoch", e->epoch) &&
      cJSON_AddNumberToObject(item, "step", (double)e->step) &&
      cJSON_AddStringToObject(item, "client_name", e->client_name) &&
      cJSON_AddStringToObject(item, "comment", e->comment ? e->comment : "") &&
      cJSON_AddItemToObject(item, "patch", patch)) {
    patch = NULL;
    if (cJSON_AddStringToObject(item, "plant_sha256", e->sha256) &&
        cJSON_AddNumberToObject(item, "states", (double)e->states) &&
        cJSON_AddNumberToObject(item, "output_jump", e->output_jump) &&
        cJSON_AddStringToObject(item, "worst_output", e->worst_output) &&
        cJSON_AddNumberToObject(item, "energy_before", e->energy_before) &&
        cJSON_AddNumberToObject(item, "energy_after", e->energy_after))
      return item;
  }
  cJSON_Delete(patch);
  cJSON_Delete(item);
  return NULL;
}

pb_status pb_request_history(pb_daemon *d, pb_request *request, pb_error *err) {
  static const char *const keys[] = {NULL};
  pb_status status = pb_body_known(request->body, keys, err);
  if (status) return status;
  cJSON *list = cJSON_AddArrayToObject(request->result, "revisions");
  const uint32_t kept =
      d->history_count < PB_CONFIGURE_HISTORY ? d->history_count : PB_CONFIGURE_HISTORY;
  for (uint32_t i = d->history_count - kept; list && i < d->history_count; i++) {
    cJSON *item = entry_json(&d->history[i % PB_CONFIGURE_HISTORY]);
    if (!item) return pb_fail_memory(err, "reply");
    cJSON_AddItemToArray(list, item);
  }
  return list ? PB_OK : pb_fail_memory(err, "reply");
}

pb_status pb_request_get_revision(pb_daemon *d, pb_request *request, pb_error *err) {
  static const char *const keys[] = {"revision", NULL};
  const pb_history_entry *entry = NULL;
  pb_status status = pb_body_known(request->body, keys, err);
  if (!status) status = entry_read(d, request->body, &entry, err);
  if (status) return status;
  if (!cJSON_AddStringToObject(request->result, "plant_text", entry->text) ||
      !cJSON_AddStringToObject(request->result, "plant_sha256", entry->sha256))
    return pb_fail_memory(err, "reply");
  return PB_OK;
}
