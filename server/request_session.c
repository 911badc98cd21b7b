// Requests about sessions: attach, detach; and what a client may ask without one.
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>

#include "daemon.h"
#include "request_body.h"

// Numbers on JSON's side are doubles: a session, with 64 random bits, travels as a string.
static bool session_text(uint64_t session, char text[24]) {
  return snprintf(text, 24, "%016" PRIx64, session) == 16;
}

static pb_status session_new(pb_daemon *d, uint64_t *session, pb_error *err) {
  do {
    if (getrandom(session, sizeof *session, 0) != sizeof *session)
      return pb_fail(err, PB_ERR_IO, "", "no random numbers");
  } while (*session == 0 || pb_engine_find(&d->engine, *session));
  return PB_OK;
}

static pb_status inputs_read(pb_daemon *d, const cJSON *body, uint32_t *index, uint32_t *count,
                             pb_error *err) {
  const cJSON *list = pb_json_member(body, "inputs");
  *count = 0;
  if (!cJSON_IsArray(list) || cJSON_GetArraySize(list) < 1)
    return pb_fail(err, PB_ERR_SCHEMA, "/inputs", "expected an array of names of inputs");
  for (const cJSON *item = list->child; item; item = item->next) {
    char where[64];
    snprintf(where, sizeof where, "/inputs/%u", *count);
    if (!cJSON_IsString(item)) return pb_fail(err, PB_ERR_SCHEMA, where, "expected a name");
    const pb_model *model = pb_daemon_live(d)->model;
    size_t i;
    pb_status status =
        pb_signal_find(model->input, model->nu, "input", item->valuestring, where, &i, err);
    if (status) return status;
    for (uint32_t k = 0; k < *count; k++)
      if (index[k] == (uint32_t)i)
        return pb_fail(err, PB_ERR_SCHEMA, where, "'%.64s' is named twice", item->valuestring);
    index[(*count)++] = (uint32_t)i;
  }
  return PB_OK;
}

static pb_status silence_read(const char *text, pb_silence *out, pb_error *err) {
  static const char *const name[] = {"hold", "zero", "ramp"};
  for (int i = 0; i < 3; i++) {
    if (strcmp(text, name[i]) != 0) continue;
    *out = (pb_silence)i;
    return PB_OK;
  }
  return pb_fail(err, PB_ERR_SCHEMA, "/silence", "expected \"hold\", \"zero\" or \"ramp\"");
}

static pb_status attach_read(pb_daemon *d, const pb_request *request, pb_attach *attach,
                             uint32_t *index, pb_error *err) {
  static const char *const keys[] = {"channel", "inputs", "barrier", "priority", "silence",
                                     "lease",   "guard",  "name",    NULL};
  const cJSON *body = request->body;
  const char *silence = "zero";
  double priority = 0.0;
  attach->client_name = "unnamed";
  attach->lease = d->options.lease;
  attach->guard = d->options.guard;
  memcpy(attach->client, request->client, sizeof attach->client);
  attach->input = index;
  pb_status st = pb_body_known(body, keys, err);
  if (!st) st = pb_body_string(body, "channel", true, &attach->channel, err);
  if (!st) st = inputs_read(d, body, index, &attach->count, err);
  if (!st) st = pb_body_bool(body, "barrier", &attach->barrier, err);
  if (!st) st = pb_body_integer(body, "priority", false, -1e6, 1e6, &priority, err);
  if (!st) st = pb_body_string(body, "silence", false, &silence, err);
  if (!st) st = silence_read(silence, &attach->silence, err);
  if (!st) st = pb_body_number(body, "lease", &attach->lease, err);
  if (!st) st = pb_body_number(body, "guard", &attach->guard, err);
  if (!st) st = pb_body_string(body, "name", false, &attach->client_name, err);
  attach->priority = (int32_t)priority;
  return st;
}

pb_status pb_request_attach(pb_daemon *d, pb_request *request, pb_error *err) {
  uint32_t index[PB_ENGINE_INPUTS];
  pb_attach attach = {.barrier = true};
  pb_status status = attach_read(d, request, &attach, index, err);
  if (status) return status;
  pthread_mutex_lock(&d->lock);
  const pb_member *member = NULL;
  status = session_new(d, &attach.id, err);
  if (!status) status = pb_engine_attach(&d->engine, &attach, pb_daemon_clock(), &member, err);
  if (!status && d->engine.drive != PB_DRIVE_REALTIME)
    pb_bus_publish_sample(d);  // for the newcomer
  const uint32_t channel = member ? member->channel : 0;
  const uint64_t step = d->engine.step;
  const uint32_t epoch = d->engine.epoch;
  const uint64_t event = d->engine.events_made;
  const pb_drive drive = d->engine.drive;
  pthread_mutex_unlock(&d->lock);
  if (status) return status;
  char session[24];
  session_text(attach.id, session);
  cJSON *result = request->result;
  if (!cJSON_AddStringToObject(result, "session", session) ||
      !cJSON_AddNumberToObject(result, "channel", channel) ||
      !cJSON_AddNumberToObject(result, "step", (double)step) ||
      !cJSON_AddNumberToObject(result, "epoch", epoch) ||
      !cJSON_AddStringToObject(result, "mode", pb_drive_name(drive)) ||
      !cJSON_AddNumberToObject(result, "lease", attach.lease) ||
      !cJSON_AddNumberToObject(result, "guard", attach.guard) ||
      !cJSON_AddNumberToObject(result, "event", (double)event))
    return pb_fail_memory(err, "reply");
  return PB_OK;
}

