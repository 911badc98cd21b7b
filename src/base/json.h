// Strict JSON on top of cJSON, which by itself accepts duplicate keys, trailing text and numbers
// that overflow, and prints fifteen digits: texts that pass here mean one thing and survive a round
// trip.
#ifndef PB_BASE_JSON_H
#define PB_BASE_JSON_H

#include <cjson/cJSON.h>
#include <stddef.h>

#include "base/status.h"

// Parses exactly one JSON value (white space around it is allowed). Refuses with PB_ERR_SYNTAX,
// naming line and column or the JSON pointer: malformed text, trailing text, a NUL inside (also as
// \u0000), strings that are not UTF-8, duplicate keys, numbers that are not finite. *out is owned
// by the caller (cJSON_Delete). [init]
pb_status pb_json_parse(const char *text, size_t length, cJSON **out, pb_error *err);

// Reads and parses a file; errors name it. `text` (may be NULL) receives the text, owned by the
// caller.
pb_status pb_json_read(const char *path, cJSON **out, char **text, pb_error *err);

// Pretty-prints with two spaces of indent, arrays of numbers and strings on one line, every number
// with the fewest digits (15 to 17) that read back to the same double. *out is owned by the caller.
// [init]
pb_status pb_json_print(const cJSON *value, char **out, pb_error *err);

// Same on one line without spaces. [init]
pb_status pb_json_print_compact(const cJSON *value, char **out, pb_error *err);

// Member of an object by its exact name (cJSON's own look-up ignores case), or NULL. [any]
const cJSON *pb_json_member(const cJSON *object, const char *key);

// Appends "/key" to a JSON pointer, escaping ~ and /. Truncates silently at size. [any]
void pb_json_pointer(char *out, size_t size, const char *base, const char *key);

// RFC 7396 merge patch: a new value that is target changed by patch. Neither is changed. NULL: out
// of memory. [init]
cJSON *pb_json_merge(const cJSON *target, const cJSON *patch);

#endif
