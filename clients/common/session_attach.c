// Attaching to a channel and leaving it.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/json.h"
#include "session_internal.h"

static bool numbers_add(cJSON *body, const pb_attach_options *o) {
  if (o->lease > 0.0 && !cJSON_AddNumberToObject(body, "lease", o->lease)) return false;
  if (o->guard > 0.0 && !cJSON_AddNumberToObject(body, "guard", o->guard)) return false;
  return true;
}

static pb_status body_make(const pb_session *s, const pb_attach_options *o, char **text,
                           pb_error *err) {
  cJSON *body = cJSON_CreateObject();
  cJSON *inputs = body ? cJSON_AddArrayToObject(body, "inputs") : NULL;
  bool good = inputs && cJSON_AddStringToObject(body, "channel", o->channel) &&
              cJSON_AddStringToObject(body, "name", s->client_name) &&
              cJSON_AddBoolToObject(body, "barrier", o->barrier) &&
              cJSON_AddNumberToObject(body, "priority", o->priority) &&
              cJSON_AddStringToObject(body, "silence", o->silence ? o->silence : "zero") &&
              numbers_add(body, o);
  for (uint32_t i = 0; good && i < o->input_count; i++) {
    cJSON *name = cJSON_CreateString(o->inputs[i]);
    good = name && cJSON_AddItemToArray(inputs, name);
  }
  pb_status status = good ? pb_json_print_compact(body, text, err) : pb_fail_memory(err, "attach");
  cJSON_Delete(body);
  return status;
}

static pb_status reply_read(pb_session *s, const char *result, pb_error *err) {
  cJSON *json = NULL;
  pb_status status = pb_json_parse(result, strlen(result), &json, err);
  if (status) return status;
  const cJSON *session = pb_json_member(json, "session");
  if (cJSON_IsString(session))
    s->session = strtoull(session->valuestring, NULL, 16);
  else
    status = pb_fail(err, PB_ERR_SYNTAX, "/session", "is missing in the daemon's answer");
  cJSON_Delete(json);
  s->channel = (uint32_t)pb_session_result(result, "channel");
  s->attach_step = (uint64_t)pb_session_result(result, "step");
  s->attach_event = (uint64_t)pb_session_result(result, "event");
  return status;
}

static pb_status entities_make(pb_session *s, pb_error *err) {
  const int64_t deadline = pb_session_clock() + (int64_t)(s->timeout * 1e9);
  pb_status status = pb_session_listen(s, err);
  if (status) return status;
  s->command =
      pb_writer_create(s->publisher, s->topic[PB_TOPIC_COMMAND], PB_TOPIC_COMMAND, s->guard);
  if (s->command < 0) return pb_fail(err, PB_ERR_IO, "command", "%s", dds_strretcode(-s->command));
  status = pb_session_match_daemon(s, s->command, deadline, err);
  return status ? status : pb_session_match(s, s->sample, false, true, deadline, err);
}

static void entities_drop(pb_session *s) {
  if (s->command > 0) dds_delete(s->command);
  s->command = 0;
}

static pb_status options_check(const pb_session *s, const pb_attach_options *o, pb_error *err) {
  if (s->attached) return pb_fail(err, PB_ERR_STATE, o->channel, "the session is attached already");
  if (!o->channel || o->input_count < 1 || o->input_count > plantbus_MAX_INPUTS)
    return pb_fail(err, PB_ERR_ARGUMENT, "attach", "expected a channel and 1 to %d inputs",
                   plantbus_MAX_INPUTS);
  return PB_OK;
}

pb_status pb_session_attach(pb_session *s, const pb_attach_options *o, pb_error *err) {
  char *body = NULL, *result = NULL;
  pb_status status = options_check(s, o, err);
  if (status) return status;
  s->guard = o->guard > 0.0 ? o->guard : s->received->default_guard;
  status = body_make(s, o, &body, err);
  if (!status) status = entities_make(s, err);
  if (!status) status = pb_session_request(s, "attach", body, 0.0, &result, err);
  if (!status) status = reply_read(s, result, err);
  if (!status) {
    s->input_count = o->input_count;
    s->attached = true;
    s->has_unanswered = false;
  } else {
    entities_drop(s);
  }
  free(result);
  free(body);
  return status;
}

// The daemon may have gone, or may have dropped this client: leaving then needs no answer.
void pb_session_detach(pb_session *s) {
  if (!s || !s->attached) return;
  char body[64];
  snprintf(body, sizeof body, "{\"session\":\"%016llx\"}", (unsigned long long)s->session);
  dds_publication_matched_status_t matched = {0};
  dds_get_publication_matched_status(s->request, &matched);
  if (matched.current_count > 0) pb_session_request(s, "detach", body, 1.0, NULL, NULL);
  entities_drop(s);
  s->attached = false;
  s->input_count = 0;
}
