// See recording.h.
#include "recording.h"

#include <stdlib.h>
#include <string.h>

#include "bus_cdr.h"
#include "bus_qos.h"
#include "recording_internal.h"

enum { TOPICS = 4, UNKNOWN = -1 };
static const pb_topic topics[TOPICS] = {PB_TOPIC_SAMPLE, PB_TOPIC_EVENT, PB_TOPIC_STATUS,
                                        PB_TOPIC_COMMAND};

typedef struct opening {
  pb_recording *recording;
  int8_t topic[UINT16_MAX + 1];  // of each channel: a pb_topic, or UNKNOWN
  bool known[UINT16_MAX + 1];
  pb_recorded_sample call;  // the second reading: samples only
  void *call_context;
  pb_spans spans;
  bool told;  // by the summary: the epochs
} opening;

static pb_status not_ours(const pb_recording *r, const char *what, pb_error *err) {
  return pb_fail(err, PB_ERR_SYNTAX, r->path, "is not a recording of a plant: %s", what);
}

static pb_status on_channel(void *context, const pb_mcap_channel_record *c, pb_error *err) {
  opening *o = context;
  o->known[c->id] = true;
  o->topic[c->id] = UNKNOWN;
  for (int i = 0; i < TOPICS; i++) {
    if (!pb_view_is(c->topic, pb_topic_name(topics[i]))) continue;
    if (!pb_view_is(c->encoding, "cdr"))
      return not_ours(o->recording, "its messages are not encoded as CDR", err);
    o->topic[c->id] = (int8_t)topics[i];
  }
  return PB_OK;
}

// ---- messages -----------------------------------------------------------------------------------

static pb_status sample_add(opening *o, const pb_mcap_message *m, pb_error *err) {
  pb_recording *r = o->recording;
  plantbus_Sample x;
  bool fresh;
  if (!pb_cdr_sample(m->data, &x)) return not_ours(r, "a sample is not well-formed", err);
  pb_status status = pb_spans_add(o->call ? &o->spans : &r->spans, &x, &fresh, err);
  if (status || !fresh) return status;
  if (o->call) return o->call(o->call_context, &x, err);
  if (r->spans.samples == 1) r->log_first = m->log_time;
  r->log_last = m->log_time;
  return PB_OK;
}

static pb_status event_add(pb_recording *r, const pb_mcap_message *m, pb_error *err) {
  pb_cdr_event_view view;
  if (!pb_cdr_event(m->data, &view)) return not_ours(r, "an event is not well-formed", err);
  if ((r->events & (r->events - 1)) == 0) {  // at each power of two
    pb_recorded_event *grown = realloc(r->event, 2 * (r->events + 1) * sizeof *grown);
    if (!grown) return pb_fail_memory(err, "events");
    r->event = grown;
  }
  pb_recorded_event *e = &r->event[r->events++];
  *e = (pb_recorded_event){view.step, view.epoch, pb_view_copy(view.kind),
                           pb_view_copy(view.client_name), pb_view_copy(view.message)};
  return e->kind && e->client_name && e->message ? PB_OK : pb_fail_memory(err, "events");
}

static pb_status on_message(void *context, const pb_mcap_message *m, pb_error *err) {
  opening *o = context;
  if (!o->known[m->channel]) return not_ours(o->recording, "a message without a channel", err);
  const int topic = o->topic[m->channel];
  if (topic == PB_TOPIC_SAMPLE) return sample_add(o, m, err);
  if (o->call) return PB_OK;
  if (topic == PB_TOPIC_EVENT) return event_add(o->recording, m, err);
  if (topic == PB_TOPIC_STATUS) o->recording->statuses++;
  if (topic == PB_TOPIC_COMMAND) o->recording->commands++;
  return PB_OK;
}

// ---- metadata and attachments: the metadata of a revision come first ----------------------------

static pb_status on_metadata(void *context, const pb_mcap_metadata *m, pb_error *err) {
  pb_recording *r = ((opening *)context)->recording;
  if (!pb_view_is(m->name, PB_RECORDING_REVISION)) return PB_OK;
  pb_recorded_revision *grown = realloc(r->revision, (r->revisions + 1) * sizeof *grown);
  if (!grown) return pb_fail_memory(err, "revisions");
  r->revision = grown;
  char *plant = NULL;
  pb_recorded_revision *new = &r->revision[r->revisions++];
  *new = (pb_recorded_revision){0};
  pb_status status = pb_recorded_revision_read(m->pairs, new, &plant, err);
  if (!status && r->plant && strcmp(r->plant, plant) != 0)
    status = not_ours(r, "there are two plants in it", err);
  if (!status && !r->plant) {
    r->plant = plant;
    plant = NULL;
  }
  free(plant);
  return status;
}

static pb_status packed_take(pb_recorded_revision *v, pb_view data, pb_error *err) {
  if (data.size % sizeof(double) != 0 || v->packed)
    return pb_fail(err, PB_ERR_SYNTAX, v->model, "is not a compiled model");
  v->packed = malloc(data.size + 1);
  if (!v->packed) return pb_fail_memory(err, v->model);
  memcpy(v->packed, data.p, data.size);
  v->packed_count = data.size / sizeof(double);
  return PB_OK;
}

