// Between modes.c and modes_restore.c.
#ifndef PB_MODEL_MODES_INTERNAL_H
#define PB_MODEL_MODES_INTERNAL_H

#include "assembly/system.h"
#include "base/workers.h"

// Restores modes slower than 1e-4 of the largest ω² to the accuracy that their M and K allow, and
// the order of all. omega2 [n], shape n × n as from the solver; space: n × n. Fails with
// PB_ERR_MEMORY. [init]
pb_status pb_modes_restore(const pb_system *system, const pb_workers *workers, double *omega2,
                           double *shape, double *space, pb_error *err);

#endif
