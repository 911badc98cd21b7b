// The gnuplot process behind the plots (internal to clients/common).
#ifndef PB_CLIENTS_PLOT_GNUPLOT_H
#define PB_CLIENTS_PLOT_GNUPLOT_H

#include <stdio.h>

#include "base/status.h"

// Runs gnuplot on the script (from its start) and puts what it writes to its standard output at
// path. Fails with PB_ERR_IO: gnuplot missing (the message names the package), its own error
// message.
pb_status pb_gnuplot_run(FILE *script, const char *path, pb_error *err);

#endif
