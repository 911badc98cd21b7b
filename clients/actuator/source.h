// What plantbus-actuator's and plantbus-joint's commands share on their command lines: the part
// that is looked at, and where results go.
#ifndef PB_ACTUATOR_SOURCE_H
#define PB_ACTUATOR_SOURCE_H

#include "options.h"
#include "study/element_source.h"

// FILE (an element, .mat, or a plant file) and how it is to be read.
typedef struct source_options {
  const char *file;           // the argument; NULL: none
  const char *model;          // of a plant file
  pb_actuator_layout layout;  // of an element file
  bool layout_given;          // by any option
  double length;              // m, of a lumped model that has none of its own; 0: not given
} source_options;

extern const struct argp source_argp;  // argp child; its input is a source_options

void source_defaults(source_options *options);

// For a parent's ARGP_KEY_ARG: takes FILE, refuses a second one.
void source_take_file(source_options *options, const char *text, struct argp_state *state);

// The actuator that the options name. Fails as pb_element_source_plant; PB_ERR_ARGUMENT for layout
// options with a plant file, --model with an element file.
pb_status source_open(const source_options *options, pb_element_source *out, pb_error *err);

bool source_is_element_file(const char *path);

// The text of a plant file and the directory that its paths are relative to; the caller's (free).
pb_status source_read_plant(const char *path, char **text, char **directory, pb_error *err);

// The value of a flag F1,F2 with 0 < F1 < F2 (Hz), and of a flag with two different frames, counted
// from 1. Both end the program through argp where it is neither.
void source_option_range(const struct argp_state *state, const char *flag, const char *text,
                         double *f1, double *f2);
void source_option_frames(const struct argp_state *state, const char *flag, const char *text,
                          size_t frames[2]);

// --json, --output-dir, --plot.
typedef struct result_options {
  bool json, plot;
  const char *dir;  // NULL: none given
} result_options;

extern const struct argp result_argp;  // argp child; its input is a result_options

// DIR/NAME for a result file, DIR made when it is missing.
pb_status result_path(const result_options *options, const char *name, char *text, size_t size,
                      pb_error *err);

// Prints the error, if there is one, and returns the exit code.
int result_end(pb_status status, const pb_error *err);

#endif
