// One body, compiled for several instruction sets: see step_kernel.h.
//
// Vectors of GNU C in the width of the registers. Up to four groups or panels go at once: they
// share the broadcast of an input or a state, and their chains of additions overlap.
#include "model/step_kernel.h"

#include <string.h>

#define INLINE static inline __attribute__((always_inline))

// States are not aligned.
#define VECTOR(bytes) __attribute__((vector_size(bytes), aligned(8), may_alias))
typedef double v2 VECTOR(16);

enum { LANES = PB_STEP_LANES, AT_ONCE = PB_STEP_AT_ONCE };

#define NAME portable
#define TARGET
#define V v2
#define W 2
#define PASS 2
#define EXCHANGE(v) __builtin_shufflevector(v, v, 1, 0)
#include "model/step_kernel_body.h"

#if defined __x86_64__
typedef double v4 VECTOR(32);
#define NAME avx2
#define TARGET __attribute__((target("avx2")))
#define V v4
#define W 4
#define PASS 2
#define EXCHANGE(v) __builtin_shufflevector(v, v, 1, 0, 3, 2)
#include "model/step_kernel_body.h"

typedef double v8 VECTOR(64);
#define NAME avx512f
#define TARGET __attribute__((target("avx512f")))
#define V v8
#define W 8
#define PASS 1
#define EXCHANGE(v) __builtin_shufflevector(v, v, 1, 0, 3, 2, 5, 4, 7, 6)
#include "model/step_kernel_body.h"
#endif

size_t pb_step_kernels(const pb_step_kernel *kernel[3]) {
  size_t count = 0;
  kernel[count++] = &kernel_portable;
#if defined __x86_64__
  if (__builtin_cpu_supports("avx2")) kernel[count++] = &kernel_avx2;
  if (__builtin_cpu_supports("avx512f")) kernel[count++] = &kernel_avx512f;
#endif
  return count;
}
