// A plant's state as text: the whole view, and one line.
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "bus_flags.h"
#include "monitor.h"

const char *monitor_mode(plantbus_RunMode mode) {
  static const char *const name[] = {"paused", "lockstep", "realtime"};
  return (unsigned)mode < 3 ? name[mode] : "unknown";
}

double monitor_nominal(const monitor_state *m) {
  const double rate = m->description->sample_rate;
  return m->status && m->status->mode == plantbus_REALTIME ? rate * m->status->speed : rate;
}

const char *monitor_refusal(const plantbus_Refusals *r, size_t index, uint64_t *count) {
  static const char *const name[] = {"session",    "foreign",   "step", "size",
                                     "non_finite", "duplicate", "stale"};
  const uint64_t value[] = {r->session,    r->foreign,   r->step, r->size,
                            r->non_finite, r->duplicate, r->stale};
  if (index >= sizeof name / sizeof *name) return NULL;
  *count = value[index];
  return name[index];
}

static void view_head(const monitor_state *m, screen *s) {
  const plantbus_PlantDescription *d = m->description;
  const plantbus_PlantStatus *p = m->status;
  screen_put(s, SCREEN_BOLD, "%s", d->name);
  screen_flow(s, SCREEN_DIM, 2, "  %u states, %u inputs, %u outputs, %s", d->states,
              d->input_names._length, d->output_names._length, m->daemon);
  if (m->gone) screen_flow(s, SCREEN_ALARM, 2, "  THE DAEMON HAS GONE");
  screen_line(s);
  if (!p) {
    screen_put(s, SCREEN_DIM, "no status yet");
    screen_line(s);
    return;
  }
  screen_put(s, SCREEN_BOLD, "%s", monitor_mode(p->mode));
  if (p->mode == plantbus_REALTIME) screen_flow(s, SCREEN_PLAIN, 2, " × %g", p->speed);
  screen_flow(s, SCREEN_PLAIN, 2, "  %.0f / %.0f steps/s", p->steps_per_second, monitor_nominal(m));
  if (monitor_nominal(m) > 0.0)
    screen_flow(s, SCREEN_DIM, 2, " (%.0f %%)", 100.0 * p->steps_per_second / monitor_nominal(m));
  screen_flow(s, SCREEN_PLAIN, 2, "  epoch %u  revision %u", p->epoch, p->revision);
  if (p->decimation > 1) screen_flow(s, SCREEN_PLAIN, 2, "  every %uth sample", p->decimation);
  if (p->configuring) screen_flow(s, SCREEN_WARN, 2, "  a changed model is on its way");
  screen_line(s);
  const uint64_t step = m->has_sample && m->sample.epoch == p->epoch && m->sample.step > p->step
                            ? m->sample.step
                            : p->step;
  screen_flow(s, SCREEN_PLAIN, 2, "step %" PRIu64 "  t = %.6f s  hash %016" PRIx64 " at %" PRIu64,
              step, (double)step / d->sample_rate, p->hash, p->hash_step);
  screen_line(s);
}

// ---- hosted
// --------------------------------------------------------------------------------------

static void view_hosted(const plantbus_PlantStatus *p, screen *s) {
  for (uint32_t i = 0; i < p->hosted._length; i++) {
    const plantbus_Hosted *h = &p->hosted._buffer[i];
    screen_flow(s, SCREEN_PLAIN, 2, "hosted  %s on %s, by %s%s", h->kind, h->channel,
                h->client_name, h->done ? ", done" : "");
    screen_line(s);
  }
}

// ---- counters, faults, events -------------------------------------------------------------------

