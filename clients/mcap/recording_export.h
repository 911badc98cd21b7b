// The samples of a recording as CSV and MAT.
#ifndef PB_CLIENTS_RECORDING_EXPORT_H
#define PB_CLIENTS_RECORDING_EXPORT_H

#include "recording.h"

// Which samples and signals. Zeroed: all of them.
typedef struct pb_export_choice {
  uint32_t revision, epoch;  // 0: all; all revisions need the same signals and sample rate
  bool limited;
  double from, to;  // s of plant time, both included, when limited
  const char *const *signal;
  size_t signals;  // 0: all; else inputs and outputs by name, in the order of the file
} pb_export_choice;

// CSV: time, step, epoch, revision, flags, inputs, outputs, a row a sample.
// MAT: t, step, epoch, revision, flags (n × 1), u (n × inputs), y (n × outputs), their names and
// units, sample_rate, plant, plant_text, plant_sha256. u(k) is what acted up to step k.
// Fails with PB_ERR_REFERENCE (no such signal, revision), PB_ERR_STATE (revisions with different
// signals: one must be chosen; no sample fits), PB_ERR_IO, PB_ERR_MEMORY. [init]
pb_status pb_export_csv(const pb_recording *recording, const pb_export_choice *choice,
                        const char *path, pb_error *err);
pb_status pb_export_mat(const pb_recording *recording, const pb_export_choice *choice,
                        const char *path, pb_error *err);

#endif
