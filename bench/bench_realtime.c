// Does the plant keep its deadlines, beside a loop that does nothing but wake?
//
// The hexapods with two remote controllers at several rates. The same plant file serves at every
// rate: plant time runs faster or slower than the wall clock (--speed). The baseline is a bare
// cyclic loop: the same absolute deadlines, class and priority, no plant and no bus, just before.
#include <errno.h>
#include <math.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

#include "bench.h"
#include "bus_client.h"
#include "child.h"
#include "plants.h"
#include "toolout.h"

enum { PRIORITY = 80, CONTROLLERS = 2 };

// ---- the bare loop ------------------------------------------------------------------------------

typedef struct bare {
  double rate, seconds;
  double cycles, overruns, p50, p99, max;
  bool fifo;
} bare;

static bool ask_fifo(void) {
  const struct sched_param parameter = {.sched_priority = PRIORITY};
  mlockall(MCL_CURRENT | MCL_FUTURE);
  return sched_setscheduler(0, SCHED_FIFO, &parameter) == 0;
}

static int64_t clock_ns(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

static void bare_work(void *context, int in, int out) {
  (void)in;
  bare b = *(bare *)context;
  const size_t cycles = (size_t)(b.rate * b.seconds);
  double *late = bench_memory(cycles, sizeof *late);
  const double interval = 1e9 / b.rate;
  b.fifo = ask_fifo();
  const int64_t start = clock_ns();
  for (size_t k = 0; k < cycles; k++) {
    const int64_t deadline = start + llround((double)(k + 1) * interval);
    const struct timespec t = {deadline / 1000000000, deadline % 1000000000};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL) == EINTR) continue;
    const double behind = (double)(clock_ns() - deadline);
    late[k] = 1e-9 * behind;
    b.overruns += behind > interval;
  }
  bench_stats stats = bench_stats_of(late, cycles);
  b.cycles = (double)cycles, b.p50 = stats.median, b.p99 = stats.p99, b.max = stats.max;
  if (write(out, &b, sizeof b) != sizeof b) bench_fail("nobody reads");
}

static bench_child bare_start(bare *b) {
  return bench_fork(bare_work, b, -1);
}

static void bare_end(bench_child *worker, bare *b) {
  if (!bench_child_read(worker, b, sizeof *b, b->seconds + 20))
    bench_fail("the bare loop did not end");
  bench_child_end(worker, 0);
}

static bare measure_bare(double rate, double seconds) {
  bare b = {.rate = rate, .seconds = seconds};
  bench_child worker = bare_start(&b);
  bare_end(&worker, &b);
  return b;
}

// ---- the plant ----------------------------------------------------------------------------------

typedef struct served {
  double steps, overruns, late, dropped, step_p99, p50, p99, max, cpu;
  char obtained[160];
} served;

// The first view of a monitor may come before the first status.
static cJSON *status_of(const char *domain) {
  const char *argv[] = {PB_BIN "/plantbus-monitor", "--domain", domain, "--once", "--json", NULL};
  for (int k = 0; k < 10; k++) {
    cJSON *json = bench_tool_json(argv, -1, 20);
    if (json && isfinite(bench_json_number(json, "step"))) return json;
    cJSON_Delete(json);
  }
  bench_fail("the status could not be read");
}

static double growth_of(const cJSON *before, const cJSON *after, const char *path) {
  return bench_json_number(after, path) - bench_json_number(before, path);
}

// rate 0: in lockstep, standing still.
static bench_child daemon_start(const bench_plant *plant, double rate, uint32_t number) {
  char domain[16], speed[32], priority[16], line[512];
  snprintf(domain, sizeof domain, "%u", number);
  snprintf(speed, sizeof speed, "%.6g", rate / plant->model->sample_rate);
  snprintf(priority, sizeof priority, "%d", PRIORITY);
  const char *argv[] = {PB_BIN "/plantbusd",
                        "--plant",
                        plant->path,
                        "--domain",
                        domain,
                        "--mode",
                        rate > 0 ? "realtime" : "lockstep",
                        "--speed",
                        rate > 0 ? speed : "1",
                        "--rt-priority",
                        priority,
                        "--lock-memory",
                        NULL};
  bench_child daemon = bench_spawn(argv, -1);
  if (!bench_child_line(&daemon, "ready", line, 60)) bench_fail("the daemon did not start");
  return daemon;
}

