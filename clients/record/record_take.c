// Taking messages from the bus, as they were serialised, and writing them.
#include <string.h>
#include <time.h>

#include "bus_cdr.h"
#include "dds/ddsi/ddsi_serdata.h"
#include "recorder_internal.h"

enum { BATCH = 256 };

int64_t record_clock(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

uint64_t record_wall_clock(const recorder *r) {
  return (uint64_t)(record_clock() + r->wall_offset);
}

// When a message was written, on the recorder's clock: by the clock of its writer, as long as that
// goes on as it began; one that is set, or that of another host, is brought to the recorder's.
static uint64_t log_time(recorder *r, int64_t source) {
  static const int64_t most = 1000000000;  // that a message may be under way, ns
  const int64_t now = (int64_t)record_wall_clock(r);
  const int64_t late = now - (source + r->source_offset);
  if (late > most || late < -most / 10) r->source_offset = now - source;
  const int64_t time = source > 0 ? source + r->source_offset : now;
  if (time > r->logged) r->logged = time;  // topics are taken one by one: it never goes back
  return (uint64_t)r->logged;
}

bool record_participant(dds_entity_t reader, dds_instance_handle_t writer, dds_guid_t *out) {
  dds_builtintopic_endpoint_t *e = dds_get_matched_publication_data(reader, writer);
  if (!e) return false;
  *out = e->participant_key;
  dds_builtintopic_free_endpoint(e);
  return true;
}

// Another daemon of the plant's name may be there. Commands are their clients'.
static bool foreign(const recorder *r, record_topic *t, dds_instance_handle_t writer) {
  dds_guid_t participant;
  if (t->bit == RECORD_COMMAND || t->writer == writer) return false;
  if (!record_participant(t->reader, writer, &participant)) return false;  // it has ended since
  if (memcmp(&participant, &r->daemon, sizeof participant) != 0) return true;
  t->writer = writer;
  return false;
}

static bool described(const recorder *r, uint32_t revision) {
  for (size_t i = r->part.revisions; i > 0; i--)
    if (r->part.revision[i - 1] == revision) return true;
  return false;
}

// Steps to plant time, as the daemon rounds it.
static int64_t step_ns(const recorder *r, uint64_t step) {
  return (int64_t)((double)step / r->report->sample_rate * 1e9 + 0.5);
}

// ---- one message --------------------------------------------------------------------------------

static bool limit_reached(const recorder *r) {
  const record_options *o = r->options;
  const pb_spans *s = &r->report->spans;
  // Half a step: the sums of steps are exact, a duration in seconds is rounded.
  return (o->steps > 0 && s->samples >= o->steps) ||
         (o->duration > 0.0 && pb_spans_seconds(s, r->report->sample_rate) >=
                                   o->duration - 0.5 / r->report->sample_rate);
}

// *plant_ns: its plant time; *keep: it is to be written.
static pb_status sample_look(recorder *r, pb_view data, int64_t *plant_ns, bool *keep,
                             pb_error *err) {
  plantbus_Sample x;
  *keep = false;
  if (r->done) return PB_OK;
  if (!pb_cdr_sample(data, &x))
    return pb_fail(err, PB_ERR_SYNTAX, r->report->plant, "a sample is not as this program expects");
  pb_status status = pb_spans_add(&r->report->spans, &x, keep, err);
  if (!status && *keep && record_part_full(r)) status = record_part_next(r, err);
  bool also;
  if (!status && *keep) status = pb_spans_add(&r->part.spans, &x, &also, err);
  if (status || !*keep) return status;
  *plant_ns = r->plant_ns = x.time_ns;
  r->last_arrival = record_clock();
  if (r->report->spans.samples == 1) r->first_arrival = r->last_arrival;
  if (!described(r, x.revision)) r->report->undescribed++;
  r->done = limit_reached(r);
  return PB_OK;
}

// Commands in real time may be for "the next step": those have the time of the last sample.
static pb_status message_look(recorder *r, const record_topic *t, pb_view data, int64_t *plant_ns,
                              bool *keep, pb_error *err) {
  pb_cdr_place place = {0};
  pb_cdr_event_view event;
  switch (t->bit) {
  case RECORD_SAMPLE:
    return sample_look(r, data, plant_ns, keep, err);
  case RECORD_EVENT:
    *keep = pb_cdr_event(data, &event);
    if (*keep) *plant_ns = step_ns(r, event.step);
    r->report->events += *keep;
    return PB_OK;
  case RECORD_STATUS:
    *keep = pb_cdr_status(data, &place);
    r->report->statuses += *keep;
    break;
  default:
    *keep = pb_cdr_command(data, &place);
    r->report->commands += *keep;
  }
  *plant_ns = place.step > 0 ? step_ns(r, place.step) : r->plant_ns;
  return PB_OK;
}

static pb_status message_write(recorder *r, record_topic *t, const pb_bytes *data,
                               const dds_sample_info_t *info, pb_error *err) {
  int64_t plant_ns = 0;
  bool keep;
  pb_status status = message_look(r, t, (pb_view){data->p, data->size}, &plant_ns, &keep, err);
  if (status || !keep) return status;
  const pb_mcap_stamp stamp = {.sequence = t->sequence++,
                               .log_time = log_time(r, info->source_timestamp),
                               .publish_time = plant_ns > 0 ? (uint64_t)plant_ns : 0};
  uint8_t *at = pb_mcap_writer_message(r->part.writer, t->channel, stamp, data->size, err);
  if (!at) return err->code;
  memcpy(at, data->p, data->size);
  return PB_OK;
}

// ---- batches ------------------------------------------------------------------------------------

static pb_status batch_write(recorder *r, record_topic *t, struct ddsi_serdata **serial,
                             const dds_sample_info_t *info, int count, pb_error *err) {
  pb_status status = PB_OK;
  pb_bytes data = {0};
  for (int i = 0; i < count && !status; i++) {
    if (!info[i].valid_data) continue;
    if (foreign(r, t, info[i].publication_handle)) {
      r->report->foreign++;
      continue;
    }
    const uint32_t size = ddsi_serdata_size(serial[i]);
    data.size = 0;
    uint8_t *at = pb_bytes_grow(&data, size);
    if (!at) status = pb_fail_memory(err, "message");
    if (at) ddsi_serdata_to_ser(serial[i], 0, size, at);
    if (!status) status = message_write(r, t, &data, &info[i], err);
  }
  pb_bytes_free(&data);
  return status;
}

pb_status record_take(recorder *r, record_topic *t, pb_error *err) {
  struct ddsi_serdata *serial[BATCH];
  dds_sample_info_t info[BATCH];
  pb_status status = PB_OK;
  while (!status) {
    const dds_return_t count = dds_takecdr(t->reader, serial, BATCH, info, DDS_ANY_STATE);
    if (count <= 0) break;
    status = batch_write(r, t, serial, info, count, err);
    for (dds_return_t i = 0; i < count; i++) ddsi_serdata_unref(serial[i]);
    if (count < BATCH) break;
  }
  return status;
}
