// See recorder.h.
#include "recorder.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "base/json.h"
#include "interrupt.h"
#include "recorder_internal.h"

enum { SAMPLE_DEPTH = 32768, DEPTH = 4096, DESCRIPTION_DEPTH = 16 };

static const int64_t wait_ns = 50000000;        // between looks around when nothing comes
static const int64_t gather_ns = 2000000;       // so that a wake-up is worth its while
static const int64_t quiet_ns = 20000000;       // without a message, after the last sample
static const int64_t rest_ns = 200000000;       // at most, after the last sample
static const int64_t backlog_ns = 5000000000;   // at most, when interrupted
static const int64_t patience_ns = 2000000000;  // for a description of a daemon that is back

static void topics_fill(recorder *r) {
  const record_topic all[RECORD_TOPICS] = {
      {PB_TOPIC_TRACE, PB_TOPIC_SAMPLE, RECORD_SAMPLE, "Sample", .depth = 0},
      {PB_TOPIC_EVENT, PB_TOPIC_EVENT, RECORD_EVENT, "Event", .depth = DEPTH},
      {PB_TOPIC_STATUS, PB_TOPIC_STATUS, RECORD_STATUS, "PlantStatus", .depth = DEPTH},
      {PB_TOPIC_COMMAND, PB_TOPIC_COMMAND, RECORD_COMMAND, "Command", .depth = DEPTH}};
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

static pb_status description_wait(recorder *r, pb_error *err) {
  const int64_t deadline = record_clock() + 5000000000;
  for (;;) {
    bool taken;
    const pb_status status = record_describe(r, &taken, err);
    if (status || taken) return status;
    if (record_clock() > deadline)
      return pb_fail(err, PB_ERR_STATE, r->report->plant, "the daemon sends no description");
    dds_waitset_wait(r->waitset, NULL, 0, wait_ns);
    const struct timespec pause = {0, gather_ns};
    nanosleep(&pause, NULL);
  }
}

static uint32_t matched(dds_entity_t reader) {
  dds_subscription_matched_status_t status = {0};
  return dds_get_subscription_matched_status(reader, &status) == 0 ? status.current_count : 0;
}

// A daemon from before the trace: its samples are taken as they come.
static pb_status samples_find(recorder *r, pb_error *err) {
  record_topic *t = &r->topic[0];
  const int64_t deadline = record_clock() + 1000000000;
  if (!t->reader) return PB_OK;
  while (matched(t->reader) == 0) {
    const struct timespec pause = {0, gather_ns};
    nanosleep(&pause, NULL);
    if (record_clock() < deadline) continue;
    dds_delete(t->reader);
    t->topic = PB_TOPIC_SAMPLE;
    r->report->untraced = true;
    pb_status status = pb_session_reader(r->session, t->topic, SAMPLE_DEPTH, &t->reader, err);
    return status ? status : pb_session_waitset(r->session, &t->reader, 1, &r->waitset, err);
  }
  return PB_OK;
}

// The file is made last: a start that fails leaves none.
static pb_status begin(recorder *r, pb_error *err) {
  const pb_session_options where = pb_common_session(&r->options->common);
  pb_status status = pb_session_open(&where, &r->session, err);
  if (status) return status;
  const char *plant = pb_session_description(r->session)->name;
  snprintf(r->report->plant, sizeof r->report->plant, "%s", plant);
  status = readers_create(r, err);
  if (!status) status = description_wait(r, err);
  if (!status) status = samples_find(r, err);
  if (status) return status;
  status = record_part_begin(r, err);
  if (!status) status = record_describe_again(r, err);
  // Also when the disk is full at once.
  if (status && r->part.writer) unlink(r->part.path);
  return status;
}

// ---- recording ----------------------------------------------------------------------------------

static void away(recorder *r, const char *what) {
  const pb_span *s =
      r->report->spans.count > 0 ? &r->report->spans.span[r->report->spans.count - 1] : NULL;
  fprintf(stderr, "%s: the daemon %s (step %llu)\n", program_invocation_short_name, what,
          (unsigned long long)(s ? s->last_step : 0));
}

// The daemon that is followed is not there. It is waited for, and what another one sends meanwhile
// is kept by the readers until its description is here.
static bool daemon_gone(recorder *r) {
  const bool there = matched(r->description) > 0;
  if (!there && r->away_since == 0) {
    r->away_since = record_clock();
    r->report->outages++;
    if (!r->options->until_gone) away(r, "has gone: waiting for it; Ctrl-C ends the recording");
  }
  if (!there) r->back_since = 0;
  return !there;
}

static void daemon_back(recorder *r) {
  r->report->outage_seconds += (double)(record_clock() - r->away_since) * 1e-9;
  r->away_since = r->back_since = 0;
  for (int i = 0; i < RECORD_TOPICS; i++) r->topic[i].writer = 0;
  away(r, "is back: recording goes on");
}

// *held: the daemon is away, or has not described its plant yet.
static pb_status description_take(recorder *r, bool *held, pb_error *err) {
  bool taken;
  const pb_status status = record_describe(r, &taken, err);
  *held = false;
  if (status || r->away_since == 0) return status;
  if (!taken && r->back_since == 0 && matched(r->description) > 0) r->back_since = record_clock();
  // One that was only out of reach has described it before.
  const bool known = r->back_since > 0 && record_clock() - r->back_since > patience_ns;
  if (taken || known)
    daemon_back(r);
  else
    *held = true;
  return PB_OK;
}

static pb_status everything_take(recorder *r, bool last, pb_error *err) {
  bool held;
  pb_status status = description_take(r, &held, err);
  for (int i = 0; i < RECORD_TOPICS && !status && (!held || last); i++)
    if (r->topic[i].reader) status = record_take(r, &r->topic[i], err);
  return status ? status : record_part_tend(r, err);
}

// What belongs to the last sample comes from other writers, and perhaps after it: taken until
// nothing has come for a moment.
static pb_status rest_take(recorder *r, pb_error *err) {
  const int64_t end = record_clock() + rest_ns;
  pb_status status = PB_OK;
  while (!status && record_clock() < end && dds_waitset_wait(r->waitset, NULL, 0, quiet_ns) > 0) {
    const struct timespec pause = {0, gather_ns};
    nanosleep(&pause, NULL);
    status = everything_take(r, true, err);
  }
  return status;
}

// The step the plant has come to; false: the daemon does not say.
static bool plant_step(recorder *r, uint64_t *epoch, uint64_t *step) {
  char *result = NULL;
  cJSON *json = NULL;
  pb_error ignored;
  if (r->report->outages > 0) return false;  // another daemon than that of the session, perhaps
  if (pb_session_request(r->session, "ping", NULL, 1.0, &result, &ignored)) return false;
  const bool good = !pb_json_parse(result, strlen(result), &json, &ignored);
  const cJSON *e = good ? pb_json_member(json, "epoch") : NULL;
  const cJSON *s = good ? pb_json_member(json, "step") : NULL;
  const bool told = cJSON_IsNumber(e) && cJSON_IsNumber(s);
  if (told) *epoch = (uint64_t)e->valuedouble, *step = (uint64_t)s->valuedouble;
  cJSON_Delete(json);
  free(result);
  return told;
}

static bool has_come_to(const recorder *r, uint64_t epoch, uint64_t step) {
  const pb_spans *s = &r->report->spans;
  const pb_span *last = s->count > 0 ? &s->span[s->count - 1] : NULL;
  const uint64_t distance = last && last->decimation > 0 ? last->decimation : 1;
  return last &&
         (last->epoch > epoch || (last->epoch == epoch && last->last_step + distance > step));
}

// Interrupted: samples may be under way. All up to where the plant is now belong to the recording.
static pb_status backlog_take(recorder *r, pb_error *err) {
  uint64_t epoch, step;
  const int64_t end = record_clock() + backlog_ns;
  pb_status status = PB_OK;
  if (!r->topic[0].reader || !plant_step(r, &epoch, &step)) return rest_take(r, err);
  while (!status && !r->done && !has_come_to(r, epoch, step) && record_clock() < end) {
    dds_waitset_wait(r->waitset, NULL, 0, quiet_ns);
    status = everything_take(r, true, err);
  }
  return status;
}

static void progress_show(recorder *r, pb_progress *line) {
  const pb_spans *s = &r->report->spans;
  const record_options *o = r->options;
  char note[96];
  snprintf(note, sizeof note, "%llu samples, %llu gaps, %.1f MB", (unsigned long long)s->samples,
           (unsigned long long)s->gaps,
           (double)(r->report->bytes + pb_mcap_writer_bytes(r->part.writer)) * 1e-6);
  if (o->steps > 0)
    pb_progress_update(line, (double)s->samples, (double)o->steps, note);
  else
    pb_progress_update(line, pb_spans_seconds(s, r->report->sample_rate), o->duration, note);
}

static pb_status record(recorder *r, pb_error *err) {
  pb_progress line;
  pb_progress_begin(&line, stderr, "recording");
  r->flushed = r->synced = record_clock();
  r->report->end = RECORD_END_LIMIT;
  pb_status status = PB_OK;
  while (!status && !r->done) {
    const bool interrupted = pb_interrupted(), gone = daemon_gone(r) && r->options->until_gone;
    if (!interrupted && !gone && dds_waitset_wait(r->waitset, NULL, 0, wait_ns) > 0) {
      const struct timespec pause = {0, gather_ns};
      nanosleep(&pause, NULL);
    }
    const bool before = r->away_since > 0 && r->back_since == 0 && matched(r->description) == 0;
    status =
        everything_take(r, interrupted || gone || before, err);  // also what came before the end
    if (r->done && !status) status = rest_take(r, err);
    if (r->done || status) break;
    if (interrupted && r->away_since == 0) status = backlog_take(r, err);
    if (interrupted || gone) {
      r->report->end = interrupted ? RECORD_END_INTERRUPTED : RECORD_END_GONE;
      break;
    }
    progress_show(r, &line);
  }
  if (r->away_since > 0)
    r->report->outage_seconds += (double)(record_clock() - r->away_since) * 1e-9;
  pb_progress_end(&line);
  return status;
}

// ---- end ----------------------------------------------------------------------------------------

static pb_status end(recorder *r, pb_error *err) {
  const pb_status status = record_part_end(r, err);
  r->report->seconds = (double)(r->last_arrival - r->first_arrival) * 1e-9;
  return status;
}

static void release(recorder *r) {
  pb_mcap_writer_discard(r->part.writer);
  pb_spans_free(&r->part.spans);
  if (r->described) plantbus_PlantDescription_free(r->described, DDS_FREE_ALL);
  pb_session_close(r->session);
  free(r);
}

static int64_t wall_offset(void) {
  struct timespec t;
  clock_gettime(CLOCK_REALTIME, &t);
  return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec - record_clock();
}

pb_status record_run(const record_options *options,
                     void (*ready)(const record_options *options, const char *plant),
                     record_report *report, pb_error *err) {
  *report = (record_report){0};
  recorder *r = calloc(1, sizeof *r);
  if (!r) return pb_fail_memory(err, "recorder");
  r->options = options;
  r->report = report;
  r->part.number = 1;
  r->wall_offset = wall_offset();
  topics_fill(r);
  pb_status status = begin(r, err);
  if (!status && ready) ready(options, report->plant);
  if (!status) status = record(r, err);
  if (!status) status = end(r, err);
  release(r);
  return status;
}
