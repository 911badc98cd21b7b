// What does one step of the plant cost, beside a dense state-space step of the same model by dgemv?
//
// A step is what the daemon does at every sample: all outputs, then the next state from all inputs.
// Roofline: flops and bytes a step needs at least, over the peaks of this core (peaks.h), each
// model beside the bandwidth of a buffer of its own size.
#include <math.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench.h"
#include "../server/fpenv.h"
#include "dense.h"
#include "model/step_kernel.h"
#include "peaks.h"
#include "plants.h"

enum { INPUT_PERIOD = 64, MOST_OUTPUTS = 256 };

typedef struct subject {
  const pb_model *model;
  pb_state *state;
  bench_dense dense;
  double *u;  // [INPUT_PERIOD][nu]
  double y[MOST_OUTPUTS], sum;
} subject;

static void step_ours(void *context, size_t repeats) {
  subject *s = context;
  for (size_t k = 0; k < repeats; k++) {
    pb_step_output(s->model, s->state, s->y);
    pb_step_advance(s->model, s->state, s->u + k % INPUT_PERIOD * s->model->nu);
    s->sum += s->y[0];
  }
}

static void step_dense(void *context, size_t repeats) {
  subject *s = context;
  for (size_t k = 0; k < repeats; k++) {
    bench_dense_output(&s->dense, s->y);
    bench_dense_advance(&s->dense, s->u + k % INPUT_PERIOD * s->dense.nu);
    s->sum += s->y[0];
  }
}

// Both must do the same work: after some steps from rest the outputs agree.
static void check_agreement(subject *s, const char *name) {
  size_t ny = s->model->ny;
  double ours[MOST_OUTPUTS], scale = 0, worst = 0;
  pb_state_reset(s->model, s->state);
  for (size_t k = 0; k < INPUT_PERIOD; k++) {
    pb_step_advance(s->model, s->state, s->u + k * s->model->nu);
    bench_dense_advance(&s->dense, s->u + k * s->model->nu);
    pb_step_output(s->model, s->state, ours);
    bench_dense_output(&s->dense, s->y);
    for (size_t o = 0; o < ny; o++) {
      scale = fmax(scale, fabs(s->y[o]));
      worst = fmax(worst, fabs(s->y[o] - ours[o]));
    }
  }
  if (!(worst <= 1e-9 * scale))
    bench_fail("%s: the dense step differs by %g of %g: not the same model", name, worst, scale);
}

static subject subject_open(const bench_plant *plant) {
  const pb_model *m = plant->model;
  subject s = {.model = m,
               .state = pb_state_new(m),
               .dense = bench_dense_of(m),
               .u = bench_memory(INPUT_PERIOD * m->nu, sizeof(double))};
  if (!s.state || m->ny > MOST_OUTPUTS) bench_fail("%s: too large", plant->name);
  for (size_t k = 0; k < INPUT_PERIOD * m->nu; k++) s.u[k] = sin(0.7 * (double)k);
  check_agreement(&s, plant->name);
  return s;
}

static void subject_close(subject *s) {
  free(s->state);
  free(s->u);
  bench_dense_free(&s->dense);
}

// What a step must compute and read, whatever the code: 2 × 2 blocks (others as they are), B, C, D,
// x read twice and written once.
static void needs(const pb_model *m, double *flops, double *bytes) {
  double values = (double)m->block_value[m->blocks],
         matrices = (double)(m->nx * m->nu + m->ny * (m->nx + m->nu));
  *flops = 2 * values - (double)m->nx + 2 * matrices;
  *bytes = 8 * (values + matrices + 3 * (double)m->nx + 2 * (double)m->nu + (double)m->ny);
}

static const bench_column step_columns[] = {
    {"states", "states", NULL, 4},
    {"inputs", "inputs", NULL, 2},
    {"outputs", "outputs", NULL, 2},
    {"ns", "one step", "ns", 4},
    {"dense_ns", "dense, dgemv", "ns", 4},
    {"ratio", "ratio", NULL, 3},
    {"ratio_q25", "1st quartile", NULL, 3},
    {"ratio_q75", "3rd quartile", NULL, 3},
    {"dense_threads_ns", "dense, all cores", "ns", 4},
};

