// Snapshot files: the plant, where its state stood, and what ran inside the step, so that another
// process continues the run bit for bit.
//
// A fixed header of 160 octets, then four pieces without padding, then a SHA-256 of everything
// before it. All numbers little-endian; states are arrays of 64-bit words, held as such.
//
//     0  magic, 8 octets          40  nx, nu, ny: uint64 each
//     8  version, uint32          64  SHA-256 of the plant text, 64 hexadecimal digits
//    12  revision, uint32        128  octets of the plant text, the state, the host text, the host
//    16  step, uint64                 state: uint64 each; the pieces follow in this order
//    24  hash, uint64
//    32  sample rate, double
#ifndef PB_SNAPSHOT_H
#define PB_SNAPSHOT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/status.h"
#include "model/model.h"

typedef struct pb_snapshot_data {
  uint64_t step;
  uint64_t hash;  // of the run so far (hash.h)
  uint32_t revision;
  double sample_rate;  // Hz
  uint64_t nx, nu, ny;
  char plant_sha256[65];  // of plant_text
  char *plant_text;
  size_t state_bytes;  // a multiple of 8
  void *state;         // of the plant: a pb_state
  char *host_text;     // what pb_host_text gives
  size_t host_bytes;   // a multiple of 8
  void *host;          // what pb_host_save gives; may be NULL without octets
} pb_snapshot_data;

// Writes the file beside its place and renames it, on the disk when this returns: after a failure
// what was there is there still. The data remain the caller's. Fails with PB_ERR_ARGUMENT (data
// that a reader would refuse), PB_ERR_IO (path, reason), PB_ERR_MEMORY. [init]
pb_status pb_snapshot_write(const char *path, const pb_snapshot_data *data, pb_error *err);

// Reads a file into *out, which is freed with pb_snapshot_clear; empty after a failure. Fails with
// PB_ERR_IO (cannot be read), PB_ERR_SYNTAX (not a snapshot, of another version, truncated,
// altered), PB_ERR_MEMORY. [init]
pb_status pb_snapshot_read(const char *path, pb_snapshot_data *out, pb_error *err);

// Whether the state is one of this model: rate, sizes. Fails with PB_ERR_STATE. [any]
pb_status pb_snapshot_check(const pb_snapshot_data *data, const pb_model *model, pb_error *err);

// Frees the texts and states and zeroes the struct. [init]
void pb_snapshot_clear(pb_snapshot_data *data);

// Whether a file of this name stays in its directory: 1 to 100 letters, digits, '.', '_', '-', the
// first not a '.'. [any]
bool pb_snapshot_name_valid(const char *name);

#endif
