// What the parts of the recorder share.
#ifndef PB_RECORD_RECORDER_INTERNAL_H
#define PB_RECORD_RECORDER_INTERNAL_H

#include "mcap_writer.h"
#include "progress.h"
#include "recorder.h"
#include "session_bus.h"

enum { RECORD_TOPICS = 4, RECORD_REVISIONS = 1024 };

typedef struct record_topic {
  pb_topic topic;       // that is read
  pb_topic recorded;    // … and its name in the file
  unsigned bit;         // RECORD_…
  const char *type;     // of its messages
  int depth;            // samples kept for the recorder while it writes; 0: all
  dds_entity_t reader;  // 0: not recorded
  uint16_t channel;
  uint32_t sequence;             // number of the next message
  dds_instance_handle_t writer;  // known to be the daemon's
} record_topic;

// The file that is being written.
typedef struct record_part {
  uint32_t number;  // from 1
  char path[1024];
  pb_mcap_writer *writer;
  uint32_t revision[RECORD_REVISIONS];  // those that it describes
  size_t revisions;
  pb_spans spans;
} record_part;

typedef struct recorder {
  const record_options *options;
  record_report *report;
  pb_session *session;
  record_part part;
  record_topic topic[RECORD_TOPICS];
  dds_entity_t description, waitset;
  plantbus_PlantDescription *described;  // the newest; owned
  dds_guid_t daemon;                     // that is followed
  int64_t away_since;                    // monotonic, ns; 0: it is there
  int64_t back_since;                    // … matched again, and no description yet
  int64_t plant_ns;                      // plant time of the last sample
  int64_t first_arrival, last_arrival;   // monotonic, ns
  int64_t flushed, synced;               // monotonic, ns
  int64_t wall_offset;                   // from the monotonic clock to the wall clock, at the start
  int64_t source_offset;                 // from the writers' clock to the recorder's
  int64_t logged;                        // log time of the last message
  bool done;
} recorder;

int64_t record_clock(void);  // monotonic, ns

// Now on the wall clock of the start, ns since 1970: later changes of that clock do not count.
uint64_t record_wall_clock(const recorder *r);

// Takes what description came and describes a new revision in the file: metadata, the plant file,
// the compiled model. *taken: one of the daemon that is followed came. record_describe.c
pb_status record_describe(recorder *r, bool *taken, pb_error *err);

// The newest description, into a file that does not have it. record_describe.c
pb_status record_describe_again(recorder *r, pb_error *err);

// Takes what came on one topic and writes it. record_take.c
pb_status record_take(recorder *r, record_topic *t, pb_error *err);

// The participant of a writer that a reader has matched; false: it is not known any more.
// record_take.c
bool record_participant(dds_entity_t reader, dds_instance_handle_t writer, dds_guid_t *out);

// --- record_part.c ---

// Creates the file of r->part.number with its channels.
pb_status record_part_begin(recorder *r, pb_error *err);

// Its summary and its end.
pb_status record_part_end(recorder *r, pb_error *err);

// Ends the file and begins the next one, with the newest description.
pb_status record_part_next(recorder *r, pb_error *err);

// Whether a limit of --split is reached.
bool record_part_full(const recorder *r);

// What is due once a second: to the operating system, to the disk, whether there is space.
pb_status record_part_tend(recorder *r, pb_error *err);

#endif
