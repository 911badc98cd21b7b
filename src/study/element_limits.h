// A specification: limits on quantities of a part, and how a part stands to them.
//
//   {"schema": "plantbus.specification/1", "name": "…", "limits": {
//      "stroke": {"above": 1e-4}, "resolution": {"below": 2e-9},
//      "stiffness": {"about": 1e6, "factor": 2}}}
//
// SI units. "above" and "below" are strict; "about" allows value/factor … value × factor.
// The margin is the distance to the nearest limit that holds, relative to it: negative when missed.
#ifndef PB_STUDY_ELEMENT_LIMITS_H
#define PB_STUDY_ELEMENT_LIMITS_H

#include <stdbool.h>
#include <stddef.h>

#include "base/json.h"
#include "base/status.h"

// How a quantity is told: its key, name, and unit for people.
typedef struct pb_quantity {
  const char *key, *name, *unit;
  double scale;  // SI value × scale is in unit
} pb_quantity;

// Of actuators (stroke, stiffness, resolution …) and joints; NULL: no such key. [any]
const pb_quantity *pb_quantity_find(const char *key);

typedef struct pb_limit {
  const pb_quantity *quantity;
  double low, high;  // −∞, ∞: none
  bool about;        // low and high are allowed themselves
} pb_limit;

typedef struct pb_limits {
  char *name;
  size_t count;
  pb_limit *limit;  // [count] in the order of the file
} pb_limits;        // zero-initialise; free with pb_limits_clear

// Reads a specification whose limits are on quantities out of known[] (NULL-terminated keys).
// Fails with PB_ERR_SCHEMA, naming the JSON pointer, PB_ERR_MEMORY. [init]
pb_status pb_limits_read(const cJSON *file, const char *const *known, pb_limits *out,
                         pb_error *err);
void pb_limits_clear(pb_limits *limits);

typedef enum pb_verdict { PB_UNKNOWN, PB_MET, PB_MISSED } pb_verdict;

// NaN is unknown, its margin NaN. [any]
pb_verdict pb_limit_judge(const pb_limit *limit, double value, double *margin);

// "> 100 µm", "< 2 nm", "0.5 … 2 N/µm" into text. [any]
void pb_limit_text(const pb_limit *limit, char *text, size_t size);

#endif
