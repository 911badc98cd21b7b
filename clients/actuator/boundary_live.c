// plantbus-actuator boundary --live: the served plant's boundary switched, and identified each
// time.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "boundary.h"
#include "interrupt.h"
#include "plant/boundary.h"
#include "session_change.h"

static const double patience = 60;  // seconds for a model to be compiled and swapped in

static pb_session_options session_of(const boundary_options *o) {
  return pb_common_session(&o->subject.live.common);
}

static pb_status configure(const boundary_options *o, const cJSON *body, pb_error *err) {
  const pb_session_options options = session_of(o);
  const pb_change_options wait = {patience, patience, pb_interrupted};
  pb_session *session = NULL;
  pb_change change = {0};
  pb_status st = pb_session_open(&options, &session, err);
  if (!st) st = pb_session_change(session, "configure", body, &wait, &change, err);
  pb_change_clear(&change);
  pb_session_close(session);
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
    st = configure(o, body, err);
  } else {
    cJSON_Delete(boundary);
    st = pb_fail_memory(err, "boundary");
  }
  cJSON_Delete(body);
  return st;
}

// What is served: the actuator's model, its revision.
static pb_status find_model(const boundary_options *o, pb_element_source *source,
                            uint32_t *revision, boundary_result *r, pb_error *err) {
  const pb_session_options options = session_of(o);
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
  const pb_session_options options = session_of(o);
  const pb_status back = pb_session_give_back(&options, revision, patience, &second);
  pb_element_source_clear(&source);
  if (st || !back) return st;
  return pb_fail(err, back, second.where, "the boundary that was found is not put back: %.300s",
                 second.message);
}
