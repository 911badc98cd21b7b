// repair: a complete file of one that is cut or damaged, with all that can be read of it.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/json.h"
#include "bus_cdr.h"
#include "bus_qos.h"
#include "mcap_writer.h"
#include "replay.h"

typedef struct repairer {
  const char *path;
  char plant[65];
  pb_mcap_writer *writer;
  uint16_t schema[UINT16_MAX + 1], channel[UINT16_MAX + 1];  // by their old ids; 0: not met
  bool samples[UINT16_MAX + 1];                              // by the channel's old id
  pb_spans spans;
  bool has_end;   // the summary of the recording is there
  uint64_t lost;  // messages of channels that the damage took
} repairer;

// Owned copies of a map's texts, for the writer.
typedef struct pairs {
  size_t count;
  pb_mcap_pair pair[64];
} pairs;

static void pairs_free(pairs *p) {
  for (size_t i = 0; i < p->count; i++) {
    free((char *)p->pair[i].key);
    free((char *)p->pair[i].value);
  }
}

static pb_status pairs_copy(pb_view map, pairs *out, pb_error *err) {
  pb_cursor c = {map.p, map.size, false};
  pb_view key, value;
  out->count = 0;
  while (out->count < 64 && pb_mcap_pair_next(&c, &key, &value)) {
    pb_mcap_pair *p = &out->pair[out->count++];
    p->key = pb_view_copy(key);
    p->value = pb_view_copy(value);
    if (!p->key || !p->value) return pb_fail_memory(err, "metadata");
  }
  return PB_OK;
}

static pb_status on_schema(void *context, const pb_mcap_schema *s, pb_error *err) {
  repairer *r = context;
  if (r->schema[s->id]) return PB_OK;
  char *name = pb_view_copy(s->name), *encoding = pb_view_copy(s->encoding),
       *data = pb_view_copy(s->data);
  pb_status status = name && encoding && data ? PB_OK : pb_fail_memory(err, r->path);
  if (!status)
    status = pb_mcap_writer_schema(r->writer, name, encoding, data, &r->schema[s->id], err);
  free(name);
  free(encoding);
  free(data);
  return status;
}

static pb_status on_channel(void *context, const pb_mcap_channel_record *c, pb_error *err) {
  repairer *r = context;
  pairs map = {0};
  if (r->channel[c->id]) return PB_OK;
  char *topic = pb_view_copy(c->topic), *encoding = pb_view_copy(c->encoding);
  pb_status status =
      topic && encoding ? pairs_copy(c->metadata, &map, err) : pb_fail_memory(err, r->path);
  if (!status)
    status = pb_mcap_writer_channel(r->writer, r->schema[c->schema], topic, encoding, map.pair,
                                    map.count, &r->channel[c->id], err);
  r->samples[c->id] = pb_view_is(c->topic, pb_topic_name(PB_TOPIC_SAMPLE));
  pairs_free(&map);
  free(topic);
  free(encoding);
  return status;
}

static pb_status on_message(void *context, const pb_mcap_message *m, pb_error *err) {
  repairer *r = context;
  plantbus_Sample x;
  bool fresh;
  if (!r->channel[m->channel]) {
    r->lost++;
    return PB_OK;
  }
  if (r->samples[m->channel] && pb_cdr_sample(m->data, &x)) {
    const pb_status status = pb_spans_add(&r->spans, &x, &fresh, err);
    if (status) return status;
  }
  const pb_mcap_stamp stamp = {m->sequence, m->log_time, m->publish_time};
  uint8_t *at = pb_mcap_writer_message(r->writer, r->channel[m->channel], stamp, m->data.size, err);
  if (!at) return err->code;
  memcpy(at, m->data.p, m->data.size);
  return PB_OK;
}

static pb_status on_attachment(void *context, const pb_mcap_attachment *a, pb_error *err) {
  repairer *r = context;
  char *name = pb_view_copy(a->name), *type = pb_view_copy(a->media_type);
  const pb_status status = name && type ? pb_mcap_writer_attach(r->writer, name, type, a->log_time,
                                                                a->data.p, a->data.size, err)
                                        : pb_fail_memory(err, r->path);
  free(name);
  free(type);
  return status;
}

static pb_status on_metadata(void *context, const pb_mcap_metadata *m, pb_error *err) {
  repairer *r = context;
  pairs map = {0};
  char *name = pb_view_copy(m->name);
  pb_status status = name ? pairs_copy(m->pairs, &map, err) : pb_fail_memory(err, r->path);
  if (!status) status = pb_mcap_writer_metadata(r->writer, name, map.pair, map.count, err);
  for (size_t i = 0; i < map.count && !status; i++)
    if (!strcmp(map.pair[i].key, "plant"))
      snprintf(r->plant, sizeof r->plant, "%s", map.pair[i].value);
  r->has_end = r->has_end || pb_view_is(m->name, PB_RECORDING_END);
  pairs_free(&map);
  free(name);
  return status;
}

// What the file tells of itself before anything is written: whether there is something to mend.
static pb_status look(const char *path, pb_mcap_report *report, pb_error *err) {
  const pb_mcap_visitor visitor = {.salvage = true};
  return pb_mcap_read(path, &visitor, report, err);
}

static pb_status copy(repairer *r, const char *to, pb_mcap_report *report, pb_error *err) {
  const pb_mcap_visitor visitor = {.context = r,
                                   .salvage = true,
                                   .schema = on_schema,
                                   .channel = on_channel,
                                   .message = on_message,
                                   .attachment = on_attachment,
                                   .metadata = on_metadata};
  const pb_mcap_writer_options options = {.library = "plantbus " PB_VERSION, .exclusive = true};
  pb_status status = pb_mcap_writer_create(to, &options, &r->writer, err);
  if (status) return status;
  status = pb_mcap_read(r->path, &visitor, report, err);
  if (!status && !r->has_end)
    status = pb_recording_end_write(r->writer, &r->spans, r->plant, 1, "cut", err);
  if (!status) {
    status = pb_mcap_writer_close(r->writer, err);
    r->writer = NULL;
  }
  if (status) remove(to);
  pb_mcap_writer_discard(r->writer);
  return status;
}

pb_status command_repair(const replay_options *o, pb_error *err) {
  pb_mcap_report report;
  pb_status status = look(o->path, &report, err);
  if (status) return status;
  if (report.complete && report.damaged == 0) {
    printf("%s: is complete and sound: nothing to repair\n", o->path);
    return PB_OK;
  }
  repairer *r = calloc(1, sizeof *r);
  if (!r) return pb_fail_memory(err, o->path);
  r->path = o->path;
  status = copy(r, o->out, &report, err);
  if (!status)
    printf("%s: %llu messages, of these %llu from a chunk that is cut (no CRC covers them)\n",
           o->out, (unsigned long long)(report.messages - r->lost),
           (unsigned long long)report.salvaged);
  if (!status && report.damaged > 0)
    printf("%llu damaged records are left out\n", (unsigned long long)report.damaged);
  if (!status && r->lost > 0)
    printf("%llu messages are left out: the damage took their channel\n",
           (unsigned long long)r->lost);
  pb_spans_free(&r->spans);
  free(r);
  return status;
}
