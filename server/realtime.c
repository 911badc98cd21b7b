// See realtime.h.
#include "realtime.h"

#include <math.h>
#include <sched.h>
#include <string.h>
#include <time.h>

#include "fpenv.h"

static const int64_t second_ns = 1000000000;

static int64_t clock_now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (int64_t)t.tv_sec * second_ns + t.tv_nsec;
}

// In slices, so that stopping does not have to wait for a long interval. False: told to stop.
static bool sleep_until(const pb_realtime *rt, int64_t deadline) {
  const int64_t slice = second_ns / 20;
  for (int64_t now = clock_now(); now < deadline; now = clock_now()) {
    if (atomic_load_explicit(&rt->stop, memory_order_relaxed)) return false;
    const int64_t until = deadline - now > slice ? now + slice : deadline;
    const struct timespec t = {until / second_ns, (long)(until % second_ns)};
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL);
  }
  return true;
}

// The newest inputs there are; LATE when they were meant for a step that is over.
static uint32_t inputs_take(pb_realtime *rt, pb_held_input *held) {
  uint32_t flags = 0;
  pb_held_input next;
  while (pb_ring_take(&rt->inputs, &next)) {
    *held = next;
    if (next.for_step >= rt->stepper->now.step) continue;
    if (!next.counted) atomic_fetch_add_explicit(&rt->late, 1, memory_order_relaxed);
    flags |= PB_FLAG_LATE;
  }
  return flags;
}

static void scheduling_ask(pb_realtime *rt) {
  const struct sched_param param = {.sched_priority = rt->options.priority};
  atomic_store(&rt->fifo, rt->options.priority > 0 &&
                              pthread_setschedparam(pthread_self(), SCHED_FIFO, &param) == 0);
  if (rt->options.cpu < 0) return;
  cpu_set_t set;
  CPU_ZERO(&set);
  CPU_SET((size_t)rt->options.cpu, &set);
  atomic_store(&rt->affinity, pthread_setaffinity_np(pthread_self(), sizeof set, &set) == 0);
}

// Deadline k is start + k·interval, computed anew each time: no rounding adds up.
static void *step_thread(void *context) {
  pb_realtime *rt = context;
  const double interval = 1e9 / (rt->stepper->model->sample_rate * rt->options.speed);
  pb_held_input held;
  memset(&held, 0, sizeof held);
  scheduling_ask(rt);
  pb_flush_denormals();
  int64_t start = clock_now();
  for (uint64_t k = 1; !atomic_load_explicit(&rt->stop, memory_order_relaxed); k++) {
    const int64_t deadline = start + llround((double)k * interval);
    if (!sleep_until(rt, deadline)) break;
    const int64_t behind = clock_now() - deadline;
    uint32_t flags = inputs_take(rt, &held);
    if ((double)behind > interval) {
      atomic_fetch_add_explicit(&rt->overruns, 1, memory_order_relaxed);
      flags |= PB_FLAG_OVERRUN;
    }
    pb_stepper_step(rt->stepper, held.u, flags);
    if (!pb_ring_put(&rt->records, &rt->stepper->now))
      atomic_fetch_add_explicit(&rt->dropped, 1, memory_order_relaxed);
    sem_post(&rt->published);
    if ((double)behind > PB_REALTIME_BEHIND * 1e9) {
      atomic_fetch_add_explicit(&rt->slips, 1, memory_order_relaxed);
      start = clock_now();
      k = 0;
    }
  }
  return NULL;
}

pb_status pb_realtime_init(pb_realtime *realtime, pb_stepper *stepper, pb_error *err) {
  memset(realtime, 0, sizeof *realtime);
  if (sem_init(&realtime->published, 0, 0) != 0)
    return pb_fail(err, PB_ERR_IO, "semaphore", "cannot be made");
  realtime->stepper = stepper;
  return PB_OK;
}

void pb_realtime_free(pb_realtime *realtime) {
  if (!realtime->stepper) return;
  pb_realtime_stop(realtime);
  sem_destroy(&realtime->published);
  realtime->stepper = NULL;
}

pb_status pb_realtime_start(pb_realtime *realtime, const pb_realtime_options *options,
                            const double *u, pb_error *err) {
  realtime->options = *options;
  pb_ring_init(&realtime->records, realtime->record_slot, sizeof realtime->record_slot[0],
               PB_REALTIME_RECORDS);
  pb_ring_init(&realtime->inputs, realtime->input_slot, sizeof realtime->input_slot[0],
               PB_REALTIME_INPUTS);
  pb_held_input first = {.for_step = UINT64_MAX};
  memcpy(first.u, u, realtime->stepper->model->nu * sizeof *u);
  pb_ring_put(&realtime->inputs, &first);
  atomic_store(&realtime->stop, false);
  const int code = pthread_create(&realtime->thread, NULL, step_thread, realtime);
  if (code) return pb_fail(err, PB_ERR_IO, "step thread", "cannot be started: %s", strerror(code));
  pthread_setname_np(realtime->thread, "pb-step");
  realtime->running = true;
  return PB_OK;
}

void pb_realtime_stop(pb_realtime *realtime) {
  if (!realtime->running) return;
  atomic_store(&realtime->stop, true);
  pthread_join(realtime->thread, NULL);
  realtime->running = false;
}

bool pb_realtime_input(pb_realtime *realtime, const pb_held_input *input) {
  return pb_ring_put(&realtime->inputs, input);
}