static void view_counters(const plantbus_PlantStatus *p, screen *s) {
  uint64_t count = 0, sum = 0;
  screen_line(s);
  screen_put(s, SCREEN_PLAIN, "refused ");
  for (size_t i = 0; monitor_refusal(&p->refused, i, &count); i++) {
    sum += count;
    if (count)
      screen_flow(s, SCREEN_WARN, 2, " %s %" PRIu64, monitor_refusal(&p->refused, i, &count),
                  count);
  }
  if (sum == 0) screen_flow(s, SCREEN_PLAIN, 2, " none");
  screen_flow(s, p->late ? SCREEN_WARN : SCREEN_PLAIN, 2, "   late %" PRIu64, p->late);
  screen_flow(s, p->overruns ? SCREEN_WARN : SCREEN_PLAIN, 2, "   overruns %" PRIu64, p->overruns);
  screen_flow(s, p->skipped ? SCREEN_WARN : SCREEN_PLAIN, 2, "   skipped %" PRIu64, p->skipped);
  screen_flow(s, p->dropped_samples ? SCREEN_WARN : SCREEN_PLAIN, 2, "   dropped %" PRIu64,
              p->dropped_samples);
  if (p->overrun_policy && p->overrun_policy[0])
    screen_flow(s, SCREEN_DIM, 2, "   on overrun: %s", p->overrun_policy);
  screen_line(s);
}

static void view_faults(const plantbus_PlantStatus *p, screen *s) {
  for (unsigned bit = 0; bit < 32; bit++) {
    if (!(p->faults >> bit & 1)) continue;
    screen_put(s, SCREEN_ALARM, "fault %s", pb_flag_name(bit));
    if (bit < p->fault_steps._length)
      screen_put(s, SCREEN_PLAIN, "  first at step %" PRIu64,
                 (uint64_t)p->fault_steps._buffer[bit]);
    screen_line(s);
  }
}

static void view_events(const monitor_state *m, screen *s) {
  if (m->events > 0) screen_line(s);
  for (size_t i = 0; i < m->events; i++) {
    const monitor_event *e = &m->event[i];
    screen_put(s, SCREEN_DIM, "%u:%" PRIu64, e->epoch, e->step);
    screen_to(s, 16);
    screen_put(s, SCREEN_PLAIN, "%s", e->kind);
    screen_to(s, 30);
    screen_flow(s, SCREEN_PLAIN, 16, "%s", e->message);
    screen_line(s);
  }
}

// ---- signals ------------------------------------------------------------------------------------

enum { BAR_MOST = 40, BAR_LEAST = 5, VALUE = 15, RANGE = 20, LABEL_MOST = 32 };

// How the width is shared: the label's column, and the bar between least and most (0: no room).
typedef struct signal_layout {
  size_t label, bar;
  bool range;  // least and most have room
} signal_layout;

// Where the value lies between the least and the most that was seen, in `length` characters.
static void bar(double value, double least, double most, size_t length, char *text) {
  const long last = (long)length - 1;
  long at = most > least ? lround((value - least) / (most - least) * (double)last) : last / 2;
  if (at < 0) at = 0;
  if (at > last) at = last;
  memset(text, '-', length);
  text[at] = '|';
  text[length] = '\0';
}

static size_t longest(char *const *name, char *const *unit, uint32_t count, size_t so_far) {
  for (uint32_t i = 0; i < count; i++) {
    const size_t length = strlen(name[i]) + strlen(unit[i]) + 4;  // "name [unit] "
    if (length > so_far) so_far = length;
  }
  return so_far;
}

static signal_layout layout(const plantbus_PlantDescription *d, size_t width) {
  signal_layout l = {.label = LABEL_MOST, .bar = 20, .range = true};
  if (width == 0) return l;
  size_t wanted =
      longest(d->input_names._buffer, d->input_units._buffer, d->input_names._length, 8);
  wanted =
      longest(d->output_names._buffer, d->output_units._buffer, d->output_names._length, wanted);
  if (wanted < l.label) l.label = wanted;
  if (l.label + VALUE > width) l.label = width > VALUE + 8 ? width - VALUE : 8;
  const size_t used = l.label + VALUE + RANGE;
  l.range = used < width;  // a character at least between least and most
  l.bar = l.range && width >= used + BAR_LEAST ? width - used : 0;
  if (l.bar > BAR_MOST) l.bar = BAR_MOST;
  return l;
}

static void view_range(const monitor_state *m, screen *s, const signal_layout *l, double value,
                       size_t index) {
  char text[BAR_MOST + 1] = "…";
  if (!l->range) return;
  if (l->bar > 0) bar(value, m->least[index], m->most[index], l->bar, text);
  screen_put(s, SCREEN_DIM, "%+.2e %s %+.2e", m->least[index], text, m->most[index]);
}

