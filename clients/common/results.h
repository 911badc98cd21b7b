// Where a tool's results go, --json, --output-dir and --plot, and how the tool ends.
#ifndef PB_CLIENTS_RESULTS_H
#define PB_CLIENTS_RESULTS_H

#include "options.h"

typedef struct pb_result_options {
  bool json, plot;
  const char *dir;  // NULL: none given
  // What --help says of --output-dir and --plot; NULL: in general words.
  const char *files_help, *plot_help;
} pb_result_options;

extern const struct argp pb_result_argp;  // argp child; its input is a pb_result_options

// DIR/NAME in text; PB_ERR_ARGUMENT when it does not fit. Creates DIR when it is missing.
pb_status pb_output_path(const char *dir, const char *name, char *text, size_t size, pb_error *err);

// The directory of --output-dir, or this one.
const char *pb_result_dir(const pb_result_options *options);

// pb_output_path in that directory.
pb_status pb_result_path(const pb_result_options *options, const char *name, char *text,
                         size_t size, pb_error *err);

// Whether files can be made in that directory, before long work whose results they are to hold;
// leaves nothing behind. Nothing to do where no file is asked for. PB_ERR_IO.
pb_status pb_result_check(const pb_result_options *options, pb_error *err);

// The end of a tool: flushes the standard output, prints the error if there is one, and returns the
// exit code.
int pb_result_end(pb_status status, const pb_error *err);

#endif
