// Named node sets out of the input decks of Abaqus and CalculiX: *NSET, NSET=NAME[, GENERATE]
// blocks, and NSET=NAME on a *NODE line. Names count without regard to case, as they do there.
#ifndef PB_CLIENTS_PART_NODE_SETS_H
#define PB_CLIENTS_PART_NODE_SETS_H

#include <stddef.h>
#include <stdint.h>

#include "base/status.h"

// The node numbers of one set, in the order of the file; sets of one name add up. *number [*count]
// is owned by the caller. Fails with PB_ERR_IO, PB_ERR_SYNTAX (where = "file:line"),
// PB_ERR_REFERENCE (the file has no such set), PB_ERR_MEMORY.
pb_status pb_node_set_read(const char *path, const char *name, int64_t **number, size_t *count,
                           pb_error *err);

#endif
