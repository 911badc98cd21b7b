// Terminal escapes and colours: see escapes.h.
#include "escapes.h"

#include <stdlib.h>
#include <string.h>
#include <unistd.h>

bool pb_escapes(FILE *stream) {
  const char *term = getenv("TERM");
  return isatty(fileno(stream)) == 1 && term && term[0] && strcmp(term, "dumb") != 0;
}

bool pb_colours(void) {
  const char *none = getenv("NO_COLOR");
  return !none || !none[0];
}
