// See recorder.h.
#include "recorder.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "bus_schema.h"
#include "interrupt.h"
#include "recorder_internal.h"
#include "recording.h"

// Three seconds at 10 kHz may pass while the disk is busy.
enum { SAMPLE_DEPTH = 32768, OTHER_DEPTH = 4096, DESCRIPTION_DEPTH = 16 };

static const int64_t wait_ns = 50000000;     // between looks around when nothing comes
static const int64_t gather_ns = 2000000;    // so that a wake-up is worth its while
static const int64_t quiet_ns = 20000000;    // without a message, after the last sample
static const int64_t rest_ns = 200000000;    // at most, after the last sample
static const int64_t flush_ns = 1000000000;  // a recorder that is killed loses no more than this

static int64_t clock_now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

static void topics_fill(recorder *r) {
  const record_topic all[RECORD_TOPICS] = {
      {.topic = PB_TOPIC_SAMPLE, .bit = RECORD_SAMPLE, .type = "Sample", .depth = SAMPLE_DEPTH},
      {.topic = PB_TOPIC_EVENT, .bit = RECORD_EVENT, .type = "Event", .depth = OTHER_DEPTH},
      {.topic = PB_TOPIC_STATUS, .bit = RECORD_STATUS, .type = "PlantStatus", .depth = OTHER_DEPTH},
      {.topic = PB_TOPIC_COMMAND, .bit = RECORD_COMMAND, .type = "Command", .depth = OTHER_DEPTH}};
  memcpy(r->topic, all, sizeof all);
}

// ---- begin --------------------------------------------------------------------------------------

// The reader of the description comes last: the daemon learns of the readers in their order, so
// that once a description is here, it knows of them all and sends to them.
static pb_status readers_create(recorder *r, pb_error *err) {
  dds_entity_t list[RECORD_TOPICS + 1];
  size_t count = 0;
  pb_status status = PB_OK;
  for (int i = 0; i < RECORD_TOPICS && !status; i++) {
    record_topic *t = &r->topic[i];
    if (!(r->options->topics & t->bit)) continue;
    status = pb_session_reader(r->session, t->topic, t->depth, &t->reader, err);
    list[count++] = t->reader;
  }
  if (!status)
    status = pb_session_reader(r->session, PB_TOPIC_DESCRIPTION, DESCRIPTION_DEPTH, &r->description,
                               err);
  list[count++] = r->description;
  return status ? status : pb_session_waitset(r->session, list, count, &r->waitset, err);
}

static pb_status channels_create(recorder *r, pb_error *err) {
  const pb_mcap_pair metadata[] = {{"plant", r->report->plant}};
  pb_status status = PB_OK;
  for (int i = 0; i < RECORD_TOPICS && !status; i++) {
    record_topic *t = &r->topic[i];
    char type[64];
    uint16_t schema;
    if (!t->reader) continue;
    snprintf(type, sizeof type, "plantbus::%s", t->type);
    status = pb_mcap_writer_schema(r->writer, type, "omgidl", pb_bus_schema, &schema, err);
    if (!status)
      status = pb_mcap_writer_channel(r->writer, schema, pb_topic_name(t->topic), "cdr", metadata,
                                      1, &t->channel, err);
  }
  return status;
}

static pb_status description_wait(recorder *r, pb_error *err) {
  const int64_t deadline = clock_now() + 5000000000;
  for (;;) {
    bool taken;
    const pb_status status = record_describe(r, &taken, err);
    if (status || taken) return status;
    if (clock_now() > deadline)
      return pb_fail(err, PB_ERR_STATE, r->report->plant, "the daemon sends no description");
    dds_waitset_wait(r->waitset, NULL, 0, wait_ns);
    const struct timespec pause = {0, gather_ns};
    nanosleep(&pause, NULL);
  }
}

static pb_status begin(recorder *r, pb_error *err) {
  const pb_session_options where = pb_common_session(&r->options->common);
  pb_status status = pb_session_open(&where, &r->session, err);
  if (status) return status;
  const char *plant = pb_session_description(r->session)->name;
  snprintf(r->report->plant, sizeof r->report->plant, "%s", plant);
  status = pb_mcap_writer_create(r->options->path, "", "plantbus " PB_VERSION, &r->writer, err);
  if (!status) status = readers_create(r, err);
  if (!status) status = channels_create(r, err);
  if (!status) status = description_wait(r, err);
  return status;
}

// ---- recording ----------------------------------------------------------------------------------

static bool daemon_gone(const recorder *r) {
  dds_subscription_matched_status_t matched;
  return dds_get_subscription_matched_status(r->description, &matched) == 0 &&
         matched.current_count == 0;
}

