// JSON on the command line: a value from an argument, and a value for whoever reads the output.
#ifndef PB_CLIENTS_JSONTEXT_H
#define PB_CLIENTS_JSONTEXT_H

#include <cjson/cJSON.h>
#include <stdbool.h>
#include <stdio.h>

#include "base/status.h"

// The JSON value of an argument: the text itself, the content of FILE for "@FILE", the standard
// input for "-". *out is owned by the caller (cJSON_Delete). Fails with PB_ERR_SYNTAX, PB_ERR_IO,
// PB_ERR_MEMORY; the error names the file or "argument". [init]
pb_status pb_json_argument(const char *argument, cJSON **out, pb_error *err);

// The same of a stream that is read to its end; name is for messages. [init]
pb_status pb_json_stream(FILE *stream, const char *name, cJSON **out, pb_error *err);

// Prints a value with a newline: indented when the stream is a terminal, else on one line. Fails
// with PB_ERR_MEMORY, PB_ERR_IO. [init]
pb_status pb_json_show(const cJSON *value, FILE *stream, pb_error *err);

// The same of a text, which is printed as it is when it is not JSON. [init]
pb_status pb_json_show_text(const char *text, FILE *stream, pb_error *err);

#endif
