// The compile thread of a change: see configure.h.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include "configure.h"
#include "pool.h"

static double seconds_now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

// What a running daemon cannot change: its partition, and the length of a step on which every lease
// and every hosted controller counts.
static pb_status compatible(const pb_model *before, const pb_model *next, pb_error *err) {
  if (strcmp(before->name, next->name) != 0)
    return pb_fail(err, PB_ERR_STATE, "/name",
                   "the plant is served as '%s'; another name needs another daemon", before->name);
  if (before->sample_rate != next->sample_rate)
    return pb_fail(err, PB_ERR_STATE, "/sample_rate",
                   "the plant is stepped at %.17g Hz; another rate needs a new start",
                   before->sample_rate);
  return PB_OK;
}

static pb_status compile(pb_compile_job *job, const pb_workers *workers) {
  const pb_means means = {.workers = workers, .elements = job->elements, .modes = job->modes};
  job->warnings.notes = &job->notes;
  pb_status status = pb_revision_build(job->text, job->directory, job->number, &means,
                                       &job->warnings, &job->next, &job->err);
  if (!status) status = compatible(job->before->model, job->next->model, &job->err);
  if (status) return status;
  job->state = pb_state_new(job->next->model);
  if (!job->state) return pb_fail_memory(&job->err, "state");
  status = pb_transfer_new(job->before->model, job->before->map, job->next->model, job->next->map,
                           workers, &job->transfer, &job->err);
  const size_t ahead = status ? 0 : pb_carrier_steps(job->transfer, job->rate);
  if (ahead) status = pb_handover_new(job->transfer, ahead, workers, &job->handover, &job->err);
  return status;
}

// At a lower priority than what steps and serves: on Linux a thread has a nice value of its own,
// and hands it on to those it starts.
static void *compile_run(void *context) {
  pb_compile_job *job = context;
  const double begin = seconds_now();
  setpriority(PRIO_PROCESS, (id_t)syscall(SYS_gettid), 10);
  pb_pool pool;
  pb_pool_open(&pool);
  job->status = compile(job, &pool.workers);
  pb_pool_close(&pool);
  job->seconds = seconds_now() - begin;
  void (*finished)(void *) = job->finished;
  void *whose = job->context;
  atomic_store(&job->done, true);
  finished(whose);
  return NULL;
}

pb_status pb_compile_start(pb_compile_job *job, pb_error *err) {
  atomic_store(&job->done, false);
  if (pthread_create(&job->thread, NULL, compile_run, job) != 0)
    return pb_fail(err, PB_ERR_IO, "compile thread", "cannot be started");
  pthread_setname_np(job->thread, "pb-compile");
  return PB_OK;
}

void pb_compile_join(pb_compile_job *job) {
  pthread_join(job->thread, NULL);
}

void pb_compile_clear(pb_compile_job *job) {
  pb_warnings_clear(&job->warnings);
  pb_warnings_clear(&job->notes);
  pb_revision_free(job->next);
  pb_handover_free(job->handover);
  pb_transfer_free(job->transfer);
  free(job->state);
  free(job->text);
  memset(job, 0, sizeof *job);
}
