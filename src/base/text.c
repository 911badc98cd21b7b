// A growing text: see text.h.
#include "base/text.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const size_t largest_file = (size_t)256 << 20;  // devices such as /dev/zero never end

static bool text_reserve(pb_text *t, size_t more) {
  if (t->failed) return false;
  if (t->length + more + 1 <= t->capacity) return true;
  size_t capacity = t->capacity ? 2 * t->capacity : 256;
  while (capacity < t->length + more + 1) capacity *= 2;
  char *text = realloc(t->text, capacity);
  if (!text) {
    free(t->text);
    *t = (pb_text){.failed = true};
    return false;
  }
  t->text = text;
  t->capacity = capacity;
  return true;
}

void pb_text_append_n(pb_text *t, const char *s, size_t n) {
  if (!text_reserve(t, n)) return;
  memcpy(t->text + t->length, s, n);
  t->length += n;
  t->text[t->length] = '\0';
}

void pb_text_append(pb_text *t, const char *s) {
  pb_text_append_n(t, s, strlen(s));
}

void pb_text_format(pb_text *t, const char *format, ...) {
  va_list args, again;
  va_start(args, format);
  va_copy(again, args);
  int n = vsnprintf(NULL, 0, format, args);
  if (n >= 0 && text_reserve(t, (size_t)n)) {
    vsnprintf(t->text + t->length, (size_t)n + 1, format, again);
    t->length += (size_t)n;
  }
  va_end(again);
  va_end(args);
}

char *pb_text_copy(const char *s) {
  size_t n = strlen(s) + 1;
  char *copy = malloc(n);
  if (copy) memcpy(copy, s, n);
  return copy;
}

void pb_text_number(char *out, size_t size, double value) {
  for (int digits = 15; digits <= 17; digits++) {
    snprintf(out, size, "%.*g", digits, value);
    if (strtod(out, NULL) == value) return;
  }
}

pb_status pb_text_read(const char *path, char **text, size_t *length, pb_error *err) {
  *text = NULL;
  *length = 0;
  FILE *file = fopen(path, "rb");
  if (!file) return pb_fail(err, PB_ERR_IO, path, "cannot be opened: %m");
  pb_text t = {0};
  char buffer[4096];
  size_t n;
  while (!t.failed && t.length <= largest_file && (n = fread(buffer, 1, sizeof buffer, file)) > 0)
    pb_text_append_n(&t, buffer, n);
  int failed = ferror(file);
  fclose(file);
  if (failed || t.length > largest_file) {
    free(t.text);
    return pb_fail(err, PB_ERR_IO, path, "%s",
                   failed ? "cannot be read" : "is larger than 256 MiB");
  }
  if (!t.failed && !t.text) pb_text_append(&t, "");
  if (t.failed) return pb_fail_memory(err, path);
  *text = t.text;
  *length = t.length;
  return PB_OK;
}
