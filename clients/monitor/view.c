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

static bool standing(const plantbus_PlantStatus *p) {
  return p->mode == plantbus_LOCKSTEP && p->steps_per_second == 0.0;
}

static void view_head(const monitor_state *m, screen *s) {
  const plantbus_PlantDescription *d = m->description;
  const plantbus_PlantStatus *p = m->status;
  screen_put(s, SCREEN_BOLD, "%s", d->name);
  screen_put(s, SCREEN_DIM, "  %u states, %u inputs, %u outputs, %s", d->states,
             d->input_names._length, d->output_names._length, m->daemon);
  if (m->gone) screen_put(s, SCREEN_ALARM, "  THE DAEMON HAS GONE");
  screen_line(s);
  if (!p) {
    screen_put(s, SCREEN_DIM, "no status yet");
    screen_line(s);
    return;
  }
  screen_put(s, SCREEN_BOLD, "%s", monitor_mode(p->mode));
  if (p->mode == plantbus_REALTIME) screen_put(s, SCREEN_PLAIN, " × %g", p->speed);
  screen_put(s, SCREEN_PLAIN, "  %.0f / %.0f steps/s", p->steps_per_second, monitor_nominal(m));
  if (monitor_nominal(m) > 0.0)
    screen_put(s, SCREEN_DIM, " (%.0f %%)", 100.0 * p->steps_per_second / monitor_nominal(m));
  screen_put(s, SCREEN_PLAIN, "  epoch %u  revision %u", p->epoch, p->revision);
  if (p->decimation > 1) screen_put(s, SCREEN_PLAIN, "  every %uth sample", p->decimation);
  if (p->configuring) screen_put(s, SCREEN_WARN, "  a changed model is on its way");
  screen_line(s);
  const uint64_t step = m->has_sample && m->sample.epoch == p->epoch && m->sample.step > p->step
                            ? m->sample.step
                            : p->step;
  screen_put(s, SCREEN_PLAIN, "step %" PRIu64 "  t = %.6f s  hash %016" PRIx64 " at %" PRIu64, step,
             (double)step / d->sample_rate, p->hash, p->hash_step);
  screen_line(s);
}

// ---- members, hosted ----------------------------------------------------------------------------

static const size_t stop[] = {24, 38, 43, 48, 53, 64, 71, 78};  // columns of the members' table

// Who keeps a plant that stands still waiting.
static void waits(const plantbus_PlantStatus *p, screen *s) {
  bool any = false;
  if (!standing(p)) return;
  for (uint32_t i = 0; i < p->attached._length; i++) {
    if (!p->attached._buffer[i].waited) continue;
    screen_put(s, SCREEN_ALARM, "%s%s", any ? ", " : "stands still, waits for ",
               p->attached._buffer[i].client_name);
    any = true;
  }
  if (any) screen_line(s);
}

static void view_members(const plantbus_PlantStatus *p, screen *s) {
  static const char *const head[] = {"client",   "channel", "prio", "acts",  "bar.",
                                     "commands", "late",    "age",  "oldest"};
  screen_line(s);
  if (p->attached._length == 0) {
    screen_put(s, SCREEN_DIM, "nobody is attached");
    screen_line(s);
    return;
  }
  for (size_t c = 0; c < 9; c++) {
    if (c > 0) screen_to(s, stop[c - 1]);
    screen_put(s, SCREEN_DIM, "%s", head[c]);
  }
  screen_line(s);
  for (uint32_t i = 0; i < p->attached._length; i++) {
    const plantbus_Attached *a = &p->attached._buffer[i];
    // In lockstep a plant that runs waits for someone at any moment.
    const screen_style style = a->waited && standing(p) ? SCREEN_ALARM
                               : a->late                ? SCREEN_WARN
                                                        : SCREEN_PLAIN;
    screen_put(s, style, "%s%.21s", a->waited ? "*" : "", a->client_name);
    screen_to(s, stop[0]);
    screen_put(s, SCREEN_PLAIN, "%.12s", a->channel);
    screen_to(s, stop[1]);
    screen_put(s, SCREEN_PLAIN, "%d", a->priority);
    screen_to(s, stop[2]);
    screen_put(s, SCREEN_PLAIN, "%s", a->acting ? "yes" : "no");
    screen_to(s, stop[3]);
    screen_put(s, SCREEN_PLAIN, "%s", a->barrier ? "yes" : "no");
    screen_to(s, stop[4]);
    screen_put(s, SCREEN_PLAIN, "%" PRIu64, a->commands);
    screen_to(s, stop[5]);
    screen_put(s, a->late ? SCREEN_WARN : SCREEN_PLAIN, "%" PRIu64, a->late);
    screen_to(s, stop[6]);
    screen_put(s, SCREEN_PLAIN, "%" PRIu64, a->age);
    screen_to(s, stop[7]);
    screen_put(s, SCREEN_PLAIN, "%" PRIu64, a->age_max);
    screen_line(s);
  }
  waits(p, s);
}

