// See realtime.h.
#include "realtime.h"

#include <math.h>
#include <sched.h>
#include <string.h>
#include <sys/prctl.h>
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

// What the step thread keeps to itself.
typedef struct step_run {
  pb_held_input held;
  uint32_t former_revision;  // whose inputs may still be on their way
  int input_from[PB_STEPPER_INPUTS];
  int64_t start;  // deadline 0
  uint64_t k;     // number of the next deadline
  double interval;
  pb_change *spread;  // under way, in steps up to `due`; NULL: none
  uint64_t due;
  const pb_change *whole;  // came too late to be spread before its step
} step_run;

static void inputs_relayout(const int *from, size_t nu, double *u) {
  double old[PB_STEPPER_INPUTS];
  memcpy(old, u, sizeof old);
  for (size_t i = 0; i < nu; i++) u[i] = from[i] >= 0 ? old[from[i]] : 0.0;
}

// The newest inputs there are; LATE when they were meant for a step that is over. Those of the
// model before the last change are put into the order of the present one; older ones are too old.
static uint32_t inputs_take(pb_realtime *rt, step_run *run) {
  uint32_t flags = 0;
  pb_held_input next;
  while (pb_ring_take(&rt->inputs, &next)) {
    if (next.revision != rt->stepper->revision) {
      if (next.revision != run->former_revision) continue;
      inputs_relayout(run->input_from, rt->stepper->model->nu, next.u);
    }
    run->held = next;
    if (next.for_step >= rt->stepper->now.step) continue;
    if (!next.counted) pb_histogram_raise(&rt->late, 1);
    flags |= PB_FLAG_LATE;
  }
  return flags;
}

static void scheduling_ask(pb_realtime *rt) {
  const struct sched_param param = {.sched_priority = rt->options.priority};
  atomic_store(&rt->fifo, rt->options.priority > 0 &&
                              pthread_setschedparam(pthread_self(), SCHED_FIFO, &param) == 0);
  if (rt->options.cpu >= 0) {
    cpu_set_t set;
    CPU_ZERO(&set);
    CPU_SET((size_t)rt->options.cpu, &set);
    atomic_store(&rt->affinity, pthread_setaffinity_np(pthread_self(), sizeof set, &set) == 0);
  }
  pb_flush_denormals();
  atomic_store(&rt->flush, pb_denormals_are_flushed());
}

static void change_make(pb_realtime *rt, step_run *run, pb_change *change) {
  if (change->model) {
    run->former_revision = rt->stepper->revision;
    memcpy(run->input_from, change->input_from, sizeof run->input_from);
  }
  const bool model = change->model != NULL;
  pb_stepper_change(rt->stepper, change);
  if (model) inputs_relayout(run->input_from, rt->stepper->model->nu, run->held.u);
  atomic_store_explicit(&rt->changed, change, memory_order_release);
  sem_post(&rt->published);
}

// Whether a change is to begin at this step: at its own, or as many steps ahead as it is spread
// over, where there are so many. One that is to be made as soon as possible is made after them.
// Looks at nothing that the change points to, as it may be taken back meanwhile.
static bool change_begins(const pb_realtime *rt, step_run *run, const pb_change *change,
                          bool *spread) {
  const uint64_t step = rt->stepper->state->step;
  const uint64_t ahead = change->ahead;
  if (step + ahead < change->at_step) return false;
  if (step < change->at_step && step + ahead > change->at_step) run->whole = change;
  *spread = ahead > 0 && run->whole != change;
  return *spread || step >= change->at_step;
}

static void change_spread(pb_realtime *rt, step_run *run, pb_change *change) {
  run->spread = change;
  run->due = rt->stepper->state->step + change->ahead;
  pb_handover_begin(change->carrier->handover, rt->stepper->state);
  sem_post(&change->carrier->begun);
}

// A spread change that is not carried in time is made whole.
static void spread_make(pb_realtime *rt, step_run *run) {
  pb_change *change = run->spread;
  const bool carried = rt->stepper->state->step == run->due &&
                       atomic_load_explicit(&change->carrier->carried, memory_order_acquire);
  run->spread = NULL;
  change->handover = carried ? change->carrier->handover : NULL;
  change_make(rt, run, change);
}

