// A growing text, and copies of strings, with allocation failures reported.
#ifndef PB_BASE_TEXT_H
#define PB_BASE_TEXT_H

#include <stdbool.h>
#include <stddef.h>

#include "base/status.h"

// Zero-initialise; text is NULL or terminated. After a failed append `failed` is true, the text is
// freed and further appends do nothing, so that a caller checks once at the end.
typedef struct pb_text {
  char *text;
  size_t length, capacity;
  bool failed;
} pb_text;

void pb_text_append(pb_text *t, const char *s);
void pb_text_append_n(pb_text *t, const char *s, size_t n);
void pb_text_format(pb_text *t, const char *format, ...) __attribute__((format(printf, 2, 3)));

// A copy owned by the caller, or NULL. (strdup by way of malloc, so that the fault test sees it.)
char *pb_text_copy(const char *s);

// A double with the fewest digits (15 to 17) that read back to the same value.
void pb_text_number(char *out, size_t size, double value);

// The whole of a file of at most 256 MiB, terminated, owned by the caller; PB_ERR_IO names the
// file. [init]
pb_status pb_text_read(const char *path, char **text, size_t *length, pb_error *err);

#endif
