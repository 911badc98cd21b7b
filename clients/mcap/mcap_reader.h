// Reads an MCAP file from its beginning to its end, checks every CRC, and hands out what the data
// section holds, in order.
//
// A file that stops before its footer (a recorder that was killed) is read up to its last whole
// record. A file that has its end and does not fit together is damaged, and refused.
#ifndef PB_CLIENTS_MCAP_READER_H
#define PB_CLIENTS_MCAP_READER_H

#include "base/status.h"
#include "mcap.h"

typedef struct pb_mcap_schema {
  uint16_t id;
  pb_view name, encoding, data;
} pb_mcap_schema;

typedef struct pb_mcap_channel_record {
  uint16_t id, schema;
  pb_view topic, encoding, metadata;
} pb_mcap_channel_record;

typedef struct pb_mcap_message {
  uint16_t channel;
  uint32_t sequence;
  uint64_t log_time, publish_time;
  pb_view data;
} pb_mcap_message;

typedef struct pb_mcap_attachment {
  uint64_t log_time;
  pb_view name, media_type, data;
} pb_mcap_attachment;

typedef struct pb_mcap_metadata {
  pb_view name, pairs;
} pb_mcap_metadata;

// Each may be NULL. What they are given lasts for the call. A status other than PB_OK ends the
// reading with it.
typedef struct pb_mcap_visitor {
  void *context;
  pb_status (*schema)(void *context, const pb_mcap_schema *schema, pb_error *err);
  pb_status (*channel)(void *context, const pb_mcap_channel_record *channel, pb_error *err);
  pb_status (*message)(void *context, const pb_mcap_message *message, pb_error *err);
  pb_status (*attachment)(void *context, const pb_mcap_attachment *attachment, pb_error *err);
  pb_status (*metadata)(void *context, const pb_mcap_metadata *metadata, pb_error *err);
  // What is damaged is left out and counted, and of a chunk that is cut the whole messages are
  // handed out: to mend a file. Else damage ends the reading.
  bool salvage;
} pb_mcap_visitor;

typedef struct pb_mcap_report {
  bool complete;     // has its summary and its footer
  uint64_t bytes;    // of the file
  uint64_t read_to;  // all of it, or up to here
  uint64_t messages, chunks;
  uint64_t damaged;   // salvage: records that were left out
  uint64_t salvaged;  // … messages of a chunk that is cut; no CRC covers them
} pb_mcap_report;

// Fails with PB_ERR_IO, PB_ERR_SYNTAX (no MCAP file, damaged: the place is named; an unknown
// compression), PB_ERR_MEMORY, and what a visitor returns. [init]
pb_status pb_mcap_read(const char *path, const pb_mcap_visitor *visitor, pb_mcap_report *report,
                       pb_error *err);

// Finds its way by the summary at the end of a file: only what is asked for is read. [init]
//
// Calls metadata and attachments as pb_mcap_read does, messages of the channels of one topic only,
// in the order of the chunks that hold them; `messages` [channels] are told by topic. *found false:
// the file has no summary with the indexes that this needs (and nothing was called, or not all of
// it): read it. Fails with what a visitor returns, PB_ERR_IO, PB_ERR_MEMORY.
typedef struct pb_mcap_count {
  char topic[128];
  uint64_t messages;
} pb_mcap_count;
typedef struct pb_mcap_summary {
  uint64_t bytes, first, last;  // of the file; log times of the first and the last message, ns
  size_t channels;
  pb_mcap_count channel[64];
} pb_mcap_summary;
pb_status pb_mcap_read_index(const char *path, const pb_mcap_visitor *visitor, const char *topic,
                             pb_mcap_summary *summary, bool *found, pb_error *err);

// The next pair of a map; false at its end, or when it is not well-formed (then pairs->bad).
bool pb_mcap_pair_next(pb_cursor *pairs, pb_view *key, pb_view *value);

#endif
