// What the root locus and the search for the best gain share.
#ifndef PB_CONTROL_ROOTLOCUS_INTERNAL_H
#define PB_CONTROL_ROOTLOCUS_INTERNAL_H

#include "control/rootlocus.h"

// Room for a locus; is_mode is false everywhere, the rest uninitialised. PB_ERR_MEMORY. [init]
pb_status pb_rootlocus_new(size_t gains, size_t branches, pb_rootlocus *out, pb_error *err);

// Room for `gains` points whose branches start, at index 0, at the open-loop poles of the band. The
// gains are the caller's to fill, the first with 0. [init] Fails as pb_rootlocus_compute.
pb_status pb_rootlocus_start(pb_loop_solver *solver, size_t gains, double f1, double f2,
                             pb_rootlocus *out, pb_error *err);

// Fills steps 1.. of a locus whose gains are set and whose step 0 holds the poles at the first of
// them; smallest[] of all steps. [init] Fails as pb_rootlocus_compute.
pb_status pb_rootlocus_follow(pb_loop_solver *solver, pb_rootlocus *locus, pb_error *err);

// smallest[k]. [any]
void pb_rootlocus_find_smallest(pb_rootlocus *locus, size_t k);

#endif
