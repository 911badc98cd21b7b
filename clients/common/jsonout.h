// JSON output piece by piece, for arrays too large to build as a tree first.
//
// Numbers are the shortest of 15 to 17 digits that read back as the same double; what JSON cannot
// say (infinite, not a number) becomes null. Commas and indentation are kept by the writer; arrays
// of numbers stay on one line. key: the member's name inside an object, NULL inside an array.
#ifndef PB_CLIENTS_JSONOUT_H
#define PB_CLIENTS_JSONOUT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

enum { PB_JSONOUT_DEPTH = 32 };

typedef struct pb_jsonout {
  FILE *stream;
  int depth;
  bool empty[PB_JSONOUT_DEPTH];  // nothing written yet at this level
  bool flat[PB_JSONOUT_DEPTH];   // this level and those below stay on one line
} pb_jsonout;

void pb_jsonout_begin(pb_jsonout *json, FILE *stream);

// Ends the text with a newline. The stream's error flag says whether everything was written.
void pb_jsonout_end(pb_jsonout *json);

void pb_jsonout_object(pb_jsonout *json, const char *key);
void pb_jsonout_object_end(pb_jsonout *json);
void pb_jsonout_array(pb_jsonout *json, const char *key);
void pb_jsonout_row(pb_jsonout *json, const char *key);  // an array kept on one line
void pb_jsonout_array_end(pb_jsonout *json);             // of either kind

void pb_jsonout_number(pb_jsonout *json, const char *key, double value);
void pb_jsonout_integer(pb_jsonout *json, const char *key, uint64_t value);
void pb_jsonout_boolean(pb_jsonout *json, const char *key, bool value);
void pb_jsonout_text(pb_jsonout *json, const char *key, const char *text);  // NULL: null
void pb_jsonout_numbers(pb_jsonout *json, const char *key, const double *value, size_t count);
void pb_jsonout_texts(pb_jsonout *json, const char *key, const char *const *text, size_t count);

// The number alone, as text of at most 31 characters; always terminated. [any]
void pb_jsonout_format(double value, char text[32]);

#endif
