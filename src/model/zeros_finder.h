// Between zeros.c, zeros_polish.c, zeros_multiple.c and sampled_roots.c: zeros of one channel.
//
// All points are s in rad/s, of a sampled channel s = ln(z)/T.
#ifndef PB_MODEL_ZEROS_FINDER_H
#define PB_MODEL_ZEROS_FINDER_H

#include "model/channel.h"

typedef struct pb_zero_finder {
  const pb_channel *channel;               // the exact one
  double slowest, middle;                  // smallest and mean |λ| of its blocks, rad/s
  double reach;                            // how far polishing may move a candidate, relative
  double complex *h, *dh, *u, *vh, *work;  // m × m; svd
  double *sigma, *rwork;
  double complex *zero;  // found: imaginary part ≥ 0, both of a pair stand for one entry
  size_t count;
} pb_zero_finder;

// False: out of memory. Closed with pb_zero_finder_close in any case.
bool pb_zero_finder_open(pb_zero_finder *f, const pb_channel *channel);
void pb_zero_finder_close(pb_zero_finder *f);

// Smallest and mean |λ| of a channel's blocks, rad/s.
void pb_channel_measure(const pb_channel *ch, double *slowest, double *middle);

// Removes the modes that this channel does not see: each would be a zero on top of its own pole.
// Fails with PB_ERR_MEMORY.
pb_status pb_channel_drop_unseen(pb_channel *ch, pb_error *err);

// Against what a distance from s counts, rad/s.
double pb_zero_scale(const pb_zero_finder *f, double complex s);

// Singular values of f->h and their vectors. False: they did not converge.
bool pb_zero_decompose(pb_zero_finder *f);

// u_kᴴ M v_k
double complex pb_zero_project(const pb_zero_finder *f, const double complex *matrix, size_t k);

// H, H′ and the decomposition at s; the Newton step of the smallest singular value and, in *doubt,
// how far the rounding error of H may move the zero. False: nothing to divide by.
bool pb_zero_step(pb_zero_finder *f, double complex s, double complex *step, double *doubt);

// Moves *s onto the simple zero next to it; false: there is none.
bool pb_zero_polish(pb_zero_finder *f, double complex *s);

// Whether s is no zero but a mode that shares its frequency with another one.
bool pb_zero_cancelled(pb_zero_finder *f, double complex s);

// ---- zeros_multiple.c ---------------------------------------------------------------------------

enum { PB_ZEROS_INSIDE = 8 };  // zeros of one cluster, at most

// Zeros of det H inside a circle without poles, by the moments
//
//   p_k = (1/2πi) ∮ (s − c)^k tr(H⁻¹ H′) ds
//
// of the trapezoidal rule (Delves and Lyness, Math. Comp. 21, 1967). Those that rounding cannot
// tell apart are equal, all at their mean, which is known far better than each of them. root
// [PB_ZEROS_INSIDE]. Returns their count; 0: none, too many, or H is noise or near a pole there.
size_t pb_zeros_inside(pb_zero_finder *f, double complex centre, double radius,
                       double complex *root);

// What the candidates left over (lost [count], whose polishing failed or ended on a zero that was
// listed) say of multiple zeros: the clusters among them replace what is listed of them. band:
// rad/s, 0: all. Fails with PB_ERR_MEMORY, PB_ERR_NUMERIC.
pb_status pb_zeros_recover(pb_zero_finder *f, const double complex *lost, size_t count, double band,
                           pb_error *err);

#endif
