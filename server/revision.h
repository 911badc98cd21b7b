// One revision of the plant: its file, its compiled model, and what the description says of it.
// Immutable once built.
#ifndef PB_REVISION_H
#define PB_REVISION_H

#include <stddef.h>
#include <stdint.h>

#include "model/model.h"
#include "model/transfer.h"

typedef struct pb_revision {
  uint32_t number;  // from 1
  pb_model *model;
  pb_motion_map *map;  // from its states to the motion of its components
  char *text;          // the plant file in canonical form
  char sha256[65];     // of text
  double *packed;      // the model as the description carries it
  size_t packed_count;
} pb_revision;

// Builds a revision from a plant file's text; element paths are relative to directory, `means` is
// what there is to build it with (NULL: nothing). Seconds for a large plant. Fails as loading and
// compiling do, and with PB_ERR_SCHEMA when the name cannot be a partition, PB_ERR_ARGUMENT when
// the bus cannot carry the signals. [init]
pb_status pb_revision_build(const char *text, const char *directory, uint32_t number,
                            const pb_means *means, pb_warnings *warnings, pb_revision **out,
                            pb_error *err);
void pb_revision_free(pb_revision *revision);

#endif
