// See engine_rig.h.
#include "engine_rig.h"

#include <stdlib.h>
#include <string.h>

rig *rig_new(void) {
  rig *r = calloc(1, sizeof *r);
  assert_non_null(r);
  pb_engine_init(&r->engine, RIG_INPUTS, 1000.0);
  pb_engine_drive(&r->engine, PB_DRIVE_LOCKSTEP, 0);
  return r;
}

pb_member *rig_attach(rig *r, uint64_t id, const char *channel, uint32_t input) {
  const pb_attach attach = {.client = {(uint8_t)id},
                            .client_name = id == 1   ? "one"
                                           : id == 2 ? "two"
                                                     : "other",
                            .channel = channel,
                            .input = &input,
                            .count = 1,
                            .barrier = true,
                            .silence = PB_SILENCE_ZERO,
                            .lease = 1.0,
                            .guard = 1.0,
                            .id = id};
  const pb_member *member = NULL;
  pb_error err;
  assert_int_equal(pb_engine_attach(&r->engine, &attach, r->now, &member, &err), PB_OK);
  pb_member *found = pb_engine_find(&r->engine, id);
  assert_ptr_equal(found, member);
  found->writer = RIG_WRITER + id;
  return found;
}

pb_verdict rig_command(rig *r, uint64_t id, uint64_t step, double value) {
  const pb_member *member = pb_engine_find(&r->engine, id);
  const pb_command command = {.session = id,
                              .step = step,
                              .channel = member ? member->channel : 0,
                              .count = 1,
                              .input = &value,
                              .writer = RIG_WRITER + id};
  return pb_engine_command(&r->engine, &command);
}

bool rig_step(rig *r, double u[RIG_INPUTS]) {
  double inputs[RIG_INPUTS];
  bool held;
  if (!pb_engine_ready(&r->engine)) return false;
  pb_engine_input(&r->engine, inputs, &held);
  if (u) memcpy(u, inputs, sizeof inputs);
  r->now += 1000000;
  pb_engine_advance(&r->engine, r->engine.step + 1, r->now);
  return true;
}

bool rig_event(rig *r, pb_event_kind kind, char *text) {
  bool found = false;
  pb_event event;
  while (pb_engine_event_take(&r->engine, &event)) {
    if (event.kind != kind) continue;
    found = true;
    if (text) strcpy(text, event.message);
  }
  return found;
}
