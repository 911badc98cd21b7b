// JSON output piece by piece: see jsonout.h.
#include "jsonout.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

void pb_jsonout_begin(pb_jsonout *json, FILE *stream) {
  *json = (pb_jsonout){.stream = stream};
  json->empty[0] = true;
}

void pb_jsonout_end(pb_jsonout *json) {
  assert(json->depth == 0);
  fputc('\n', json->stream);
}

static void put_string(FILE *stream, const char *text) {
  fputc('"', stream);
  for (; *text; text++) {
    unsigned char c = (unsigned char)*text;
    switch (c) {
    case '"':
    case '\\':
      fputc('\\', stream);
      fputc(c, stream);
      break;
    case '\n':
      fputs("\\n", stream);
      break;
    case '\t':
      fputs("\\t", stream);
      break;
    default:
      if (c < 0x20) {
        fprintf(stream, "\\u%04x", c);
      } else {
        fputc(c, stream);
      }
    }
  }
  fputc('"', stream);
}

static void break_line(pb_jsonout *json) {
  if (json->depth && !json->flat[json->depth]) fprintf(json->stream, "\n%*s", 2 * json->depth, "");
}

static void begin_item(pb_jsonout *json, const char *key) {
  if (!json->empty[json->depth]) {
    fputs(json->flat[json->depth] ? ", " : ",", json->stream);
  }
  json->empty[json->depth] = false;
  break_line(json);
  if (!key) return;
  put_string(json->stream, key);
  fputs(": ", json->stream);
}

static void open_level(pb_jsonout *json, const char *key, char bracket, bool flat) {
  begin_item(json, key);
  assert(json->depth + 1 < PB_JSONOUT_DEPTH);
  flat = flat || json->flat[json->depth];
  json->depth++;
  json->empty[json->depth] = true;
  json->flat[json->depth] = flat;
  fputc(bracket, json->stream);
}

static void close_level(pb_jsonout *json, char bracket) {
  assert(json->depth > 0);
  bool broken = !json->empty[json->depth] && !json->flat[json->depth];
  json->depth--;
  if (broken) fprintf(json->stream, "\n%*s", 2 * json->depth, "");
  fputc(bracket, json->stream);
}

void pb_jsonout_object(pb_jsonout *json, const char *key) {
  open_level(json, key, '{', false);
}
void pb_jsonout_object_end(pb_jsonout *json) {
  close_level(json, '}');
}
void pb_jsonout_array(pb_jsonout *json, const char *key) {
  open_level(json, key, '[', false);
}
void pb_jsonout_row(pb_jsonout *json, const char *key) {
  open_level(json, key, '[', true);
}
void pb_jsonout_array_end(pb_jsonout *json) {
  close_level(json, ']');
}

void pb_jsonout_format(double value, char text[32]) {
  if (!isfinite(value)) {
    snprintf(text, 32, "null");
    return;
  }
  for (int digits = 15; digits <= 17; digits++) {
    snprintf(text, 32, "%.*g", digits, value);
    if (strtod(text, NULL) == value) return;
  }
}

void pb_jsonout_number(pb_jsonout *json, const char *key, double value) {
  char text[32];
  pb_jsonout_format(value, text);
  begin_item(json, key);
  fputs(text, json->stream);
}

void pb_jsonout_integer(pb_jsonout *json, const char *key, uint64_t value) {
  begin_item(json, key);
  fprintf(json->stream, "%llu", (unsigned long long)value);
}

void pb_jsonout_boolean(pb_jsonout *json, const char *key, bool value) {
  begin_item(json, key);
  fputs(value ? "true" : "false", json->stream);
}

void pb_jsonout_text(pb_jsonout *json, const char *key, const char *text) {
  begin_item(json, key);
  if (text) {
    put_string(json->stream, text);
  } else {
    fputs("null", json->stream);
  }
}

void pb_jsonout_numbers(pb_jsonout *json, const char *key, const double *value, size_t count) {
  pb_jsonout_row(json, key);
  for (size_t i = 0; i < count; i++) pb_jsonout_number(json, NULL, value[i]);
  pb_jsonout_array_end(json);
}

void pb_jsonout_texts(pb_jsonout *json, const char *key, const char *const *text, size_t count) {
  pb_jsonout_row(json, key);
  for (size_t i = 0; i < count; i++) pb_jsonout_text(json, NULL, text[i]);
  pb_jsonout_array_end(json);
}
