// What this core can do at most, measured: the two roofs of the roofline.
#ifndef PB_BENCH_PEAKS_H
#define PB_BENCH_PEAKS_H

#include "bench.h"

// Floating-point operations per second of independent fused multiply-adds in registers (two each),
// with the widest vectors there are; and of as many multiplications and additions apart, which is
// what code may reach whose bits must not depend on the machine.
double bench_peak_fma(double seconds);
double bench_peak_multiply_add(double seconds);

// Bytes per second of reading `bytes` over and over: of the cache level they fit in.
double bench_read_bandwidth(size_t bytes, double seconds);

#endif
