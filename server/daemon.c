// Start and end of the daemon.
#include "daemon.h"

#include <openssl/evp.h>
#include <stdlib.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>

int64_t pb_daemon_clock(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

static pb_status hash_text(const char *text, char hex[65], pb_error *err) {
  unsigned char digest[EVP_MAX_MD_SIZE];
  unsigned int length = 0;
  if (EVP_Digest(text, strlen(text), digest, &length, EVP_sha256(), NULL) != 1 || length != 32)
    return pb_fail(err, PB_ERR_IO, "SHA-256", "cannot be computed");
  for (unsigned i = 0; i < length; i++) snprintf(hex + 2 * i, 3, "%02x", digest[i]);
  return PB_OK;
}

static pb_status plant_load(pb_daemon *d, pb_warnings *warnings, pb_error *err) {
  cJSON *json = NULL;
  pb_status status = pb_json_read(d->options.plant, &json, &d->plant_text, err);
  cJSON_Delete(json);
  if (!status) status = pb_model_load(d->options.plant, warnings, &d->model, err);
  if (!status && !pb_plant_name_valid(d->model->name))
    status =
        pb_fail(err, PB_ERR_SCHEMA, "/name",
                "expected 1 to 64 octets without * ? [ ] and control characters, to serve as a "
                "partition");
  if (!status) status = hash_text(d->plant_text, d->plant_sha256, err);
  if (!status) status = pb_model_pack(d->model, &d->packed, &d->packed_count, err);
  if (!status) status = pb_stepper_init(&d->stepper, d->model, err);
  return status;
}

// Before the middleware makes its threads and buffers. What is refused is told in `status`.
static void memory_lock(pb_daemon *d) {
  if (d->options.lock_memory) d->memory_locked = mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
}

static pb_status service_start(pb_daemon *d, pb_error *err) {
  d->description_due = d->status_due = true;
  pthread_mutex_lock(&d->lock);
  pb_engine_drive(&d->engine, d->options.mode, pb_daemon_clock());
  d->listening = true;
  pthread_mutex_unlock(&d->lock);
  if (d->options.mode == PB_DRIVE_REALTIME) {
    pb_status status = pb_bus_realtime_start(d, err);
    if (status) return status;
  }
  if (pthread_create(&d->service_thread, NULL, pb_bus_service, d) != 0)
    return pb_fail(err, PB_ERR_IO, "service thread", "cannot be started");
  pthread_setname_np(d->service_thread, "pb-service");
  d->service_running = true;
  return PB_OK;
}

pb_status pb_daemon_load(pb_daemon *d, const pb_daemon_options *options, pb_warnings *warnings,
                         pb_error *err) {
  memset(d, 0, sizeof *d);
  d->options = *options;
  d->speed = options->speed;
  pthread_mutex_init(&d->lock, NULL);
  pb_status status = plant_load(d, warnings, err);
  if (!status) status = pb_realtime_init(&d->realtime, &d->stepper, err);
  if (status) {
    pb_daemon_stop(d);
    return status;
  }
  pb_engine_init(&d->engine, (uint32_t)d->model->nu, d->model->sample_rate);
  d->current = d->stepper.now;
  return PB_OK;
}

pb_status pb_daemon_start(pb_daemon *d, pb_error *err) {
  memory_lock(d);
  pb_status status = pb_bus_create(d, err);
  if (!status) status = service_start(d, err);
  if (status) pb_daemon_stop(d);
  return status;
}

void pb_daemon_stop(pb_daemon *d) {
  atomic_store(&d->stop, true);
  if (d->service_running) {
    dds_set_guardcondition(d->wake, true);
    pthread_join(d->service_thread, NULL);
  } else if (d->listening) {
    pb_bus_realtime_stop(d);
  }
  pthread_mutex_lock(&d->lock);
  d->listening = false;
  pthread_mutex_unlock(&d->lock);
  if (d->participant > 0) dds_delete(d->participant);
  pb_realtime_free(&d->realtime);
  for (size_t i = 0; i < PB_DAEMON_SNAPSHOTS; i++) free(d->snapshot[i].state);
  pb_stepper_free(&d->stepper);
  pb_model_free(d->model);
  free(d->packed);
  free(d->plant_text);
  pthread_mutex_destroy(&d->lock);
  memset(d, 0, sizeof *d);
}
