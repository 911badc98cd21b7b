// See revision.h.
#include "revision.h"

#include <openssl/evp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bus_qos.h"
#include "stepper.h"

static pb_status hash_text(const char *text, char hex[65], pb_error *err) {
  unsigned char digest[EVP_MAX_MD_SIZE];
  unsigned int length = 0;
  if (EVP_Digest(text, strlen(text), digest, &length, EVP_sha256(), NULL) != 1 || length != 32)
    return pb_fail(err, PB_ERR_IO, "SHA-256", "cannot be computed");
  for (unsigned i = 0; i < length; i++) snprintf(hex + 2 * i, 3, "%02x", digest[i]);
  return PB_OK;
}

pb_status pb_revision_build(const char *text, const char *directory, uint32_t number,
                            const pb_means *means, pb_warnings *warnings, pb_revision **out,
                            pb_error *err) {
  *out = NULL;
  pb_revision *r = calloc(1, sizeof *r);
  if (!r) return pb_fail_memory(err, "revision");
  r->number = number;
  pb_status status = pb_model_parse_with(text, strlen(text), directory, means, warnings, &r->model,
                                         &r->map, &r->text, err);
  if (!status && !pb_plant_name_valid(r->model->name))
    status =
        pb_fail(err, PB_ERR_SCHEMA, "/name",
                "expected 1 to 64 octets without * ? [ ] and control characters, to serve as a "
                "partition");
  if (!status) status = pb_stepper_admits(r->model, err);
  if (!status) status = hash_text(r->text, r->sha256, err);
  if (!status) status = pb_model_pack(r->model, &r->packed, &r->packed_count, err);
  if (status)
    pb_revision_free(r);
  else
    *out = r;
  return status;
}

void pb_revision_free(pb_revision *r) {
  if (!r) return;
  pb_model_free(r->model);
  pb_motion_map_free(r->map);
  free(r->text);
  free(r->packed);
  free(r);
}
