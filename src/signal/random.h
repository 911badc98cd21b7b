// Seeded random numbers with a flat state: the same seed gives the same bits on any machine with
// IEEE 754 doubles, and a snapshot is a memcpy.
//
// xoshiro256++ (D. Blackman, S. Vigna, "Scrambled linear pseudorandom number generators", 2021),
// its state filled by splitmix64. Gaussian numbers by Marsaglia's polar method, with a logarithm of
// its own made of the four operations only: the C library's may differ in the last bit between
// hosts.
#ifndef PB_SIGNAL_RANDOM_H
#define PB_SIGNAL_RANDOM_H

#include <stdint.h>

typedef struct pb_random {
  uint64_t s[4];
  double spare;        // second number of the last Gaussian pair
  uint64_t has_spare;  // 0 or 1
} pb_random;

// Starts a generator; different streams of one seed are independent. [any]
void pb_random_seed(pb_random *random, uint64_t seed, uint64_t stream);

// 64 random bits. [rt]
uint64_t pb_random_bits(pb_random *random);

// Uniform in [0, 1), 53 bits. [rt]
double pb_random_uniform(pb_random *random);

// Gaussian of mean 0 and variance 1. [rt]
double pb_random_gaussian(pb_random *random);

#endif
