// Snapshots: of the state of the plant and of all that runs inside the step, kept here or in files.
// Commands that clients hold are not part of it: they are the clients'.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "daemon.h"
#include "request_body.h"

static pb_status host_save(const pb_host *host, pb_snapshot_data *out, pb_error *err) {
  pb_status status = pb_host_text(host, &out->host_text, err);
  if (status) return status;
  out->host_bytes = pb_host_bytes(host);
  out->host = malloc(out->host_bytes ? out->host_bytes : 1);
  if (!out->host) return pb_fail_memory(err, "snapshot");
  pb_host_save(host, out->host);
  return PB_OK;
}

// With the plant standing still: under lock, and not in real time.
static pb_status data_take(pb_daemon *d, pb_snapshot_data *out, pb_error *err) {
  const pb_revision *live = d->live;
  *out = (pb_snapshot_data){.step = d->stepper.state->step,
                            .hash = d->stepper.now.hash,
                            .revision = live->number,
                            .sample_rate = live->model->sample_rate,
                            .nx = live->model->nx,
                            .nu = live->model->nu,
                            .ny = live->model->ny,
                            .state_bytes = pb_state_bytes(live->model),
                            .plant_text = pb_text_copy(live->text)};
  memcpy(out->plant_sha256, live->sha256, sizeof out->plant_sha256);
  out->state = malloc(out->state_bytes);
  if (!out->state || !out->plant_text) return pb_fail_memory(err, "snapshot");
  memcpy(out->state, d->stepper.state, out->state_bytes);
  return host_save(d->stepper.host, out, err);
}

static pb_status file_path(const pb_daemon *d, const char *name, char *path, size_t size,
                           pb_error *err) {
  if (!d->options.state_directory)
    return pb_fail(err, PB_ERR_STATE, "/file",
                   "the daemon was started without --state, the directory of snapshot files");
  if (!pb_snapshot_name_valid(name))
    return pb_fail(err, PB_ERR_SCHEMA, "/file",
                   "expected a name of letters, digits, '.', '_' and '-'");
  if ((size_t)snprintf(path, size, "%s/%s", d->options.state_directory, name) >= size)
    return pb_fail(err, PB_ERR_ARGUMENT, "/file", "the name is too long");
  return PB_OK;
}

static pb_status taken_keep(pb_daemon *d, const pb_snapshot_data *data, const char *file,
                            const char *path, pb_request *request, pb_error *err) {
  pb_status status = file ? pb_snapshot_write(path, data, err) : PB_OK;
  if (status) return status;
  if (file && !cJSON_AddStringToObject(request->result, "file", file))
    return pb_fail_memory(err, "reply");
  pb_snapshot *place = &d->snapshot[d->snapshots_made % PB_DAEMON_SNAPSHOTS];
  pb_snapshot_clear(&place->data);  // the oldest of PB_DAEMON_SNAPSHOTS
  place->data = *data;
  place->id = ++d->snapshots_made;
  if (!cJSON_AddNumberToObject(request->result, "snapshot", place->id) ||
      !cJSON_AddNumberToObject(request->result, "step", (double)data->step) ||
      !cJSON_AddNumberToObject(request->result, "bytes",
                               (double)(data->state_bytes + data->host_bytes)))
    return pb_fail_memory(err, "reply");
  return PB_OK;
}

pb_status pb_request_snapshot(pb_daemon *d, pb_request *request, pb_error *err) {
  static const char *const keys[] = {"file", NULL};
  const char *file = NULL;
  char path[4096];
  pb_snapshot_data data = {0};
  pb_status status = pb_body_known(request->body, keys, err);
  if (!status) status = pb_body_string(request->body, "file", false, &file, err);
  if (!status && file) status = file_path(d, file, path, sizeof path, err);
  if (status) return status;
  const bool ran = pb_daemon_halt(d);
  pthread_mutex_lock(&d->lock);
  status = data_take(d, &data, err);
  pthread_mutex_unlock(&d->lock);
  const pb_status resumed = pb_daemon_continue(d, ran, err);
  const uint32_t made = d->snapshots_made;
  if (!status) status = taken_keep(d, &data, file, path, request, err);
  if (d->snapshots_made == made) pb_snapshot_clear(&data);
  return status ? status : resumed;
}

