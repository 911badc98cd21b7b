// See request_body.h.
#include "request_body.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static pb_status refuse(pb_error *err, const char *key, const char *expected) {
  char where[256];
  pb_json_pointer(where, sizeof where, "", key);
  return pb_fail(err, PB_ERR_SCHEMA, where, "expected %s", expected);
}

pb_status pb_body_known(const cJSON *body, const char *const *keys, pb_error *err) {
  for (const cJSON *item = body->child; item; item = item->next) {
    size_t k = 0;
    while (keys[k] && strcmp(keys[k], item->string) != 0) k++;
    if (keys[k]) continue;
    char where[256];
    pb_json_pointer(where, sizeof where, "", item->string);
    return pb_fail(err, PB_ERR_SCHEMA, where, "is not a key of this request");
  }
  return PB_OK;
}

pb_status pb_body_string(const cJSON *body, const char *key, bool required, const char **out,
                         pb_error *err) {
  const cJSON *item = pb_json_member(body, key);
  if (!item && !required) return PB_OK;
  if (!cJSON_IsString(item) || !*item->valuestring)
    return refuse(err, key, "a string that is not empty");
  *out = item->valuestring;
  return PB_OK;
}

pb_status pb_body_bool(const cJSON *body, const char *key, bool *out, pb_error *err) {
  const cJSON *item = pb_json_member(body, key);
  if (!item) return PB_OK;
  if (!cJSON_IsBool(item)) return refuse(err, key, "true or false");
  *out = cJSON_IsTrue(item);
  return PB_OK;
}

pb_status pb_body_number(const cJSON *body, const char *key, double *out, pb_error *err) {
  const cJSON *item = pb_json_member(body, key);
  if (!item) return PB_OK;
  if (!cJSON_IsNumber(item)) return refuse(err, key, "a number");
  *out = item->valuedouble;
  return PB_OK;
}

pb_status pb_body_integer(const cJSON *body, const char *key, bool required, double low,
                          double high, double *out, pb_error *err) {
  const cJSON *item = pb_json_member(body, key);
  if (!item && !required) return PB_OK;
  const double value = cJSON_IsNumber(item) ? item->valuedouble : NAN;
  if (!(value >= low && value <= high) || value != floor(value)) {
    char expected[96];
    snprintf(expected, sizeof expected, "a whole number from %.0f to %.0f", low, high);
    return refuse(err, key, expected);
  }
  *out = value;
  return PB_OK;
}
