// Condensation of a symmetric, indefinite sparse matrix onto a small border, with its inertia:
//   S = D − BᵀA⁻¹B,  negative = number of negative eigenvalues of A
// by a multifrontal LDLᵀ without pivoting that keeps no factor: each front passes its update on to
// its parent and is forgotten. For A = K − σM away from eigenvalues of leading blocks that is
// stable; the growth of the numbers says whether it was. By Sylvester's law A has as many
// eigenvalues below zero as D in A = LDLᵀ. Source: J. Liu, "The multifrontal method for sparse
// matrix solution: theory and practice", SIAM Review 34, 1992.
#ifndef PB_PART_CONDENSE_H
#define PB_PART_CONDENSE_H

#include "part/factor.h"

// B by rows of A, only its numbers that are not zero. Entries of one place add up.
typedef struct pb_border {
  size_t columns;
  size_t *start;  // [rows of A + 1]
  size_t *column;
  double *value;
} pb_border;

typedef struct pb_condensation {
  size_t negative;
  double growth;  // largest update of a diagonal relative to A's largest; ∞: a pivot was zero
  bool (*progress)(void *context, double done, double total);  // false: stop; may be NULL
  void *context;
} pb_condensation;

// A = k + shift · m without the rows that `order` holds; the pattern of both must be in the one
// analysed. s [columns × columns]: D on entry, S on return, lower triangle. Fails with
// PB_ERR_MEMORY, PB_ERR_STATE (stopped). [init]
pb_status pb_condense(pb_factor *order, const pb_sparse *k, const pb_sparse *m, double shift,
                      const pb_border *border, double *s, pb_condensation *result, pb_error *err);

#endif
