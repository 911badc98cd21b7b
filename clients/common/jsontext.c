// JSON on the command line: see jsontext.h.
#include "jsontext.h"

#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/json.h"
#include "base/text.h"
#include "standard_output.h"

static pb_status parse_named(const char *text, size_t length, const char *name, cJSON **out,
                             pb_error *err) {
  pb_error inner = {0};
  const pb_status status = pb_json_parse(text, length, out, &inner);
  if (!status) return PB_OK;
  return pb_fail(err, status, name, "%s%s%s", inner.where, inner.where[0] ? ": " : "",
                 inner.message);
}

pb_status pb_json_stream(FILE *stream, const char *name, cJSON **out, pb_error *err) {
  pb_text text = {0};
  char part[4096];
  size_t n;
  *out = NULL;
  while ((n = fread(part, 1, sizeof part, stream)) > 0) pb_text_append_n(&text, part, n);
  pb_status status = PB_OK;
  if (text.failed)
    status = pb_fail_memory(err, name);
  else if (ferror(stream))
    status = pb_fail(err, PB_ERR_IO, name, "cannot be read");
  else
    status = parse_named(text.text ? text.text : "", text.length, name, out, err);
  free(text.text);
  return status;
}

pb_status pb_json_argument(const char *argument, cJSON **out, pb_error *err) {
  *out = NULL;
  if (argument[0] == '@') return pb_json_read(argument + 1, out, NULL, err);
  if (strcmp(argument, "-") == 0) return pb_json_stream(stdin, "standard input", out, err);
  return parse_named(argument, strlen(argument), "argument", out, err);
}

static pb_status put(const char *text, const char *end, FILE *stream, pb_error *err) {
  fputs(text, stream);
  fputs(end, stream);
  if (stream == stdout) return pb_stdout_flush(err);
  if (fflush(stream) != 0 || ferror(stream))
    return pb_fail(err, PB_ERR_IO, "output", "cannot be written");
  return PB_OK;
}

pb_status pb_json_show(const cJSON *value, FILE *stream, pb_error *err) {
  const bool pretty = isatty(fileno(stream)) == 1;
  char *text = NULL;
  pb_status status =
      pretty ? pb_json_print(value, &text, err) : pb_json_print_compact(value, &text, err);
  if (!status) status = put(text, pretty ? "" : "\n", stream, err);
  free(text);
  return status;
}

pb_status pb_json_show_text(const char *text, FILE *stream, pb_error *err) {
  cJSON *json = NULL;
  pb_status status = PB_OK;
  if (pb_json_parse(text, strlen(text), &json, NULL))
    status = put(text, "\n", stream, err);
  else
    status = pb_json_show(json, stream, err);
  cJSON_Delete(json);
  return status;
}
