// Requests about time: mode, steps, reset, snapshots, decimation, the end.
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "daemon.h"
#include "fpenv.h"
#include "request_body.h"

static pb_status result_number(pb_request *request, const char *key, double value, pb_error *err) {
  return cJSON_AddNumberToObject(request->result, key, value) ? PB_OK
                                                              : pb_fail_memory(err, "reply");
}

// What changes the plant's state stops the step thread for that moment. True when it ran.
static bool realtime_pause(pb_daemon *d) {
  if (d->engine.drive != PB_DRIVE_REALTIME) return false;
  pb_bus_realtime_stop(d);
  return true;
}

// A daemon whose step thread cannot be started again is paused, and says so.
static pb_status realtime_resume(pb_daemon *d, bool ran, pb_error *err) {
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
                           pb_error *err) {
  static const char *const keys[] = {"mode", "speed", NULL};
  const char *mode = NULL;
  *speed = d->speed;
  pb_status status = pb_body_known(body, keys, err);
  if (!status) status = pb_body_string(body, "mode", true, &mode, err);
  if (!status) status = pb_body_number(body, "speed", speed, err);
  if (status) return status;
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
  pb_status status = mode_read(d, request->body, &drive, &speed, err);
  if (status) return status;
  realtime_pause(d);
  pthread_mutex_lock(&d->lock);
  pb_engine_drive(&d->engine, drive, pb_daemon_clock());
  d->speed = speed;
  pb_engine_note(&d->engine, PB_EVENT_MODE, "mode is %s, speed %g", pb_drive_name(drive), speed);
  if (drive != PB_DRIVE_REALTIME && !pb_bus_run_ready(d)) pb_bus_publish_sample(d);
  pthread_mutex_unlock(&d->lock);
  d->description_due = true;
  return realtime_resume(d, drive == PB_DRIVE_REALTIME, err);
}

pb_status pb_request_step(pb_daemon *d, pb_request *request, pb_error *err) {
  static const char *const keys[] = {"n", NULL};
  double n = 1.0;
  pb_status status = pb_body_known(request->body, keys, err);
  if (!status) status = pb_body_integer(request->body, "n", false, 1.0, 1e9, &n, err);
  if (status) return status;
  pthread_mutex_lock(&d->lock);
  pb_engine *engine = &d->engine;
  if (engine->drive == PB_DRIVE_REALTIME)
    status = pb_fail(err, PB_ERR_STATE, "", "the plant runs in real time");
  else if (engine->drive == PB_DRIVE_LOCKSTEP && pb_engine_barrier_count(engine) > 0)
    status = pb_fail(err, PB_ERR_STATE, "", "attached clients step the plant; pause it first");
  else if (engine->budget > 0)
    status = pb_fail(err, PB_ERR_STATE, "", "the steps of an earlier request are not done yet");
  if (!status) {
    pb_engine_allow(engine, (uint64_t)n, pb_daemon_clock());
    pb_bus_run_ready(d);
    request->accepted = engine->budget > 0;
  }
  const uint64_t step = engine->step;
  pthread_mutex_unlock(&d->lock);
  return status ? status : result_number(request, "step", (double)step, err);
}

// A new epoch from rest (state NULL) or from a saved state.
static pb_status restart(pb_daemon *d, pb_request *request, const pb_state *state,
                         pb_event_kind kind, const char *text, pb_error *err) {
  const bool ran = realtime_pause(d);
  pthread_mutex_lock(&d->lock);
  pb_engine_restart(&d->engine, state ? state->step : 0, pb_daemon_clock());
  const uint32_t epoch = d->engine.epoch;
  const uint64_t saved = pb_flush_denormals();
  pb_stepper_restart(&d->stepper, state, epoch);
  pb_restore_denormals(saved);
  d->current = d->stepper.now;
  d->faults = 0;
  memset(d->fault_step, 0, sizeof d->fault_step);
  pb_engine_note(&d->engine, kind, "%s, epoch %u begins", text, epoch);
  pb_bus_publish_sample(d);
  pthread_mutex_unlock(&d->lock);
  d->description_due = true;
  pb_status status = result_number(request, "epoch", epoch, err);
  const pb_status resumed = realtime_resume(d, ran, err);
  return status ? status : resumed;
}

pb_status pb_request_reset(pb_daemon *d, pb_request *request, pb_error *err) {
  static const char *const keys[] = {NULL};
  pb_status status = pb_body_known(request->body, keys, err);
  if (status) return status;
  return restart(d, request, NULL, PB_EVENT_RESET, "the plant is at rest", err);
}

pb_status pb_request_snapshot(pb_daemon *d, pb_request *request, pb_error *err) {
  static const char *const keys[] = {NULL};
  pb_status status = pb_body_known(request->body, keys, err);
  if (status) return status;
  pb_snapshot *place = &d->snapshot[d->snapshots_made % PB_DAEMON_SNAPSHOTS];
  const size_t bytes = pb_state_bytes(d->model);
  pb_state *copy = malloc(bytes);
  if (!copy) return pb_fail_memory(err, "snapshot");
  const bool ran = realtime_pause(d);
  pthread_mutex_lock(&d->lock);
  memcpy(copy, d->stepper.state, bytes);
  pthread_mutex_unlock(&d->lock);
  free(place->state);  // the oldest of PB_DAEMON_SNAPSHOTS
  place->state = copy;
  place->id = ++d->snapshots_made;
  status = result_number(request, "snapshot", place->id, err);
  if (!status) status = result_number(request, "step", (double)copy->step, err);
  const pb_status resumed = realtime_resume(d, ran, err);
  return status ? status : resumed;
}

pb_status pb_request_restore(pb_daemon *d, pb_request *request, pb_error *err) {
  static const char *const keys[] = {"snapshot", NULL};
  double id = 0.0;
  pb_status status = pb_body_known(request->body, keys, err);
  if (!status) status = pb_body_integer(request->body, "snapshot", true, 1.0, 4e9, &id, err);
  if (status) return status;
  for (size_t i = 0; i < PB_DAEMON_SNAPSHOTS; i++)
    if (d->snapshot[i].state && d->snapshot[i].id == (uint32_t)id)
      return restart(d, request, d->snapshot[i].state, PB_EVENT_RESTORED, "a snapshot is restored",
                     err);
  return pb_fail(err, PB_ERR_REFERENCE, "/snapshot", "there is no snapshot %.0f (%d are kept)", id,
                 PB_DAEMON_SNAPSHOTS);
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
