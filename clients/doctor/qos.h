// Whether a discovered reader or writer can talk to ours.
#ifndef PB_CLIENTS_DOCTOR_QOS_H
#define PB_CLIENTS_DOCTOR_QOS_H

#include "dds/dds.h"

// The first policy by which a reader that requests cannot be matched with a writer that offers
// ("reliability: BEST_EFFORT offered, RELIABLE requested"), into text; false: none, they match.
// The rules are those of the DDS specification for requested and offered qualities. [any]
bool qos_conflict(const dds_qos_t *offered, const dds_qos_t *requested, char *text, size_t size);

#endif
