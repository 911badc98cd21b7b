// Taking steps: the barrier, the sum of the channels, leases, ramps and guards. See engine.h.
#include "engine.h"

#include <stdio.h>
#include <string.h>

// Between two published samples (decimation > 1) nobody can answer: the last commands are held.
static bool barrier_step(const pb_engine *engine) {
  return engine->step % engine->decimation == 0;
}

static bool barrier_out(const pb_engine *engine) {
  if (!barrier_step(engine)) return false;
  for (size_t i = 0; i < engine->places; i++) {
    const pb_member *m = &engine->member[i];
    if (m->id && m->barrier && !m->in) return true;
  }
  return false;
}

// Lockstep is driven by its barrier members; without any it stands still.
static bool driven(const pb_engine *engine) {
  return engine->budget > 0 ||
         (engine->drive == PB_DRIVE_LOCKSTEP && pb_engine_barrier_count(engine) > 0);
}

bool pb_engine_waiting(const pb_engine *engine) {
  return engine->drive != PB_DRIVE_REALTIME && driven(engine) && barrier_out(engine);
}

bool pb_engine_ready(const pb_engine *engine) {
  return engine->drive != PB_DRIVE_REALTIME && driven(engine) && !barrier_out(engine);
}

void pb_engine_input(const pb_engine *engine, double *u, bool *held) {
  memset(u, 0, engine->nu * sizeof *u);
  *held = false;
  for (uint32_t c = 0; c < engine->channels; c++) {
    const pb_channel *channel = &engine->channel[engine->sorted[c]];
    if (!channel->acting) {
      const double scale =
          channel->ramp_total ? (double)channel->ramp_left / channel->ramp_total : 1.0;
      for (uint32_t i = 0; i < engine->nu; i++) u[i] += scale * channel->rest[i];
      continue;
    }
    for (size_t m = 0; m < engine->places; m++) {
      const pb_member *member = &engine->member[m];
      if (member->id != channel->acting) continue;
      for (uint32_t i = 0; i < member->count; i++) u[member->input[i]] += member->value[i];
      if (!member->in) *held = true;
    }
  }
}

// Nobody can speak between two published samples: a lease is as long as their distance at least.
static uint64_t lease_of(const pb_engine *engine, const pb_member *member) {
  return member->lease_steps > engine->decimation ? member->lease_steps : engine->decimation;
}

static bool leases_end(pb_engine *engine) {
  bool any = false;
  for (size_t i = 0; i < engine->places; i++) {
    pb_member *m = &engine->member[i];
    if (!m->id || engine->step - m->heard_step <= lease_of(engine, m)) continue;
    char why[160];
    snprintf(why, sizeof why, "gave no command for its lease of %.4g s of plant time",
             (double)m->lease_steps / engine->sample_rate);
    pb_engine_drop(engine, m, PB_EVENT_LEASE_OVER, why);
    any = true;
  }
  return any;
}

static bool ramps_run(pb_engine *engine) {
  bool any = false;
  for (uint32_t c = 0; c < engine->channels; c++) {
    pb_channel *channel = &engine->channel[engine->sorted[c]];
    if (channel->acting || channel->ramp_total == 0) continue;
    any = true;
    if (channel->ramp_left > 0 && --channel->ramp_left > 0) continue;
    memset(channel->rest, 0, sizeof channel->rest);
    channel->ramp_total = 0;
  }
  return any;
}

bool pb_engine_advance(pb_engine *engine, uint64_t step, int64_t now) {
  engine->step = step;
  if (engine->budget > 0 && --engine->budget == 0)
    pb_engine_note(engine, PB_EVENT_STEPPED, "the steps asked for are done");
  if (barrier_step(engine)) {
    for (size_t i = 0; i < engine->places; i++) {
      engine->member[i].in = false;
      engine->member[i].waiting_since = now;
    }
  }
  const bool ramped = ramps_run(engine);
  return leases_end(engine) || ramped;
}

bool pb_engine_guard(pb_engine *engine, int64_t now) {
  if (!pb_engine_waiting(engine)) return false;
  bool any = false;
  for (size_t i = 0; i < engine->places; i++) {
    pb_member *m = &engine->member[i];
    if (!m->id || !m->barrier || m->in || now - m->waiting_since <= m->guard_ns) continue;
    char why[160];
    snprintf(why, sizeof why, "was late at step %llu: evicted after %.3f s",
             (unsigned long long)engine->step, (double)(now - m->waiting_since) * 1e-9);
    pb_engine_drop(engine, m, PB_EVENT_EVICTED, why);
    any = true;
  }
  return any;
}

static void members_wait_anew(pb_engine *engine, int64_t now) {
  for (size_t i = 0; i < engine->places; i++) {
    pb_member *m = &engine->member[i];
    m->waiting_since = now;
    m->heard_step = engine->step;
  }
}

void pb_engine_restart(pb_engine *engine, uint64_t step, int64_t now) {
  engine->epoch++;
  engine->step = step;
  engine->budget = 0;
  members_wait_anew(engine, now);
  for (size_t i = 0; i < engine->places; i++) {
    pb_member *m = &engine->member[i];
    m->in = false;
    m->last_step = step;
    m->started = false;
    memset(m->value, 0, sizeof m->value);
  }
  for (size_t c = 0; c < PB_ENGINE_CHANNELS; c++) {
    pb_channel *channel = &engine->channel[c];
    memset(channel->rest, 0, sizeof channel->rest);
    channel->acting = 0;
    channel->ramp_left = channel->ramp_total = 0;
  }
}

void pb_engine_allow(pb_engine *engine, uint64_t n, int64_t now) {
  engine->budget = n;
  for (size_t i = 0; i < engine->places; i++) engine->member[i].waiting_since = now;
}

void pb_engine_drive(pb_engine *engine, pb_drive drive, int64_t now) {
  if (engine->drive == PB_DRIVE_REALTIME)
    for (size_t i = 0; i < engine->places; i++) engine->member[i].in = false;
  engine->drive = drive;
  engine->budget = 0;
  members_wait_anew(engine, now);
}
