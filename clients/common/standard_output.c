// Standard output, looked at in one place: see standard_output.h.
#include "standard_output.h"

#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "options.h"

static bool told;

pb_status pb_stdout_flush(pb_error *err) {
  errno = 0;
  if (fflush(stdout) == 0 && !ferror(stdout)) return PB_OK;
  told = true;
  // An earlier write may have met the reason, which is then gone.
  return pb_fail(err, PB_ERR_IO, "standard output",
                 errno ? "cannot be written: %s" : "cannot be written", strerror(errno));
}

static void end(void) {
  const bool before = told;
  pb_error err = {0};
  if (!pb_stdout_flush(&err)) return;
  if (!before) pb_print_error(stderr, &err);
  fflush(NULL);
  _exit(PB_EXIT_FAILED);
}

void pb_stdout_guard(void) {
  static bool guarded;
  if (!guarded) guarded = atexit(end) == 0;
}
