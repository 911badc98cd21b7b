// plantbus-actuator boundary --live: the served plant's boundary switched, and identified each
// time.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "boundary.h"
#include "interrupt.h"
#include "plant/boundary.h"
#include "session.h"

static const double patience = 60;  // seconds for a model to be compiled and swapped in

// Sends a request that makes a revision and waits until it acts.
static pb_status reconfigure(const boundary_options *o, const char *kind, const cJSON *body,
                             pb_error *err) {
  const pb_session_options options = {.domain = o->subject.live.common.domain,
                                      .plant = o->subject.live.common.plant};
  pb_session *session = NULL;
  pb_session_event event;
  pb_answer answer = {0};
  cJSON *result = NULL;
  char *text = NULL;
  pb_status st = pb_json_print_compact(body, &text, err);
  if (!st) st = pb_session_open(&options, &session, err);
  if (!st) st = pb_session_ask(session, kind, text, patience, &answer, err);
  if (!st) st = pb_json_parse(answer.result, strlen(answer.result), &result, err);
  if (!st && !cJSON_IsTrue(pb_json_member(result, "swapped"))) {
    st = pb_session_wait_event(session, "reconfigured configure_failed shutdown", answer.event,
                               patience, NULL, &event, err);
    if (!st && strcmp(event.kind, "reconfigured"))
      st = pb_fail(err, PB_ERR_STATE, event.kind, "%s", event.message);
  }
  cJSON_Delete(result);
  pb_answer_clear(&answer);
  pb_session_close(session);
  free(text);
  return st;
}

static pb_status switch_to(const boundary_options *o, const char *model, const pb_boundary *b,
                           pb_error *err) {
  cJSON *body = cJSON_CreateObject();
  cJSON *patch = body ? cJSON_AddObjectToObject(body, "patch") : NULL;
  cJSON *models = patch ? cJSON_AddObjectToObject(patch, "models") : NULL;
  cJSON *boundary = boundary_patch(b);
  pb_status st = PB_OK;
  if (models && boundary && cJSON_AddItemToObject(models, model, boundary)) {
    st = reconfigure(o, "configure", body, err);
  } else {
    cJSON_Delete(boundary);
    st = pb_fail_memory(err, "boundary");
  }
  cJSON_Delete(body);
  return st;
}

static pb_status put_back(const boundary_options *o, uint32_t revision, pb_error *err) {
  cJSON *body = cJSON_CreateObject();
  pb_status st = body && cJSON_AddNumberToObject(body, "revision", (double)revision)
                     ? reconfigure(o, "revert", body, err)
                     : pb_fail_memory(err, "revert");
  cJSON_Delete(body);
  return st;
}

// What is served: the actuator's model, its revision.
static pb_status find_model(const boundary_options *o, pb_element_source *source,
                            uint32_t *revision, boundary_result *r, pb_error *err) {
  const pb_session_options options = {.domain = o->subject.live.common.domain,
                                      .plant = o->subject.live.common.plant};
  pb_session *session = NULL;
  pb_status st = pb_session_open(&options, &session, err);
  if (st) return st;
  const pb_description *d = pb_session_description(session);
  *revision = d->revision;
  snprintf(r->subject, sizeof r->subject, "%.100s, measured", d->name);
  st = pb_element_source_plant(d->plant_text, d->name, NULL, o->subject.source.model,
                               pb_element_is_actuator, source, err);
  pb_session_close(session);
  return st;
}

static pb_status measure(const boundary_options *o, const char *model, const pb_boundary *b,
                         boundary_result *r, pb_error *err) {
  live_result live;
  pb_apa_landmarks l;
  pb_status st = switch_to(o, model, b, err);
  if (!st) st = live_identify(&o->subject.live, false, &live, err);
  if (st) return st;
  st = pb_apa_landmarks_of_data(&live.data, &l, err);
  const boundary_row row = {.boundary = *b,
                            .stiffness = NAN,
                            .hz = l.pole_hz,
                            .damping = l.pole_damping,
                            .zero_hz = l.zero_hz};
  if (!st) st = boundary_add(r, &row, err);
  live_result_clear(&live);
  return st;
}

pb_status boundary_live(const boundary_options *o, boundary_result *r, pb_error *err) {
  pb_element_source source;
  uint32_t revision = 0;
  pb_status st = find_model(o, &source, &revision, r, err);
  if (st) return st;
  pb_boundary b = boundary_start(o, source.model);
  for (size_t i = 0; i < 2 + o->resistances && !st; i++) {
    b.kind = i == 0 ? PB_BOUNDARY_SHORT : i == 1 ? PB_BOUNDARY_OPEN : PB_BOUNDARY_RESISTOR;
    if (i > 1) b.resistance = o->resistance[i - 2];
    st = measure(o, source.name, &b, r, err);
    if (!st && pb_interrupted()) st = pb_fail(err, PB_ERR_STATE, "boundary", "interrupted");
  }
  pb_error second = {0};
  const pb_status back = put_back(o, revision, &second);
  pb_element_source_clear(&source);
  if (st || !back) return st;
  return pb_fail(err, back, second.where, "the boundary that was found is not put back: %.300s",
                 second.message);
}
