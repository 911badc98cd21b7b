// What plantbus-actuator's and plantbus-joint's commands share on their command lines: the part
// that is looked at.
#ifndef PB_ACTUATOR_SOURCE_H
#define PB_ACTUATOR_SOURCE_H

#include "results.h"
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

// The actuator that the options name. Fails as pb_element_source_plant; PB_ERR_ARGUMENT for layout
// options with a plant file, --model with an element file.
pb_status source_open(const source_options *options, pb_element_source *out, pb_error *err);

bool source_is_element_file(const char *path);

// The text of a plant file and the directory that its paths are relative to; the caller's (free).
pb_status source_read_plant(const char *path, char **text, char **directory, pb_error *err);

#endif
