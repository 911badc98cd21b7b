// Judging commands. See engine.h.
#include "engine.h"

#include <math.h>
#include <string.h>

static bool values_finite(const double *value, uint32_t count) {
  for (uint32_t i = 0; i < count; i++)
    if (!isfinite(value[i])) return false;
  return true;
}

// A barrier member in lockstep answers each sample exactly once. Everyone else may be late: such a
// command acts at the next step and is counted; only going back in time is refused.
static pb_verdict judge_step(const pb_engine *engine, const pb_member *member, uint64_t step) {
  if (step > engine->step) return PB_VERDICT_STEP;
  if (engine->drive != PB_DRIVE_REALTIME && member->barrier) {
    if (step < engine->step)
      return member->started && step == member->last_step ? PB_VERDICT_DUPLICATE : PB_VERDICT_STALE;
    return member->in ? PB_VERDICT_DUPLICATE : PB_VERDICT_ACCEPTED;
  }
  if (step == 0) return PB_VERDICT_ACCEPTED;  // the next one
  if (member->started && step == member->last_step) return PB_VERDICT_DUPLICATE;
  if (step < member->last_step) return PB_VERDICT_STALE;
  return step + engine->decimation <= engine->step ? PB_VERDICT_LATE : PB_VERDICT_ACCEPTED;
}

static pb_verdict judge(const pb_engine *engine, const pb_member *member,
                        const pb_command *command) {
  if (!member || command->channel != member->channel) return PB_VERDICT_SESSION;
  if (command->writer != member->writer) return PB_VERDICT_UNKNOWN_WRITER;
  if (command->count != member->count) return PB_VERDICT_SIZE;
  if (!values_finite(command->input, command->count)) return PB_VERDICT_NON_FINITE;
  return judge_step(engine, member, command->step);
}

// Only a first command can change who acts: priorities are fixed when attaching.
static void first_command(pb_engine *engine, pb_member *member) {
  member->started = true;
  pb_channel *channel = &engine->channel[member->channel];
  const pb_member *acting = channel->acting ? pb_engine_find(engine, channel->acting) : NULL;
  if (acting && (acting->priority > member->priority ||
                 (acting->priority == member->priority && acting->order < member->order)))
    return;
  channel->acting = member->id;
  memset(channel->rest, 0, sizeof channel->rest);
  channel->ramp_left = channel->ramp_total = 0;
  if (acting)
    pb_engine_note(engine, PB_EVENT_TAKEOVER, "'%s' takes over channel '%s' from '%s'",
                   member->client_name, channel->name, acting->client_name);
}

static bool power_of_ten(uint64_t n) {
  while (n >= 10 && n % 10 == 0) n /= 10;
  return n == 1;
}

void pb_engine_refuse(pb_engine *engine, const pb_command *command, pb_verdict cause) {
  const uint64_t times = ++engine->verdicts[cause];
  if (!power_of_ten(times)) return;
  const pb_member *m = pb_engine_find(engine, command->session);
  pb_engine_note(engine, PB_EVENT_REFUSED,
                 "a command for step %llu at step %llu was refused: %s (%llu so far); session "
                 "%016llx%s%s%s",
                 (unsigned long long)command->step, (unsigned long long)engine->step,
                 pb_verdict_name(cause), (unsigned long long)times,
                 (unsigned long long)command->session, m ? " of '" : ", which is not attached",
                 m ? m->client_name : "", m ? "'" : "");
}

pb_verdict pb_engine_command(pb_engine *engine, const pb_command *command) {
  pb_member *member = pb_engine_find(engine, command->session);
  pb_verdict verdict = judge(engine, member, command);
  if (verdict == PB_VERDICT_UNKNOWN_WRITER) return verdict;
  if (verdict == PB_VERDICT_DUPLICATE &&
      memcmp(member->value, command->input, command->count * sizeof(double)) == 0)
    verdict = PB_VERDICT_REPEATED;
  if (verdict >= PB_VERDICT_SESSION) {
    pb_engine_refuse(engine, command, verdict);
    return verdict;
  }
  engine->verdicts[verdict]++;
  if (verdict == PB_VERDICT_REPEATED) return verdict;
  memcpy(member->value, command->input, command->count * sizeof(double));
  member->in = true;
  member->last_step = command->step ? command->step : engine->step;
  const uint64_t age = engine->step - member->last_step;
  if (age > member->age_max) member->age_max = age;
  member->heard_step = engine->step;
  member->commands++;
  if (verdict == PB_VERDICT_LATE) member->late++;
  if (!member->started) first_command(engine, member);
  return verdict;
}
