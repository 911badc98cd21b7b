// The arithmetic of a step for the vector units: the matrices laid out in the order in which they
// are read, and the same code compiled for several instruction sets.
//
//   x(k+1) = A_d x(k) + B_d u     groups of four 2 × 2 blocks, eight states side by side:
//                                 s = p₀·x + p₁·x̃ (x̃: the two states of each block exchanged),
//                                 then s += b_i u_i for each input in turn
//   y(k) = [C D] [x; u]           panels of eight outputs side by side: y += column_j z_j, j in
//   turn
//
// Every element is added up in the order of the plain loops (step.c) and no multiplication is fused
// with an addition: all variants, and the plain loops, give the same bits on every machine.
#ifndef PB_MODEL_STEP_KERNEL_H
#define PB_MODEL_STEP_KERNEL_H

#include "model/model.h"

enum { PB_STEP_LANES = 8, PB_STEP_AT_ONCE = 4 };

typedef struct pb_step_kernel pb_step_kernel;

// One allocation, arrays aligned to 64 bytes.
typedef struct pb_step_pack {
  const pb_step_kernel *kernel;
  size_t nu, ny, nz;      // nz = nx + nu
  size_t states;          // 2 × pairs: those the groups hold, the rest is stepped by plain loops
  size_t panels;          // of eight outputs; the last may be padded when there is no tail
  size_t tail;            // width of the narrow panel after them: 0, 2 or 4
  const double *advance;  // chunks of four groups, then one of those left, then a group that the
                          // last states do not fill: each [2 + nu][groups][8]
  const double *output;   // chunks of four panels, then one of those left: each [nz][panels][8];
                          // then [nz][tail]. What is padded is zero
} pb_step_pack;

struct pb_step_kernel {
  const char *name;  // "portable", "avx2", "avx512f"
  // x [states] ← groups of A_d and B_d on x and u [nu]
  void (*advance)(const pb_step_pack *pack, double *restrict x, const double *restrict u);
  // y [ny] ← [C D] z, z [nz]
  void (*output)(const pb_step_pack *pack, const double *restrict z, double *restrict y);
};

// Those this processor can run, the fastest last; at least one. [any]
size_t pb_step_kernels(const pb_step_kernel *kernel[3]);

// Lays out the discretised model's matrices for the fastest kernel, into model->step. Fails with
// PB_ERR_MEMORY. [init]
pb_status pb_step_pack_model(pb_model *model, pb_error *err);
void pb_step_pack_free(pb_step_pack *pack);

#endif
