// The roofs of the roofline: see peaks.h.
//
// The same loops compiled for several instruction sets, each with vectors and a number of
// accumulators that fit its registers: more than latency × units asks for. This file alone is
// compiled with contraction: a product and a sum may be fused here.
#include "peaks.h"

#include <math.h>
#include <stdlib.h>

enum { ROUND = 64 };

typedef double v2 __attribute__((vector_size(16), may_alias));
typedef double v4 __attribute__((vector_size(32), may_alias));
typedef double v8 __attribute__((vector_size(64), may_alias));

typedef struct variant {
  size_t lanes, chains;
  // `rounds` × ROUND times: x ← x·a + b in each lane of each chain, fused where the target can.
  void (*fma)(double *x, size_t rounds);
  // The same number of times: half of the chains are multiplied, half added to. A step's
  // multiplications and additions need not wait for each other: what counts is the number of units.
  void (*apart)(double *x, size_t rounds);
  double (*read)(const double *data, size_t count);  // count: a multiple of 64
} variant;

#define VARIANT(name, vector, count, attribute)                                               \
  attribute static void fma_##name(double *p, size_t n) {                                     \
    vector x[count];                                                                          \
    for (int k = 0; k < count; k++) x[k] = ((vector *)p)[k];                                  \
    for (size_t left = n * ROUND; left; left--) {                                             \
      _Pragma("GCC unroll 24") for (int k = 0; k < count; k++) x[k] = x[k] * 0.999999 + 1e-6; \
    }                                                                                         \
    for (int k = 0; k < count; k++) ((vector *)p)[k] = x[k];                                  \
  }                                                                                           \
  attribute static void apart_##name(double *p, size_t n) {                                   \
    vector x[count];                                                                          \
    for (int k = 0; k < count; k++) x[k] = ((vector *)p)[k];                                  \
    for (size_t left = n * ROUND; left; left--) {                                             \
      _Pragma("GCC unroll 24") for (int k = 0; k < count; k += 2) x[k] *= 0.999999,           \
          x[k + 1] += 1e-6;                                                                   \
    }                                                                                         \
    for (int k = 0; k < count; k++) ((vector *)p)[k] = x[k];                                  \
  }                                                                                           \
  attribute static double read_##name(const double *p, size_t n) {                            \
    enum { LANES = sizeof(vector) / sizeof(double) };                                         \
    vector sum[8] = {0};                                                                      \
    for (size_t k = 0; k < n; k += 8 * LANES)                                                 \
      for (int l = 0; l < 8; l++) sum[l] += *(const vector *)(p + k + l * LANES);             \
    double all = 0;                                                                           \
    for (int l = 0; l < 8; l++)                                                               \
      for (int e = 0; e < LANES; e++) all += sum[l][e];                                       \
    return all;                                                                               \
  }                                                                                           \
  static const variant variant_##name = {sizeof(vector) / sizeof(double), count, fma_##name,  \
                                         apart_##name, read_##name};

VARIANT(portable, v2, 12, )
#if defined __x86_64__
VARIANT(avx2, v4, 12, __attribute__((target("avx2,fma"))))
VARIANT(avx512, v8, 24, __attribute__((target("avx512f,fma"))))
#endif

static const variant *best(void) {
#if defined __x86_64__
  if (__builtin_cpu_supports("avx512f")) return &variant_avx512;
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return &variant_avx2;
#endif
  return &variant_portable;
}

static void work_fma(void *context, size_t repeats) {
  best()->fma(context, repeats);
}

static void work_apart(void *context, size_t repeats) {
  best()->apart(context, repeats);
}

// Operations per second: `each` of every lane in a round.
static double flops(bench_function *work, double each, double seconds) {
  const size_t numbers = best()->lanes * best()->chains;
  double *x = bench_memory(numbers, sizeof *x);
  for (size_t k = 0; k < numbers; k++) x[k] = 1 + 0.01 * (double)k;
  const double time = bench_measure(work, x, seconds).median;
  free(x);
  return each * ROUND * (double)numbers / time;
}

double bench_peak_fma(double seconds) {
  return flops(work_fma, 2, seconds);
}

double bench_peak_multiply_add(double seconds) {
  return flops(work_apart, 1, seconds);
}

typedef struct buffer {
  size_t count;
  double *data;
  double sum;
} buffer;

static void work_read(void *context, size_t repeats) {
  buffer *b = context;
  for (size_t n = 0; n < repeats; n++) {
    b->sum += best()->read(b->data, b->count);
    __asm__ volatile("" ::: "memory");  // each pass reads anew
  }
}

double bench_read_bandwidth(size_t bytes, double seconds) {
  buffer b = {.count = (bytes / sizeof(double) + 63) / 64 * 64};
  b.data = bench_memory(b.count, sizeof(double));
  const double time = bench_measure(work_read, &b, seconds).median;
  if (!isfinite(b.sum)) bench_fail("reading memory gave nonsense");
  free(b.data);
  return (double)(b.count * sizeof(double)) / time;
}
