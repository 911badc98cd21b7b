// Reading typed values out of JSON objects with errors that name the place.
//
// A component or a joint may say "model": NAME and override single keys: a pb_reader looks a key up
// in the object itself and then in the model behind it, and its errors point at where the value
// stands.
#ifndef PB_PLANT_READER_H
#define PB_PLANT_READER_H

#include <stdbool.h>

#include "base/json.h"

typedef struct pb_reader {
  const cJSON *own;
  const cJSON *model;  // NULL: none
  char own_pointer[256];
  char model_pointer[256];
  pb_error *err;
} pb_reader;

// Allowed range of a number.
typedef enum pb_range { PB_ANY, PB_NON_NEGATIVE, PB_POSITIVE, PB_SIGN } pb_range;

// One number of a struct: its key, where it goes, and what is allowed.
typedef struct pb_field {
  const char *key;
  size_t offset;
  pb_range range;
  bool required;
  double fallback;
} pb_field;

// A reader of `object`, which must be a JSON object, with the model that its "model" key names.
// `models` may be NULL. Errors: PB_ERR_SCHEMA, PB_ERR_REFERENCE.
pb_status pb_reader_open(const cJSON *object, const char *pointer, const cJSON *models,
                         pb_reader *out, pb_error *err);

// The value of a key, or NULL; `where` (256 characters) receives its JSON pointer in either case.
const cJSON *pb_reader_find(const pb_reader *r, const char *key, char *where);

// Refuses keys outside `known` (a NULL-terminated list) and `fields` (count entries).
pb_status pb_reader_known(const pb_reader *r, const char *const *known, const pb_field *fields,
                          size_t count);

// Reads the fields of a struct at `base`. With `partial`, missing required keys are passed over.
pb_status pb_reader_fields(const pb_reader *r, const pb_field *fields, size_t count, void *base,
                           bool partial);

pb_status pb_reader_number(const pb_reader *r, const pb_field *field, double *out);

// [x, y, z]; *found tells whether the key is there. Absent and required: PB_ERR_SCHEMA.
pb_status pb_reader_vector(const pb_reader *r, const char *key, bool required, double out[3],
                           bool *found);

// A unit vector along the [x, y, z] of the key; a zero vector is refused.
pb_status pb_reader_direction(const pb_reader *r, const char *key, bool required, double out[3],
                              bool *found);

// A non-empty string, valid as long as the JSON; NULL in *out when absent and not required.
pb_status pb_reader_string(const pb_reader *r, const char *key, bool required, const char **out);

// An array of exactly n numbers, or fails naming what was expected.
pb_status pb_json_numbers(const cJSON *value, const char *where, size_t n, double *out,
                          pb_error *err);

// A whole number from low to high out of a JSON value.
pb_status pb_json_index(const cJSON *value, const char *where, size_t low, size_t high, size_t *out,
                        pb_error *err);

#endif
