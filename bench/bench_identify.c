// How long must an experiment on the hexapod be for a frequency response within 1 %?
//
// By kind of excitation: all six actuators, all outputs, 5 to 500 Hz; the experiment is made longer
// until the largest difference from the exact sampled response, over all lines and channels, is
// below 1 % of it (magnitude, and phase as an arc), or a limit is reached. Blocks of steps; for the
// multisine also step by step over the bus.
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench.h"
#include "child.h"
#include "toolout.h"

static const char hexapod[] = PB_CONFIG "/plants/nano-hexapod.json";
static const double wanted = 1;  // percent

typedef struct attempt {
  const char *resolution, *averages;
} attempt;

typedef struct kind {
  const char *name;
  attempt attempt[6];  // ascending length; ends with NULL
} kind;

static const kind kinds[] = {
    {"multisine", {{"4", "2"}, {"2", "2"}, {"1", "2"}, {"0.5", "2"}, {"0.25", "2"}, {0}}},
    {"periodic-noise", {{"4", "2"}, {"2", "2"}, {"1", "2"}, {"0.5", "2"}, {"0.25", "2"}, {0}}},
    {"chirp", {{"4", "2"}, {"2", "2"}, {"1", "2"}, {"0.5", "2"}, {"0.25", "2"}, {0}}},
    {"noise", {{"0.5", "10"}, {"0.1", "10"}, {"0.1", "40"}, {0}}},
};

typedef struct outcome {
  double error, experiment, wall, total;  // %, s of plant time, s of the exchange, s of the tool
  double used;                            // part of the lines that the comparison uses
} outcome;

static outcome identify(const char *domain, const char *excitation, const attempt *a, bool blocks,
                        int cpu) {
  const char *argv[] = {PB_BIN "/plantbus-identify",
                        "--domain",
                        domain,
                        "--json",
                        "--input=Va1,Va2,Va3,Va4,Va5,Va6",
                        "--band=5,500",
                        "--excitation",
                        excitation,
                        "--resolution",
                        a->resolution,
                        "--averages",
                        a->averages,
                        blocks ? "--blocks" : NULL,
                        NULL};
  const double begun = bench_now();
  cJSON *json = bench_tool_json(argv, cpu, 120);
  if (!json) bench_fail("%s could not be identified", excitation);
  const double magnitude = bench_json_number(json, "agreement/magnitude_error_percent"),
               phase = bench_json_number(json, "agreement/phase_error_degree");
  outcome o = {.error = fmax(magnitude, phase * M_PI / 180 * 100),
               .experiment = bench_json_number(json, "experiment/samples") /
                             bench_json_number(json, "sample_rate"),
               .wall = bench_json_number(json, "experiment/seconds"),
               .total = bench_now() - begun,
               .used = bench_json_number(json, "agreement/used") /
                       bench_json_number(json, "agreement/lines")};
  cJSON_Delete(json);
  return o;
}

static const bench_column columns[] = {
    {"error", "largest error", "%", 3},       {"resolution", "lines every", "Hz", 3},
    {"averages", "averages", NULL, 3},        {"experiment", "experiment", "s", 4},
    {"wall", "wall, exchange", "s", 3},       {"total", "wall, whole tool", "s", 3},
    {"faster", "faster than plant", NULL, 3}, {"used", "lines used", "%", 4},
};

static void add_row(bench_table *t, const char *name, const attempt *a, const outcome *o) {
  bench_row(t, name,
            (double[]){o->error, atof(a->resolution), atof(a->averages), o->experiment, o->wall,
                       o->total, o->experiment / o->wall, 100 * o->used});
}

// The shortest that is within 1 %, else the longest. All attempts go into the table of lengths.
static void measure_kind(bench *b, bench_table *t, bench_table *lengths, const char *domain,
                         const kind *k) {
  const attempt *best = NULL, *a = k->attempt;
  outcome o = {0};
  for (; a->resolution; a++) {
    if (bench_quick(b) && o.experiment > 50) break;
    best = a;
    o = identify(domain, k->name, a, true, -1);
    bench_row(lengths, k->name, (double[]){o.experiment, o.error, o.wall, o.total});
    if (o.error <= wanted) break;
  }
  add_row(t, k->name, best, &o);
  if (o.error > wanted)
    bench_note(b, "%s: 1 %% was not reached: %.3g %% after %.0f s.", k->name, o.error,
               o.experiment);
  if (bench_quick(b) || strcmp(k->name, "multisine") != 0 || o.error > wanted) return;
  o = identify(domain, k->name, best, false, 0);
  add_row(t, "multisine, step by step", best, &o);
}

// The same kind at longer and longer periods: what an experiment costs with its length.
static void measure_growth(bench *b, const char *domain, const bench_column *column) {
  static const attempt lengths[] = {{"4", "2"}, {"0.5", "2"}, {"0.125", "2"}, {"0.05", "2"}};
  bench_table *t =
      bench_table_add(b, "growth", "Multisine, longer and longer", "lines every", 4, column);
  for (int k = 0; k < (bench_quick(b) ? 3 : 4); k++) {
    const outcome o = identify(domain, "multisine", &lengths[k], true, -1);
    char name[32];
    snprintf(name, sizeof name, "%s Hz", lengths[k].resolution);
    bench_row(t, name, (double[]){o.experiment, o.error, o.wall, o.total});
  }
  bench_growth(b, t, "experiment", "wall", 0);
  bench_growth(b, t, "experiment", "total", 0);
}

int main(int argc, char **argv) {
  bench *b = bench_begin(argc, argv, "identify",
                         "How long must an experiment be for a frequency response within 1 %?");
  static const bench_column length_columns[] = {{"experiment", "experiment", "s", 4},
                                                {"error", "largest error", "%", 3},
                                                {"wall", "wall, exchange", "s", 3},
                                                {"total", "wall, whole tool", "s", 3}};
  char domain[16], line[512];
  bench_loopback();
  snprintf(domain, sizeof domain, "%u", bench_domain());
  const char *daemon_argv[] = {PB_BIN "/plantbusd", "--plant", hexapod, "--domain", domain, NULL};
  // On one processor with the step-by-step client: neither waits for the other's to wake up.
  bench_child daemon = bench_spawn(daemon_argv, 0);
  if (!bench_child_line(&daemon, "ready", line, 20)) bench_fail("the daemon did not start");
  bench_table *t = bench_table_add(b, "identify", "The shortest experiment within 1 %",
                                   "excitation", sizeof columns / sizeof *columns, columns);
  bench_table *lengths =
      bench_table_add(b, "lengths", "Experiments tried", "excitation", 4, length_columns);
  for (size_t k = 0; k < sizeof kinds / sizeof *kinds; k++)
    measure_kind(b, t, lengths, domain, &kinds[k]);
  measure_growth(b, domain, length_columns);
  bench_child_end(&daemon, SIGTERM);
  return bench_end(b);
}
