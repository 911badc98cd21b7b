// A sampled feedback loop around a compiled plant.
//
//   y(k) = P(z) u,   u = w + sign·gain·E K(z) z^{−delay} S y
//
// P is from command to measured output (PB_SAMPLED): the electronics' gains and delays are in it.
// S takes the outputs that the controller reads, E places its outputs on the inputs they drive.
// Positive feedback is sign = +1 (V_a = +K_IFF V_s). delay = 0: the command computed from y(k) is
// held over [k, k+1), as in lockstep; delay = 1: over the next interval, as in real time.
//
// Closed-loop poles are the roots of det(I − L(z)), L = sign·gain·z^{−delay} S P E K. A plant of up
// to PB_LOOP_DENSE states is solved in dense state space. A larger one gives starting values
// through its lowest modes (static contribution of the others kept), which are then made exact on
// the full plant: Newton's method on p(z) = det(I − L(z)) Π(z − open-loop pole), a polynomial, with
// p'/p = −tr((I − L)⁻¹ L') + Σ 1/(z − pole); starts that arrive where others are go back and are
// kept apart from them (O. Aberth, 1973). No large matrix appears.
#ifndef PB_CONTROL_LOOP_H
#define PB_CONTROL_LOOP_H

#include <stdbool.h>

#include "control/lti.h"
#include "control/poles.h"
#include "model/model.h"

enum { PB_LOOP_DENSE = 160 };

// Everything pointed to stays the caller's and must outlive the loop's use.
typedef struct pb_loop {
  const pb_model *model;
  const pb_lti *controller;  // discrete, dt = 1 / model->sample_rate
  const size_t *output;      // [controller->nu] of the model
  const size_t *input;       // [controller->ny] of the model
  double sign;               // +1 or −1
  unsigned delay;            // whole samples
} pb_loop;

// All functions: [init]; PB_ERR_ARGUMENT (sizes, indices, period, non-finite gain), PB_ERR_MEMORY.
// gain multiplies the controller.

// Closed loop from w (all inputs of the model) to all its outputs, dense: for small plants.
pb_status pb_loop_closed(const pb_loop *loop, double gain, pb_lti *out, pb_error *err);

// Frequency responses from w to y of the sampled closed loop, h[nf][ny][nu], by one small solve a
// frequency: cheap for any plant. PB_ERR_SINGULAR: a closed-loop pole on the unit circle there.
pb_status pb_loop_frf(const pb_loop *loop, double gain, const double *hz, size_t nf,
                      double complex *h, pb_error *err);

// Open-loop transfer L(z) at hz[nf], h[nf][n][n] with n = controller->ny.
pb_status pb_loop_gain(const pb_loop *loop, double gain, const double *hz, size_t nf,
                       double complex *h, pb_error *err);

// A loop prepared for its poles at many gains.
typedef struct pb_loop_solver pb_loop_solver;

pb_status pb_loop_solver_new(const pb_loop *loop, pb_loop_solver **out, pb_error *err);
void pb_loop_solver_free(pb_loop_solver *solver);

const pb_loop *pb_loop_solver_loop(const pb_loop_solver *solver);

// Closed-loop poles of the upper half plane (Im z ≥ 0) with f1 ≤ |s|/2π ≤ f2, by frequency;
// includes the controller's. f2 = INFINITY: all except those that vanish within two samples (|z| <
// 0.05). PB_ERR_NUMERIC when the iteration does not converge.
pb_status pb_loop_solver_poles(pb_loop_solver *solver, double gain, double f1, double f2,
                               pb_pole_list *out, pb_error *err);

// Whether all closed-loop poles are inside the unit circle. Up to PB_LOOP_STABLE_DENSE states by
// the dense eigenvalues. Above by the argument principle: det(I − L(z)) turns −2π·(poles outside)
// along the circle when the open loop has none outside; the phase is followed in steps of less than
// a radian, finest where poles are near, and where the determinant's size changes much. *worst (may
// be NULL) is the pole of largest |z| that is known: beyond the lowest modes of a large plant not
// all are. Delays of the electronics count as states. The open loop must be stable but for a
// controller's integrators (a floating plant is PB_ERR_STATE above that size).
enum { PB_LOOP_STABLE_DENSE = 400 };
pb_status pb_loop_solver_stable(pb_loop_solver *solver, double gain, bool *stable, pb_pole *worst,
                                pb_error *err);

#endif
