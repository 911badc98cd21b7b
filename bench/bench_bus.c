// How many steps a second go over the bus, beside the middleware's own ping-pong?
//
// Lockstep with the hexapod: sample out, command back, one step a round trip. The baseline is
// `ddsperf ping/pong` with a payload of the mean size of sample and command, in turns with ours;
// with several clients there are as many pongs, of which each ping awaits all. Then what needs no
// round trip a step: blocks, and controllers inside the step.
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench.h"
#include "bus_client.h"
#include "child.h"
#include "plantbus.h"
#include "session.h"

enum { MOST_CLIENTS = 4, MOST_ROUNDS = 9 };

static const char hexapod[] = PB_CONFIG "/plants/nano-hexapod.json";

static bench_child start_daemon(uint32_t domain, const char *mode, int cpu) {
  char number[16], line[512];
  snprintf(number, sizeof number, "%u", domain);
  const char *argv[] = {
      PB_BIN "/plantbusd", "--plant", hexapod, "--domain", number, "--mode", mode, NULL};
  bench_child daemon = bench_spawn(argv, cpu);
  if (!bench_child_line(&daemon, "ready", line, 20)) bench_fail("the daemon did not start");
  return daemon;
}

// ---- ping-pong ----------------------------------------------------------------------------------

typedef struct ping {
  double rate, cpu;  // round trips a second; CPU seconds a round trip, both sides
  double p50, p99, max;
} ping;

// ddsperf tells half round trips in microseconds, and their number, every second.
static bool parse_ping(const char *line, ping *p) {
  const char *p50 = strstr(line, "50% "), *p99 = strstr(line, "99% "), *max = strstr(line, "max "),
             *count = strstr(line, "cnt ");
  if (!p50 || !p99 || !max || !count) return false;
  p->p50 = 2e-6 * strtod(p50 + 4, NULL);
  p->p99 = 2e-6 * strtod(p99 + 4, NULL);
  p->max = 2e-6 * strtod(max + 4, NULL);
  p->rate = strtod(count + 4, NULL);
  return true;
}

// The second full second: the first is of finding each other.
static ping measure_ping(int clients, int cpu) {
  char domain[16], size[16], line[512];
  ping p = {0};
  snprintf(domain, sizeof domain, "%u", bench_domain());
  snprintf(size, sizeof size, "%zu", (sizeof(plantbus_Sample) + sizeof(plantbus_Command)) / 2);
  const char *pong[] = {"ddsperf", "-i", domain, "pong", NULL};
  const char *pinging[] = {"ddsperf", "-i", domain, "-TKS", "ping", "size", size, NULL};
  bench_child a[MOST_CLIENTS], b = bench_spawn(pinging, cpu);
  for (int k = 0; k < clients; k++) a[k] = bench_spawn(pong, cpu);
  double cpu_used = NAN;
  for (int second = 0; second < 2; second++) {
    for (int k = 0; k < clients; k++)  // a line a pong
      if (!bench_child_line(&b, "cnt ", line, 15)) bench_fail("ddsperf told nothing");
    double now = bench_child_cpu(&b);
    for (int k = 0; k < clients; k++) now += bench_child_cpu(&a[k]);
    cpu_used = second ? now - cpu_used : now;
  }
  if (!parse_ping(line, &p)) bench_fail("ddsperf: not understood: %s", line);
  p.cpu = cpu_used / p.rate;
  bench_child_end(&b, SIGTERM);
  for (int k = 0; k < clients; k++) bench_child_end(&a[k], SIGTERM);
  return p;
}

// ---- lockstep -----------------------------------------------------------------------------------

typedef struct trips {
  double rate, daemon_cpu, client_cpu;  // CPU seconds a step; of all clients
  double p50, p99, max;
} trips;

static trips measure_lockstep(int clients, int cpu, double seconds) {
  const uint32_t domain = bench_domain();
  bench_child daemon = start_daemon(domain, "lockstep", cpu), client[MOST_CLIENTS];
  bench_client_task task[MOST_CLIENTS];
  for (int k = 0; k < clients; k++) {
    task[k] = (bench_client_task){domain, k, true, seconds};
    client[k] = bench_client_start(&task[k], cpu);
  }
  const double cpu_before = bench_child_cpu(&daemon);
  for (int k = 0; k < clients; k++) bench_client_go(&client[k]);
  trips t = {0};
  for (int k = 0; k < clients; k++) {
    const bench_client_result r = bench_client_wait(&client[k], seconds + 20);
    if (k == 0)
      t = (trips){.rate = r.steps / r.seconds,
                  .daemon_cpu = (bench_child_cpu(&daemon) - cpu_before) / (1.1 * r.steps),
                  .p50 = r.p50,
                  .p99 = r.p99,
                  .max = r.max};
    t.client_cpu += r.cpu / r.steps;
  }
  bench_child_end(&daemon, SIGTERM);
  return t;
}

