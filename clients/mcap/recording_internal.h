// What the parts that read a recording share. Not for tools.
#ifndef PB_CLIENTS_RECORDING_INTERNAL_H
#define PB_CLIENTS_RECORDING_INTERNAL_H

#include "recording.h"

// Fills *r (zeroed) and *plant (NULL) from the map; on failure what was filled is still the
// caller's to free. recording_revision.c
pb_status pb_recorded_revision_read(pb_view pairs, pb_recorded_revision *r, char **plant,
                                    pb_error *err);
void pb_recorded_revision_free(pb_recorded_revision *r);

#endif
