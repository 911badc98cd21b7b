// A point as bytes: the struct as it is, then the block of its arrays.
#include "wire.h"

#include <stdlib.h>
#include <string.h>

pb_status study_message_pack(const study_message *m, void **bytes, size_t *size, pb_error *err) {
  size_t block = m->status ? 0 : pb_study_point_doubles(&m->point.size) * sizeof(double);
  *size = sizeof *m + block;
  char *text = malloc(*size);
  *bytes = text;
  if (!text) return pb_fail_memory(err, "study");
  memcpy(text, m, sizeof *m);
  if (block) memcpy(text + sizeof *m, m->point.data, block);
  return PB_OK;
}

pb_status study_message_unpack(const void *bytes, size_t size, study_message *out, pb_error *err) {
  const char *text = bytes;
  if (size < sizeof *out) return pb_fail(err, PB_ERR_SYNTAX, "study", "a short message");
  memcpy(out, text, sizeof *out);
  out->point.data = NULL;
  if (out->status) return PB_OK;
  size_t block = pb_study_point_doubles(&out->point.size) * sizeof(double);
  if (size != sizeof *out + block)
    return pb_fail(err, PB_ERR_SYNTAX, "study", "%zu bytes do not make this point", size);
  pb_status status = pb_study_point_allocate(&out->point, err);
  if (!status) memcpy(out->point.data, text + sizeof *out, block);
  return status;
}
