// The options by which plantbus-identify and plantbus-iff describe an excitation, an argp child.
#ifndef PB_IDENTIFY_EXCITE_OPTIONS_H
#define PB_IDENTIFY_EXCITE_OPTIONS_H

#include "bench.h"
#include "experiment.h"
#include "options.h"

typedef struct pb_excite_options {
  pb_experiment_options experiment;  // 0 where not given: rms, resolution, averages, f1, f2, settle
  bool settle_given;
  pb_reset_choice reset;
} pb_excite_options;

// Defaults: multisine, seed 1, Hann, half overlap, H1.
void pb_excite_options_default(pb_excite_options *options);

// Use as argp child with a pb_excite_options as its input.
extern const struct argp pb_excite_argp;

// "multisine", "noise", … of an excitation; its inverse exits through argp. [any]
const char *pb_excitation_name(pb_excitation excitation);

#endif
