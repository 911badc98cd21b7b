// Whether a stream may be sent terminal escapes, and colours.
#ifndef PB_CLIENTS_ESCAPES_H
#define PB_CLIENTS_ESCAPES_H

#include <stdbool.h>
#include <stdio.h>

// It is a terminal, and TERM names one that moves its cursor: set, and not "dumb". [any]
bool pb_escapes(FILE *stream);

// Colours are wanted: NO_COLOR is not set, or empty (no-color.org). [any]
bool pb_colours(void);

#endif
