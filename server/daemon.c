// Start and end of the daemon.
#include "daemon.h"

#include <libgen.h>
#include <stdlib.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>

#include "base/text.h"
#include "pool.h"

int64_t pb_daemon_clock(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

const pb_revision *pb_daemon_live(pb_daemon *d) {
  pthread_mutex_lock(&d->lock);
  const pb_revision *live = d->live;
  pthread_mutex_unlock(&d->lock);
  return live;
}

static pb_status names_make(pb_daemon *d, pb_error *err) {
  char *path = pb_text_copy(d->options.plant);
  d->directory = path ? pb_text_copy(dirname(path)) : NULL;
  free(path);
  d->name = pb_text_copy(d->live->model->name);
  return d->name && d->directory ? PB_OK : pb_fail_memory(err, d->options.plant);
}

static pb_status first_build(pb_daemon *d, const char *text, const char *directory,
                             pb_warnings *warnings, pb_error *err) {
  pb_pool pool;
  pb_pool_open(&pool);
  const pb_means means = {.workers = &pool.workers, .elements = &d->elements, .modes = &d->modes};
  pb_status status = pb_revision_build(text, directory, 1, &means, warnings, &d->live, err);
  pb_pool_close(&pool);
  return status;
}

static pb_status plant_load(pb_daemon *d, pb_warnings *warnings, pb_error *err) {
  char *text = NULL, *path = pb_text_copy(d->options.plant);
  size_t length;
  pb_status status = path ? pb_text_read(d->options.plant, &text, &length, err)
                          : pb_fail_memory(err, d->options.plant);
  if (!status && strlen(text) != length)
    status = pb_fail(err, PB_ERR_SYNTAX, d->options.plant, "holds a NUL");
  if (!status) status = first_build(d, text, dirname(path), warnings, err);
  free(text);
  free(path);
  if (!status) status = names_make(d, err);
  if (!status) status = pb_stepper_init(&d->stepper, d->live->model, err);
  return status;
}

// Before the middleware makes its threads and buffers. What there is is brought in at once; what is
// mapped later stays in memory from its first touch on, which is the compile thread's. Otherwise
// each large array of a change would be brought in page by page when it is mapped, at a multiple of
// the cost, before it can ask for large pages. What is refused is told in `status`.
static void memory_lock(pb_daemon *d) {
  if (!d->options.lock_memory) return;
  d->memory_locked = mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
#ifdef MCL_ONFAULT
  if (d->memory_locked) mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT);
#endif
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
  d->overrun = options->overrun;
  pthread_mutex_init(&d->lock, NULL);
  pb_status status = plant_load(d, warnings, err);
  if (!status) status = pb_realtime_init(&d->realtime, &d->stepper, err);
  if (status) {
    pb_daemon_stop(d);
    return status;
  }
  pb_engine_init(&d->engine, (uint32_t)d->live->model->nu, d->live->model->sample_rate);
  d->current = d->stepper.now;
  d->revisions_made = 1;
  pb_configure_first(d);
  if (options->restore) status = pb_daemon_resume(d, err);
  if (status) pb_daemon_stop(d);
  return status;
}

pb_status pb_daemon_start(pb_daemon *d, pb_error *err) {
  memory_lock(d);
  pb_status status = pb_bus_create(d, err);
  if (!status) status = service_start(d, err);
  if (status) pb_daemon_stop(d);
  return status;
}

bool pb_daemon_stop(pb_daemon *d) {
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
  const bool whole = pb_configure_end(d);
  for (size_t i = 0; i < PB_DAEMON_SNAPSHOTS; i++) pb_snapshot_clear(&d->snapshot[i].data);
  pb_stepper_free(&d->stepper);
  if (!whole) return false;
  pb_revision_free(d->live);
  pb_element_store_clear(&d->elements);
  pb_mode_store_clear(&d->modes);
  free(d->name);
  free(d->directory);
  pthread_mutex_destroy(&d->lock);
  memset(d, 0, sizeof *d);
  return true;
}
