// One body, compiled for several instruction sets: see step_kernel.h.
//
// Vectors of GNU C of eight doubles, which the compiler splits where registers are narrower. Four
// groups or panels go at once: they share the broadcast of an input or a state, and their chains of
// additions overlap.
#include "model/step_kernel.h"

#include <string.h>

#define INLINE static inline __attribute__((always_inline))

// Loads and stores of states are not aligned.
typedef double v8 __attribute__((vector_size(64), aligned(8), may_alias));
typedef double v4 __attribute__((vector_size(32), aligned(8), may_alias));
typedef double v2 __attribute__((vector_size(16), aligned(8), may_alias));

enum { LANES = PB_STEP_LANES, AT_ONCE = PB_STEP_AT_ONCE };

// ---- states -------------------------------------------------------------------------------------

// `groups` is a constant where this is inlined.
INLINE void advance_groups(const double *restrict p, size_t nu, int groups, double *restrict x,
                           const double *restrict u) {
  const size_t row = (size_t)groups * LANES;
  v8 s[AT_ONCE];
#pragma GCC unroll 4
  for (int g = 0; g < groups; g++) {
    const v8 now = *(const v8 *)(x + LANES * g);
    const v8 other = __builtin_shufflevector(now, now, 1, 0, 3, 2, 5, 4, 7, 6);
    s[g] = *(const v8 *)(p + LANES * g) * now + *(const v8 *)(p + row + LANES * g) * other;
  }
  for (size_t i = 0; i < nu; i++) {
    const double *b = p + (2 + i) * row;
#pragma GCC unroll 4
    for (int g = 0; g < groups; g++) s[g] += *(const v8 *)(b + LANES * g) * u[i];
  }
#pragma GCC unroll 4
  for (int g = 0; g < groups; g++) *(v8 *)(x + LANES * g) = s[g];
}

INLINE void advance_body(const pb_step_pack *pack, double *restrict x, const double *restrict u) {
  const size_t nu = pack->nu, group = (2 + nu) * LANES;
  const double *p = pack->advance;
  size_t left = pack->states;
  for (; left >= AT_ONCE * LANES; left -= AT_ONCE * LANES, x += AT_ONCE * LANES) {
    advance_groups(p, nu, AT_ONCE, x, u);
    p += AT_ONCE * group;
  }
  const size_t groups = left / LANES;
  if (groups == 3) advance_groups(p, nu, 3, x, u);
  if (groups == 2) advance_groups(p, nu, 2, x, u);
  if (groups == 1) advance_groups(p, nu, 1, x, u);
  left -= groups * LANES, x += groups * LANES, p += groups * group;
  if (left) {
    double rest[LANES] = {0};
    memcpy(rest, x, left * sizeof *x);
    advance_groups(p, nu, 1, rest, u);
    memcpy(x, rest, left * sizeof *x);
  }
}

// ---- outputs ------------------------------------------------------------------------------------

// `panels` whole panels from p and one of width `tail` from t, both constants where this is
// inlined; `count` outputs in all.
INLINE void output_panels(const double *restrict p, int panels, const double *restrict t, int tail,
                          const double *restrict z, size_t nz, double *restrict y, size_t count) {
  v8 s[AT_ONCE] = {0};
  v4 s4 = {0};
  v2 s2 = {0};
  for (size_t j = 0; j < nz; j++) {
    const double zj = z[j];
#pragma GCC unroll 4
    for (int k = 0; k < panels; k++) s[k] += *(const v8 *)(p + (j * panels + k) * LANES) * zj;
    if (tail == 4) s4 += *(const v4 *)(t + 4 * j) * zj;
    if (tail == 2) s2 += *(const v2 *)(t + 2 * j) * zj;
  }
#pragma GCC unroll 4
  for (int k = 0; k < panels; k++) {
    if (count >= LANES * ((size_t)k + 1))
      *(v8 *)(y + LANES * k) = s[k];
    else
      memcpy(y + LANES * k, &s[k], (count - LANES * k) * sizeof *y);
  }
  if (tail == 4) memcpy(y + LANES * panels, &s4, (count - LANES * panels) * sizeof *y);
  if (tail == 2) memcpy(y + LANES * panels, &s2, (count - LANES * panels) * sizeof *y);
}

INLINE void output_body(const pb_step_pack *pack, const double *restrict z, double *restrict y) {
  const size_t nz = pack->nz;
  const double *p = pack->output;
  size_t panels = pack->panels, left = pack->ny;
  for (; panels >= AT_ONCE; panels -= AT_ONCE) {
    output_panels(p, AT_ONCE, p, 0, z, nz, y, left);
    if (left <= AT_ONCE * LANES) return;
    left -= AT_ONCE * LANES, y += AT_ONCE * LANES, p += AT_ONCE * nz * LANES;
  }
  const double *t = p + panels * nz * LANES;
#define CASE(panels, tail)                             \
  case (panels)*LANES + (tail):                        \
    output_panels(p, panels, t, tail, z, nz, y, left); \
    break;
  switch (panels * LANES + pack->tail) {
    CASE(0, 2)
    CASE(0, 4)
    CASE(1, 0)
    CASE(1, 2)
    CASE(1, 4)
    CASE(2, 0)
    CASE(2, 2)
    CASE(2, 4)
    CASE(3, 0)
    CASE(3, 2)
    CASE(3, 4)
  }
#undef CASE
}

// ---- instruction sets ---------------------------------------------------------------------------

#define VARIANT(variant, attribute)                                                          \
  attribute static void advance_##variant(const pb_step_pack *pack, double *restrict x,      \
                                          const double *restrict u) {                        \
    advance_body(pack, x, u);                                                                \
  }                                                                                          \
  attribute static void output_##variant(const pb_step_pack *pack, const double *restrict z, \
                                         double *restrict y) {                               \
    output_body(pack, z, y);                                                                 \
  }                                                                                          \
  static const pb_step_kernel kernel_##variant = {#variant, advance_##variant, output_##variant};

VARIANT(portable, )
#if defined __x86_64__
VARIANT(avx2, __attribute__((target("avx2"))))
VARIANT(avx512f, __attribute__((target("avx512f"))))
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
