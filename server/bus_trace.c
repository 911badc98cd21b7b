// The trace: every published sample once more, kept for its readers (recorders) until they have it.
//
// The topic sample keeps the newest only, as a controller wants it. The writer of the trace keeps
// all that a reader has not acknowledged, up to the middleware's high-water mark. Where that is
// reached, lockstep waits with the next step: at most `patience`, which is longer than the time
// after which a dead reader is given up, so that it costs the others nothing. Real time does not
// wait.
#include <inttypes.h>

#include "daemon.h"

static const int64_t patience_ns = 4000000000;

static void on_matched(dds_entity_t writer, dds_publication_matched_status_t status,
                       void *context) {
  (void)writer;
  pb_trace *t = context;
  atomic_store(&t->followers, status.current_count);
}

pb_status pb_trace_create(pb_daemon *d, pb_error *err) {
  pb_trace *t = &d->trace;
  dds_publication_matched_status_t matched = {0};
  t->writer = pb_writer_create(d->publisher, d->topic[PB_TOPIC_TRACE], PB_TOPIC_TRACE, 0.0);
  dds_listener_t *listener = dds_create_listener(t);
  if (listener) dds_lset_publication_matched(listener, on_matched);
  const dds_return_t set = listener && t->writer > 0 ? dds_set_listener(t->writer, listener) : -1;
  dds_delete_listener(listener);
  if (set < 0) return pb_fail(err, PB_ERR_IO, pb_topic_name(PB_TOPIC_TRACE), "cannot be created");
  // Who matched before the listener was there.
  if (dds_get_publication_matched_status(t->writer, &matched) == 0)
    atomic_store(&t->followers, matched.current_count);
  return PB_OK;
}

static void cut(pb_daemon *d, const char *why) {
  pb_trace *t = &d->trace;
  t->owed = false;
  t->cut = true;
  t->lost = 1;
  pb_engine_note(&d->engine, PB_EVENT_UNRECORDED,
                 "step %" PRIu64 " and what follows are kept for no recorder: %s", t->sample.step,
                 why);
}

static void lose(pb_daemon *d) {
  if (d->trace.cut)
    d->trace.lost++;
  else
    cut(d, "real time does not wait, and one is too slow");
}

// False: there is no room.
static bool offer(pb_daemon *d) {
  pb_trace *t = &d->trace;
  if (dds_write(t->writer, &t->sample) == DDS_RETCODE_TIMEOUT) return false;
  t->owed = false;
  if (t->cut)
    pb_engine_note(&d->engine, PB_EVENT_UNRECORDED,
                   "recorders get samples again, from step %" PRIu64 " on: %" PRIu64
                   " were not kept for them",
                   t->sample.step, t->lost);
  t->cut = false;
  return true;
}

void pb_trace_put(pb_daemon *d, const plantbus_Sample *sample) {
  pb_trace *t = &d->trace;
  const bool repeated = sample->step == t->sample.step && sample->epoch == t->sample.epoch;
  if (!pb_trace_followed(d) || (repeated && t->owed)) return;
  if (pb_trace_owed(d)) cut(d, "another epoch began while one was awaited");
  t->sample = *sample;
  if (offer(d) || repeated) return;
  if (t->cut || d->engine.drive == PB_DRIVE_REALTIME) {
    lose(d);
    return;
  }
  t->owed = true;
  t->since = pb_daemon_clock();
}

bool pb_trace_followed(const pb_daemon *d) {
  return atomic_load_explicit(&d->trace.followers, memory_order_relaxed) > 0;
}

bool pb_trace_owed(pb_daemon *d) {
  pb_trace *t = &d->trace;
  if (!t->owed) return false;
  if (!pb_trace_followed(d)) t->owed = false;
  if (!t->owed || offer(d)) return false;
  if (d->engine.drive != PB_DRIVE_REALTIME && pb_daemon_clock() - t->since < patience_ns)
    return true;
  cut(d, "one has taken nothing for seconds");
  return false;
}
