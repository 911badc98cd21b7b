// Which measured pole (or zero) is which exact one: each at most once, all together as near as
// possible (optimal assignment, assign.h).
#ifndef PB_CONTROL_POLE_MATCH_H
#define PB_CONTROL_POLE_MATCH_H

#include "base/status.h"
#include "control/poles.h"

// of[k] for each of wanted[count]: the one of found[] that is meant, with hz NaN where none is
// within reach, |Δs| < (0.005 + 0.3 |ζ|) |s|, or where wanted[k].hz is NaN. Rates in Hz. [init]
// PB_ERR_MEMORY.
pb_status pb_pole_match(const pb_pole *wanted, size_t count, const pb_pole *found,
                        size_t found_count, double sample_rate, pb_pole *of, pb_error *err);

// Groups of poles, sorted by frequency, that lie nearer to their neighbour than `resolution` Hz: a
// measurement does not tell them apart one by one. cluster[k] = 1, 2, … for the members of one, 0
// for a pole by itself. Returns the number of clusters. [any]
size_t pb_pole_clusters(const pb_pole *pole, size_t count, double sample_rate, double resolution,
                        size_t *cluster);

#endif
