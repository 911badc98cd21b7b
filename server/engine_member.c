// Members, channels and events. See engine.h.
#include "engine.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

static const double ramp_seconds = 0.05;  // of plant time, for the silence policy "ramp"

const char *pb_verdict_name(pb_verdict verdict) {
  static const char *const name[] = {
#define PB_VERDICT_NAME(id, text) text,
      PB_VERDICT_LIST(PB_VERDICT_NAME)
#undef PB_VERDICT_NAME
  };
  return name[verdict];
}

const char *pb_event_kind_name(pb_event_kind kind) {
  static const char *const name[] = {
#define PB_EVENT_NAME(id, text) text,
      PB_EVENT_LIST(PB_EVENT_NAME)
#undef PB_EVENT_NAME
  };
  return name[kind];
}

void pb_engine_init(pb_engine *engine, uint32_t nu, double sample_rate) {
  memset(engine, 0, sizeof *engine);
  engine->nu = nu;
  engine->sample_rate = sample_rate;
  engine->decimation = 1;
  engine->epoch = 1;
}

static pb_event *event_new(pb_engine *engine, pb_event_kind kind) {
  if (engine->events_made - engine->events_taken == PB_ENGINE_EVENTS) engine->events_taken++;
  pb_event *event = &engine->event[engine->events_made % PB_ENGINE_EVENTS];
  memset(event, 0, sizeof *event);
  event->number = engine->events_made++;
  event->kind = kind;
  event->step = engine->step;
  event->epoch = engine->epoch;
  return event;
}

void pb_engine_note(pb_engine *engine, pb_event_kind kind, const char *format, ...) {
  pb_event *event = event_new(engine, kind);
  va_list args;
  va_start(args, format);
  vsnprintf(event->message, sizeof event->message, format, args);
  va_end(args);
}

static void event_member(pb_engine *engine, pb_event_kind kind, const pb_member *member,
                         const char *what) {
  pb_event *event = event_new(engine, kind);
  char message[sizeof event->message];
  const char *channel = engine->channel[member->channel].name;
  memcpy(event->client, member->client, sizeof event->client);
  strcpy(event->client_name, member->client_name);
  strcpy(event->channel, channel);
  snprintf(message, sizeof message, "client '%s' on channel '%s' %s", member->client_name, channel,
           what);
  strcpy(event->message, message);
}

bool pb_engine_event_take(pb_engine *engine, pb_event *out) {
  if (engine->events_taken == engine->events_made) return false;
  *out = engine->event[engine->events_taken++ % PB_ENGINE_EVENTS];
  return true;
}

pb_member *pb_engine_find(pb_engine *engine, uint64_t id) {
  for (size_t i = 0; id && i < engine->places; i++)
    if (engine->member[i].id == id) return &engine->member[i];
  return NULL;
}

uint32_t pb_engine_member_count(const pb_engine *engine) {
  uint32_t count = 0;
  for (size_t i = 0; i < engine->places; i++) count += engine->member[i].id != 0;
  return count;
}

uint32_t pb_engine_barrier_count(const pb_engine *engine) {
  uint32_t count = 0;
  for (size_t i = 0; i < engine->places; i++)
    count += engine->member[i].id && engine->member[i].barrier;
  return count;
}

// Insertion keeps `sorted` in the order of the names.
static void channels_sort(pb_engine *engine) {
  uint32_t n = 0;
  for (uint32_t i = 0; i < PB_ENGINE_CHANNELS; i++) {
    if (!engine->channel[i].name[0]) continue;
    uint32_t at = n++;
    for (; at > 0; at--) {
      const pb_channel *before = &engine->channel[engine->sorted[at - 1]];
      if (strcmp(before->name, engine->channel[i].name) <= 0) break;
      engine->sorted[at] = engine->sorted[at - 1];
    }
    engine->sorted[at] = (uint8_t)i;
  }
  engine->channels = n;
}

static bool channel_in_use(const pb_engine *engine, uint32_t index) {
  for (size_t i = 0; i < engine->places; i++)
    if (engine->member[i].id && engine->member[i].channel == index) return true;
  for (uint32_t i = 0; i < engine->nu; i++)
    if (engine->channel[index].rest[i] != 0.0) return true;
  return false;
}

// The channel of that name, else a free place made into it, else -1.
static int channel_get(pb_engine *engine, const char *name) {
  int place = -1;
  for (uint32_t i = 0; i < PB_ENGINE_CHANNELS; i++) {
    if (strcmp(engine->channel[i].name, name) == 0) return (int)i;
    if (place < 0 && (!engine->channel[i].name[0] || !channel_in_use(engine, i))) place = (int)i;
  }
  if (place < 0) return -1;
  pb_channel *channel = &engine->channel[place];
  memset(channel, 0, sizeof *channel);
  snprintf(channel->name, sizeof channel->name, "%s", name);
  channels_sort(engine);
  return place;
}

