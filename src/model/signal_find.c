// Inputs and outputs by name: see model.h.
#include <stdio.h>
#include <string.h>

#include "model/model.h"

static int index_of(const pb_signal *signal, size_t count, const char *name) {
  for (size_t i = 0; i < count; i++)
    if (!strcmp(signal[i].name, name)) return (int)i;
  return -1;
}

int pb_model_input(const pb_model *m, const char *name) {
  return index_of(m->input, m->nu, name);
}

int pb_model_output(const pb_model *m, const char *name) {
  return index_of(m->output, m->ny, name);
}

// The names, separated by commas; those that do not fit are counted.
static void list_names(const pb_signal *signal, size_t count, char *text, size_t size) {
  enum { TAIL = 24 };  // " and 4294967295 more"
  size_t used = 0;
  snprintf(text, size, "none");
  for (size_t i = 0; i < count; i++) {
    const size_t length = strlen(signal[i].name);
    if (used + length + 2 + TAIL > size) {
      snprintf(text + used, size - used, " and %zu more", count - i);
      return;
    }
    used += (size_t)snprintf(text + used, size - used, "%s%s", i ? ", " : "", signal[i].name);
  }
}

pb_status pb_signal_find(const pb_signal *signal, size_t count, const char *kind, const char *name,
                         const char *where, size_t *index, pb_error *err) {
  char names[360];
  const int at = index_of(signal, count, name);
  if (at >= 0) {
    *index = (size_t)at;
    return PB_OK;
  }
  list_names(signal, count, names, sizeof names);
  return pb_fail(err, PB_ERR_REFERENCE, where, "the plant has no %s '%.64s'; its %ss: %s", kind,
                 name, kind, names);
}
