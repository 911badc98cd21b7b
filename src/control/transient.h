// Steady state from periods that are not yet in it.
//
// Waiting for the steady state costs ln(1/level)/(ζω) at each experiment: a minute for a resonance
// of 94 Hz with a damping of 0.03 %. But the difference of two periods holds the decay alone: a
// rational function with the poles of the plant. They are fitted to it (fit.h), the decay follows
// by least squares, and what it adds to the averages is taken out. Trends (the free motion of rigid
// bodies, and of suspensions slower than the record) never die: they are taken out whether the
// start was waited for or not. Only the records are used, no model.
#ifndef PB_CONTROL_TRANSIENT_H
#define PB_CONTROL_TRANSIENT_H

#include "signal/periodic.h"

// Corrects the means of a periodic estimator (see pb_periodic_settle) by decays and trends.
// *explained (may be NULL):
// part of the difference's power that decays explain; 0 also when the difference is rounding only
// or no poles can be fitted to it, which is no error. [init] Fails with PB_ERR_STATE (periods that
// do not follow one another), PB_ERR_MEMORY.
pb_status pb_transient_remove(pb_periodic *periodic, double sample_rate, double *explained,
                              pb_error *err);

#endif
