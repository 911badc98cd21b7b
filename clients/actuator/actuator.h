// plantbus-actuator: its commands, and what they share.
#ifndef PB_ACTUATOR_ACTUATOR_H
#define PB_ACTUATOR_ACTUATOR_H

#include "commands.h"
#include "excite_options.h"
#include "print.h"
#include "source.h"
#include "study/actuator_fit.h"

int command_characterize(int argc, char **argv);
int command_constants(int argc, char **argv);
int command_select(int argc, char **argv);
int command_fit(int argc, char **argv);
int command_boundary(int argc, char **argv);

// Quantities of actuators in data sheets and specifications, NULL-terminated.
extern const char *const actuator_quantities[];

// ---- experiments on a running bench (live.c) ----------------------------------------------------

// --live and the names of the signals.
typedef struct live_options {
  bool live;
  pb_common_options common;
  pb_excite_options excite;
  const char *va, *y, *vs, *force;  // defaults Va, y, Vs, F
} live_options;

extern const struct argp live_argp;  // argp child; its input is a live_options
void live_defaults(live_options *options);

// ---- what a command looks at: FILE or --live, and where its results go (subject.c) --------------

typedef struct subject_options {
  source_options source;
  live_options live;
  pb_result_options result;
  bool other;          // set by the command: an option of its own says what to look at
  const char *wanted;  // told where there is not one of them
} subject_options;

extern const struct argp subject_argp;  // argp child; its input is a subject_options
void subject_defaults(subject_options *options);

// ---- what an experiment gives -------------------------------------------------------------------

// What an identification of a bench gives.
typedef struct live_result {
  pb_apa_data data;   // y/V_a, V_s/V_a
  double compliance;  // y/F at 0 Hz, m/N; NaN: the plant has no such input
  char plant[128];
  uint32_t revision;
} live_result;  // free with live_result_clear

// Identifies V_a (and F, where with_force is set and the plant has it) → y, V_s of the plant on the
// bus. Fails as pb_bench_open, pb_experiment_run, and with PB_ERR_REFERENCE for missing signals.
pb_status live_identify(const live_options *options, bool with_force, live_result *out,
                        pb_error *err);
void live_result_clear(live_result *result);

#endif