static void view_hosted(const plantbus_PlantStatus *p, screen *s) {
  for (uint32_t i = 0; i < p->hosted._length; i++) {
    const plantbus_Hosted *h = &p->hosted._buffer[i];
    screen_put(s, SCREEN_PLAIN, "hosted  %s on %s, by %s%s", h->kind, h->channel, h->client_name,
               h->done ? ", done" : "");
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
      screen_put(s, SCREEN_WARN, " %s %" PRIu64, monitor_refusal(&p->refused, i, &count), count);
  }
  if (sum == 0) screen_put(s, SCREEN_PLAIN, " none");
  screen_put(s, p->late ? SCREEN_WARN : SCREEN_PLAIN, "   late %" PRIu64, p->late);
  screen_put(s, p->overruns ? SCREEN_WARN : SCREEN_PLAIN, "   overruns %" PRIu64, p->overruns);
  screen_put(s, p->skipped ? SCREEN_WARN : SCREEN_PLAIN, "   skipped %" PRIu64, p->skipped);
  screen_put(s, p->dropped_samples ? SCREEN_WARN : SCREEN_PLAIN, "   dropped %" PRIu64,
             p->dropped_samples);
  if (p->overrun_policy && p->overrun_policy[0])
    screen_put(s, SCREEN_DIM, "   on overrun: %s", p->overrun_policy);
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
    screen_put(s, SCREEN_PLAIN, "%s", e->message);
    screen_line(s);
  }
}

// ---- signals ------------------------------------------------------------------------------------

enum { BAR = 20 };

// Where the value lies between the least and the most that was seen.
static void bar(double value, double least, double most, char text[BAR + 1]) {
  int at = most > least ? (int)lround((value - least) / (most - least) * (BAR - 1)) : BAR / 2;
  if (at < 0) at = 0;
  if (at > BAR - 1) at = BAR - 1;
  memset(text, '-', BAR);
  text[at] = '|';
  text[BAR] = '\0';
}

static void view_signal(const monitor_state *m, screen *s, const char *name, const char *unit,
                        bool known, double value, size_t index) {
  char text[BAR + 1];
  screen_put(s, SCREEN_PLAIN, "%.30s", name);
  screen_put(s, SCREEN_DIM, " [%.10s]", unit);
  screen_to(s, 32);
  if (!known) {
    screen_put(s, SCREEN_DIM, "–");
  } else if (!isfinite(value)) {
    screen_put(s, SCREEN_ALARM, "%g", value);
  } else {
    bar(value, m->least[index], m->most[index], text);
    screen_put(s, SCREEN_PLAIN, "%+.6e  ", value);
    screen_put(s, SCREEN_DIM, "%+.2e %s %+.2e", m->least[index], text, m->most[index]);
  }
  screen_line(s);
}

static void view_signals(const monitor_state *m, screen *s) {
  const plantbus_PlantDescription *d = m->description;
  screen_line(s);
  screen_put(s, SCREEN_DIM, "signal");
  screen_to(s, 32);
  screen_put(s, SCREEN_DIM, "value          least and most of %" PRIu64 " samples looked at",
             m->seen);
  screen_line(s);
  for (uint32_t i = 0; i < d->input_names._length; i++)
    view_signal(m, s, d->input_names._buffer[i], d->input_units._buffer[i],
                m->has_sample && i < m->sample.input_count && i < plantbus_MAX_INPUTS,
                m->sample.input[i % plantbus_MAX_INPUTS], i);
  for (uint32_t i = 0; i < d->output_names._length; i++)
    view_signal(m, s, d->output_names._buffer[i], d->output_units._buffer[i],
                m->has_sample && i < m->sample.output_count && i < plantbus_MAX_OUTPUTS,
                m->sample.output[i % plantbus_MAX_OUTPUTS], plantbus_MAX_INPUTS + i);
}

void monitor_view(const monitor_state *m, screen *s) {
  view_head(m, s);
  if (m->status) {
    view_members(m->status, s);
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
