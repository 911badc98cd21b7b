// What a tool prints has arrived, or the tool fails: the one place that looks.
#ifndef PB_CLIENTS_STANDARD_OUTPUT_H
#define PB_CLIENTS_STANDARD_OUTPUT_H

#include "base/status.h"

// From now on the process ends with PB_EXIT_FAILED and a message when standard output cannot be
// written ("plantbus-x: standard output: cannot be written: No space left on device"), whatever the
// tool made of it. Called by pb_options_parse and pb_commands_run; more often does no harm. [init]
void pb_stdout_guard(void);

// Writes what is buffered, for a tool that goes on with other work. Fails with PB_ERR_IO; the guard
// does not tell it a second time. [any]
pb_status pb_stdout_flush(pb_error *err);

#endif
