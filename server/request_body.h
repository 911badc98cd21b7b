// Reading the body of a request strictly: unknown keys and wrong types are refused by JSON pointer.
#ifndef PB_REQUEST_BODY_H
#define PB_REQUEST_BODY_H

#include <stdbool.h>

#include "base/json.h"

// Refuses keys outside the NULL-terminated list.
pb_status pb_body_known(const cJSON *body, const char *const *keys, pb_error *err);

// *out keeps its value when the key is absent (refused when required). Strings live as long as body
// and are not empty.
pb_status pb_body_string(const cJSON *body, const char *key, bool required, const char **out,
                         pb_error *err);
pb_status pb_body_bool(const cJSON *body, const char *key, bool *out, pb_error *err);
pb_status pb_body_number(const cJSON *body, const char *key, double *out, pb_error *err);

// A whole number from low to high.
pb_status pb_body_integer(const cJSON *body, const char *key, bool required, double low,
                          double high, double *out, pb_error *err);

#endif