static const bench_column lockstep_columns[] = {
    {"clients", "clients", NULL, 2},
    {"rate", "steps", "1/s", 4},
    {"ping_rate", "ddsperf", "1/s", 4},
    {"ratio", "ratio", NULL, 3},
    {"p50", "p50", "µs", 3},
    {"p99", "p99", "µs", 3},
    {"max", "max", "µs", 3},
    {"ping_p50", "ddsperf p50", "µs", 3},
    {"ping_p99", "ddsperf p99", "µs", 3},
    {"ping_max", "ddsperf max", "µs", 3},
    {"daemon_cpu", "CPU/step, daemon", "µs", 3},
    {"client_cpu", "CPU/step, clients", "µs", 3},
    {"ping_cpu", "CPU/trip, ddsperf", "µs", 3},
};

static double median_of(double *value, int count) {
  return bench_stats_of(value, (size_t)count).median;
}

// Turns of ddsperf and ours; the ratio is of neighbours.
static double measure_rounds(bench *b, bench_table *table, int clients, int cpu, bool compared) {
  const int rounds = bench_quick(b) ? 2 : clients == 1 ? 7 : 3;
  const double seconds = bench_quick(b) ? 0.8 : 1;
  double rate[MOST_ROUNDS], ping_rate[MOST_ROUNDS], ratio[MOST_ROUNDS];
  ping p = {NAN, NAN, NAN, NAN, NAN};
  trips t = {0};
  char name[64];
  for (int k = 0; k < rounds; k++) {
    if (compared) p = measure_ping(clients, cpu);
    t = measure_lockstep(clients, cpu, seconds);
    rate[k] = t.rate;
    ping_rate[k] = p.rate;
    ratio[k] = t.rate / p.rate;
  }
  snprintf(name, sizeof name, "%d client%s, %s", clients, clients > 1 ? "s" : "",
           cpu < 0 ? "all cores" : "one core");
  const double middle = compared ? median_of(ratio, rounds) : NAN;
  bench_row(table, name,
            (double[]){clients, median_of(rate, rounds),
                       compared ? median_of(ping_rate, rounds) : NAN, middle, 1e6 * t.p50,
                       1e6 * t.p99, 1e6 * t.max, 1e6 * p.p50, 1e6 * p.p99, 1e6 * p.max,
                       1e6 * t.daemon_cpu, 1e6 * t.client_cpu, 1e6 * p.cpu});
  return middle;
}

static void measure_trips(bench *b) {
  const bool compared = bench_program_exists("ddsperf");
  bench_table *t =
      bench_table_add(b, "lockstep", "Lockstep with the hexapod, one step a round trip", "case",
                      sizeof lockstep_columns / sizeof *lockstep_columns, lockstep_columns);
  const double one = measure_rounds(b, t, 1, 0, compared);
  measure_rounds(b, t, 2, 0, compared);
  measure_rounds(b, t, 4, 0, compared);
  const double spread = bench_cores() > 1 ? measure_rounds(b, t, 1, -1, compared) : NAN;
  if (compared) {
    bench_goal(b, "round trips, 1 client / ddsperf, one core", one, BENCH_AT_LEAST, 0.95);
    if (bench_cores() > 1)
      bench_goal(b, "round trips, 1 client / ddsperf, all cores", spread, BENCH_AT_LEAST, 0.95);
  } else {
    bench_note(b, "ddsperf is not installed (cyclonedds-tools): no baseline for the bus.");
  }
  bench_growth(b, t, "clients", "daemon_cpu", 0);
  bench_note(b, "ddsperf carries %zu octets each way: the mean of sample (%zu) and command (%zu).",
             (sizeof(plantbus_Sample) + sizeof(plantbus_Command)) / 2, sizeof(plantbus_Sample),
             sizeof(plantbus_Command));
}

// ---- without a round trip a step ----------------------------------------------------------------

typedef struct exchange {
  double rate;  // steps a second
  char failure[400];
} exchange;

typedef struct fast_task {
  uint32_t domain, steps;  // steps of one exchange
  bool hosted;
  double seconds;
} fast_task;

