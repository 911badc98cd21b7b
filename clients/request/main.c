// plantbus-request: sends one request of the bus and prints its result.
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/json.h"
#include "base/text.h"
#include "interrupt.h"
#include "jsontext.h"
#include "options.h"
#include "session.h"

enum { KEY_TIMEOUT = 0x100, KEY_WAIT };

typedef struct request_options {
  pb_common_options common;
  const char *kind, *body;  // body: JSON, "@FILE", "-"; NULL: {}
  double timeout;           // s; 0: the session's
  double wait;              // s for the ending event; 0: no wait
} request_options;

static const struct argp_option option_table[] = {
    {"timeout", KEY_TIMEOUT, "S", 0, "Wait this long for the daemon and for its reply (default 5)",
     1},
    {"wait", KEY_WAIT, "S", OPTION_ARG_OPTIONAL,
     "When the reply is \"accepted\", wait for the event that tells the end (default 60 s)", 1},
    {0}};

static const char description[] =
    "Sends a request to a daemon and prints the result of its reply as JSON.\v"
    "KIND and its body are those of docs/bus.md. The body is JSON, @FILE, or - for the standard "
    "input; without one it is {}. A refusal ends with the daemon's pointer and message.\n\n"
    "What this process attaches is gone when it ends: attach is of use only to see whether it "
    "would be "
    "granted.\n\n"
    "Exit codes: 0 done, 1 failed or refused, 2 wrong command line.\n\n"
    "Examples:\n"
    "  plantbus-request ping\n"
    "  plantbus-request step '{\"n\": 100000}' --wait\n"
    "  plantbus-request set_mode '{\"mode\": \"realtime\"}' --domain 3\n";

static error_t parse(int key, char *text, struct argp_state *state) {
  request_options *o = state->input;
  switch (key) {
  case ARGP_KEY_INIT:
    state->child_inputs[0] = &o->common;
    return 0;
  case KEY_TIMEOUT:
    o->timeout = pb_option_double(state, "--timeout", text, 1e-3, 86400);
    return 0;
  case KEY_WAIT:
    o->wait = text ? pb_option_double(state, "--wait", text, 1e-3, 86400) : 60.0;
    return 0;
  case ARGP_KEY_ARG:
    if (state->arg_num == 0)
      o->kind = text;
    else if (state->arg_num == 1)
      o->body = text;
    else
      argp_error(state, "unexpected argument '%s'", text);
    return 0;
  case ARGP_KEY_END:
    if (!o->kind) argp_error(state, "KIND is missing");
    return 0;
  default:
    return ARGP_ERR_UNKNOWN;
  }
}

static pb_status body_read(const request_options *o, char **body, pb_error *err) {
  cJSON *json = NULL;
  *body = NULL;
  pb_status status = o->body ? pb_json_argument(o->body, &json, err) : PB_OK;
  if (!status && json && !cJSON_IsObject(json))
    status = pb_fail(err, PB_ERR_SYNTAX, "body", "expected a JSON object");
  if (!status && json) status = pb_json_print_compact(json, body, err);
  cJSON_Delete(json);
  return status;
}

// ---- the ending event ---------------------------------------------------------------------------

// The events that end what a request began: the good ones, and those that cut it short.
static const struct ending {
  const char *kind, *good, *bad;
} endings[] = {{"step", "stepped", "reset restored shutdown"},
               {"configure", "reconfigured", "configure_failed shutdown"},
               {"revert", "reconfigured", "configure_failed shutdown"},
               {NULL, "stepped reconfigured", "configure_failed shutdown"}};

static const struct ending *ending_of(const char *kind) {
  const struct ending *e = endings;
  while (e->kind && strcmp(e->kind, kind) != 0) e++;
  return e;
}

static pb_status event_print(const pb_session_event *event, pb_error *err) {
  cJSON *json = cJSON_CreateObject();
  pb_status status = PB_OK;
  if (!json || !cJSON_AddStringToObject(json, "event", event->kind) ||
      !cJSON_AddNumberToObject(json, "number", (double)event->number) ||
      !cJSON_AddNumberToObject(json, "epoch", event->epoch) ||
      !cJSON_AddNumberToObject(json, "step", (double)event->step) ||
      !cJSON_AddStringToObject(json, "message", event->message))
    status = pb_fail_memory(err, "event");
  if (!status) status = pb_json_show(json, stdout, err);
  cJSON_Delete(json);
  return status;
}

static pb_status ending_wait(const request_options *o, pb_session *session, const pb_answer *answer,
                             pb_error *err) {
  const struct ending *e = ending_of(o->kind);
  char kinds[128];
  pb_session_event event;
  snprintf(kinds, sizeof kinds, "%s %s", e->good, e->bad);
  pb_status status =
      pb_session_wait_event(session, kinds, answer->event, o->wait, pb_interrupted, &event, err);
  if (!status) status = event_print(&event, err);
  if (!status && !strstr(e->good, event.kind))
    return pb_fail(err, PB_ERR_STATE, event.kind, "%s", event.message);
  return status;
}

static pb_status run(const request_options *o, pb_error *err) {
  pb_session_options options = pb_common_session(&o->common);
  options.timeout = o->timeout;
  pb_session *session = NULL;
  pb_answer answer = {0};
  char *body = NULL;
  pb_status status = body_read(o, &body, err);
  if (!status) status = pb_session_open(&options, &session, err);
  if (!status) status = pb_session_ask(session, o->kind, body, o->timeout, &answer, err);
  if (!status) status = pb_json_show_text(answer.result, stdout, err);
  if (!status && answer.accepted && o->wait > 0.0) status = ending_wait(o, session, &answer, err);
  pb_answer_clear(&answer);
  pb_session_close(session);
  free(body);
  return status;
}

int main(int argc, char **argv) {
  static const struct argp_child children[] = {{&pb_common_argp, 0, NULL, 0}, {0}};
  static const struct argp argp = {
      option_table, parse, "KIND [JSON|@FILE|-]", description, children, NULL, NULL};
  request_options options = {0};
  pb_error err = {0};
  pb_options_parse(&argp, argc, argv, &options);
  pb_interrupt_install();
  pb_status status = run(&options, &err);
  if (status) pb_print_error(stderr, &err);
  return status ? PB_EXIT_FAILED : PB_EXIT_DONE;
}
