// The compressions of chunks that the format names: "" (none), "lz4" (LZ4 frames), "zstd".
#ifndef PB_CLIENTS_MCAP_COMPRESS_H
#define PB_CLIENTS_MCAP_COMPRESS_H

#include "base/status.h"
#include "bytes.h"

typedef enum pb_mcap_compression {
  PB_MCAP_NONE,
  PB_MCAP_LZ4,
  PB_MCAP_ZSTD,
  PB_MCAP_COMPRESSIONS
} pb_mcap_compression;

// Its name in a file; PB_MCAP_COMPRESSIONS for a name that is none of them. [any]
const char *pb_mcap_compression_name(pb_mcap_compression kind);
pb_mcap_compression pb_mcap_compression_of(pb_view name);

// Appends data, compressed, to *out; not for PB_MCAP_NONE. Fails with PB_ERR_MEMORY. [init]
pb_status pb_mcap_compress(pb_mcap_compression kind, pb_view data, pb_bytes *out, pb_error *err);

// Appends what the compressed data hold to *out, at most `most` octets. *whole: they came to their
// proper end; else what they held up to where they break off or are damaged is there. Fails with
// PB_ERR_MEMORY. [init]
pb_status pb_mcap_expand(pb_mcap_compression kind, pb_view data, size_t most, pb_bytes *out,
                         bool *whole, pb_error *err);

#endif
