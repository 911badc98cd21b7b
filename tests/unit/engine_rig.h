// An engine of four inputs at 1 kHz with a clock of its own, for the unit tests of the engine.
#ifndef PB_TESTS_ENGINE_RIG_H
#define PB_TESTS_ENGINE_RIG_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "engine.h"

enum { RIG_INPUTS = 4, RIG_WRITER = 1000 };

typedef struct rig {
  pb_engine engine;
  int64_t now;  // ns
} rig;

// A lockstep engine at step 0; owned by the test (free).
rig *rig_new(void);

// A session number `id` on a channel for one input, barrier, zero silence, lease 1 s, guard 1 s.
// Its writer counts as checked: RIG_WRITER + id.
pb_member *rig_attach(rig *r, uint64_t id, const char *channel, uint32_t input);

// Judges one command with one value from the session's own writer.
pb_verdict rig_command(rig *r, uint64_t id, uint64_t step, double value);

// Takes a step when the engine is ready; u (may be NULL) receives the inputs. False when it is not.
bool rig_step(rig *r, double u[RIG_INPUTS]);

// Takes all events; true when one of this kind was among them, `text` (may be NULL, 320 octets) its
// message.
bool rig_event(rig *r, pb_event_kind kind, char *text);

#endif
