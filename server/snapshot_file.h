// Whole files of octets, for snapshots (internal to snapshot*.c).
#ifndef PB_SNAPSHOT_FILE_H
#define PB_SNAPSHOT_FILE_H

#include <stddef.h>

#include "base/status.h"

// Writes beside path, onto the disk, then renames. Fails with PB_ERR_IO, PB_ERR_ARGUMENT
// (above 2 GiB), PB_ERR_MEMORY; what was at path before is then there still, and nothing beside it.
pb_status pb_snapshot_file_write(const char *path, const unsigned char *data, size_t size,
                                 pb_error *err);

// The octets of a regular file of at most 2 GiB, owned by the caller. Fails with PB_ERR_IO,
// PB_ERR_MEMORY.
pb_status pb_snapshot_file_read(const char *path, unsigned char **data, size_t *size,
                                pb_error *err);

#endif
