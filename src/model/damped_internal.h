// Between the parts of damped.c.
#ifndef PB_MODEL_DAMPED_INTERNAL_H
#define PB_MODEL_DAMPED_INTERNAL_H

#include "model/damped.h"

enum { PB_DAMPED_BATCH = 128 };  // most columns that are corrected together

// What one worker corrects a batch in.
typedef struct pb_damped_space {
  double *in, *out;      // n × batch: of the product with Ĉ
  double *r[2], *dx[2];  // n × batch: residuals and corrections
  double *basis;         // modes × 2 eigenpairs of the largest cluster: [Y_r Y_i], [V_r V_i]
  double *along[2];      // batch × 2 eigenpairs of the largest cluster
} pb_damped_space;

// Besides the result: the matrices in the order of the clusters, and work space.
typedef struct pb_iteration {
  pb_damped *d;
  const pb_workers *workers;
  pb_damped_space *space;        // [workers]
  double *c, *w2;                // n × n: Ĉ; [n]: ω²
  size_t *list, count;           // [columns] those of active clusters, ascending; how many
  double *residual;              // [columns] of each, against its eigenvalue
  double *turned_by;             // [columns] Σ of its corrections, in the 1-norm
  bool *active;                  // [clusters]
  double *error;                 // [clusters] largest residual against its eigenvalue
  size_t *home;                  // [columns] cluster of each
  size_t *value;                 // [clusters] where each begins in `own`
  double complex *own;           // per cluster eigenpairs squared: YᵀR inside it
  double complex *t, *z, *work;  // widest eigenpairs squared, twice; 4 × widest
  double *rwork, *turned;        // 2 × widest; 2 n × widest
  double *basis;                 // 2 × widest eigenpairs squared
  int *pivot;
  size_t widest;  // eigenpairs of the largest cluster
  double tilt;    // largest of this sweep: how far corrections turn a vector
} pb_iteration;

// Corrects the columns k[count], ascending, count ≤ batch, whose P is up to date, in all directions
// but those inside their clusters, which go to `own`. Writes nothing that belongs to other columns.
void pb_damped_correct(const pb_iteration *it, pb_damped_space *space, const size_t *k,
                       size_t count);

// Takes what `own` says of cluster c into its vectors and eigenvalues. False: it is defective.
bool pb_damped_turn(pb_iteration *it, size_t c);

#endif