static served measure_served(const bench_plant *plant, double rate, double seconds) {
  const uint32_t number = bench_domain();
  char domain[16];
  snprintf(domain, sizeof domain, "%u", number);
  bench_child daemon = daemon_start(plant, rate, number), client[CONTROLLERS];
  bench_client_task task[CONTROLLERS];
  for (int k = 0; k < CONTROLLERS; k++) {
    task[k] = (bench_client_task){number, k, false, seconds};
    client[k] = bench_client_start(&task[k], -1);
    bench_client_go(&client[k]);
  }
  const double cpu = bench_child_cpu(&daemon);
  cJSON *before = status_of(domain);
  for (int k = 0; k < CONTROLLERS; k++) bench_client_wait(&client[k], seconds + 40);
  cJSON *after = status_of(domain);
  served s = {.steps = growth_of(before, after, "step"),
              .overruns = growth_of(before, after, "overruns"),
              .late = growth_of(before, after, "late"),
              .dropped = growth_of(before, after, "dropped_samples"),
              .step_p99 = bench_json_number(after, "step_time/p99"),
              .p50 = bench_json_number(after, "jitter/p50"),
              .p99 = bench_json_number(after, "jitter/p99"),
              .max = bench_json_number(after, "jitter/max")};
  s.cpu = (bench_child_cpu(&daemon) - cpu) / s.steps;
  snprintf(s.obtained, sizeof s.obtained, "%s", bench_json_text(after, "real_time"));
  cJSON_Delete(before);
  cJSON_Delete(after);
  bench_child_end(&daemon, SIGTERM);
  return s;
}

// ---- the plant while it is changed --------------------------------------------------------------

typedef struct changing {
  double quiet, changed;  // overruns per step, before and while changes are compiled and swapped
  double bare_changed;    // of a bare loop while another daemon is changed alike
  double changes, seconds, step_max;
} changing;

// Another payload on the hexapod: every mode is solved for anew, and the motion carried over.
static double change_once(const char *domain, int k) {
  char patch[120];
  snprintf(patch, sizeof patch, "{\"patch\": {\"template\": {\"payload\": {\"mass\": %.12g}}}}",
           10 + 0.01 * (k + 1));
  const char *argv[] = {PB_BIN "/plantbus-request",
                        "--domain",
                        domain,
                        "--timeout",
                        "20",
                        "configure",
                        patch,
                        "--wait",
                        NULL};
  cJSON *json = bench_tool_json(argv, -1, 60);
  if (!json) bench_fail("a change was refused");
  const double seconds = bench_json_number(json, "compile_seconds");
  cJSON_Delete(json);
  return seconds;
}

// The same work on the same machine, but what is watched has neither plant nor memory in common
// with it: what is late here is the machine's doing.
static double measure_bare_changed(const bench_plant *plant, double rate, double seconds) {
  const uint32_t number = bench_domain();
  char domain[16];
  bare b = {.rate = rate, .seconds = seconds};
  snprintf(domain, sizeof domain, "%u", number);
  bench_child daemon = daemon_start(plant, 0, number), worker = bare_start(&b);
  const double since = bench_now();
  for (int k = 0; bench_now() - since < seconds; k++) change_once(domain, k);
  bare_end(&worker, &b);
  bench_child_end(&daemon, SIGTERM);
  return b.overruns / b.cycles;
}

static changing measure_changing(const bench_plant *plant, double rate, double seconds) {
  const uint32_t number = bench_domain();
  char domain[16];
  changing c = {.bare_changed = measure_bare_changed(plant, rate, seconds), .seconds = NAN};
  snprintf(domain, sizeof domain, "%u", number);
  bench_child daemon = daemon_start(plant, rate, number);
  cJSON *begin = status_of(domain);
  sleep((unsigned)ceil(seconds));
  cJSON *middle = status_of(domain);
  const double since = bench_now();
  while (c.changes < 2 || bench_now() - since < seconds) {
    const double took = change_once(domain, (int)c.changes++);
    if (isfinite(took)) c.seconds = fmax(c.seconds, took);
  }
  cJSON *end = status_of(domain);
  c.quiet = growth_of(begin, middle, "overruns") / growth_of(begin, middle, "step");
  c.changed = growth_of(middle, end, "overruns") / growth_of(middle, end, "step");
  c.step_max = bench_json_number(end, "jitter/max");
  cJSON_Delete(begin);
  cJSON_Delete(middle);
  cJSON_Delete(end);
  bench_child_end(&daemon, SIGTERM);
  return c;
}

static const bench_column changing_columns[] = {
    {"states", "states", NULL, 4},
    {"rate", "rate", "Hz", 6},
    {"quiet", "late steps, quiet", "‰", 2},
    {"changed", "while changed", "‰", 2},
    {"bare_changed", "bare loop, another daemon changed", "‰", 2},
    {"changes", "changes", NULL, 3},
    {"compile", "longest compilation", "ms", 3},
    {"jitter", "jitter max", "µs", 3},
};

