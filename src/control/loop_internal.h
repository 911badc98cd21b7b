// What the files of the loop share.
#ifndef PB_CONTROL_LOOP_INTERNAL_H
#define PB_CONTROL_LOOP_INTERNAL_H

#include "control/loop.h"

// Sizes, indices, period, gain and sign of a loop.
pb_status pb_loop_check(const pb_loop *loop, double gain, pb_error *err);

// sign·gain·z^{−delay} K(z), on the loop's own channels.
pb_status pb_loop_delayed_controller(const pb_loop *loop, double gain, pb_lti *out, pb_error *err);

struct pb_loop_solver {
  pb_loop loop;
  bool exact;              // `plant` is the whole plant
  pb_lti plant;            // the loop's channels only, sampled; reduced unless exact
  pb_model channels;       // the whole plant with the loop's channels only; shares A with the model
  size_t delays;           // samples of the electronics in the loop: of its inputs and its outputs
  size_t open_count;       // open-loop poles: plant, controller
  double complex *open;    // [open_count] as z
  size_t far_count;        // of the poles that the reduction left out
  double complex *far;     // [far_count]
  double complex *h, *dh;  // [n_out][n_in] of the plant at a point
  double complex *k, *dk;  // [n_in][n_out] of the controller at a point
  double complex *m, *rhs;  // [n_in × n_in]
};

// All closed-loop poles of both half planes, without the iteration: of a large plant those with its
// low modes only. Their number does not depend on the gain. *z [*count], with room for far_count
// more, is the caller's (free).
pb_status pb_loop_all_poles(pb_loop_solver *solver, double gain, double complex **z, size_t *count,
                            pb_error *err);

// Moves z[count] onto the roots of the whole plant's loop next to them, each kept apart from the
// others; lost[count]: where that leads nowhere.
pb_status pb_loop_refine_roots(pb_loop_solver *solver, double gain, double complex *z, size_t count,
                               bool *lost, pb_error *err);

// Makes the roots z[*count] exact together, each kept apart from the others; takes out what did not
// converge. *lost: of these as many as cannot be the reduction's own.
pb_status pb_loop_make_exact(pb_loop_solver *solver, double gain, double complex *z, size_t *count,
                             size_t *lost, pb_error *err);

#endif
