// The progress line: see progress.h.
#include "progress.h"

#include <string.h>
#include <time.h>

#include "escapes.h"

enum { BAR = 24 };

static double monotonic_seconds(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

void pb_progress_begin(pb_progress *progress, FILE *stream, const char *label) {
  *progress = (pb_progress){.stream = stream, .on = pb_escapes(stream)};
  progress->begun = monotonic_seconds();
  progress->last = progress->begun - 1;
  snprintf(progress->label, sizeof progress->label, "%s", label);
}

static void draw_bar(FILE *stream, double fraction, double elapsed) {
  int full = (int)(fraction * BAR + 0.5);
  fputs(" [", stream);
  for (int i = 0; i < BAR; i++) fputc(i < full ? '#' : '.', stream);
  fprintf(stream, "] %3.0f %%", 100 * fraction);
  if (fraction > 0.02) fprintf(stream, "  %.0f s left", elapsed * (1 - fraction) / fraction);
}

void pb_progress_update(pb_progress *progress, double done, double total, const char *note) {
  if (!progress->on) return;
  double now = monotonic_seconds();
  if (now - progress->last < 0.1) return;
  progress->last = now;
  fprintf(progress->stream, "\r\033[K%s", progress->label);
  if (total > 0) {
    double fraction = done / total;
    draw_bar(progress->stream,
             fraction < 0   ? 0
             : fraction > 1 ? 1
                            : fraction,
             now - progress->begun);
  } else {
    fprintf(progress->stream, " %.0f s", now - progress->begun);
  }
  if (note) fprintf(progress->stream, "  %s", note);
  fflush(progress->stream);
}

void pb_progress_end(pb_progress *progress) {
  if (!progress->on) return;
  fputs("\r\033[K", progress->stream);
  fflush(progress->stream);
}
