// A plant file with a merge patch, as text.
#ifndef TESTS_SUPPORT_PATCHED_H
#define TESTS_SUPPORT_PATCHED_H

#include "base/json.h"

// Owned by the caller; needs cmocka.h before it.
static inline char *patched_plant(const char *path, const char *patch) {
  char *text = NULL;
  cJSON *file = NULL, *change = cJSON_Parse(patch);
  assert_int_equal(pb_json_read(path, &file, NULL, NULL), PB_OK);
  assert_non_null(change);
  cJSON *merged = pb_json_merge(file, change);
  assert_int_equal(pb_json_print(merged, &text, NULL), PB_OK);
  cJSON_Delete(file);
  cJSON_Delete(change);
  cJSON_Delete(merged);
  return text;
}

#endif
