// A specification, and a plant held against all of its limits.
//
//   { "schema": "plantbus.gate/1", "name": "…", "limits": [ {"quantity": …, "min": …, "max": …}, …
//   ] }
//
// | quantity             | further keys                    | value |
// |----------------------|---------------------------------|-------------------------------------------|
// | stiffness            | axis (x y z rx ry rz)           | N/m, Nm/rad: a static load at the
// point   | |                      |                                 | of interest over the motion
// along it      | | mode                 | number (1 …)                    | Hz, undamped | |
// stroke               | range [low, high] of the        | m, rad: of the pure motion along the
// axis | |                      | actuators, axis or strut (1…6)  | that the range allows; of a
// strut alone   | | attainable_damping   | number (optional)               | largest on the IFF
// locus, of a mode or    | |                      |                                 | the least of
// the six                      | | damping              |                                 |
// smallest, at IFF's best stable gain       | | coupling             | band [f1, f2] Hz, damped
// (bool) | largest RGA number of the HAC plant       | | order                | | states | |
// force_along_struts   |                                 | k l² / k_r (struts.h) |
//
// Each limit has min, max or both, above 0. All but mode and order need the template nano_hexapod.
// The margin of a value is what part of the limit it is away from it, negative beyond.
#ifndef PB_STUDY_GATE_H
#define PB_STUDY_GATE_H

#include <stdbool.h>

#include "base/json.h"

typedef enum pb_gate_quantity {
  PB_GATE_STIFFNESS,
  PB_GATE_MODE,
  PB_GATE_STROKE,
  PB_GATE_ATTAINABLE,
  PB_GATE_DAMPING,
  PB_GATE_COUPLING,
  PB_GATE_ORDER,
  PB_GATE_STRUTS,
  PB_GATE_QUANTITIES,
} pb_gate_quantity;

typedef struct pb_gate_limit {
  pb_gate_quantity quantity;
  char pointer[64];  // of the limit in the specification
  int axis;          // 0 … 5; −1: none
  size_t number;     // of a mode, or of a strut; 0: none
  double range[2];   // of the actuators, or the band in Hz
  bool damped;
  double min, max;  // NaN: none
  // Of a plant:
  double value;   // NaN: not found
  double margin;  // of the nearer limit
  bool passed;
} pb_gate_limit;

// Zero-initialise; free with pb_gate_clear.
typedef struct pb_gate {
  char *name;
  size_t count;
  pb_gate_limit *limit;  // [count] in the order of the specification
  bool passed;           // all of them
} pb_gate;

// Reads a specification. [init] Fails with PB_ERR_SCHEMA: the error's place is the JSON pointer.
pb_status pb_gate_read(const cJSON *spec, pb_gate *out, pb_error *err);

// Fills in what the plant gives; element files are relative to directory. [init] Fails as
// pb_plant_parse, pb_study_point_find; PB_ERR_STATE names the limit that the plant cannot answer.
pb_status pb_gate_judge(pb_gate *gate, const cJSON *plant, const char *directory, pb_error *err);

void pb_gate_clear(pb_gate *gate);

// "stiffness z", "mode 1", "coupling 1 … 100 Hz, damped"; always terminated. [any]
void pb_gate_limit_name(const pb_gate_limit *limit, char *text, size_t size);
const char *pb_gate_limit_unit(const pb_gate_limit *limit);  // "" for a pure number

#endif
