// The electrical boundary of a sensor stack. [report 2.5]
//
// A piezoelectric stack of short-circuit stiffness k, elongation e and charge Q = θ e + C_S V pulls
// with F = k e − θ V. With the coupling k_33² = θ²/(k C), C = C_S + θ²/k the capacitance of the
// free stack, C_S = C (1 − k_33²) that of the held one:
//
//   short   V = 0             F = k e
//   open    Q = 0             F = (k + dk) e        dk = k k_33²/(1 − k_33²), k + dk = k/(1 −
//   k_33²) R       Q̇ = −V/R          F = k e + dk (e − z)  τ ż = e − z, τ = R C_S; V ~ e − z
//
// the last a standard linear solid: k in parallel with dk in series with a damper dk τ.
// Source: N. W. Hagood, A. von Flotow, "Damping of structural vibrations with piezoelectric
// materials and passive electrical networks", J. Sound Vib. 146 (1991).
#ifndef PB_PLANT_BOUNDARY_H
#define PB_PLANT_BOUNDARY_H

#include "plant/plant.h"
#include "plant/reader.h"

// dk, N/m; 0 for a short circuit. [any]
double pb_boundary_stiffening(const pb_boundary *boundary);

// τ, s; 0 without a resistor. [any]
double pb_boundary_time(const pb_boundary *boundary);

// Stiffness of an element's stack between two interface frames (0-based) along a unit axis in part
// axes, N/m: the force on one end when the other moves, all other frames held, those on the way
// from one end to the other free. [init]
// Fails with PB_ERR_ELEMENT (no stiffness between the frames), PB_ERR_MEMORY.
pb_status pb_element_stack_stiffness(const pb_element *element, const size_t frame[2],
                                     const double axis[3], double *stiffness, pb_error *err);

// Reads the key "boundary" of a component, and what it needs of the stack, into c->boundary;
// without the key the stack is short-circuited. Fails with PB_ERR_SCHEMA, PB_ERR_ELEMENT. [init]
pb_status pb_loader_boundary(const pb_reader *r, pb_component *c);

#endif