static pb_status attach_check(const pb_attach *attach, pb_error *err) {
  if (!(attach->lease > 0.0 && attach->lease <= 1e6))
    return pb_fail(err, PB_ERR_ARGUMENT, "/lease", "is %g s, expected 0 < lease ≤ 1e6",
                   attach->lease);
  if (!(attach->guard >= 0.001 && attach->guard <= 3600.0))
    return pb_fail(err, PB_ERR_ARGUMENT, "/guard", "is %g s, expected 0.001 to 3600",
                   attach->guard);
  const size_t length = strlen(attach->channel);
  if (length == 0 || length >= PB_ENGINE_NAME)
    return pb_fail(err, PB_ERR_ARGUMENT, "/channel", "must have 1 to %d octets",
                   PB_ENGINE_NAME - 1);
  return PB_OK;
}

static void member_fill(pb_engine *engine, pb_member *member, const pb_attach *attach,
                        uint32_t channel, int64_t now) {
  memset(member, 0, sizeof *member);
  member->id = attach->id;
  memcpy(member->client, attach->client, sizeof member->client);
  snprintf(member->client_name, sizeof member->client_name, "%s", attach->client_name);
  member->channel = channel;
  member->count = attach->count;
  memcpy(member->input, attach->input, attach->count * sizeof *attach->input);
  member->barrier = attach->barrier;
  member->priority = attach->priority;
  member->silence = attach->silence;
  member->lease_steps = (uint64_t)ceil(attach->lease * engine->sample_rate);
  member->guard_ns = (int64_t)(attach->guard * 1e9);
  member->order = engine->attached++;
  member->last_step = member->heard_step = engine->step;
  member->waiting_since = now;
}

pb_status pb_engine_attach(pb_engine *engine, const pb_attach *attach, int64_t now,
                           const pb_member **out, pb_error *err) {
  *out = NULL;
  pb_status status = attach_check(attach, err);
  if (status) return status;
  pb_member *member = NULL;
  for (uint32_t i = 0; i < PB_ENGINE_MEMBERS && !member; i++)
    if (!engine->member[i].id) member = &engine->member[i];
  if (!member) return pb_fail(err, PB_ERR_STATE, "", "all %d places are taken", PB_ENGINE_MEMBERS);
  const int channel = channel_get(engine, attach->channel);
  if (channel < 0)
    return pb_fail(err, PB_ERR_STATE, "/channel", "all %d channels are in use", PB_ENGINE_CHANNELS);
  member_fill(engine, member, attach, (uint32_t)channel, now);
  const uint32_t place = (uint32_t)(member - engine->member);
  if (place >= engine->places) engine->places = place + 1;
  event_member(engine, PB_EVENT_ATTACHED, member, "attached");
  *out = member;
  return PB_OK;
}

// What the channel holds once nobody acts on it any more.
static void channel_leave(pb_engine *engine, pb_channel *channel, const pb_member *member) {
  if (member->silence == PB_SILENCE_ZERO) return;
  for (uint32_t i = 0; i < member->count; i++) channel->rest[member->input[i]] = member->value[i];
  if (member->silence == PB_SILENCE_RAMP)
    channel->ramp_left = channel->ramp_total =
        (uint32_t)fmax(1.0, ceil(ramp_seconds * engine->sample_rate));
}

static const pb_member *channel_next(const pb_engine *engine, uint32_t index) {
  const pb_member *best = NULL;
  for (size_t i = 0; i < engine->places; i++) {
    const pb_member *m = &engine->member[i];
    if (!m->id || m->channel != index || !m->started) continue;
    if (!best || m->priority > best->priority ||
        (m->priority == best->priority && m->order < best->order))
      best = m;
  }
  return best;
}

void pb_engine_drop(pb_engine *engine, pb_member *member, pb_event_kind kind, const char *why) {
  const pb_member gone = *member;
  pb_channel *channel = &engine->channel[gone.channel];
  event_member(engine, kind, &gone, why);
  member->id = 0;
  while (engine->places > 0 && !engine->member[engine->places - 1].id) engine->places--;
  if (channel->acting != gone.id) return;
  const pb_member *next = channel_next(engine, gone.channel);
  channel->acting = next ? next->id : 0;
  if (!next)
    channel_leave(engine, channel, &gone);
  else
    event_member(engine, PB_EVENT_TAKEOVER, next, "acts now");
}

bool pb_engine_drop_client(pb_engine *engine, const uint8_t client[16], pb_event_kind kind,
                           const char *why) {
  bool any = false;
  for (size_t i = 0; i < engine->places; i++) {
    pb_member *member = &engine->member[i];
    if (!member->id || memcmp(member->client, client, sizeof member->client) != 0) continue;
    pb_engine_drop(engine, member, kind, why);
    any = true;
  }
  return any;
}
