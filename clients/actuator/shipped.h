// Data files that the tools carry with them (config/actuators, config/specifications).
#ifndef PB_ACTUATOR_SHIPPED_H
#define PB_ACTUATOR_SHIPPED_H

#include <cjson/cJSON.h>

#include "base/status.h"
#include "study/element_limits.h"

extern const char pb_shipped_actuators[];
extern const char pb_shipped_actuator_specification[];
extern const char pb_shipped_joint_specification[];

// The JSON of a file, or with path NULL the shipped text; the caller's (cJSON_Delete). Fails as
// pb_json_read, naming the file. [init]
pb_status pb_shipped_read(const char *path, const char *shipped, cJSON **out, pb_error *err);

// A specification for these quantities out of a file, or the shipped one. [init]
pb_status pb_shipped_limits(const char *path, const char *shipped, const char *const *known,
                            pb_limits *out, pb_error *err);

// A data-sheet value: a number, or the range [low, high]; NaN where unknown (null or missing).
typedef struct pb_sheet_value {
  double low, high;
} pb_sheet_value;

// Reads one quantity of a data sheet's object at pointer `where`. Fails with PB_ERR_SCHEMA. [any]
pb_status pb_sheet_read(const cJSON *sheet, const char *where, const char *key, pb_sheet_value *out,
                        pb_error *err);

// The data sheets {name: {quantity: value}} of a file, or with path NULL the shipped ones; schema,
// names and quantities are checked. *file is the caller's (cJSON_Delete), *sheets points into it.
// Fails as pb_shipped_read, and with PB_ERR_SCHEMA. [init]
pb_status pb_shipped_sheets(const char *path, const char *const *known, cJSON **file,
                            const cJSON **sheets, pb_error *err);

#endif
