// The service thread: requests, events, status, what must happen when nothing arrives.
#include "daemon.h"

static const int64_t republish_ns = 20000000;        // without progress while an answer is missing
static const int64_t republish_idle_ns = 200000000;  // otherwise, for those that join
static const int64_t status_ns = 1000000000;

// Under lock. Guards that end, steps that became possible, samples that nobody answered: an answer
// or a sample may be lost, and without publishing again both sides would wait for ever.
static bool lockstep_tend(pb_daemon *d) {
  if (d->engine.drive == PB_DRIVE_REALTIME) return false;
  const int64_t now = pb_daemon_clock();
  pb_engine_guard(&d->engine, now);
  const bool more = pb_bus_run_ready(d);
  const int64_t pause = pb_engine_waiting(&d->engine) ? republish_ns : republish_idle_ns;
  if (now - d->sample_written >= pause) pb_bus_publish_sample(d);
  return more;
}

static dds_duration_t tend(pb_daemon *d) {
  pthread_mutex_lock(&d->lock);
  const bool more = lockstep_tend(d);
  const bool waiting = pb_engine_waiting(&d->engine), owed = pb_trace_owed(d);
  pthread_mutex_unlock(&d->lock);
  pb_bus_realtime_tend(d);
  pb_configure_tend(d);
  if (d->description_due) pb_bus_publish_description(d);  // before the event that tells of it
  pb_bus_publish_events(d);
  if (d->status_due || pb_daemon_clock() - d->status_written >= status_ns) pb_bus_publish_status(d);
  return more ? 0 : owed ? DDS_MSECS(1) : waiting ? DDS_MSECS(5) : DDS_MSECS(20);
}

void *pb_bus_service(void *context) {
  pb_daemon *d = context;
  const dds_entity_t waitset = dds_create_waitset(d->participant);
  const dds_entity_t condition = dds_create_readcondition(d->request, DDS_ANY_STATE);
  dds_waitset_attach(waitset, condition, 0);
  const dds_entity_t blocks = dds_create_readcondition(d->block_request, DDS_ANY_STATE);
  dds_waitset_attach(waitset, blocks, 0);
  dds_waitset_attach(waitset, d->wake, 0);
  dds_duration_t timeout = 0;
  while (!atomic_load(&d->stop)) {
    dds_waitset_wait(waitset, NULL, 0, timeout);
    bool woken;
    dds_take_guardcondition(d->wake, &woken);
    pb_bus_take_requests(d);
    pb_bus_take_blocks(d);
    timeout = tend(d);
  }
  pb_bus_realtime_stop(d);
  pb_bus_publish_events(d);
  dds_delete(condition);
  dds_delete(blocks);
  dds_delete(waitset);
  return NULL;
}
