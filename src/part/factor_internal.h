// What the files of the factorisation share.
#ifndef PB_PART_FACTOR_INTERNAL_H
#define PB_PART_FACTOR_INTERNAL_H

#include "part/factor.h"

// factor_graph.c: f->place, row and n in an order that keeps the factor small.
pb_status factor_dissect(pb_factor *f, const pb_sparse *a, size_t nodes, const int64_t *dof,
                         const bool *held, pb_error *err);

// PB_ERR_MEMORY or PB_ERR_NUMERIC by CHOLMOD's status.
pb_status factor_fail(const pb_factor *f, pb_error *err);

#endif
