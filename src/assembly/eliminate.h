// From stacked equations with constraints to minimal coordinates, and the condensation of motions
// without mass.
#ifndef PB_ASSEMBLY_ELIMINATE_H
#define PB_ASSEMBLY_ELIMINATE_H

#include "assembly/stack.h"
#include "assembly/system.h"

// An orthonormal basis N of null(G) in factored form: Gᵀ P = Q R with pivoting, N = Q[:, rank:],
// Q = I − V T Vᵀ (Schreiber and Van Loan, SIAM J. Sci. Stat. Comput. 10, 1989).
typedef struct pb_null_basis {
  size_t n, rank;
  double *v;  // n × constraints, the first `rank` columns count: unit lower trapezoidal
  double *t;  // rank × rank, upper triangular
} pb_null_basis;

// Rank-revealing factorisation of the constraints. Redundant ones are dropped; one that is nearly
// redundant (1e-9 < |R_jj| < 1e-6) is warned about by the name of its connection. [init]
pb_status pb_null_build(const pb_stack_equations *stack, pb_warnings *warnings, pb_null_basis *out,
                        pb_error *err);
void pb_null_clear(pb_null_basis *basis);

// Each relaxation of the stack becomes an input (its force dk δ z, which is −K's column of z) and
// an output (δᵀq), the last ones of the stack; what the outputs so far see of z itself is taken
// down in the system. Fails with PB_ERR_MEMORY. [init]
pb_status pb_relaxations_append(pb_stack_equations *stack, pb_system *system, pb_error *err);

// Fills system (sizes and matrices) with the stack projected on null(G). [init]
pb_status pb_null_project(const pb_null_basis *basis, pb_stack_equations *stack, pb_system *system,
                          pb_error *err);

// N itself, n × (n − rank), the caller's. [init]
pb_status pb_null_matrix(const pb_null_basis *basis, double **out, pb_error *err);

// q = N v for one vector: v has n − rank entries, q has n. [init]
pb_status pb_null_expand(const pb_null_basis *basis, const double *v, double *q, pb_error *err);

// Condenses statically the motions of the system that have no mass:
//   K_zz z + K_za a = F_z u  ⇒  q = T a + Z K_zz⁻¹ F_z u
// M, C, K, F and the outputs are transformed by T; the second term goes into D (and, where the
// system tells how stacked coordinates follow, into expand_u). Warns when damping
// acted on such a motion. Fails with PB_ERR_SINGULAR, naming the component, where K_zz is singular.
pb_status pb_condense(pb_system *system, const pb_null_basis *basis, const pb_layout *layout,
                      pb_warnings *warnings, pb_error *err);

#endif
