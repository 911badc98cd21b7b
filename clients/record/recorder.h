// Records the bus of one plant into a file, or several. Attaches to no channel. Samples come from
// the trace: in lockstep the plant waits until the recorder has them, so that none is missed.
#ifndef PB_RECORD_RECORDER_H
#define PB_RECORD_RECORDER_H

#include "mcap_compress.h"
#include "options.h"
#include "spans.h"

enum { RECORD_SAMPLE = 1, RECORD_EVENT = 2, RECORD_STATUS = 4, RECORD_COMMAND = 8 };

typedef struct record_options {
  pb_common_options common;
  const char *path;
  unsigned topics;       // RECORD_ bits
  double duration;       // s of plant time; 0: no limit
  uint64_t steps;        // samples; 0: no limit
  uint64_t split_bytes;  // a file is followed by another one when it has so many; 0: not
  double split_seconds;  // … or spans so much plant time, s; 0: not
  uint64_t min_free;     // octets that are left free on the disk
  double sync;           // s between calls that wait for the disk; 0: none
  pb_mcap_compression compression;
  bool force;       // existing files are replaced
  bool until_gone;  // the end of the daemon ends the recording
  bool allow_gaps, json;
  const char *csv, *mat;
} record_options;

typedef enum record_end {
  RECORD_END_LIMIT,        // --steps or --duration reached
  RECORD_END_INTERRUPTED,  // SIGINT, SIGTERM, SIGHUP
  RECORD_END_GONE,         // the daemon has ended, and was not waited for
  RECORD_END_SPACE,        // the disk is as full as it may become
} record_end;

typedef struct record_report {
  char plant[65];
  record_end end;
  pb_spans spans;  // owned: pb_spans_free
  uint64_t events, statuses, commands;
  uint32_t revisions;     // described in the files
  uint64_t undescribed;   // samples of a revision that no description came for
  uint64_t foreign;       // messages of another daemon of this name, left out
  uint32_t outages;       // times that the daemon was away
  double outage_seconds;  // wall clock, in all
  bool untraced;          // the daemon offers no trace: samples may be missed
  double sample_rate;     // Hz
  double seconds;         // wall clock, from the first to the last sample's arrival
  uint64_t bytes;         // of the files
  uint32_t files;
} record_report;

// The name of a file of a recording: the path itself for the first (1), "run-2.mcap" and so on for
// those that follow run.mcap. False: it does not fit. [any]
bool record_part_path(const char *path, uint32_t part, char *text, size_t size);

// Records until the limit, a signal, a full disk, or, with until_gone, the end of the daemon; the
// files are complete then. A daemon that goes is waited for; when it comes back as another process
// another file begins. On a failure what was written stays, without its end; a start that fails
// leaves no file. ready (may be NULL) is called once the daemon knows of all readers: from then on
// nothing is missed. Fails as pb_session_open does, and with PB_ERR_IO, PB_ERR_MEMORY.
pb_status record_run(const record_options *options,
                     void (*ready)(const record_options *options, const char *plant),
                     record_report *report, pb_error *err);

#endif