static void change_look(pb_realtime *rt, step_run *run) {
  bool spread;
  if (run->spread) {
    if (rt->stepper->state->step >= run->due) spread_make(rt, run);
    return;
  }
  pb_change *change = atomic_load_explicit(&rt->change, memory_order_acquire);
  if (!change) run->whole = NULL;  // taken back, perhaps
  if (!change || !change_begins(rt, run, change, &spread)) return;
  // Taken out before it is begun or made: it may be revoked up to here.
  if (!atomic_compare_exchange_strong(&rt->change, &change, NULL)) return;
  run->whole = NULL;
  if (spread)
    change_spread(rt, run, change);
  else
    change_make(rt, run, change);
}

static void step_take(pb_realtime *rt, step_run *run, uint32_t flags) {
  const int64_t begin = clock_now();
  flags |= inputs_take(rt, run);
  pb_stepper_step(rt->stepper, run->held.u, flags);
  if (run->spread) pb_handover_follow(run->spread->carrier->handover, rt->stepper->state);
  pb_histogram_add(&rt->step_time, clock_now() - begin);
  if (!pb_ring_put(&rt->records, &rt->stepper->now)) pb_histogram_raise(&rt->dropped, 1);
  sem_post(&rt->published);
}

// What a missed deadline leads to. False: the thread ends.
static bool overrun_follow(pb_realtime *rt, step_run *run, int64_t behind) {
  pb_histogram_raise(&rt->overruns, 1);
  switch (rt->options.overrun) {
  case PB_OVERRUN_STOP:
    atomic_store(&rt->gave_up, true);
    sem_post(&rt->published);
    return false;
  case PB_OVERRUN_SKIP: {
    const uint64_t over = (uint64_t)((double)behind / run->interval);
    run->k += over;
    pb_histogram_raise(&rt->skipped, over);
    return true;
  }
  default:
    if ((double)behind <= PB_REALTIME_BEHIND * 1e9) return true;
    pb_histogram_raise(&rt->slips, 1);
    run->start = clock_now();
    run->k = 0;
    return true;
  }
}

// So that no step is the first to need a page of the stack.
static void stack_touch(void) {
  volatile char page[64 << 10];
  for (size_t i = 0; i < sizeof page; i += 4096) page[i] = 0;
}

// Deadline k is start + k·interval, computed anew each time: no rounding adds up.
static void *step_thread(void *context) {
  pb_realtime *rt = context;
  step_run run = {.former_revision = UINT32_MAX,
                  .interval = 1e9 / (rt->stepper->model->sample_rate * rt->options.speed)};
  prctl(PR_SET_NAME, "pb-step");
  stack_touch();
  scheduling_ask(rt);
  run.start = clock_now();
  for (run.k = 1; !atomic_load_explicit(&rt->stop, memory_order_relaxed); run.k++) {
    const int64_t deadline = run.start + llround((double)run.k * run.interval);
    if (!sleep_until(rt, deadline)) break;
    const int64_t behind = clock_now() - deadline;
    const bool overrun = (double)behind > run.interval;
    pb_histogram_add(&rt->jitter, behind);
    change_look(rt, &run);
    step_take(rt, &run, overrun ? PB_FLAG_OVERRUN : 0);
    if (overrun && !overrun_follow(rt, &run, behind)) break;
  }
  if (run.spread) spread_make(rt, &run);  // whole: nobody else has it any more
  return NULL;
}

const char *pb_overrun_name(pb_overrun overrun) {
  static const char *const name[] = {"catch-up", "skip", "stop"};
  return name[overrun];
}

int pb_overrun_parse(const char *name) {
  for (int i = PB_OVERRUN_CATCH_UP; i <= PB_OVERRUN_STOP; i++)
    if (strcmp(name, pb_overrun_name((pb_overrun)i)) == 0) return i;
  return -1;
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
  pb_held_input first = {.for_step = UINT64_MAX, .revision = realtime->stepper->revision};
  memcpy(first.u, u, realtime->stepper->model->nu * sizeof *u);
  pb_ring_put(&realtime->inputs, &first);
  atomic_store(&realtime->stop, false);
  atomic_store(&realtime->gave_up, false);
  const int code = pthread_create(&realtime->thread, NULL, step_thread, realtime);
  if (code) return pb_fail(err, PB_ERR_IO, "step thread", "cannot be started: %s", strerror(code));
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

void pb_realtime_change(pb_realtime *realtime, pb_change *change) {
  atomic_store_explicit(&realtime->change, change, memory_order_release);
}

bool pb_realtime_revoke(pb_realtime *realtime) {
  return atomic_exchange_explicit(&realtime->change, NULL, memory_order_acq_rel) != NULL;
}

pb_change *pb_realtime_changed(pb_realtime *realtime) {
  return atomic_exchange_explicit(&realtime->changed, NULL, memory_order_acq_rel);
}
