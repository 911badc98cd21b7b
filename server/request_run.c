// Requests about time: mode, steps, reset, snapshots, decimation, the end.
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "daemon.h"
#include "fpenv.h"
#include "hash.h"
#include "request_body.h"

static pb_status result_number(pb_request *request, const char *key, double value, pb_error *err) {
  return cJSON_AddNumberToObject(request->result, key, value) ? PB_OK
                                                              : pb_fail_memory(err, "reply");
}

// What changes the plant's state stops the step thread for that moment. True when it ran.
bool pb_daemon_halt(pb_daemon *d) {
  if (d->engine.drive != PB_DRIVE_REALTIME) return false;
  pb_bus_realtime_stop(d);
  return true;
}

// A daemon whose step thread cannot be started again is paused, and says so.
pb_status pb_daemon_continue(pb_daemon *d, bool ran, pb_error *err) {
  pb_status status = ran ? pb_bus_realtime_start(d, err) : PB_OK;
  if (!status) return PB_OK;
  pthread_mutex_lock(&d->lock);
  pb_engine_drive(&d->engine, PB_DRIVE_PAUSED, pb_daemon_clock());
  pb_engine_note(&d->engine, PB_EVENT_MODE, "paused: real time cannot be started");
  pthread_mutex_unlock(&d->lock);
  d->description_due = true;
  return status;
}

static pb_status mode_read(pb_daemon *d, const cJSON *body, pb_drive *drive, double *speed,
                           pb_overrun *overrun, pb_error *err) {
  static const char *const keys[] = {"mode", "speed", "overrun", NULL};
  const char *mode = NULL, *policy = pb_overrun_name(d->overrun);
  *speed = d->speed;
  pb_status status = pb_body_known(body, keys, err);
  if (!status) status = pb_body_string(body, "mode", true, &mode, err);
  if (!status) status = pb_body_number(body, "speed", speed, err);
  if (!status) status = pb_body_string(body, "overrun", false, &policy, err);
  if (status) return status;
  const int known = pb_overrun_parse(policy);
  if (known < 0)
    return pb_fail(err, PB_ERR_SCHEMA, "/overrun", "expected \"catch-up\", \"skip\" or \"stop\"");
  *overrun = (pb_overrun)known;
  const int parsed = pb_drive_parse(mode);
  if (parsed < 0)
    return pb_fail(err, PB_ERR_SCHEMA, "/mode",
                   "expected \"paused\", \"lockstep\" or \"realtime\"");
  if (!(*speed >= 1e-3 && *speed <= 1e3))
    return pb_fail(err, PB_ERR_SCHEMA, "/speed", "expected a number from 0.001 to 1000");
  *drive = (pb_drive)parsed;
  return PB_OK;
}

pb_status pb_request_set_mode(pb_daemon *d, pb_request *request, pb_error *err) {
  pb_drive drive = PB_DRIVE_PAUSED;
  double speed;
  pb_overrun overrun = PB_OVERRUN_CATCH_UP;
  pb_status status = mode_read(d, request->body, &drive, &speed, &overrun, err);
  if (status) return status;
  pb_daemon_halt(d);
  pthread_mutex_lock(&d->lock);
  pb_engine_drive(&d->engine, drive, pb_daemon_clock());
  d->speed = speed;
  d->overrun = overrun;
  pb_engine_note(&d->engine, PB_EVENT_MODE, "mode is %s, speed %g", pb_drive_name(drive), speed);
  if (drive != PB_DRIVE_REALTIME && !pb_bus_run_ready(d)) pb_bus_publish_sample(d);
  pthread_mutex_unlock(&d->lock);
  d->description_due = true;
  return pb_daemon_continue(d, drive == PB_DRIVE_REALTIME, err);
}

pb_status pb_request_may_step(const pb_engine *e, pb_error *err) {
  if (e->drive == PB_DRIVE_REALTIME)
    return pb_fail(err, PB_ERR_STATE, "", "the plant runs in real time");
  if (e->drive == PB_DRIVE_LOCKSTEP && pb_engine_barrier_count(e) > 0)
    return pb_fail(err, PB_ERR_STATE, "", "attached clients step the plant; pause it first");
  if (e->budget > 0)
    return pb_fail(err, PB_ERR_STATE, "", "the steps of an earlier request are not done yet");
  return PB_OK;
}

