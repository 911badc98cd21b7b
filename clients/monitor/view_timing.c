// Step time, jitter, and what the daemon obtained of real time.
#include <inttypes.h>
#include <math.h>
#include <stdio.h>

#include "histogram.h"
#include "monitor.h"

static void duration(screen *s, const char *label, double seconds) {
  if (isnan(seconds))
    screen_flow(s, SCREEN_PLAIN, 10, "  %s –", label);
  else
    screen_flow(s, SCREEN_PLAIN, 10, "  %s %.3g µs", label, seconds * 1e6);
}

static void view_histogram(screen *s, const char *name, const plantbus_Histogram *h) {
  if (h->count == 0) return;
  screen_put(s, SCREEN_PLAIN, "%s", name);
  screen_to(s, 10);
  duration(s, "p50", pb_histogram_percentile(h, 0.5));
  duration(s, "p99", pb_histogram_percentile(h, 0.99));
  duration(s, "max", h->largest);
  screen_flow(s, SCREEN_DIM, 10, "  of %" PRIu64, (uint64_t)h->count);
  screen_line(s);
}

void monitor_view_timing(const monitor_state *m, screen *s) {
  const plantbus_PlantStatus *p = m->status;
  view_histogram(s, "step time", &p->step_time);
  view_histogram(s, "jitter", &p->jitter);
  if (!p->real_time || !p->real_time[0]) return;
  screen_flow(s, SCREEN_DIM, 2, "%s", p->real_time);
  screen_line(s);
}
