// The experiment's parts, shared by its files.
#ifndef PB_IDENTIFY_EXPERIMENT_INTERNAL_H
#define PB_IDENTIFY_EXPERIMENT_INTERNAL_H

#include "experiment.h"
#include "signal/periodic.h"

enum { PB_EXPERIMENT_HISTORY = 8 };  // commands remembered, to find which one was applied

struct pb_experiment {
  const pb_model *model;
  pb_experiment_channels channels;
  pb_experiment_feedback feedback;
  pb_experiment_options options;
  bool realtime, periodic;

  // The plan.
  size_t period;   // samples of a period or segment
  size_t stages;   // of a round
  size_t settle;   // samples at the start of a stage; a whole number of periods when periodic
  size_t measure;  // samples after it
  double *signal;  // periodic: [stages][period][inputs]; noise: [stages][settle + measure][inputs]
  size_t signal_length;  // samples of one stage in `signal`
  unsigned round;        // rounds begun

  // The estimators: one of the two.
  pb_periodic *averages;
  pb_welch **welch;  // [welches] one, or one an input
  size_t welches;

  // The round under way; touched by the callback only.
  bool begun, started, previous_known, ending;
  uint64_t first_step;  // step of the round's first sample
  uint64_t previous_step;
  uint64_t gap_until;             // real time: pairs before this step are not used
  double *previous_y;             // [ny] of the model
  double *u, *y;                  // pair for the estimator: [inputs], [outputs]
  double *w;                      // [inputs] excitation now
  size_t remembered;              // PB_EXPERIMENT_HISTORY and the inputs' delay
  double *history_u, *history_w;  // [inputs][remembered] commands, and their w, newest first
  double *x, *scratch, *loop_y, *loop_u;  // of the controller

  FILE *save;
  pb_experiment_watch watch;
  pb_experiment_trouble trouble;
};

// Fills `signal` for the round about to start. [init]
pb_status pb_experiment_draw(pb_experiment *experiment, pb_error *err);

// Allocates `signal` and the estimators. [init]
pb_status pb_experiment_plan(pb_experiment *experiment, pb_error *err);

// The excitation at index n of the round into w. [rt]
void pb_experiment_excite(pb_experiment *experiment, uint64_t n);

// The end of a round that came to this status.
pb_status pb_experiment_finish(pb_experiment *experiment, pb_status status, pb_error *err);

// Monotonic wall clock.
double pb_experiment_seconds(void);

#endif
