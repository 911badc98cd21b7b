// Records the bus of one plant into a file. Reads only: it attaches to no channel, and neither
// lockstep nor the other clients notice it.
#ifndef PB_RECORD_RECORDER_H
#define PB_RECORD_RECORDER_H

#include "options.h"
#include "spans.h"

enum { RECORD_SAMPLE = 1, RECORD_EVENT = 2, RECORD_STATUS = 4, RECORD_COMMAND = 8 };

typedef struct record_options {
  pb_common_options common;
  const char *path;
  unsigned topics;  // RECORD_ bits
  double duration;  // s of plant time; 0: no limit
  uint64_t steps;   // samples; 0: no limit
  bool strict, json;
  const char *csv, *mat;
} record_options;

typedef enum record_end {
  RECORD_END_LIMIT,        // --steps or --duration reached
  RECORD_END_INTERRUPTED,  // SIGINT, SIGTERM
  RECORD_END_GONE,         // the daemon has ended
} record_end;

typedef struct record_report {
  char plant[65];
  record_end end;
  pb_spans spans;  // owned: pb_spans_free
  uint64_t events, statuses, commands;
  uint32_t revisions;    // described in the file
  uint64_t undescribed;  // samples of a revision that no description came for
  double sample_rate;    // Hz
  double seconds;        // wall clock, from the first to the last sample's arrival
  uint64_t bytes;        // of the file
} record_report;

// Records until the limit, a signal, or the end of the daemon; the file is complete then. On a
// failure what was written stays, without its end. ready (may be NULL) is called once the daemon
// knows of all readers: from then on nothing is missed. Fails as pb_session_open does, and with
// PB_ERR_IO, PB_ERR_MEMORY.
pb_status record_run(const record_options *options,
                     void (*ready)(const record_options *options, const char *plant),
                     record_report *report, pb_error *err);

#endif