static const bench_column roof_columns[] = {
    {"states", "states", NULL, 4},       {"flops", "flops", NULL, 5},
    {"bytes", "bytes", NULL, 6},         {"intensity", "flops/byte", NULL, 2},
    {"gflops", "reached", "Gflop/s", 3}, {"of_flops", "of mul and add", "%", 3},
    {"gbytes", "read", "GB/s", 3},       {"of_bandwidth", "of a buffer of that size", "%", 3},
};

typedef struct roofs {
  double fma, apart, memory;
} roofs;

typedef struct tables {
  bench_table *step, *roof, *growth;
  roofs peak;
} tables;

static double measure(bench *b, const tables *t, const bench_plant *plant) {
  const double seconds = bench_quick(b) ? 0.2 : 1.0;
  const pb_model *m = plant->model;
  subject s = subject_open(plant);
  bench_ratio r = bench_compare(step_ours, &s, step_dense, &s, seconds);
  bench_blas_threads((int)bench_cores());
  double threaded = bench_measure(step_dense, &s, seconds / 4).median;
  bench_blas_threads(1);
  double flops, bytes, ns = 1e9 * r.ours.median, states = (double)m->nx;
  needs(m, &flops, &bytes);
  double bandwidth = bench_read_bandwidth((size_t)bytes, seconds / 4) / 1e9;
  bench_row(t->step, plant->name,
            (double[]){states, (double)m->nu, (double)m->ny, ns, 1e9 * r.baseline.median,
                       r.ratio.median, r.ratio.q25, r.ratio.q75, 1e9 * threaded});
  bench_row(t->roof, plant->name,
            (double[]){states, flops, bytes, flops / bytes, flops / ns,
                       100e9 * flops / ns / t->peak.apart, bytes / ns,
                       100 * bytes / ns / bandwidth});
  if (m->nu == 12 && m->ny == 18)
    bench_row(t->growth, plant->name, (double[]){states, ns, 1e9 * r.baseline.median});
  if (!isfinite(s.sum)) bench_fail("%s: the outputs overflowed", plant->name);
  subject_close(&s);
  return r.ratio.median;
}

static const bench_column variant_columns[] = {
    {"states", "states", NULL, 4},     {"plain", "plain loops", "ns", 4},
    {"portable", "portable", "ns", 4}, {"avx2", "avx2", "ns", 4},
    {"avx512f", "avx512f", "ns", 4},
};

// The same step by each kernel that this processor has, and by the plain loops.
static void measure_variants(bench *b, bench_table *table, const bench_plant *plant) {
  const double seconds = bench_quick(b) ? 0.05 : 0.2;
  pb_model *m = plant->model;
  pb_step_pack *pack = m->step;
  const pb_step_kernel *kernel[3], *chosen = pack->kernel;
  const size_t kernels = pb_step_kernels(kernel);
  double value[] = {(double)m->nx, NAN, NAN, NAN, NAN};
  subject s = subject_open(plant);
  m->step = NULL;
  value[1] = 1e9 * bench_measure(step_ours, &s, seconds).median;
  m->step = pack;
  for (size_t k = 0; k < kernels; k++)
    for (size_t c = 2; c < sizeof value / sizeof *value; c++) {
      if (strcmp(kernel[k]->name, variant_columns[c].key) != 0) continue;
      pack->kernel = kernel[k];
      value[c] = 1e9 * bench_measure(step_ours, &s, seconds).median;
    }
  pack->kernel = chosen;
  bench_row(table, plant->name, value);
  subject_close(&s);
}

static const bench_column peak_columns[] = {{"value", "measured", NULL, 4}};

static roofs measure_roofs(bench *b) {
  const double seconds = bench_quick(b) ? 0.1 : 0.5;
  roofs r = {bench_peak_fma(seconds), bench_peak_multiply_add(seconds),
             bench_read_bandwidth((size_t)256 << 20, seconds)};
  bench_table *t = bench_table_add(b, "roofs", "Peaks of one core", "peak", 1, peak_columns);
  bench_row(t, "fused multiply-add (Gflop/s)", (double[]){r.fma / 1e9});
  bench_row(t, "multiply and add apart (Gflop/s)", (double[]){r.apart / 1e9});
  bench_row(t, "reading memory, 256 MiB (GB/s)", (double[]){r.memory / 1e9});
  bench_row(t, "reading 16 KiB (GB/s)", (double[]){bench_read_bandwidth(16384, seconds) / 1e9});
  return r;
}

