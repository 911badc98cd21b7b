// Status codes, errors and warnings: see status.h.
#include "base/status.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const char *pb_status_name(pb_status code) {
  switch (code) {
#define PB_STATUS_NAME(name, text) \
  case PB_##name:                  \
    return #name;
    PB_STATUS_LIST(PB_STATUS_NAME)
#undef PB_STATUS_NAME
  }
  return "unknown";
}

const char *pb_status_text(pb_status code) {
  switch (code) {
#define PB_STATUS_TEXT(name, text) \
  case PB_##name:                  \
    return text;
    PB_STATUS_LIST(PB_STATUS_TEXT)
#undef PB_STATUS_TEXT
  }
  return "unknown status";
}

pb_status pb_fail(pb_error *err, pb_status code, const char *where, const char *format, ...) {
  if (!err) return code;
  err->code = code;
  snprintf(err->where, sizeof err->where, "%s", where ? where : "");
  va_list args;
  va_start(args, format);
  vsnprintf(err->message, sizeof err->message, format, args);
  va_end(args);
  return code;
}

pb_status pb_fail_memory(pb_error *err, const char *where) {
  return pb_fail(err, PB_ERR_MEMORY, where, "out of memory");
}

pb_status pb_warn(pb_warnings *list, pb_error *err, const char *where, const char *format, ...) {
  if (!list) return PB_OK;
  if (list->count == list->capacity) {
    size_t capacity = list->capacity ? 2 * list->capacity : 8;
    pb_warning *item = realloc(list->item, capacity * sizeof *item);
    if (!item) return pb_fail_memory(err, where);
    list->item = item;
    list->capacity = capacity;
  }
  pb_warning *w = &list->item[list->count++];
  snprintf(w->where, sizeof w->where, "%s", where ? where : "");
  va_list args;
  va_start(args, format);
  vsnprintf(w->message, sizeof w->message, format, args);
  va_end(args);
  return PB_OK;
}

void pb_warnings_clear(pb_warnings *list) {
  if (!list) return;
  free(list->item);
  *list = (pb_warnings){0};
}

void pb_error_format(const pb_error *err, char *text, size_t size) {
  const char *separator = err->where[0] ? ": " : "";
  snprintf(text, size, "%s%s%s", err->where, separator, err->message);
}
