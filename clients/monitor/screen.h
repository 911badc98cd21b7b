// Lines of text that fit a terminal: cut at its width and height, with styles where it has them,
// and without control characters, whatever the names on the bus hold.
#ifndef PB_CLIENTS_MONITOR_SCREEN_H
#define PB_CLIENTS_MONITOR_SCREEN_H

#include <stdbool.h>
#include <stddef.h>

#include "base/text.h"

typedef enum screen_style {
  SCREEN_PLAIN,
  SCREEN_BOLD,
  SCREEN_DIM,
  SCREEN_WARN,   // late, refused, waited for
  SCREEN_ALARM,  // the plant stands still, a fault
} screen_style;

// Zero-initialise but for what is given; text.text is owned by the caller.
typedef struct screen {
  pb_text text;
  size_t width, height;  // 0: unlimited
  bool terminal;         // escapes may be used
  bool plain;            // … but no colours: what has one is bold
  bool begun;            // the line is
  size_t column, row;    // of the next character
  size_t left_out;       // lines that did not fit
} screen;

// Appends to the line. [any]
void screen_put(screen *s, screen_style style, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

// Appends words; those for which the line has no room go on in a new one, behind `indent` blanks.
// [any]
void screen_flow(screen *s, screen_style style, size_t indent, const char *format, ...)
    __attribute__((format(printf, 4, 5)));

// Blanks up to a column (not before where the line is now, and at least one after a text).
void screen_to(screen *s, size_t column);

// Ends the line; on a terminal what the old line had there is erased.
void screen_line(screen *s);

#endif
