// What the files of the loop share.
#ifndef PB_CONTROL_LOOP_INTERNAL_H
#define PB_CONTROL_LOOP_INTERNAL_H

#include "control/loop.h"

// Sizes, indices, period, gain and sign of a loop.
pb_status pb_loop_check(const pb_loop *loop, double gain, pb_error *err);

// sign·gain·z^{−delay} K(z), on the loop's own channels.
pb_status pb_loop_delayed_controller(const pb_loop *loop, double gain, pb_lti *out, pb_error *err);

#endif
