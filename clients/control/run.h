// plantbus-control run: HAC-LAC on the bus, stage by stage; what its files share.
#ifndef PB_CONTROL_RUN_H
#define PB_CONTROL_RUN_H

#include "control_tool.h"

// One stage: undamped, IFF, HAC-LAC.
typedef struct run_stage {
  bool done;
  iff_measurement response;  // disturbances to all outputs; its fit is not made
  pb_experiment_trouble trouble;
  size_t segments;       // of the record that the spectra are the mean of
  double *density[2];    // [motions][lines] of the motions: measured, predicted
  double *amplitude[2];  // the same, cumulative
  double *largest;       // [n] largest |voltage| applied
} run_stage;

typedef struct run_result {
  const control_design *design;
  control_judgement judgement;
  pb_bench *bench;
  pb_experiment_options experiment;
  pb_experiment_channels channels;  // disturbances, all outputs
  size_t *output;                   // [ny]
  size_t lines;                     // of the spectra
  double df;                        // Hz between them
  run_stage stage[STAGES];
  size_t nf;               // sensitivity: lines; 0 where it cannot be told
  double *sensitivity[2];  // [nf] largest σ(S) at the metrology: measured, predicted
  bool *coherent;          // [nf] the measured one is good there
  double sensitivity_percent, sensitivity_hz;  // largest difference where it is
} run_result;

// Rms of a motion of a stage: measured or predicted. [any]
double run_rms(const run_result *r, control_stage stage, size_t motion, int which);

// Runs a stage over the bus and evaluates it. [init]
pb_status run_stage_carry_out(run_result *r, control_stage stage, pb_error *err);

// Spectra of the motions and largest inputs from the samples that the experiment wrote; layout: of
// its round, told before it began. [init]
pb_status run_spectra(run_result *r, control_stage stage, const pb_experiment_layout *layout,
                      size_t period, FILE *samples, pb_error *err);

// Measured sensitivity H_HAC H⁻¹ beside the predicted one, where there are as many disturbances as
// loops. [init]
pb_status run_sensitivity(run_result *r, pb_error *err);

pb_status run_print(const run_result *r, pb_error *err);
pb_status run_print_json(const run_result *r, pb_error *err);
pb_status run_save(const run_result *r, const char *dir, pb_error *err);
pb_status run_plot(const run_result *r, const char *dir, pb_error *err);

// ---- HAC as a client of its own -----------------------------------------------------------------

typedef struct hac_client hac_client;

// Opens a session, attaches channel "hac" and answers samples in a thread. [init]
pb_status hac_client_start(const control_design *design, bool realtime, hac_client **out,
                           pb_error *err);

// Ends it; its first failure, if it had one, also when the run itself was good. NULL is allowed.
pb_status hac_client_stop(hac_client *client, pb_error *err);

#endif
