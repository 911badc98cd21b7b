// Rolling hash of a run: two runs with the same hash had, bit for bit, the same inputs and outputs
// at the same steps.
//
//   h ← rotl((h ⊕ w) · K, 31) for each 64-bit word w, and splitmix64's finaliser once a step
//
// Each word acts by a bijection of the 64 bits of h, so that one changed word always changes the
// hash. It tells accidents apart, not forgeries.
#ifndef PB_HASH_H
#define PB_HASH_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

// The hash of a run without a step.
#define PB_HASH_START UINT64_C(0x706c616e74627573)

static inline uint64_t pb_hash_word(uint64_t hash, uint64_t word) {
  hash = (hash ^ word) * UINT64_C(0x9e3779b97f4a7c15);
  return hash << 31 | hash >> 33;
}

// One step more: its number, the revision of the plant, the inputs u[nu] held until it and the
// outputs y[ny] sampled at it. By bits: 0.0 and −0.0 differ, NaNs count by their pattern. [rt]
static inline uint64_t pb_hash_step(uint64_t hash, uint64_t step, uint32_t revision,
                                    const double *u, size_t nu, const double *y, size_t ny) {
  uint64_t word;
  hash = pb_hash_word(hash, step);
  hash = pb_hash_word(hash, revision);
  hash = pb_hash_word(hash, (uint64_t)nu << 32 | (uint64_t)ny);
  for (size_t i = 0; i < nu; i++) {
    memcpy(&word, &u[i], sizeof word);
    hash = pb_hash_word(hash, word);
  }
  for (size_t i = 0; i < ny; i++) {
    memcpy(&word, &y[i], sizeof word);
    hash = pb_hash_word(hash, word);
  }
  hash = (hash ^ hash >> 30) * UINT64_C(0xbf58476d1ce4e5b9);
  hash = (hash ^ hash >> 27) * UINT64_C(0x94d049bb133111eb);
  return hash ^ hash >> 31;
}

#endif
