// A plant on the bus as an experimenter meets it: found, reset, attached, watched.
#ifndef PB_IDENTIFY_BENCH_H
#define PB_IDENTIFY_BENCH_H

#include "experiment.h"
#include "options.h"
#include "progress.h"

typedef enum pb_reset_choice {
  PB_RESET_AUTO,  // in lockstep, when no other client is attached
  PB_RESET_ALWAYS,
  PB_RESET_NEVER,
} pb_reset_choice;

typedef struct pb_bench {
  pb_session *session;
  const pb_model *model;
  const pb_description *description;
  bool realtime;
  bool was_reset;
  uint32_t block;  // steps of a block request; 0: step by step, attached
} pb_bench;

// Finds the plant and, as chosen, puts it at rest. [init]
pb_status pb_bench_open(const pb_common_options *common, pb_reset_choice reset, pb_bench *out,
                        pb_error *err);
void pb_bench_close(pb_bench *bench);

// Attaches a channel on inputs of the model, as a member of the lockstep barrier; silence is zero.
// guard: seconds that lockstep waits for this client; 0: the daemon's default. Nothing to do where
// blocks are used; PB_ERR_STATE when the plant is paused.
pb_status pb_bench_attach(pb_bench *bench, const char *channel, const size_t *input, size_t inputs,
                          double guard, pb_error *err);
void pb_bench_detach(pb_bench *bench);

// One round of an experiment with a progress line on the terminal.
pb_status pb_bench_run(pb_bench *bench, pb_experiment *experiment, const char *label,
                       pb_run_report *report, pb_error *err);

// Tells on stderr what the experiment found odd (gaps, faults, inputs moved by others).
void pb_bench_tell_trouble(const pb_experiment *experiment);

// Indices of named signals of a list of `count`; all of them when no name is given. *index
// [*chosen] is the caller's. PB_ERR_REFERENCE names what is unknown or named twice.
pb_status pb_bench_choose(const pb_name_list *names, const pb_signal *signal, size_t count,
                          const char *kind, size_t **index, size_t *chosen, pb_error *err);

#endif