static pb_status everything_take(recorder *r, pb_error *err) {
  bool taken;
  pb_status status = record_describe(r, &taken, err);
  for (int i = 0; i < RECORD_TOPICS && !status; i++)
    if (r->topic[i].reader) status = record_take(r, &r->topic[i], err);
  const int64_t now = clock_now();
  if (!status && now - r->flushed > flush_ns) {
    status = pb_mcap_writer_flush(r->writer, err);
    r->flushed = now;
  }
  return status;
}

// What belongs to the last sample comes from other writers, and perhaps after it: taken until
// nothing has come for a moment.
static pb_status rest_take(recorder *r, pb_error *err) {
  const int64_t end = clock_now() + rest_ns;
  pb_status status = PB_OK;
  while (!status && clock_now() < end && dds_waitset_wait(r->waitset, NULL, 0, quiet_ns) > 0) {
    const struct timespec pause = {0, gather_ns};
    nanosleep(&pause, NULL);
    status = everything_take(r, err);
  }
  return status;
}

static void progress_show(recorder *r, pb_progress *line) {
  const pb_spans *s = &r->report->spans;
  const record_options *o = r->options;
  char note[96];
  snprintf(note, sizeof note, "%llu samples, %llu gaps, %.1f MB", (unsigned long long)s->samples,
           (unsigned long long)s->gaps, (double)pb_mcap_writer_bytes(r->writer) * 1e-6);
  if (o->steps > 0)
    pb_progress_update(line, (double)s->samples, (double)o->steps, note);
  else
    pb_progress_update(line, pb_spans_seconds(s, r->report->sample_rate), o->duration, note);
}

static pb_status record(recorder *r, pb_error *err) {
  pb_progress line;
  pb_progress_begin(&line, stderr, "recording");
  r->flushed = clock_now();
  r->report->end = RECORD_END_LIMIT;
  pb_status status = PB_OK;
  while (!status && !r->done) {
    const bool interrupted = pb_interrupted(), gone = daemon_gone(r);
    if (!interrupted && !gone && dds_waitset_wait(r->waitset, NULL, 0, wait_ns) > 0) {
      const struct timespec pause = {0, gather_ns};
      nanosleep(&pause, NULL);
    }
    status = everything_take(r, err);  // also what came before the end
    if (r->done && !status) status = rest_take(r, err);
    if (r->done || status) break;
    if (interrupted || gone) {
      r->report->end = interrupted ? RECORD_END_INTERRUPTED : RECORD_END_GONE;
      break;
    }
    progress_show(r, &line);
  }
  pb_progress_end(&line);
  return status;
}

// ---- end ----------------------------------------------------------------------------------------

static pb_status summary_write(recorder *r, pb_error *err) {
  static const char *const end[] = {"limit", "interrupted", "daemon gone"};
  const pb_spans *s = &r->report->spans;
  char samples[24], gaps[24], missing[24], repeats[24], epochs[24];
  snprintf(samples, sizeof samples, "%llu", (unsigned long long)s->samples);
  snprintf(gaps, sizeof gaps, "%llu", (unsigned long long)s->gaps);
  snprintf(missing, sizeof missing, "%llu", (unsigned long long)s->missing);
  snprintf(repeats, sizeof repeats, "%llu", (unsigned long long)s->repeats);
  snprintf(epochs, sizeof epochs, "%zu", s->count);
  const pb_mcap_pair pairs[] = {{"plant", r->report->plant},
                                {"samples", samples},
                                {"gaps", gaps},
                                {"missing", missing},
                                {"repeats", repeats},
                                {"epochs", epochs},
                                {"ended_by", end[r->report->end]}};
  return pb_mcap_writer_metadata(r->writer, PB_RECORDING_END, pairs, sizeof pairs / sizeof *pairs,
                                 err);
}

static pb_status end(recorder *r, pb_error *err) {
  pb_status status = summary_write(r, err);
  if (status) return status;
  status = pb_mcap_writer_close(r->writer, err);
  r->writer = NULL;
  FILE *file = status ? NULL : fopen(r->options->path, "rb");
  if (file && fseeko(file, 0, SEEK_END) == 0) r->report->bytes = (uint64_t)ftello(file);
  if (file) fclose(file);
  r->report->seconds = (double)(r->last_arrival - r->first_arrival) * 1e-9;
  return status;
}

pb_status record_run(const record_options *options,
                     void (*ready)(const record_options *options, const char *plant),
                     record_report *report, pb_error *err) {
  *report = (record_report){0};
  recorder *r = calloc(1, sizeof *r);
  if (!r) return pb_fail_memory(err, "recorder");
  r->options = options;
  r->report = report;
  topics_fill(r);
  pb_status status = begin(r, err);
  if (!status && ready) ready(options, report->plant);
  if (!status) status = record(r, err);
  if (!status) status = end(r, err);
  pb_mcap_writer_discard(r->writer);
  pb_session_close(r->session);
  free(r);
  return status;
}
