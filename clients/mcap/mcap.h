// MCAP files (https://mcap.dev/spec), version 0: what writer and reader share.
//
//   magic, Header, data section, Data End, summary section, Summary Offsets, Footer, magic
//
// A record is an opcode, its length in 64 bits, and that many octets.
#ifndef PB_CLIENTS_MCAP_H
#define PB_CLIENTS_MCAP_H

#include "bytes.h"

#define PB_MCAP_MAGIC "\x89MCAP0\r\n"

enum {
  PB_MCAP_MAGIC_SIZE = 8,
  PB_MCAP_HEAD_SIZE = 9,     // opcode and length
  PB_MCAP_FOOTER_SIZE = 20,  // content of the Footer
};

typedef enum pb_mcap_opcode {
  PB_MCAP_HEADER = 1,
  PB_MCAP_FOOTER,
  PB_MCAP_SCHEMA,
  PB_MCAP_CHANNEL,
  PB_MCAP_MESSAGE,
  PB_MCAP_CHUNK,
  PB_MCAP_MESSAGE_INDEX,
  PB_MCAP_CHUNK_INDEX,
  PB_MCAP_ATTACHMENT,
  PB_MCAP_ATTACHMENT_INDEX,
  PB_MCAP_STATISTICS,
  PB_MCAP_METADATA,
  PB_MCAP_METADATA_INDEX,
  PB_MCAP_SUMMARY_OFFSET,
  PB_MCAP_DATA_END,
} pb_mcap_opcode;

// One entry of a map from text to text.
typedef struct pb_mcap_pair {
  const char *key, *value;
} pb_mcap_pair;

#endif
