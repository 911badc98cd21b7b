// Denormal numbers in a plant that rings down slow a step by up to 90 times: the threads that step
// flush them to zero. In a thread that belongs to the middleware the old setting is put back.
#ifndef PB_FPENV_H
#define PB_FPENV_H

#include <stdbool.h>
#include <stdint.h>

// Whether this thread flushes denormals now, tried out. [rt]
static inline bool pb_denormals_are_flushed(void) {
  volatile double tiny = 1e-308;
  volatile double product = tiny * 0.01;
  return product == 0.0;
}

#if defined(__SSE2__)
#include <immintrin.h>

static inline uint64_t pb_flush_denormals(void) {
  const unsigned saved = _mm_getcsr();
  _mm_setcsr(saved | 0x8040u);  // flush to zero, denormals are zero
  return saved;
}
static inline void pb_restore_denormals(uint64_t saved) {
  _mm_setcsr((unsigned)saved);
}

#elif defined(__aarch64__)

static inline uint64_t pb_flush_denormals(void) {
  uint64_t saved;
  __asm__ volatile("mrs %0, fpcr" : "=r"(saved));
  __asm__ volatile("msr fpcr, %0" ::"r"(saved | (UINT64_C(1) << 24)));
  return saved;
}
static inline void pb_restore_denormals(uint64_t saved) {
  __asm__ volatile("msr fpcr, %0" ::"r"(saved));
}

#else

static inline uint64_t pb_flush_denormals(void) {
  return 0;
}
static inline void pb_restore_denormals(uint64_t saved) {
  (void)saved;
}

#endif

#endif
