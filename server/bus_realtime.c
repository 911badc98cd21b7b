// Real time: two threads carry commands to the step thread and its records to the bus, so that the
// step thread itself never enters the middleware.
#include <errno.h>
#include <string.h>
#include <time.h>

#include "daemon.h"

// Under lock: what acts now goes to the step thread; when its ring is full, with the next record.
static void inputs_send(pb_daemon *d, uint64_t for_step, bool counted) {
  pb_held_input input = {.for_step = for_step, .revision = d->live->number, .counted = counted};
  bool held;
  pb_engine_input(&d->engine, input.u, &held);
  d->input_owed = !pb_realtime_input(&d->realtime, &input);
}

static void *receive_run(void *context) {
  pb_daemon *d = context;
  const dds_entity_t waitset = dds_create_waitset(d->participant);
  const dds_entity_t condition = dds_create_readcondition(d->command, DDS_ANY_STATE);
  dds_waitset_attach(waitset, condition, 0);
  dds_waitset_attach(waitset, d->receive_stop, 0);
  for (;;) {
    bool stop = false;
    dds_waitset_wait(waitset, NULL, 0, DDS_MSECS(200));
    dds_read_guardcondition(d->receive_stop, &stop);
    if (stop) break;
    pthread_mutex_lock(&d->lock);
    uint64_t for_step = UINT64_MAX;
    const uint64_t late = d->engine.verdicts[PB_VERDICT_LATE];
    if (pb_bus_take_commands(d, &for_step))
      inputs_send(d, for_step, d->engine.verdicts[PB_VERDICT_LATE] != late);
    pthread_mutex_unlock(&d->lock);
  }
  dds_delete(condition);
  dds_delete(waitset);
  return NULL;
}

static void record_publish(pb_daemon *d, const pb_record *record) {
  double u[PB_STEPPER_INPUTS];
  bool held;
  pthread_mutex_lock(&d->lock);
  pb_engine_input(&d->engine, u, &held);
  d->current = *record;
  if (held) d->current.flags |= PB_FLAG_HELD;
  if (pb_engine_advance(&d->engine, record->step, pb_daemon_clock()) || d->input_owed)
    inputs_send(d, UINT64_MAX, false);
  pb_bus_note_faults(d, &d->current);
  if (record->step % d->engine.decimation == 0) pb_bus_publish_sample(d);
  pthread_mutex_unlock(&d->lock);
}

static void change_made(pb_daemon *d) {
  pthread_mutex_lock(&d->lock);
  pb_bus_change_made(d);
  pthread_mutex_unlock(&d->lock);
}

// Ends only after the step thread has, with the last record published.
static void *publish_run(void *context) {
  pb_daemon *d = context;
  for (;;) {
    const bool last = atomic_load(&d->publish_stop);
    pb_record record;
    if (pb_realtime_changed(&d->realtime)) change_made(d);
    if (atomic_load(&d->realtime.gave_up)) dds_set_guardcondition(d->wake, true);
    while (pb_ring_take(&d->realtime.records, &record)) record_publish(d, &record);
    if (last) return NULL;
    while (sem_wait(&d->realtime.published) != 0 && errno == EINTR) {
    }
  }
}

static pb_status threads_start(pb_daemon *d, pb_error *err) {
  atomic_store(&d->publish_stop, false);
  dds_set_guardcondition(d->receive_stop, false);
  if (pthread_create(&d->publish_thread, NULL, publish_run, d) != 0)
    return pb_fail(err, PB_ERR_IO, "publish thread", "cannot be started");
  if (pthread_create(&d->receive_thread, NULL, receive_run, d) != 0) {
    atomic_store(&d->publish_stop, true);
    sem_post(&d->realtime.published);
    pthread_join(d->publish_thread, NULL);
    return pb_fail(err, PB_ERR_IO, "receive thread", "cannot be started");
  }
  pthread_setname_np(d->publish_thread, "pb-publish");
  pthread_setname_np(d->receive_thread, "pb-receive");
  d->realtime_threads = true;
  return PB_OK;
}

pb_status pb_bus_realtime_start(pb_daemon *d, pb_error *err) {
  double u[PB_STEPPER_INPUTS];
  bool held;
  pthread_mutex_lock(&d->lock);
  pb_engine_input(&d->engine, u, &held);
  d->input_owed = false;
  pb_realtime_options options = {d->speed, d->options.priority, d->options.cpu, d->overrun};
  if (d->pending.armed) pb_realtime_change(&d->realtime, &d->pending.change);
  atomic_store_explicit(&d->realtime_mode, true, memory_order_release);
  pthread_mutex_unlock(&d->lock);
  pb_status status = pb_realtime_start(&d->realtime, &options, u, err);
  if (!status) status = threads_start(d, err);
  if (status) pb_bus_realtime_stop(d);
  return status;
}

void pb_bus_realtime_stop(pb_daemon *d) {
  pb_realtime_stop(&d->realtime);
  if (d->realtime_threads) {
    atomic_store(&d->publish_stop, true);
    sem_post(&d->realtime.published);
    dds_set_guardcondition(d->receive_stop, true);
    pthread_join(d->publish_thread, NULL);
    pthread_join(d->receive_thread, NULL);
    d->realtime_threads = false;
  }
  // When the ring was full the last records are lost; the plant is where the stepper is.
  if (d->stepper.now.step > d->engine.step) record_publish(d, &d->stepper.now);
  pthread_mutex_lock(&d->lock);
  if (pb_realtime_changed(&d->realtime)) pb_bus_change_made(d);
  pb_realtime_change(&d->realtime, NULL);
  atomic_store_explicit(&d->realtime_mode, false, memory_order_release);
  pb_bus_change_due(d);           // a change that the step thread did not come to
  pb_bus_take_commands(d, NULL);  // what came while the threads ended
  pthread_mutex_unlock(&d->lock);
}

void pb_bus_realtime_tend(pb_daemon *d) {
  if (!atomic_load(&d->realtime.gave_up) || d->engine.drive != PB_DRIVE_REALTIME) return;
  pb_bus_realtime_stop(d);
  pthread_mutex_lock(&d->lock);
  pb_engine_drive(&d->engine, PB_DRIVE_PAUSED, pb_daemon_clock());
  pb_engine_note(&d->engine, PB_EVENT_OVERRUN, "paused at step %llu: a deadline was missed",
                 (unsigned long long)d->engine.step);
  pthread_mutex_unlock(&d->lock);
  d->description_due = true;
}
