// Integral force feedback as the tools design and measure it: plantbus-iff, plantbus-control.
#ifndef PB_IFF_TOOL_H
#define PB_IFF_TOOL_H

#include "analysis.h"
#include "bench.h"
#include "control/iff.h"
#include "control/rootlocus.h"
#include "excite_options.h"
#include "results.h"

// The command line.
typedef struct iff_options {
  pb_common_options common;
  pb_excite_options excite;
  pb_name_list inputs, outputs;  // of the loops, paired in order; empty: found by name
  uint64_t strut;                // 1 …: this loop only of those found; 0: all
  bool gain_given;               // else the best is sought
  double gain;
  double integrator_hz, highpass_hz;  // corners; 0: those of eq. 1.4
  double sign;
  int delay;            // samples; −1: as the mode has it
  bool skip_open_loop;  // do not measure the undamped plant
  bool force;           // close a loop that is predicted to be unstable
  pb_result_options result;
} iff_options;

// All of the command line; its input is an iff_options. Positional arguments are the tool's.
extern const struct argp iff_argp;
void iff_options_default(iff_options *options);
void iff_options_free(iff_options *options);

// Values of the flags for the gain ("auto" or a number) and the corners, for other command lines.
void iff_parse_gain(struct argp_state *state, const char *flag, const char *text, iff_options *o);
void iff_parse_corners(struct argp_state *state, const char *flag, const char *text,
                       iff_options *o);

// Excitation with what was not given filled in; its band is the band of the modes. [any]
void iff_experiment_defaults(const iff_options *options, const pb_model *model,
                             pb_experiment_options *out);

// The loops: output[k] of the model through K_IFF to input[k].
typedef struct iff_loops {
  size_t count;
  size_t *input, *output;  // [count]
} iff_loops;

// One mode through the experiment. hz is NaN where something was not measured or not found.
typedef struct iff_mode {
  pb_pole open_exact, open_measured;
  pb_pole closed_predicted, closed_measured;
} iff_mode;

// A measured response with the prediction beside it.
typedef struct iff_measurement {
  pb_frf frf;                // nf == 0: not measured
  double complex *expected;  // [nf][outputs][inputs]
  double *floor;             // [nf][outputs] below which an expected response is rounding
  pb_agreement agreement;    // over all outputs
  pb_fit fit;
  pb_run_report report;
} iff_measurement;

// Fills the agreement of a measured response with the expected one, over all its outputs. [any]
void iff_compare(iff_measurement *measurement);
void iff_measurement_clear(iff_measurement *measurement);

typedef struct iff_result {
  const iff_options *options;
  const pb_bench *bench;
  const pb_model *model;
  iff_loops loops;
  size_t *output;                    // [ny] all outputs of the model
  pb_experiment_channels channels;   // inputs of the loops, all outputs
  pb_experiment_options experiment;  // as run, defaults filled in
  pb_iff law;                        // with the gain that was used
  pb_lti controller;                 // of unit gain, discrete, a channel a loop
  pb_lti controller_used;            // with the gain
  pb_loop loop;
  pb_loop_solver *solver;
  bool searched;      // the gain is the best one found
  pb_best_gain best;  // when searched
  bool stable;
  pb_pole worst;       // closed-loop pole of the largest |z|
  pb_rootlocus locus;  // gains around the chosen one
  size_t chosen;       // its index in locus.gain
  size_t modes;
  iff_mode *mode;  // [modes] of the band
  iff_measurement open, closed;
} iff_result;

// Which loops are meant (by names, or every actuator with its sensor). [init]
// PB_ERR_REFERENCE, PB_ERR_ARGUMENT say what does not fit; PB_ERR_STATE: no actuator has a sensor.
pb_status iff_choose_loops(const pb_model *model, const iff_options *options, iff_loops *out,
                           pb_error *err);
void iff_loops_clear(iff_loops *loops);

// Loops, controller, gain, stability, root locus, modes: everything before the experiment. bench:
// its session may be missing where nothing is measured. Cleared by iff_result_clear, also after a
// failure. [init]
pb_status iff_prepare(const iff_options *options, const pb_bench *bench, iff_result *out,
                      pb_error *err);

// Both runs over the bus, then the estimates and the fits. [init]
pb_status iff_measure(iff_result *result, pb_bench *bench, pb_error *err);

// What was measured is told where it was. Report on stdout, files and plots as the options say.
pb_status iff_present(const iff_result *result, pb_error *err);

pb_status iff_print(const iff_result *result, pb_error *err);
pb_status iff_print_json(const iff_result *result, pb_error *err);

// iff.mat, iff-damped.csv, iff-undamped.csv, iff-root-locus.csv in a directory.
pb_status iff_save(const iff_result *result, const char *dir, pb_error *err);

// iff-root-locus.png, iff-INPUT-OUTPUT.png: damped against undamped.
pb_status iff_plot(const iff_result *result, const char *dir, pb_error *err);

void iff_result_clear(iff_result *result);

#endif
