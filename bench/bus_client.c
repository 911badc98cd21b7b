// A controller that times its round trips: see bus_client.h.
#include "bus_client.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "bench.h"
#include "session.h"

enum { MOST_INTERVALS = 1000000 };

typedef struct run {
  const bench_client_task *task;
  double begin, last, cpu;  // begin 0: not yet counting
  double first;
  size_t intervals;
  double *interval;
} run;

static bool on_sample(void *context, const pb_sample *sample, double *command) {
  run *r = context;
  const double now = bench_now();
  command[0] = 1e-3 * (double)(sample->step % 7);
  if (r->first == 0) r->first = now;
  if (r->begin == 0) {
    if (now - r->first < 0.1 * r->task->seconds) return true;
    r->begin = now;
    r->cpu = bench_cpu_seconds();
  } else if (r->intervals < MOST_INTERVALS) {
    r->interval[r->intervals++] = now - r->last;
  }
  r->last = now;
  return now - r->begin < r->task->seconds;
}

static void tell(int out, const bench_client_result *result) {
  const ssize_t written = write(out, result, sizeof *result);
  (void)written;  // when nobody reads any more nobody wants it
}

static pb_status attach(pb_session *s, const bench_client_task *task, pb_error *err) {
  const pb_model *m = pb_session_model(s);
  char channel[32];
  snprintf(channel, sizeof channel, "bench-%d", task->number);
  const char *input = m->input[(size_t)task->number % m->nu].name;
  return pb_session_attach(s,
                           &(pb_attach_options){.channel = channel,
                                                .inputs = &input,
                                                .input_count = 1,
                                                .barrier = task->barrier,
                                                .guard = 60},
                           err);
}

static void work(void *context, int in, int out) {
  run r = {.task = context, .interval = malloc(MOST_INTERVALS * sizeof(double))};
  bench_client_result result = {0};
  pb_session *s = NULL;
  pb_error err = {0};
  pb_run_report report = {0};
  char order;
  if (!r.interval) bench_fail("out of memory");
  pb_status st =
      pb_session_open(&(pb_session_options){.domain = r.task->domain, .timeout = 10}, &s, &err);
  if (!st) st = attach(s, r.task, &err);
  if (!st) {
    tell(out, &result);
    if (read(in, &order, 1) != 1) return;
    st = pb_session_run(s, &(pb_run_options){.on_sample = on_sample, .context = &r, .stall = 20},
                        &report, &err);
    result.cpu = bench_cpu_seconds() - r.cpu;
  }
  if (st) {
    pb_error_format(&err, result.failure, sizeof result.failure);
  } else {
    pb_session_detach(s);
    result.steps = (double)r.intervals;
    result.seconds = r.last - r.begin;
    result.missed = (double)report.missed;
    bench_stats stats = bench_stats_of(r.interval, r.intervals);
    result.p50 = stats.median, result.p99 = stats.p99, result.max = stats.max;
  }
  tell(out, &result);
  pb_session_close(s);
}

static bench_client_result receive(bench_child *client, double seconds) {
  bench_client_result result;
  if (!bench_child_read(client, &result, sizeof result, seconds))
    bench_fail("a client gave no answer within %g s", seconds);
  if (result.failure[0]) bench_fail("a client: %s", result.failure);
  return result;
}

bench_child bench_client_start(const bench_client_task *task, int cpu) {
  bench_child client = bench_fork(work, (void *)task, cpu);
  receive(&client, 15);
  return client;
}

void bench_client_go(bench_child *client) {
  bench_child_order(client, 'g');
}

bench_client_result bench_client_wait(bench_child *client, double seconds) {
  bench_client_result result = receive(client, seconds);
  bench_child_end(client, 0);
  return result;
}
