// What the parts of the recorder share.
#ifndef PB_RECORD_RECORDER_INTERNAL_H
#define PB_RECORD_RECORDER_INTERNAL_H

#include "mcap_writer.h"
#include "progress.h"
#include "recorder.h"
#include "session_bus.h"

enum { RECORD_TOPICS = 4, RECORD_REVISIONS = 1024 };

typedef struct record_topic {
  pb_topic topic;
  unsigned bit;         // RECORD_…
  const char *type;     // of its messages
  int depth;            // samples kept for the recorder while it writes
  dds_entity_t reader;  // 0: not recorded
  uint16_t channel;
  uint32_t sequence;  // number of the next message
} record_topic;

typedef struct recorder {
  const record_options *options;
  record_report *report;
  pb_session *session;
  pb_mcap_writer *writer;
  record_topic topic[RECORD_TOPICS];
  dds_entity_t description, waitset;
  uint32_t revision[RECORD_REVISIONS];  // those that the file describes
  size_t revisions;
  int64_t plant_ns;                     // plant time of the last sample
  int64_t first_arrival, last_arrival;  // monotonic, ns
  int64_t flushed;                      // monotonic, ns
  bool done;
} recorder;

uint64_t record_wall_clock(void);  // ns since 1970

// Takes what description came and describes a new revision in the file: metadata, the plant file,
// the compiled model. *taken: some came. record_describe.c
pb_status record_describe(recorder *r, bool *taken, pb_error *err);

// Takes what came on one topic and writes it. record_take.c
pb_status record_take(recorder *r, record_topic *t, pb_error *err);

#endif
