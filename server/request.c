// Requests: who asks, what is asked, one answer to each.
//
// A client is who its participant is: the id in the request must be the GUID of the participant
// whose writer brought it. A forged one is answered to the participant that forged it.
#include <string.h>

#include "base/json.h"
#include "daemon.h"

static const struct {
  const char *kind;
  pb_request_handler handler;
} table[] = {{"attach", pb_request_attach},
             {"detach", pb_request_detach},
             {"ping", pb_request_ping},
             {"get_description", pb_request_get_description},
             {"set_mode", pb_request_set_mode},
             {"step", pb_request_step},
             {"reset", pb_request_reset},
             {"snapshot", pb_request_snapshot},
             {"restore", pb_request_restore},
             {"configure", pb_request_configure},
             {"cancel_configure", pb_request_cancel},
             {"revert", pb_request_revert},
             {"history", pb_request_history},
             {"get_revision", pb_request_get_revision},
             {"host_controller", pb_request_host},
             {"excite", pb_request_host},
             {"remove_controller", pb_request_unhost},
             {"decimate", pb_request_decimate},
             {"shutdown", pb_request_shutdown}};

static pb_status body_parse(const char *text, cJSON **body, pb_error *err) {
  if (!*text) text = "{}";
  pb_status status = pb_json_parse(text, strlen(text), body, err);
  if (status || cJSON_IsObject(*body)) return status;
  cJSON_Delete(*body);
  *body = NULL;
  return pb_fail(err, PB_ERR_SCHEMA, "", "expected a JSON object");
}

static pb_status dispatch(pb_daemon *d, const plantbus_Request *in, pb_request *request,
                          pb_error *err) {
  for (size_t i = 0; i < sizeof table / sizeof *table; i++)
    if (strcmp(table[i].kind, in->kind) == 0) return table[i].handler(d, request, err);
  return pb_fail(err, PB_ERR_REFERENCE, "kind", "'%.64s' is not a request this daemon serves",
                 in->kind);
}

void pb_bus_reply(pb_daemon *d, const uint8_t client[16], uint64_t id, const char *status,
                  const pb_error *err, const char *result) {
  plantbus_Reply reply = {.id = id,
                          .status = (char *)status,
                          .pointer = (char *)err->where,
                          .message = (char *)err->message,
                          .result = (char *)result};
  memcpy(reply.client, client, sizeof reply.client);
  // Who has the answer and looks for the plant then finds what it tells of.
  if (d->description_due) pb_bus_publish_description(d);
  dds_write(d->reply, &reply);
}

static void serve(pb_daemon *d, const plantbus_Request *in) {
  pb_error err = {PB_OK, "", ""};
  cJSON *body = NULL;
  char *text = NULL;
  pb_request request = {
      .client = in->client, .id = in->id, .kind = in->kind, .result = cJSON_CreateObject()};
  pb_status status =
      request.result ? body_parse(in->body, &body, &err) : pb_fail_memory(&err, "reply");
  request.body = body;
  if (!status) status = dispatch(d, in, &request, &err);
  if (!status) status = pb_json_print_compact(request.result, &text, &err);
  const char *word = status ? "refused" : request.accepted ? "accepted" : "ok";
  if (!request.deferred) pb_bus_reply(d, in->client, in->id, word, &err, status ? "{}" : text);
  cJSON_free(text);
  cJSON_Delete(request.result);
  cJSON_Delete(body);
}

bool pb_bus_answered_before(pb_daemon *d, const uint8_t client[16], uint64_t id) {
  for (size_t i = 0; i < PB_DAEMON_ANSWERED; i++)
    if (d->answered[i].id == id && memcmp(d->answered[i].client, client, 16) == 0) return true;
  pb_answered *place = &d->answered[d->answered_next++ % PB_DAEMON_ANSWERED];
  memcpy(place->client, client, sizeof place->client);
  place->id = id;
  return false;
}

// The client's request writer is gone: the client has ended, or its host is lost.
static void client_over(pb_daemon *d, const uint8_t client[16]) {
  pthread_mutex_lock(&d->lock);
  if (pb_engine_drop_client(&d->engine, client, PB_EVENT_LOST, "has left the bus"))
    pb_bus_run_ready(d);
  pthread_mutex_unlock(&d->lock);
  plantbus_Reply key = {0};
  memcpy(key.client, client, sizeof key.client);
  dds_unregister_instance(d->reply, &key);
}

static void request_judge(pb_daemon *d, const plantbus_Request *in, const dds_sample_info_t *info) {
  uint8_t actual[16];
  if (!pb_bus_writer_is(d->request, info->publication_handle, in->client, actual)) {
    static const uint8_t nobody[16];
    pb_error err;
    pb_fail(&err, PB_ERR_STATE, "client", "the client id is not that of the participant");
    if (memcmp(actual, nobody, sizeof actual) != 0)
      pb_bus_reply(d, actual, in->id, "refused", &err, "{}");
    return;
  }
  if (!pb_bus_answered_before(d, in->client, in->id)) serve(d, in);
}

// The end of a client's writer is told with its last request when that was still here. Anyone may
// dispose of its instance; only its own word counts.
static void request_take(pb_daemon *d, const plantbus_Request *in, const dds_sample_info_t *info) {
  uint8_t actual[16];
  if (info->valid_data) request_judge(d, in, info);
  if (info->instance_state == DDS_IST_NOT_ALIVE_NO_WRITERS ||
      (!info->valid_data && info->instance_state == DDS_IST_NOT_ALIVE_DISPOSED &&
       pb_bus_writer_is(d->request, info->publication_handle, in->client, actual)))
    client_over(d, in->client);
}

// A bounded number at a time: whoever floods the daemon with requests does not keep it from the
// rest.
void pb_bus_take_requests(pb_daemon *d) {
  for (int i = 0; i < PB_DAEMON_REQUESTS; i++) {
    void *sample[1] = {NULL};
    dds_sample_info_t info;
    const dds_return_t n = dds_take(d->request, sample, &info, 1, 1);
    if (n != 1) return;
    request_take(d, sample[0], &info);
    dds_return_loan(d->request, sample, n);
  }
}