// Whether a snapshot fits the plant that is stepped.
static pb_status snapshot_admit(const pb_daemon *d, const pb_snapshot_data *data, pb_error *err) {
  const pb_revision *live = d->live;
  if (strcmp(data->plant_sha256, live->sha256) != 0)
    return pb_fail(err, PB_ERR_STATE, "snapshot",
                   "is of another plant file (SHA-256 %.12s…, this one is %.12s…)",
                   data->plant_sha256, live->sha256);
  return pb_snapshot_check(data, live->model, err);
}

// The hosted items of a snapshot, made anew.
static pb_status host_build(const pb_daemon *d, const pb_snapshot_data *data, pb_host **out,
                            pb_error *err) {
  pb_status status = pb_host_parse(data->host_text, d->live->model, out, err);
  if (status || pb_host_bytes(*out) == data->host_bytes) return status;
  pb_host_free(*out);
  *out = NULL;
  return pb_fail(err, PB_ERR_STATE, "snapshot", "its hosted items do not fit their state");
}

static pb_status restore(pb_daemon *d, const pb_snapshot_data *data, pb_error *err) {
  pb_host *host = NULL;
  pb_status status = snapshot_admit(d, data, err);
  if (!status) status = host_build(d, data, &host, err);
  if (status) return status;
  const bool ran = pb_daemon_halt(d);
  pthread_mutex_lock(&d->lock);
  pb_host_free(d->stepper.host);
  d->stepper.host = host;
  d->host = host;
  pb_daemon_restart(d, data, PB_EVENT_RESTORED, "a snapshot is restored");
  if (host) pb_host_load(host, data->host);
  pthread_mutex_unlock(&d->lock);
  return pb_daemon_continue(d, ran, err);
}

static pb_status restore_file(pb_daemon *d, const char *path, pb_error *err) {
  pb_snapshot_data data = {0};
  pb_status status = pb_snapshot_read(path, &data, err);
  if (!status) status = restore(d, &data, err);
  pb_snapshot_clear(&data);
  return status;
}

static pb_status restore_kept(pb_daemon *d, uint32_t id, pb_error *err) {
  for (size_t i = 0; i < PB_DAEMON_SNAPSHOTS; i++)
    if (d->snapshot[i].id == id) return restore(d, &d->snapshot[i].data, err);
  return pb_fail(err, PB_ERR_REFERENCE, "/snapshot", "there is no snapshot %u (%d are kept)", id,
                 PB_DAEMON_SNAPSHOTS);
}

pb_status pb_request_restore(pb_daemon *d, pb_request *request, pb_error *err) {
  static const char *const keys[] = {"snapshot", "file", NULL};
  const char *file = NULL;
  char path[4096];
  double id = 0.0;
  pb_status status = pb_body_known(request->body, keys, err);
  if (!status) status = pb_body_string(request->body, "file", false, &file, err);
  if (!status)
    status = pb_body_integer(request->body, "snapshot", file == NULL, 1.0, 4e9, &id, err);
  if (!status && file && id > 0.0)
    status = pb_fail(err, PB_ERR_SCHEMA, "/snapshot", "expected a snapshot or a file, not both");
  if (!status) status = pb_configure_idle(d, err);
  if (!status && file) status = file_path(d, file, path, sizeof path, err);
  if (!status) status = file ? restore_file(d, path, err) : restore_kept(d, (uint32_t)id, err);
  if (status && file && err) snprintf(err->where, sizeof err->where, "/file");
  if (status) return status;
  if (!cJSON_AddNumberToObject(request->result, "epoch", d->current.epoch) ||
      !cJSON_AddNumberToObject(request->result, "step", (double)d->engine.step))
    return pb_fail_memory(err, "reply");
  return PB_OK;
}

pb_status pb_daemon_resume(pb_daemon *d, pb_error *err) {
  return restore_file(d, d->options.restore, err);
}
