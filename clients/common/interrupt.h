// SIGINT and SIGTERM as a flag that long runs poll, so that they end in order (detach, close
// files).
#ifndef PB_CLIENTS_INTERRUPT_H
#define PB_CLIENTS_INTERRUPT_H

#include <stdbool.h>

// The first signal sets the flag; a second one ends the process the usual way.
void pb_interrupt_install(void);

// True once a signal has come; fits pb_run_options.interrupted.
bool pb_interrupted(void);

#endif