static pb_status on_attachment(void *context, const pb_mcap_attachment *a, pb_error *err) {
  pb_recording *r = ((opening *)context)->recording;
  for (size_t i = 0; i < r->revisions; i++) {
    pb_recorded_revision *v = &r->revision[i];
    if (pb_view_is(a->name, v->model)) return packed_take(v, a->data, err);
    if (!pb_view_is(a->name, v->attachment) || v->plant_text) continue;
    v->plant_text = pb_view_copy(a->data);
    if (!v->plant_text) return pb_fail_memory(err, v->attachment);
  }
  return PB_OK;
}

// ---- the whole ----------------------------------------------------------------------------------

static pb_status opening_new(const char *path, opening **out, pb_error *err) {
  opening *o = *out = calloc(1, sizeof *o);
  pb_recording *r = calloc(1, sizeof *r);
  if (r) r->path = strdup(path);
  if (o) o->recording = r;
  if (o && r && r->path) return PB_OK;
  if (r) free(r->path);
  free(r);
  free(o);
  *out = NULL;
  return pb_fail_memory(err, path);
}

static pb_status opening_end(opening *o, pb_status status, pb_recording **out, pb_error *err) {
  pb_recording *r = o->recording;
  if (!status && r->revisions == 0) status = not_ours(r, "it describes none", err);
  free(o);
  if (status)
    pb_recording_free(r);
  else
    *out = r;
  return status;
}

pb_status pb_recording_open(const char *path, pb_recording **out, pb_error *err) {
  opening *o;
  *out = NULL;
  pb_status status = opening_new(path, &o, err);
  if (status) return status;
  const pb_mcap_visitor visitor = {.context = o,
                                   .channel = on_channel,
                                   .message = on_message,
                                   .attachment = on_attachment,
                                   .metadata = on_metadata};
  status = pb_mcap_read(path, &visitor, &o->recording->file, err);
  return opening_end(o, status, out, err);
}

// ---- by the summary -----------------------------------------------------------------------------

static pb_status on_indexed_metadata(void *context, const pb_mcap_metadata *m, pb_error *err) {
  opening *o = context;
  if (!pb_view_is(m->name, PB_RECORDING_END)) return on_metadata(context, m, err);
  return pb_recording_end_read(m->pairs, &o->recording->spans, &o->told, err);
}

static pb_status on_indexed_event(void *context, const pb_mcap_message *m, pb_error *err) {
  return event_add(((opening *)context)->recording, m, err);
}

static void counts_take(pb_recording *r, const pb_mcap_summary *s) {
  for (size_t i = 0; i < s->channels; i++) {
    if (!strcmp(s->channel[i].topic, pb_topic_name(PB_TOPIC_STATUS)))
      r->statuses += s->channel[i].messages;
    if (!strcmp(s->channel[i].topic, pb_topic_name(PB_TOPIC_COMMAND)))
      r->commands += s->channel[i].messages;
  }
  r->file = (pb_mcap_report){.complete = true, .bytes = s->bytes, .read_to = s->bytes};
  r->log_first = s->first;
  r->log_last = s->last;
}

pb_status pb_recording_open_index(const char *path, pb_recording **out, pb_error *err) {
  opening *o;
  pb_mcap_summary summary;
  bool found = false;
  *out = NULL;
  pb_status status = opening_new(path, &o, err);
  if (status) return status;
  const pb_mcap_visitor visitor = {.context = o,
                                   .message = on_indexed_event,
                                   .attachment = on_attachment,
                                   .metadata = on_indexed_metadata};
  status = pb_mcap_read_index(path, &visitor, pb_topic_name(PB_TOPIC_EVENT), &summary, &found, err);
  if (!status && found && o->told) {
    counts_take(o->recording, &summary);
    return opening_end(o, status, out, err);
  }
  // Whatever is the matter is found where all is read.
  pb_recording_free(o->recording);
  free(o);
  return pb_recording_open(path, out, err);
}

pb_status pb_recording_samples(const pb_recording *recording, pb_recorded_sample call,
                               void *context, pb_error *err) {
  opening *o = calloc(1, sizeof *o);
  if (!o) return pb_fail_memory(err, recording->path);
  pb_mcap_report report;
  o->recording = (pb_recording *)recording;  // only its path is used
  o->call = call;
  o->call_context = context;
  const pb_mcap_visitor visitor = {.context = o, .channel = on_channel, .message = on_message};
  const pb_status status = pb_mcap_read(recording->path, &visitor, &report, err);
  pb_spans_free(&o->spans);
  free(o);
  return status;
}

double pb_recording_rate(const pb_recording *r) {
  return r->revisions > 0 ? r->revision[r->revisions - 1].sample_rate : 0.0;
}

const pb_recorded_revision *pb_recording_revision(const pb_recording *r, uint32_t number) {
  for (size_t i = 0; i < r->revisions; i++)
    if (r->revision[i].revision == number) return &r->revision[i];
  return NULL;
}

void pb_recording_free(pb_recording *r) {
  if (!r) return;
  for (size_t i = 0; i < r->revisions; i++) pb_recorded_revision_free(&r->revision[i]);
  for (size_t i = 0; i < r->events; i++) {
    free(r->event[i].kind);
    free(r->event[i].client_name);
    free(r->event[i].message);
  }
  pb_spans_free(&r->spans);
  free(r->revision);
  free(r->event);
  free(r->path);
  free(r->plant);
  free(r);
}