static void measure_changes(bench *b, bench_table *t, const bench_plant *plant, double rate) {
  char name[96];
  const changing c = measure_changing(plant, rate, bench_quick(b) ? 1 : 4);
  snprintf(name, sizeof name, "%zu states, %g kHz", plant->model->nx, rate / 1000);
  bench_row(t, name,
            (double[]){(double)plant->model->nx, rate, 1e3 * c.quiet, 1e3 * c.changed,
                       1e3 * c.bare_changed, c.changes, 1e3 * c.seconds, 1e6 * c.step_max});
}

// ---- all of it ----------------------------------------------------------------------------------

static const bench_column columns[] = {
    {"states", "states", NULL, 4},        {"rate", "rate", "Hz", 6},
    {"overruns", "overruns", "‰", 2},     {"bare_overruns", "bare loop", "‰", 2},
    {"p50", "jitter p50", "µs", 3},       {"bare_p50", "bare p50", "µs", 3},
    {"p99", "jitter p99", "µs", 3},       {"bare_p99", "bare p99", "µs", 3},
    {"max", "jitter max", "µs", 3},       {"bare_max", "bare max", "µs", 3},
    {"step", "one step, p99", "µs", 3},   {"late", "late commands", "‰", 2},
    {"dropped", "not published", "‰", 2}, {"cpu", "CPU/step", "µs", 3},
};

static void measure(bench *b, bench_table *t, const bench_plant *plant, double rate, bool *said) {
  const double seconds = bench_quick(b) ? 1 : 3;
  const bare loop = measure_bare(rate, seconds);
  const served s = measure_served(plant, rate, seconds);
  char name[96];
  snprintf(name, sizeof name, "%zu states, %g kHz", plant->model->nx, rate / 1000);
  bench_row(t, name,
            (double[]){(double)plant->model->nx, rate, 1e3 * s.overruns / s.steps,
                       1e3 * loop.overruns / loop.cycles, 1e6 * s.p50, 1e6 * loop.p50, 1e6 * s.p99,
                       1e6 * loop.p99, 1e6 * s.max, 1e6 * loop.max, 1e6 * s.step_p99,
                       1e3 * s.late / s.steps, 1e3 * s.dropped / s.steps, 1e6 * s.cpu});
  if (!*said)
    bench_note(b, "The bare loop ran %s; the daemon tells of its step thread: %s.",
               loop.fifo ? "with SCHED_FIFO and locked memory" : "without SCHED_FIFO (not allowed)",
               s.obtained);
  *said = true;
}

int main(int argc, char **argv) {
  bench *b = bench_begin(argc, argv, "realtime",
                         "Does the plant keep its deadlines, beside a loop that only wakes?");
  static const double rates[] = {1000, 5000, 10000, 20000};
  static const size_t sizes[] = {252, 2100};
  bool said = false;
  bench_loopback();
  bench_plants plants = bench_plants_load(bench_quick(b) ? 1000 : 0);
  bench_table *t = bench_table_add(b, "realtime", "Deadlines, two remote controllers", "case",
                                   sizeof columns / sizeof *columns, columns);
  for (size_t k = 0; k < sizeof sizes / sizeof *sizes; k++) {
    const bench_plant *plant = bench_plants_find(&plants, sizes[k]);
    if (!plant) {
      bench_note(b, "No plant with about %zu states was measured.", sizes[k]);
      continue;
    }
    for (size_t r = 0; r < sizeof rates / sizeof *rates; r++) measure(b, t, plant, rates[r], &said);
  }
  bench_table *changes =
      bench_table_add(b, "changing", "Late steps while the plant is changed", "case",
                      sizeof changing_columns / sizeof *changing_columns, changing_columns);
  for (size_t k = 0; k < sizeof sizes / sizeof *sizes; k++) {
    const bench_plant *plant = bench_plants_find(&plants, sizes[k]);
    if (!plant) continue;
    measure_changes(b, changes, plant, 1000);
    measure_changes(b, changes, plant, 10000);
  }
  bench_note(b, "Jitter is from a deadline to the begin of its step; the daemon's is of its "
                "histogram, in bins of half an octave, from its start on.");
  bench_growth(b, t, "rate", "p99", 0);
  bench_growth(b, t, "rate", "bare_p99", 0);
  bench_plants_free(&plants);
  return bench_end(b);
}
