// Members and channels on a plant whose inputs have changed. See engine.h.
#include "engine.h"

#include <string.h>

// to[old]: where each old input is now, −1: nowhere.
static void layout_invert(uint32_t nu, const int *from, int to[PB_ENGINE_INPUTS]) {
  for (int i = 0; i < PB_ENGINE_INPUTS; i++) to[i] = -1;
  for (uint32_t i = 0; i < nu; i++)
    if (from[i] >= 0) to[from[i]] = (int)i;
}

static const pb_member *misses(const pb_engine *engine, const int to[PB_ENGINE_INPUTS],
                               uint32_t *input) {
  for (size_t m = 0; m < engine->places; m++) {
    const pb_member *member = &engine->member[m];
    for (uint32_t i = 0; member->id && i < member->count; i++) {
      if (to[member->input[i]] >= 0) continue;
      *input = member->input[i];
      return member;
    }
  }
  return NULL;
}

const pb_member *pb_engine_misses(const pb_engine *engine, uint32_t nu, const int *from,
                                  uint32_t *input) {
  int to[PB_ENGINE_INPUTS];
  layout_invert(nu, from, to);
  return misses(engine, to, input);
}

static void channel_relayout(pb_channel *channel, uint32_t nu, const int *from) {
  double rest[PB_ENGINE_INPUTS] = {0};
  for (uint32_t i = 0; i < nu; i++)
    if (from[i] >= 0) rest[i] = channel->rest[from[i]];
  memcpy(channel->rest, rest, sizeof rest);
}

void pb_engine_relayout(pb_engine *engine, uint32_t nu, const int *from) {
  int to[PB_ENGINE_INPUTS];
  layout_invert(nu, from, to);
  uint32_t input;
  for (const pb_member *m; (m = misses(engine, to, &input)) != NULL;)
    pb_engine_drop(engine, &engine->member[m - engine->member], PB_EVENT_LOST,
                   "has an input that the changed plant lacks");
  for (size_t m = 0; m < engine->places; m++) {
    pb_member *member = &engine->member[m];
    for (uint32_t i = 0; member->id && i < member->count; i++)
      member->input[i] = (uint32_t)to[member->input[i]];
  }
  for (size_t c = 0; c < PB_ENGINE_CHANNELS; c++) channel_relayout(&engine->channel[c], nu, from);
  engine->nu = nu;
}