static void view_signal(const monitor_state *m, screen *s, const signal_layout *l, const char *name,
                        const char *unit, bool known, double value, size_t index) {
  const size_t taken = strlen(unit) + 4;
  const size_t room = l->label > taken ? l->label - taken : 1;
  screen_put(s, SCREEN_PLAIN, "%.*s", (int)room, name);
  screen_put(s, SCREEN_DIM, " [%.10s]", unit);
  screen_to(s, l->label);
  if (!known) {
    screen_put(s, SCREEN_DIM, "–");
  } else if (!isfinite(value)) {
    screen_put(s, SCREEN_ALARM, "%g", value);
  } else {
    screen_put(s, SCREEN_PLAIN, "%+.6e  ", value);
    view_range(m, s, l, value, index);
  }
  screen_line(s);
}

static void view_signals(const monitor_state *m, screen *s) {
  const plantbus_PlantDescription *d = m->description;
  const signal_layout l = layout(d, s->width);
  screen_line(s);
  screen_put(s, SCREEN_DIM, "signal");
  screen_to(s, l.label);
  screen_put(s, SCREEN_DIM, "value");
  screen_to(s, l.label + VALUE);
  if (l.range)
    screen_put(s, SCREEN_DIM, "least and most of %" PRIu64 " %s", m->seen,
               s->width == 0 || l.bar > 14 ? "samples looked at" : "samples");
  screen_line(s);
  for (uint32_t i = 0; i < d->input_names._length; i++)
    view_signal(m, s, &l, d->input_names._buffer[i], d->input_units._buffer[i],
                m->has_sample && i < m->sample.input_count && i < plantbus_MAX_INPUTS,
                m->sample.input[i % plantbus_MAX_INPUTS], i);
  for (uint32_t i = 0; i < d->output_names._length; i++)
    view_signal(m, s, &l, d->output_names._buffer[i], d->output_units._buffer[i],
                m->has_sample && i < m->sample.output_count && i < plantbus_MAX_OUTPUTS,
                m->sample.output[i % plantbus_MAX_OUTPUTS], plantbus_MAX_INPUTS + i);
}

void monitor_view(const monitor_state *m, screen *s) {
  view_head(m, s);
  if (m->status) {
    monitor_view_members(m->status, s);
    view_hosted(m->status, s);
    view_counters(m->status, s);
    monitor_view_timing(m, s);
    view_faults(m->status, s);
  }
  view_events(m, s);
  view_signals(m, s);
}

void monitor_line(const monitor_state *m, screen *s) {
  const plantbus_PlantStatus *p = m->status;
  uint64_t count = 0, refused = 0;
  const char *between = "";
  for (size_t i = 0; monitor_refusal(&p->refused, i, &count); i++) refused += count;
  screen_put(s, SCREEN_PLAIN,
             "%s %s epoch %u step %" PRIu64 " revision %u rate %.0f/%.0f hash %016" PRIx64
             " members %u refused %" PRIu64 " late %" PRIu64 " overruns %" PRIu64
             " skipped %" PRIu64 " dropped %" PRIu64 " faults",
             p->name, monitor_mode(p->mode), p->epoch, (uint64_t)p->step, p->revision,
             p->steps_per_second, monitor_nominal(m), (uint64_t)p->hash, p->attached._length,
             refused, (uint64_t)p->late, (uint64_t)p->overruns, (uint64_t)p->skipped,
             (uint64_t)p->dropped_samples);
  if (p->faults == 0) screen_put(s, SCREEN_PLAIN, " none");
  for (unsigned bit = 0; bit < 32; bit++)
    if (p->faults >> bit & 1) screen_put(s, SCREEN_PLAIN, " %s", pb_flag_name(bit));
  for (uint32_t i = 0; i < p->attached._length; i++) {
    if (!p->attached._buffer[i].waited) continue;
    screen_put(s, SCREEN_PLAIN, "%s%s", *between ? between : " waits for ",
               p->attached._buffer[i].client_name);
    between = ", ";
  }
  screen_line(s);
}
