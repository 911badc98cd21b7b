// Times on the wall clock in bins of half an octave: bin i counts 16 ns·2^(i/2) … 16
// ns·2^((i+1)/2), the ends also what lies beyond. One thread adds, any thread reads; no lock, no
// allocation.
#ifndef PB_HISTOGRAM_H
#define PB_HISTOGRAM_H

#include <stdatomic.h>
#include <stdint.h>

enum { PB_HISTOGRAM_BINS = 64 };

typedef struct pb_histogram {
  atomic_uint_fast64_t count, sum_ns, largest_ns, bin[PB_HISTOGRAM_BINS];
} pb_histogram;

static inline int pb_histogram_bin(int64_t ns) {
  if (ns < 16) return 0;
  const int octave = 63 - __builtin_clzll((unsigned long long)ns);
  const uint64_t mantissa =
      octave > 31 ? (uint64_t)ns >> (octave - 31) : (uint64_t)ns << (31 - octave);
  const int bin = 2 * (octave - 4) + (mantissa >= 3037000500u);  // 2^31.5
  return bin < PB_HISTOGRAM_BINS ? bin : PB_HISTOGRAM_BINS - 1;
}

// One writer: a load and a store are enough, and cheaper than a locked addition. [rt]
static inline void pb_histogram_raise(atomic_uint_fast64_t *x, uint64_t by) {
  atomic_store_explicit(x, atomic_load_explicit(x, memory_order_relaxed) + by,
                        memory_order_relaxed);
}

static inline void pb_histogram_add(pb_histogram *h, int64_t ns) {
  const uint64_t t = ns > 0 ? (uint64_t)ns : 0;
  pb_histogram_raise(&h->count, 1);
  pb_histogram_raise(&h->sum_ns, t);
  pb_histogram_raise(&h->bin[pb_histogram_bin(ns)], 1);
  if (t > atomic_load_explicit(&h->largest_ns, memory_order_relaxed))
    atomic_store_explicit(&h->largest_ns, t, memory_order_relaxed);
}

#endif
