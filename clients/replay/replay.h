// plantbus-replay: what its commands share.
#ifndef PB_REPLAY_REPLAY_H
#define PB_REPLAY_REPLAY_H

#include "model/model.h"
#include "options.h"
#include "recording_export.h"

typedef struct replay_options {
  pb_common_options common;
  const char *path;
  bool json;
  pb_export_choice choice;
  pb_name_list signals;
  const char *csv, *mat, *plant_out, *out;
  bool check;        // info: read all of it
  double tolerance;  // < 0: only report
} replay_options;

pb_status command_info(const replay_options *options, const pb_recording *recording, pb_error *err);
// *path into a complete file *out. PB_ERR_IO: it is there already, or cannot be written;
// PB_ERR_SYNTAX: nothing of it can be read.
pb_status command_repair(const replay_options *options, pb_error *err);
pb_status command_export(const replay_options *options, const pb_recording *recording,
                         pb_error *err);
pb_status command_play(const replay_options *options, const pb_recording *recording, pb_error *err);
pb_status command_verify(const replay_options *options, const pb_recording *recording,
                         pb_error *err);

// One epoch from rest, every step of it: what can be run again.
typedef struct replay_run {
  const pb_recorded_revision *revision;
  uint32_t epoch;
  uint64_t steps;  // samples: steps 0 … steps − 1
  size_t nu, ny;
  double *u;  // [steps][nu] that of sample k acted over [k − 1, k)
  double *y;  // [steps][ny]
} replay_run;

// The epoch of that number, or the first whole one (0; told on stderr where there are several).
// Fails with PB_ERR_STATE when it does not begin at step 0, has gaps, was decimated, or changes its
// revision. [init]
pb_status replay_load(const pb_recording *recording, uint32_t epoch, replay_run *out,
                      pb_error *err);
void replay_free(replay_run *run);

// How far the outputs are from the recorded ones.
typedef struct replay_deviation {
  uint64_t samples, different;  // compared; of these, those that are not the same to the bit
  double largest[plantbus_MAX_OUTPUTS], value[plantbus_MAX_OUTPUTS];  // deviation, |recorded|
  uint64_t at[plantbus_MAX_OUTPUTS];                                  // step of the deviation
} replay_deviation;

void replay_compare(replay_deviation *d, const replay_run *run, uint64_t step, const double *y);

// Prints the deviations and judges them by --tolerance (PB_ERR_NUMERIC).
pb_status replay_present(const replay_options *options, const replay_run *run,
                         const replay_deviation *d, pb_error *err);

#endif
