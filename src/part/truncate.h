// An element with fewer modes: as few as keep its poles and zeros in a band within a budget.
//
// The element's own interior (its modal rows i) is reduced once more with its frames b held:
//   Ψ = −K_ii⁻¹K_ib,  K_ii φ = ω² M_ii φ,  T = [[I, 0], [Ψ, Φ_k]],  K ← TᵀKT,  M ← TᵀMT
// and only k of the φ are kept: those of the band and those that move the frames' dynamic stiffness
// most in it. T holds the static answer to every motion of the frames, so
// that the stiffness between frames, the static residual of what goes, stays exactly; modal
// truncation of the free or held part would lose it and move the zeros of collocated and force
// sensors far away.
//
// Poles and zeros of the undamped element are compared before and after, free and with one frame
// held: zeros of each force and moment on the tip to its own motion (the poles with that motion
// held), and of the actuator's stack force to the sensor's elongation and to the tip:
//   det [[K − λM, b], [cᵀ, 0]] = 0,  ω² = λ
// Source: design notes on truncation and on Craig–Bampton reduction; report 1.1, 2.4.
#ifndef PB_PART_TRUNCATE_H
#define PB_PART_TRUNCATE_H

#include <stdbool.h>

#include "plant/element.h"

typedef struct pb_truncate_options {
  double low_hz, high_hz;         // the band
  double zero_error, pole_error;  // largest relative changes allowed in it
  size_t modes;      // > 0: this many, whatever the errors; 0: as few as the budget allows
  size_t base, tip;  // frames that are held and free, from 0
  bool stacks;       // the element has an actuator's stacks:
  size_t actuator[2], sensor[2];  // their frames
  double payload;                 // kg that move with the tip (translations), 0: none
} pb_truncate_options;

typedef struct pb_truncate_row {
  const char *boundary, *what;  // "free", "held"; "pole", "zero …"
  double before, after;         // Hz (by magnitude where complex)
  double error;                 // relative; infinite: it has no counterpart
} pb_truncate_row;

typedef struct pb_truncation {
  size_t modes_before, modes;
  pb_element_data element;
  double *fixed_hz;  // [modes]
  size_t rows;
  pb_truncate_row *row;  // [rows] in the band
  double worst_zero, worst_pole;
} pb_truncation;

// *out is owned by the caller. Fails as pb_element_new does (matrices that are not symmetric, M not
// positive definite), and with PB_ERR_ARGUMENT (frames, band, no modes to drop), PB_ERR_ELEMENT
// (the interior not held by its frames), PB_ERR_NUMERIC, PB_ERR_MEMORY. [init]
pb_status pb_element_truncate(const char *name, const pb_element_data *data,
                              const pb_truncate_options *options, pb_truncation *out,
                              pb_error *err);
void pb_truncation_clear(pb_truncation *truncation);

#endif
