// Writes an MCAP file as it comes: what has been flushed is on its way to the disk as whole
// records, so that a file that never got its end is readable up to there.
//
// Chunks carry CRCs, and so do attachments, data section and summary.
// Every failure leaves a writer that can only be discarded.
#ifndef PB_CLIENTS_MCAP_WRITER_H
#define PB_CLIENTS_MCAP_WRITER_H

#include "base/status.h"
#include "mcap.h"
#include "mcap_compress.h"

typedef struct pb_mcap_writer pb_mcap_writer;

enum { PB_MCAP_CHUNK_BYTES = 1 << 20, PB_MCAP_CHANNELS = 64 };

typedef struct pb_mcap_writer_options {
  const char *profile, *library;    // NULL: ""
  pb_mcap_compression compression;  // of chunks
  bool exclusive;                   // an existing file is not replaced: PB_ERR_IO
} pb_mcap_writer_options;

// Creates the file. *out is released by pb_mcap_writer_close or pb_mcap_writer_discard. Fails with
// PB_ERR_IO, PB_ERR_MEMORY.
pb_status pb_mcap_writer_create(const char *path, const pb_mcap_writer_options *options,
                                pb_mcap_writer **out, pb_error *err);

// A schema, and a channel of messages that refers to it (0: none); *id counts from 1. At most
// PB_MCAP_CHANNELS of each (PB_ERR_ARGUMENT).
pb_status pb_mcap_writer_schema(pb_mcap_writer *w, const char *name, const char *encoding,
                                const char *text, uint16_t *id, pb_error *err);
pb_status pb_mcap_writer_channel(pb_mcap_writer *w, uint16_t schema, const char *topic,
                                 const char *encoding, const pb_mcap_pair *metadata, size_t count,
                                 uint16_t *id, pb_error *err);

// Room for a message of `size` octets in the present chunk, to be filled before the next call;
// times in ns. A chunk is ended when it has PB_MCAP_CHUNK_BYTES. NULL: see *err.
typedef struct pb_mcap_stamp {
  uint32_t sequence;
  uint64_t log_time, publish_time;
} pb_mcap_stamp;
uint8_t *pb_mcap_writer_message(pb_mcap_writer *w, uint16_t channel, pb_mcap_stamp stamp,
                                size_t size, pb_error *err);

// Attachment and metadata stand between chunks: the present one is ended first.
pb_status pb_mcap_writer_attach(pb_mcap_writer *w, const char *name, const char *media_type,
                                uint64_t log_time, const void *data, size_t size, pb_error *err);
pb_status pb_mcap_writer_metadata(pb_mcap_writer *w, const char *name, const pb_mcap_pair *pairs,
                                  size_t count, pb_error *err);

// Ends the present chunk and hands everything to the operating system.
pb_status pb_mcap_writer_flush(pb_mcap_writer *w, pb_error *err);

// … and waits until the disk has it.
pb_status pb_mcap_writer_sync(pb_mcap_writer *w, pb_error *err);

// Octets written so far, and those of the chunk that is being filled. [any]
uint64_t pb_mcap_writer_bytes(const pb_mcap_writer *w);

// Summary, footer, end. *w is released either way. Fails with PB_ERR_IO, PB_ERR_MEMORY.
pb_status pb_mcap_writer_close(pb_mcap_writer *w, pb_error *err);

// Closes the file as it is. NULL is allowed.
void pb_mcap_writer_discard(pb_mcap_writer *w);

#endif
