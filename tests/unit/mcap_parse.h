// A second reader of MCAP files, for the tests: written from the specification alone, shares no
// code with clients/mcap, and believes nothing: every index, count and CRC must be right.
#ifndef PB_TESTS_MCAP_PARSE_H
#define PB_TESTS_MCAP_PARSE_H

#include <stdint.h>

typedef struct mcap_parse_counts {
  uint64_t messages, chunks, attachments, metadata, schemas, channels;
} mcap_parse_counts;

// Fails the test with what is wrong. Files with one definition of each schema and channel.
mcap_parse_counts mcap_parse(const char *path);

#endif
