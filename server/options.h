// The command line of plantbusd.
#ifndef PB_OPTIONS_H
#define PB_OPTIONS_H

#include "daemon.h"

// Fills *options; on a usage error or --help the process ends (2 or 0).
void pb_options_parse(int argc, char **argv, pb_daemon_options *options);

#endif
