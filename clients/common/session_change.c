// Changing the plant of a running daemon: see session_change.h.
#include "session_change.h"

#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "base/json.h"

static pb_status wait_swap(pb_session *session, uint64_t first, const pb_change_options *o,
                           pb_session_event *event, pb_error *err) {
  pb_status status = pb_session_wait_event(session, "reconfigured configure_failed shutdown", first,
                                           o->wait, o->interrupted, event, err);
  if (!status && strcmp(event->kind, "reconfigured"))
    status = pb_fail(err, PB_ERR_STATE, event->kind, "%s", event->message);
  return status;
}

pb_status pb_session_change(pb_session *session, const char *kind, const cJSON *body,
                            const pb_change_options *o, pb_change *out, pb_error *err) {
  char *text = NULL;
  pb_answer answer = {0};
  *out = (pb_change){0};
  pb_status status = pb_json_print_compact(body, &text, err);
  if (!status) status = pb_session_ask(session, kind, text, o->timeout, &answer, err);
  if (!status) status = pb_json_parse(answer.result, strlen(answer.result), &out->result, err);
  if (!status && !cJSON_IsObject(out->result))
    status = pb_fail(err, PB_ERR_SYNTAX, kind, "the daemon's answer is not an object");
  if (!status && !cJSON_IsTrue(pb_json_member(out->result, "swapped")))
    status = wait_swap(session, answer.event, o, &out->event, err);
  pb_answer_clear(&answer);
  free(text);
  return status;
}

void pb_change_clear(pb_change *change) {
  cJSON_Delete(change->result);
  *change = (pb_change){0};
}

static pb_status revert(pb_session *session, uint32_t revision, double wait, pb_error *err) {
  const pb_change_options options = {wait, wait, NULL};
  pb_change change = {0};
  cJSON *body = cJSON_CreateObject();
  pb_status status = body && cJSON_AddNumberToObject(body, "revision", (double)revision)
                         ? pb_session_change(session, "revert", body, &options, &change, err)
                         : pb_fail_memory(err, "revert");
  pb_change_clear(&change);
  cJSON_Delete(body);
  return status;
}

// Until nothing is on its way: what is being compiled ends, cancelled, only with its compilation.
static void cancel(pb_session *session, double wait) {
  const struct timespec pause = {.tv_nsec = 20000000};
  pb_error none;
  for (double waited = 0; waited < wait; waited += 1e-9 * (double)pause.tv_nsec) {
    if (pb_session_request(session, "cancel_configure", NULL, 0, NULL, &none)) return;
    nanosleep(&pause, NULL);
  }
}

pb_status pb_session_give_back(const pb_session_options *options, uint32_t revision, double wait,
                               pb_error *err) {
  pb_session *session = NULL;
  pb_status status = pb_session_open(options, &session, err);
  if (status) return status;
  cancel(session, wait);
  pb_session_close(session);
  // Anew: what it was before the answer may be out of date.
  status = pb_session_open(options, &session, err);
  if (status) return status;
  if (pb_session_description(session)->revision != revision)
    status = revert(session, revision, wait, err);
  pb_session_close(session);
  return status;
}
