// Requests and their replies.
#include <stdlib.h>
#include <string.h>

#include "base/json.h"
#include "base/text.h"
#include "session_internal.h"

static const int64_t resend_ns =
    300000000;  // the daemon serves a request once, however often it comes

// Looks for the reply among those that are there. True when found; *reply is then on loan.
static bool reply_take(pb_session *s, uint64_t id, plantbus_Reply **reply) {
  for (;;) {
    void *sample[1] = {NULL};
    dds_sample_info_t info;
    if (dds_take(s->reply, sample, &info, 1, 1) != 1) return false;
    plantbus_Reply *r = sample[0];
    if (info.valid_data && r->id == id && memcmp(r->client, s->client, sizeof s->client) == 0) {
      *reply = r;
      return true;
    }
    dds_return_loan(s->reply, sample, 1);
  }
}

static pb_status reply_read(const plantbus_Reply *reply, const char *kind, bool *accepted,
                            char **result, pb_error *err) {
  *accepted = strcmp(reply->status, "accepted") == 0;
  if (strcmp(reply->status, "ok") != 0 && !*accepted)
    return pb_fail(err, PB_ERR_STATE, reply->pointer, "%s refused: %s", kind, reply->message);
  if (!result) return PB_OK;
  *result = pb_text_copy(reply->result);
  return *result ? PB_OK : pb_fail_memory(err, kind);
}

static bool reply_wait(pb_session *s, const plantbus_Request *request, int64_t deadline,
                       plantbus_Reply **reply) {
  int64_t resend = 0;
  for (;;) {
    const int64_t now = pb_session_clock();
    if (now >= deadline) return false;
    if (now >= resend) {
      dds_write(s->request, request);
      resend = now + resend_ns;
    }
    const int64_t until = resend < deadline ? resend : deadline;
    dds_waitset_wait(s->request_wait, NULL, 0, until - now);
    if (reply_take(s, request->id, reply)) return true;
  }
}

static pb_status ask(pb_session *s, const char *kind, const char *body, double timeout,
                     bool *accepted, char **result, pb_error *err) {
  if (result) *result = NULL;
  if (timeout <= 0.0) timeout = s->timeout;
  plantbus_Request request = {
      .id = s->next_request++, .kind = (char *)kind, .body = (char *)(body ? body : "{}")};
  memcpy(request.client, s->client, sizeof request.client);
  plantbus_Reply *reply = NULL;
  if (!reply_wait(s, &request, pb_session_clock() + (int64_t)(timeout * 1e9), &reply))
    return pb_fail(err, PB_ERR_STATE, kind, "plant '%s' did not answer within %g s",
                   s->received->name, timeout);
  const pb_status status = reply_read(reply, kind, accepted, result, err);
  void *sample[1] = {reply};
  dds_return_loan(s->reply, sample, 1);
  return status;
}

pb_status pb_session_request(pb_session *s, const char *kind, const char *body, double timeout,
                             char **result, pb_error *err) {
  bool accepted;
  return ask(s, kind, body, timeout, &accepted, result, err);
}

pb_status pb_session_ask(pb_session *s, const char *kind, const char *body, double timeout,
                         pb_answer *out, pb_error *err) {
  pb_standing standing = {0};
  *out = (pb_answer){0};
  pb_status status = pb_session_ping(s, &standing, err);
  if (!status) status = ask(s, kind, body, timeout, &out->accepted, &out->result, err);
  if (!status) out->event = standing.event;
  return status;
}

void pb_answer_clear(pb_answer *answer) {
  free(answer->result);
  *answer = (pb_answer){0};
}

double pb_session_result(const char *result, const char *key) {
  cJSON *json = NULL;
  double value = 0.0;
  if (pb_json_parse(result, strlen(result), &json, NULL)) return 0.0;
  const cJSON *item = pb_json_member(json, key);
  if (cJSON_IsNumber(item)) value = item->valuedouble;
  cJSON_Delete(json);
  return value;
}

static pb_status mode_read(const char *result, pb_run_mode *mode, pb_error *err) {
  static const char *const name[] = {"paused", "lockstep", "realtime"};
  cJSON *json = NULL;
  pb_status status = pb_json_parse(result, strlen(result), &json, err);
  if (status) return status;
  const cJSON *item = pb_json_member(json, "mode");
  status = pb_fail(err, PB_ERR_SYNTAX, "/mode", "the daemon's answer has no known mode");
  for (int i = 0; i < 3; i++) {
    if (!cJSON_IsString(item) || strcmp(item->valuestring, name[i]) != 0) continue;
    *mode = (pb_run_mode)i;
    status = PB_OK;
  }
  cJSON_Delete(json);
  return status;
}

pb_status pb_session_ping(pb_session *s, pb_standing *out, pb_error *err) {
  char *result = NULL;
  pb_status status = pb_session_request(s, "ping", NULL, 0.0, &result, err);
  if (!status) status = mode_read(result, &out->mode, err);
  if (!status) {
    out->epoch = (uint32_t)pb_session_result(result, "epoch");
    out->step = (uint64_t)pb_session_result(result, "step");
    out->event = (uint64_t)pb_session_result(result, "event");
    s->description.mode = out->mode;
    s->description.epoch = out->epoch;
  }
  free(result);
  return status;
}