static pb_status run_blocks(pb_session *s, const fast_task *task, double *rate, pb_error *err) {
  const uint32_t input[6] = {0, 1, 2, 3, 4, 5};
  double *values = bench_memory(6 * task->steps, sizeof *values), steps = 0;
  for (uint32_t k = 0; k < 6 * task->steps; k++) values[k] = 1e-3 * (k % 11);
  pb_status st = PB_OK;
  const double begin = bench_now();
  while (!st && bench_now() - begin < task->seconds) {
    pb_block block;
    st = pb_session_block(s, input, 6, values, task->steps, 10, &block, err);
    if (st) break;
    pb_block_clear(&block);
    steps += task->steps;
  }
  *rate = steps / (bench_now() - begin);
  free(values);
  return st;
}

static const char controller[] =
    "{\"channel\": \"iff\", \"type\": \"iff\", \"gain\": 400,"
    " \"inputs\": [\"Va1\", \"Va2\", \"Va3\", \"Va4\", \"Va5\", \"Va6\"],"
    " \"outputs\": [\"Vs1\", \"Vs2\", \"Vs3\", \"Vs4\", \"Vs5\", \"Vs6\"]}";

static pb_status run_hosted(pb_session *s, const fast_task *task, double *rate, pb_error *err) {
  char body[32];
  double steps = 0;
  snprintf(body, sizeof body, "{\"n\": %u}", task->steps);
  pb_status st = pb_session_request(s, "host_controller", controller, 5, NULL, err);
  const double begin = bench_now();
  while (!st && bench_now() - begin < task->seconds) {
    pb_answer answer = {0};
    pb_session_event event;
    st = pb_session_ask(s, "step", body, 10, &answer, err);
    if (!st && answer.accepted)
      st = pb_session_wait_event(s, "stepped", answer.event, 30, NULL, &event, err);
    pb_answer_clear(&answer);
    steps += task->steps;
  }
  *rate = steps / (bench_now() - begin);
  return st;
}

static void exchange_work(void *context, int in, int out) {
  (void)in;
  const fast_task *task = context;
  exchange e = {0};
  pb_session *s = NULL;
  pb_error err = {0};
  pb_status st =
      pb_session_open(&(pb_session_options){.domain = task->domain, .timeout = 10}, &s, &err);
  if (!st) st = (task->hosted ? run_hosted : run_blocks)(s, task, &e.rate, &err);
  if (st) pb_error_format(&err, e.failure, sizeof e.failure);
  if (write(out, &e, sizeof e) != sizeof e) bench_fail("nobody reads");
  pb_session_close(s);
}

static double measure_exchange(fast_task task) {
  exchange e;
  task.domain = bench_domain();
  bench_child daemon = start_daemon(task.domain, "paused", -1);
  bench_child worker = bench_fork(exchange_work, &task, -1);
  if (!bench_child_read(&worker, &e, sizeof e, task.seconds + 60)) bench_fail("no answer in time");
  if (e.failure[0]) bench_fail("%s", e.failure);
  bench_child_end(&worker, 0);
  bench_child_end(&daemon, SIGTERM);
  return e.rate;
}

static const bench_column fast_columns[] = {
    {"steps", "steps an exchange", NULL, 6},
    {"rate", "steps", "1/s", 4},
    {"us", "one step", "µs", 3},
};

static void measure_fast(bench *b) {
  const double seconds = bench_quick(b) ? 0.5 : 2;
  bench_table *t = bench_table_add(b, "exchange", "Many steps an exchange, hexapod", "case",
                                   sizeof fast_columns / sizeof *fast_columns, fast_columns);
  static const struct {
    const char *name;
    uint32_t steps;
    bool hosted;
  } cases[] = {{"blocks of 10", 10, false},
               {"blocks of 100", 100, false},
               {"blocks of 1000", 1000, false},
               {"hosted IFF, 6 loops", 100000, true}};
  for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
    const double rate = measure_exchange((fast_task){0, cases[k].steps, cases[k].hosted, seconds});
    bench_row(t, cases[k].name, (double[]){cases[k].steps, rate, 1e6 / rate});
  }
}

int main(int argc, char **argv) {
  bench *b = bench_begin(argc, argv, "bus",
                         "How many steps a second go over the bus, beside ddsperf's ping-pong?");
  bench_loopback();
  measure_trips(b);
  measure_fast(b);
  return bench_end(b);
}
