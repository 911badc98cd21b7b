// Clusters of strongly coupled damped modes, each with its own eigenpairs: the start of damped.h.
#ifndef PB_MODEL_CLUSTER_H
#define PB_MODEL_CLUSTER_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

#include "base/status.h"

// Modes in the order of their clusters, and each cluster's eigenpairs as if it were alone: λ, the
// right vectors v (as η) and the left vectors y against which a force counts. Complex pairs are
// listed once, with Im λ > 0, and first; then real eigenvalues, each by itself.
typedef struct pb_clusters {
  size_t n, count;
  size_t widest;           // modes of the largest cluster
  size_t *mode;            // [n] numbers of the modes, cluster by cluster
  size_t *start;           // [count + 1] where each cluster begins in `mode`
  size_t *column;          // [count + 1] where its eigenpairs begin; column[count] in all
  size_t *pairs;           // [count] how many of them are complex
  double complex *lambda;  // [columns]
  size_t *value;           // [count + 1] where its vectors begin in v and y
  double complex *v, *y;   // per cluster modes × eigenpairs, column-major
} pb_clusters;

// Modes are of one cluster when one tilts the other's vector by more than 1 % or when their
// eigenvalues are within 1e-3 of each other. omega [n] rad/s, damping n × n. *sound false: a
// cluster's eigenvectors are too ill-conditioned, or everything is one cluster. Fails with
// PB_ERR_MEMORY. [init]
pb_status pb_clusters_make(size_t n, const double *omega, const double *damping, pb_clusters *out,
                           bool *sound, pb_error *err);
void pb_clusters_clear(pb_clusters *clusters);

// s of the state s η of a mode: ω, or 1 rad/s for a rigid-body mode. [any]
double pb_mode_scale(double omega);

#endif