// ---- the processor ------------------------------------------------------------------------------

// Shortest of several batches, seconds a step.
static double shortest(subject *s) {
  enum { BATCHES = 20, STEPS = 20000 };
  double best = INFINITY;
  for (int k = 0; k < BATCHES; k++) {
    const double since = bench_now();
    step_ours(s, STEPS);
    best = fmin(best, (bench_now() - since) / STEPS);
  }
  return best;
}

// A processor that shares its core with another one at work, perhaps another machine's, steps up to
// 1.5 times as slowly while products that wait for memory hardly notice: everything is measured on
// the one that is least disturbed.
static void choose_processor(bench *b, const bench_plants *plants) {
  const bench_plant *plant = bench_plants_find(plants, 48);
  cpu_set_t all, one;
  int best = -1, count = 0;
  double quickest = INFINITY, slowest = 0;
  if (!plant || sched_getaffinity(0, sizeof all, &all) != 0) return;
  subject s = subject_open(plant);
  for (int cpu = 0; cpu < CPU_SETSIZE; cpu++) {
    if (!CPU_ISSET(cpu, &all)) continue;
    CPU_ZERO(&one);
    CPU_SET(cpu, &one);
    if (sched_setaffinity(0, sizeof one, &one) != 0) continue;
    const double seconds = shortest(&s);
    count++;
    slowest = fmax(slowest, seconds);
    if (seconds >= quickest) continue;
    quickest = seconds;
    best = cpu;
  }
  subject_close(&s);
  if (best < 0) return;
  CPU_ZERO(&one);
  CPU_SET(best, &one);
  sched_setaffinity(0, sizeof one, &one);
  bench_note(
      b,
      "Measured on processor %d, the quickest of %d: a step of 48 states took %.0f ns there, "
      "%.0f ns on the slowest.",
      best, count, 1e9 * quickest, 1e9 * slowest);
}

int main(int argc, char **argv) {
  bench *b =
      bench_begin(argc, argv, "step",
                  "What does one step cost, beside a dense step of the same model by dgemv?");
  static const struct {
    size_t states;
    double ratio;
  } goal[] = {{48, 3}, {252, 10}, {2100, 100}};
  pb_flush_denormals();
  bench_plants plants = bench_plants_load(bench_quick(b) ? 1000 : 0);
  bench_blas_threads(1);
  choose_processor(b, &plants);
  tables t = {.peak = measure_roofs(b)};
  t.step = bench_table_add(b, "step", "One step, all inputs and outputs", "plant",
                           sizeof step_columns / sizeof *step_columns, step_columns);
  t.roof = bench_table_add(b, "roofline", "What a step needs, and how fast it gets it", "plant",
                           sizeof roof_columns / sizeof *roof_columns, roof_columns);
  t.growth =
      bench_table_add(b, "growth", "One step of the hexapods: 12 inputs, 18 outputs", "plant", 3,
                      (bench_column[]){step_columns[0], step_columns[3], step_columns[4]});
  for (size_t k = 0; k < plants.count; k++) {
    double ratio = measure(b, &t, &plants.item[k]);
    for (size_t g = 0; g < sizeof goal / sizeof *goal; g++) {
      char what[96];
      if (bench_plants_find(&plants, goal[g].states) != &plants.item[k]) continue;
      snprintf(what, sizeof what, "dense step / step at %zu states", plants.item[k].model->nx);
      bench_goal(b, what, ratio, BENCH_AT_LEAST, goal[g].ratio);
    }
  }
  bench_table *variants =
      bench_table_add(b, "variants", "One step by instruction set; all give the same bits", "plant",
                      sizeof variant_columns / sizeof *variant_columns, variant_columns);
  for (size_t k = 0; k < plants.count; k++) measure_variants(b, variants, &plants.item[k]);
  for (size_t g = 0; g < sizeof goal / sizeof *goal; g++)
    if (!bench_plants_find(&plants, goal[g].states))
      bench_note(b, "No plant with about %zu states was measured.", goal[g].states);
  bench_growth(b, t.growth, "states", "ns", 48);
  bench_growth(b, t.growth, "states", "dense_ns", 48);
  bench_plants_free(&plants);
  return bench_end(b);
}
