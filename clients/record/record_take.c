// Taking messages from the bus, as they were serialised, and writing them.
#include <string.h>
#include <time.h>

#include "bus_cdr.h"
#include "dds/ddsi/ddsi_serdata.h"
#include "recorder_internal.h"

enum { BATCH = 256 };

uint64_t record_wall_clock(void) {
  struct timespec t;
  clock_gettime(CLOCK_REALTIME, &t);
  return (uint64_t)t.tv_sec * 1000000000u + (uint64_t)t.tv_nsec;
}

static int64_t clock_now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

static bool described(const recorder *r, uint32_t revision) {
  for (size_t i = r->revisions; i > 0; i--)
    if (r->revision[i - 1] == revision) return true;
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
  if (status || !*keep) return status;
  *plant_ns = r->plant_ns = x.time_ns;
  r->last_arrival = clock_now();
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
                               .log_time = info->source_timestamp > 0
                                               ? (uint64_t)info->source_timestamp
                                               : record_wall_clock(),
                               .publish_time = plant_ns > 0 ? (uint64_t)plant_ns : 0};
  uint8_t *at = pb_mcap_writer_message(r->writer, t->channel, stamp, data->size, err);
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
