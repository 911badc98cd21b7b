// plantbus-identify: what its files share.
#ifndef PB_IDENTIFY_IDENTIFY_H
#define PB_IDENTIFY_IDENTIFY_H

#include "analysis.h"
#include "bench.h"
#include "excite_options.h"
#include "results.h"

// The command line.
typedef struct identify_options {
  pb_common_options common;
  pb_excite_options excite;
  pb_name_list inputs, outputs;
  double coherence_target;  // 0: none
  uint32_t block;           // steps of a block; 0: step by step
  size_t most_averages;     // with a target; 0: 16 times the first
  const char *samples;      // file of the raw samples, or NULL
  pb_result_options result;
} identify_options;

// What was done and found.
typedef struct identify_result {
  const pb_bench *bench;
  const identify_options *options;
  pb_experiment_options experiment;  // as run, defaults filled in
  const pb_experiment_trouble *trouble;
  pb_analysis analysis;
  pb_run_report report;  // of all rounds
  size_t rounds;
} identify_result;

// Report on stdout: tables, or JSON.
pb_status identify_print(const identify_result *result, pb_error *err);
pb_status identify_print_json(const identify_result *result, pb_error *err);

// identify.csv, identify.mat in a directory.
pb_status identify_save(const identify_result *result, const char *dir, pb_error *err);

// identify-INPUT-OUTPUT.png for the channels looked at closely: measured over exact, coherence.
pb_status identify_plot(const identify_result *result, const char *dir, pb_error *err);

#endif