pb_status pb_request_step(pb_daemon *d, pb_request *request, pb_error *err) {
  static const char *const keys[] = {"n", NULL};
  double n = 1.0;
  pb_status status = pb_body_known(request->body, keys, err);
  if (!status) status = pb_body_integer(request->body, "n", false, 1.0, 1e9, &n, err);
  if (status) return status;
  pthread_mutex_lock(&d->lock);
  pb_engine *engine = &d->engine;
  status = pb_request_may_step(engine, err);
  if (!status) {
    pb_engine_allow(engine, (uint64_t)n, pb_daemon_clock());
    pb_bus_run_ready(d);
    request->accepted = engine->budget > 0;
  }
  const uint64_t step = engine->step;
  pthread_mutex_unlock(&d->lock);
  return status ? status : result_number(request, "step", (double)step, err);
}

// Under lock, and not in real time. During the start nobody listens yet.
void pb_daemon_restart(pb_daemon *d, const pb_snapshot_data *from, pb_event_kind kind,
                       const char *text) {
  pb_engine_restart(&d->engine, from ? from->step : 0, pb_daemon_clock());
  const uint32_t epoch = d->engine.epoch;
  const uint64_t saved = pb_flush_denormals();
  pb_stepper_restart(&d->stepper, from ? from->state : NULL, from ? from->hash : PB_HASH_START,
                     epoch);
  pb_restore_denormals(saved);
  d->current = d->stepper.now;
  d->faults = 0;
  memset(d->fault_step, 0, sizeof d->fault_step);
  pb_engine_note(&d->engine, kind, "%s, epoch %u begins", text, epoch);
  if (d->listening) pb_bus_publish_sample(d);
  d->description_due = true;
}

pb_status pb_request_reset(pb_daemon *d, pb_request *request, pb_error *err) {
  static const char *const keys[] = {NULL};
  pb_status status = pb_body_known(request->body, keys, err);
  if (status) return status;
  const bool ran = pb_daemon_halt(d);
  pthread_mutex_lock(&d->lock);
  pb_daemon_restart(d, NULL, PB_EVENT_RESET, "the plant is at rest");
  const uint32_t epoch = d->engine.epoch;
  pthread_mutex_unlock(&d->lock);
  status = pb_daemon_continue(d, ran, err);
  return status ? status : result_number(request, "epoch", epoch, err);
}

static bool others_wait(const pb_engine *engine, const uint8_t client[16]) {
  for (uint32_t i = 0; i < engine->places; i++) {
    const pb_member *m = &engine->member[i];
    if (m->id && m->barrier && memcmp(m->client, client, sizeof m->client) != 0) return true;
  }
  return false;
}

pb_status pb_request_decimate(pb_daemon *d, pb_request *request, pb_error *err) {
  static const char *const keys[] = {"n", NULL};
  double n = 0.0;
  pb_status status = pb_body_known(request->body, keys, err);
  if (!status) status = pb_body_integer(request->body, "n", true, 1.0, 1e6, &n, err);
  if (status) return status;
  pthread_mutex_lock(&d->lock);
  if (others_wait(&d->engine, request->client)) {
    status = pb_fail(err, PB_ERR_STATE, "", "another client counts on every sample");
  } else {
    d->engine.decimation = (uint32_t)n;
    pb_bus_run_ready(d);
  }
  pthread_mutex_unlock(&d->lock);
  d->description_due = d->description_due || !status;
  return status;
}

pb_status pb_request_shutdown(pb_daemon *d, pb_request *request, pb_error *err) {
  static const char *const keys[] = {NULL};
  pb_status status = pb_body_known(request->body, keys, err);
  if (status) return status;
  if (!d->options.allow_shutdown)
    return pb_fail(err, PB_ERR_STATE, "", "the daemon was started without --allow-shutdown");
  pthread_mutex_lock(&d->lock);
  pb_engine_note(&d->engine, PB_EVENT_SHUTDOWN, "a client asked for the end");
  pthread_mutex_unlock(&d->lock);
  kill(getpid(), SIGTERM);  // main waits for it
  return PB_OK;
}
