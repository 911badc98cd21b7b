// One line on a terminal that says how far a long run is; nothing at all in a pipe or a file.
#ifndef PB_CLIENTS_PROGRESS_H
#define PB_CLIENTS_PROGRESS_H

#include <stdbool.h>
#include <stdio.h>

typedef struct pb_progress {
  FILE *stream;
  bool on;             // stream is a terminal
  double begun, last;  // monotonic seconds: start, last redraw
  char label[64];
} pb_progress;

// Starts a line with this label; nothing is shown before the first update.
void pb_progress_begin(pb_progress *progress, FILE *stream, const char *label);

// Redraws at most ten times a second: label, bar, percentage, time left, and the note (may be
// NULL). total <= 0: the amount is unknown, only the note and the elapsed time are shown.
void pb_progress_update(pb_progress *progress, double done, double total, const char *note);

// Clears the line.
void pb_progress_end(pb_progress *progress);

#endif
