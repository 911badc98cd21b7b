// Repeated measurement: see bench.h.
//
// A sample is a batch of repeats that lasts long enough for the clock; the batch size is found by
// doubling. The median of the samples is told: on a machine that does other things the mean is
// theirs, and the minimum is luck.
#include <math.h>
#include <stdlib.h>
#include <time.h>

#include "bench.h"

static const double sample_seconds = 0.5e-3;
enum { LEAST_SAMPLES = 5, MOST_SAMPLES = 20000 };

static double read_clock(clockid_t clock) {
  struct timespec t;
  clock_gettime(clock, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

double bench_now(void) {
  return read_clock(CLOCK_MONOTONIC);
}

double bench_cpu_seconds(void) {
  return read_clock(CLOCK_PROCESS_CPUTIME_ID);
}

static int ascending(const void *a, const void *b) {
  double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

// Quantile of sorted values, linear between neighbours.
static double quantile(const double *value, size_t count, double q) {
  double at = q * (double)(count - 1);
  size_t k = (size_t)at;
  if (k + 1 >= count) return value[count - 1];
  return value[k] + (at - (double)k) * (value[k + 1] - value[k]);
}

bench_stats bench_stats_of(double *value, size_t count) {
  if (!count) return (bench_stats){0, NAN, NAN, NAN, NAN, NAN, NAN, NAN};
  qsort(value, count, sizeof *value, ascending);
  double sum = 0;
  for (size_t k = 0; k < count; k++) sum += value[k];
  return (bench_stats){.count = count,
                       .min = value[0],
                       .q25 = quantile(value, count, 0.25),
                       .median = quantile(value, count, 0.5),
                       .q75 = quantile(value, count, 0.75),
                       .p99 = quantile(value, count, 0.99),
                       .max = value[count - 1],
                       .mean = sum / (double)count};
}

static double time_batch(bench_function *work, void *context, size_t repeats) {
  double begun = bench_now();
  work(context, repeats);
  return (bench_now() - begun) / (double)repeats;
}

// Repeats that make a batch long enough. Also warms the caches up.
static size_t batch_size(bench_function *work, void *context) {
  size_t repeats = 1;
  while (time_batch(work, context, repeats) * (double)repeats < sample_seconds) repeats *= 2;
  return repeats;
}

bench_stats bench_measure(bench_function *work, void *context, double seconds) {
  double *value = bench_memory(MOST_SAMPLES, sizeof *value);
  size_t repeats = batch_size(work, context), count = 0;
  double end = bench_now() + seconds;
  while (count < MOST_SAMPLES && (count < LEAST_SAMPLES || bench_now() < end))
    value[count++] = time_batch(work, context, repeats);
  bench_stats stats = bench_stats_of(value, count);
  free(value);
  return stats;
}

bench_ratio bench_compare(bench_function *ours, void *our_context, bench_function *baseline,
                          void *baseline_context, double seconds) {
  double *a = bench_memory(3 * MOST_SAMPLES, sizeof *a), *b = a + MOST_SAMPLES,
         *ratio = b + MOST_SAMPLES;
  size_t our_repeats = batch_size(ours, our_context),
         repeats = batch_size(baseline, baseline_context), count = 0;
  double end = bench_now() + seconds;
  while (count < MOST_SAMPLES && (count < LEAST_SAMPLES || bench_now() < end)) {
    a[count] = time_batch(ours, our_context, our_repeats);
    b[count] = time_batch(baseline, baseline_context, repeats);
    ratio[count] = b[count] / a[count];
    count++;
  }
  bench_ratio result = {bench_stats_of(a, count), bench_stats_of(b, count),
                        bench_stats_of(ratio, count)};
  free(a);
  return result;
}
