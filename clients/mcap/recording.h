// A recording of plantbus-record: an MCAP file (mcap.h) with the samples of one plant, what else
// its bus carried, and the plant file of each revision. docs/recording.md tells its layout.
#ifndef PB_CLIENTS_RECORDING_H
#define PB_CLIENTS_RECORDING_H

#include "mcap_reader.h"
#include "mcap_writer.h"
#include "spans.h"

// Names of the metadata records, and the keys of the first.
#define PB_RECORDING_REVISION "plantbus/v1/revision"
#define PB_RECORDING_END "plantbus/v1/recording"

typedef struct pb_recorded_names {
  size_t count;
  char **name, **unit;  // [count]
} pb_recorded_names;

typedef struct pb_recorded_revision {
  uint32_t revision;
  double sample_rate;  // Hz
  char *sha256;        // of the plant file
  char *software;      // version of the daemon
  char *attachment;    // name of the plant file in the recording
  char *plant_text;    // the plant file; NULL: it was cut off
  char *model;         // name of the attachment with the compiled model
  double *packed;      // [packed_count] the compiled model (pb_model_unpack), or NULL
  size_t packed_count;
  pb_recorded_names inputs, outputs;
} pb_recorded_revision;

typedef struct pb_recorded_event {
  uint64_t step;
  uint32_t epoch;
  char *kind, *client_name, *message;
} pb_recorded_event;

typedef struct pb_recording {
  char *path, *plant;
  pb_mcap_report file;
  size_t revisions;
  pb_recorded_revision *revision;  // [revisions] in the order in which they were met
  pb_spans spans;
  uint64_t log_first, log_last;  // wall clock of the first and the last sample, ns
  size_t events;
  pb_recorded_event *event;  // [events]
  uint64_t statuses, commands;
} pb_recording;

// Reads and checks the whole file and keeps all but the samples. [init]
// Fails with PB_ERR_IO, PB_ERR_SYNTAX (damaged, not a recording of a plant), PB_ERR_MEMORY. *out is
// owned by the caller (pb_recording_free).
pb_status pb_recording_open(const char *path, pb_recording **out, pb_error *err);

// The same by the summary at the end of the file: epochs, revisions, plant files and events, as
// they were told there; samples are neither read nor checked. A file without such a summary is read
// as a whole. [init]
pb_status pb_recording_open_index(const char *path, pb_recording **out, pb_error *err);
void pb_recording_free(pb_recording *recording);

// The metadata record at the end of a recording, written and read: *found: it tells the epochs,
// which *out (zeroed) then holds. PB_ERR_IO, PB_ERR_MEMORY, PB_ERR_SYNTAX. [init]
pb_status pb_recording_end_write(pb_mcap_writer *writer, const pb_spans *spans, const char *plant,
                                 uint32_t part, const char *ended_by, pb_error *err);
pb_status pb_recording_end_read(pb_view pairs, pb_spans *out, bool *found, pb_error *err);

// The sample rate of the last revision, Hz; 0 without any. [any]
double pb_recording_rate(const pb_recording *recording);

// The revision of that number, or NULL. [any]
const pb_recorded_revision *pb_recording_revision(const pb_recording *recording, uint32_t number);

// Calls for each sample, in order, repetitions left out. A status other than PB_OK ends it. [init]
typedef pb_status (*pb_recorded_sample)(void *context, const plantbus_Sample *sample,
                                        pb_error *err);
pb_status pb_recording_samples(const pb_recording *recording, pb_recorded_sample call,
                               void *context, pb_error *err);

#endif
