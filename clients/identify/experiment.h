// An identification experiment on the bus: what it commands at each sample, and what it learns.
//
// The experiment is a state machine behind the sample callback of a session. A run is one round:
// each of its stages settles, then measures. At sample k the callback pairs u(k−1), which the
// sample carries, with y(k−1) of the sample before, feeds the estimator, and commands
//   u(k) = w(k) + K y(k)
// with w the excitation and K an optional controller. Without a controller the estimate is from the
// applied u to y, what the inputs' electronics do left out; with one it is from w to y, the damped
// plant, from command on.
//
// Stages: periodic excitation takes as many as there are inputs (orthogonal, or one input at a
// time); noise takes one, or one an input.
#ifndef PB_IDENTIFY_EXPERIMENT_H
#define PB_IDENTIFY_EXPERIMENT_H

#include <stdio.h>

#include "bus_flags.h"
#include "control/lti.h"
#include "session.h"
#include "signal/frf.h"
#include "signal/spectrum.h"

typedef enum pb_excitation {
  PB_EXCITE_MULTISINE,
  PB_EXCITE_NOISE,           // aperiodic, Welch's estimate
  PB_EXCITE_PERIODIC_NOISE,  // one realisation repeated, averaged periods
  PB_EXCITE_CHIRP,           // repeated sweeps, one input at a time
} pb_excitation;

typedef struct pb_experiment_options {
  pb_excitation excitation;
  double f1, f2;      // Hz
  double rms;         // of each command, in its unit (chirp: amplitude = √2 rms)
  double resolution;  // Hz: one over the period or the segment
  size_t averages;    // periods, or segments, measured in one round of a stage
  double settle;      // seconds at the start of each stage that are not used
  bool one_at_a_time;
  uint64_t seed;
  pb_window window;        // noise
  double overlap;          // noise
  pb_estimator estimator;  // noise
  double limit;            // largest |command|; 0: none
} pb_experiment_options;

// Channels of the experiment, as indices into the model's lists.
typedef struct pb_experiment_channels {
  const size_t *input;   // [inputs] driven
  const size_t *output;  // [outputs] measured
  size_t inputs, outputs;
} pb_experiment_channels;

// Feedback during the experiment, onto the driven inputs.
typedef struct pb_experiment_feedback {
  const pb_lti *controller;  // discrete; inputs: output[controller->nu] of the model; outputs: as
                             // many as driven inputs. NULL: none
  const size_t *output;
  double sign;
  bool from_command;  // without a controller too, the estimate is from w
} pb_experiment_feedback;

typedef struct pb_experiment pb_experiment;

// Who looks on during a run; both may be NULL.
typedef struct pb_experiment_watch {
  bool (*interrupted)(void);
  void (*progress)(void *context, uint64_t samples);
  void *context;
} pb_experiment_watch;

// What went wrong, or should be told, in a run that the bus itself took for good.
typedef struct pb_experiment_trouble {
  bool over_limit;      // |u| exceeded the limit, or y was not finite: ended, commands zeroed
  uint64_t limit_step;  // at this step
  size_t limit_input;   // by this driven input
  double limit_value;
  uint64_t gaps;       // steps not seen (real time)
  uint64_t disturbed;  // steps at which an input that is not driven moved by more than its noise
  uint64_t flagged;    // samples with fault flags
  uint64_t flag[PB_FLAG_BITS];  // of these, by flag (bus_flags.h)
  uint64_t late;                // samples whose input was not the newest command (real time)
  double decay;                 // periodic: part of the change between periods that was free motion
} pb_experiment_trouble;

// Prepares everything; afterwards nothing is allocated in the callback. realtime: commands may act
// a step late, gaps may occur, every round settles anew. Refuses with PB_ERR_ARGUMENT what the
// signals or estimators refuse. The model, channels and controller must outlive the experiment.
// [init]
pb_status pb_experiment_new(const pb_model *model, const pb_experiment_channels *channels,
                            const pb_experiment_feedback *feedback,
                            const pb_experiment_options *options, bool realtime,
                            pb_experiment **out, pb_error *err);
void pb_experiment_free(pb_experiment *experiment);

// Each sample that is answered is also written to stream: step (uint64), all inputs, all outputs
// (double), in the host's byte order. NULL: not.
void pb_experiment_save_to(pb_experiment *experiment, FILE *stream);

// One round over the bus: draws the signals, runs the session until the stages are through. [init]
// Fails as pb_session_run, and with PB_ERR_STATE when the limit was exceeded.
pb_status pb_experiment_run(pb_experiment *experiment, pb_session *session,
                            const pb_experiment_watch *watch, pb_run_report *report, pb_error *err);

// The same round in blocks of `steps` steps (pb_session_block): for a plant that nobody else steps,
// without attaching, and without feedback (PB_ERR_ARGUMENT); a controller may be hosted. [init]
pb_status pb_experiment_run_blocks(pb_experiment *experiment, pb_session *session, uint32_t steps,
                                   const pb_experiment_watch *watch, pb_run_report *report,
                                   pb_error *err);

// Steps that the next round takes.
uint64_t pb_experiment_round_steps(const pb_experiment *experiment);

// The estimate of all rounds so far, [nf][outputs][inputs] of the channels. Of periodic excitation
// the free motion that the periods still hold is taken out first (transient.h). [init]
pb_status pb_experiment_estimate(pb_experiment *experiment, pb_frf *out, pb_error *err);

const pb_experiment_trouble *pb_experiment_trouble_of(const pb_experiment *experiment);

// Samples of one period or segment.
size_t pb_experiment_period(const pb_experiment *experiment);

// Where the samples of a round are measured: stage s from sample s·(settle + measure) + settle on.
typedef struct pb_experiment_layout {
  size_t stages, settle, measure;  // of the round under way, or of the next one
} pb_experiment_layout;
pb_experiment_layout pb_experiment_layout_of(const pb_experiment *experiment);

// The callback, for tests that have no session.
bool pb_experiment_on_sample(void *experiment, const pb_sample *sample, double *command);

// Draws the signals of the next round. pb_experiment_run does it when it was not done; a client
// does it before it attaches, because lockstep waits for a client that is attached. [init]
pb_status pb_experiment_begin(pb_experiment *experiment, pb_error *err);

#endif