pb_status pb_request_detach(pb_daemon *d, pb_request *request, pb_error *err) {
  static const char *const keys[] = {"session", NULL};
  const char *text;
  pb_status status = pb_body_known(request->body, keys, err);
  if (!status) status = pb_body_string(request->body, "session", true, &text, err);
  if (status) return status;
  char *end;
  const uint64_t session = strtoull(text, &end, 16);
  if (strlen(text) != 16 || *end)
    return pb_fail(err, PB_ERR_SCHEMA, "/session", "expected 16 hexadecimal digits");
  pthread_mutex_lock(&d->lock);
  pb_member *member = pb_engine_find(&d->engine, session);
  if (!member || memcmp(member->client, request->client, sizeof member->client) != 0) {
    status = pb_fail(err, PB_ERR_REFERENCE, "/session", "is not attached by this client");
  } else {
    pb_engine_drop(&d->engine, member, PB_EVENT_DETACHED, "has detached");
    pb_bus_run_ready(d);
  }
  pthread_mutex_unlock(&d->lock);
  return status;
}

pb_status pb_request_ping(pb_daemon *d, pb_request *request, pb_error *err) {
  static const char *const keys[] = {NULL};
  pb_status status = pb_body_known(request->body, keys, err);
  if (status) return status;
  pthread_mutex_lock(&d->lock);
  const uint64_t step = d->engine.step;
  const uint32_t epoch = d->engine.epoch;
  const pb_drive drive = d->engine.drive;
  const uint64_t event = d->engine.events_made;
  const uint32_t members = pb_engine_member_count(&d->engine);
  const uint32_t revision = d->live->number;
  char hash[24];
  session_text(d->current.hash, hash);
  pthread_mutex_unlock(&d->lock);
  if (!cJSON_AddNumberToObject(request->result, "members", members) ||
      !cJSON_AddNumberToObject(request->result, "revision", revision) ||
      !cJSON_AddStringToObject(request->result, "hash", hash) ||
      !cJSON_AddNumberToObject(request->result, "step", (double)step) ||
      !cJSON_AddNumberToObject(request->result, "epoch", epoch) ||
      !cJSON_AddNumberToObject(request->result, "event", (double)event) ||
      !cJSON_AddStringToObject(request->result, "mode", pb_drive_name(drive)))
    return pb_fail_memory(err, "reply");
  return PB_OK;
}

static bool signals_add(cJSON *result, const char *key, const pb_signal *signal, size_t count) {
  cJSON *list = cJSON_AddArrayToObject(result, key);
  if (!list) return false;
  for (size_t i = 0; i < count; i++) {
    cJSON *item = cJSON_CreateObject();
    if (!item || !cJSON_AddStringToObject(item, "name", signal[i].name) ||
        !cJSON_AddStringToObject(item, "unit", signal[i].unit)) {
      cJSON_Delete(item);
      return false;
    }
    cJSON_AddItemToArray(list, item);
  }
  return true;
}

// For clients without the description topic: everything but the matrices.
pb_status pb_request_get_description(pb_daemon *d, pb_request *request, pb_error *err) {
  static const char *const keys[] = {NULL};
  pb_status status = pb_body_known(request->body, keys, err);
  if (status) return status;
  pthread_mutex_lock(&d->lock);
  const uint32_t epoch = d->engine.epoch, decimation = d->engine.decimation;
  const pb_drive drive = d->engine.drive;
  const double speed = d->speed;
  pthread_mutex_unlock(&d->lock);
  cJSON *result = request->result;
  const pb_revision *live = pb_daemon_live(d);
  const pb_model *m = live->model;
  if (!cJSON_AddStringToObject(result, "name", m->name) ||
      !cJSON_AddStringToObject(result, "version", PB_VERSION) ||
      !cJSON_AddNumberToObject(result, "revision", live->number) ||
      !cJSON_AddNumberToObject(result, "epoch", epoch) ||
      !cJSON_AddNumberToObject(result, "sample_rate", m->sample_rate) ||
      !cJSON_AddNumberToObject(result, "states", (double)m->nx) ||
      !cJSON_AddNumberToObject(result, "dof", (double)m->dof) ||
      !signals_add(result, "inputs", m->input, m->nu) ||
      !signals_add(result, "outputs", m->output, m->ny) ||
      !cJSON_AddStringToObject(result, "mode", pb_drive_name(drive)) ||
      !cJSON_AddNumberToObject(result, "speed", speed) ||
      !cJSON_AddNumberToObject(result, "decimation", decimation) ||
      !cJSON_AddStringToObject(result, "plant_sha256", live->sha256) ||
      !cJSON_AddStringToObject(result, "plant_text", live->text))
    return pb_fail_memory(err, "reply");
  return PB_OK;
}
