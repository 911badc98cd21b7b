// What the two halves of the writer share: records and chunks. Not for tools.
#ifndef PB_CLIENTS_MCAP_WRITER_INTERNAL_H
#define PB_CLIENTS_MCAP_WRITER_INTERNAL_H

#include <stdio.h>

#include "mcap_writer.h"

// The groups of the summary, in the order in which they are written; each is a row of records.
typedef enum pb_mcap_group {
  PB_MCAP_GROUP_SCHEMA,
  PB_MCAP_GROUP_CHANNEL,
  PB_MCAP_GROUP_STATISTICS,
  PB_MCAP_GROUP_CHUNK,
  PB_MCAP_GROUP_ATTACHMENT,
  PB_MCAP_GROUP_METADATA,
  PB_MCAP_GROUPS
} pb_mcap_group;

struct pb_mcap_channel {
  uint64_t messages;
  pb_bytes index;  // of the present chunk: log time and offset of each message
};

struct pb_mcap_writer {
  char *path;
  FILE *stream;
  pb_mcap_compression compression;
  uint64_t offset;                                   // octets written
  uint32_t crc;                                      // of all of them
  pb_bytes record;                                   // being put together
  pb_bytes packed;                                   // the compressed chunk
  uint64_t packed_size;                              // … or that of one that is not
  pb_bytes chunk;                                    // the records of the present chunk
  uint64_t chunk_messages, chunk_first, chunk_last;  // … and the log times of its messages
  uint64_t messages, first, last;                    // of the file
  uint16_t schemas, channels;
  uint32_t attachments, metadata, chunks;
  struct pb_mcap_channel channel[PB_MCAP_CHANNELS];
  pb_bytes group[PB_MCAP_GROUPS];
};

// Opcode and a length that the end sets.
size_t pb_mcap_record_begin(pb_bytes *b, pb_mcap_opcode opcode);
void pb_mcap_record_end(pb_bytes *b, size_t begin);

// To the file.
pb_status pb_mcap_put(pb_mcap_writer *w, const void *data, size_t size, pb_error *err);

// Writes the present chunk, if it holds anything, and its message indexes.
pb_status pb_mcap_chunk_end(pb_mcap_writer *w, pb_error *err);

#endif
