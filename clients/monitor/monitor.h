// plantbus-monitor: what its parts share.
#ifndef PB_CLIENTS_MONITOR_H
#define PB_CLIENTS_MONITOR_H

#include <cjson/cJSON.h>
#include <stdbool.h>
#include <stdint.h>

#include "base/status.h"
#include "bus_qos.h"
#include "screen.h"

enum { MONITOR_EVENTS = 6, MONITOR_SIGNALS = plantbus_MAX_INPUTS + plantbus_MAX_OUTPUTS };

typedef struct monitor_event {
  uint32_t epoch;
  uint64_t step;
  char kind[32], message[512];
} monitor_event;

// Everything that is shown. The pointers are the feed's.
typedef struct monitor_state {
  const plantbus_PlantDescription *description;
  const plantbus_PlantStatus *status;  // NULL: none yet
  char daemon[200];                    // "process[pid] on host"
  bool gone;                           // the daemon is
  bool has_sample;
  plantbus_Sample sample;                                // the newest
  double least[MONITOR_SIGNALS], most[MONITOR_SIGNALS];  // inputs, then outputs: of those seen
  uint64_t seen;                                         // samples seen, of this revision
  monitor_event event[MONITOR_EVENTS];                   // the newest last
  size_t events;
} monitor_state;

// --- view.c ---
const char *monitor_mode(plantbus_RunMode mode);
void monitor_view(const monitor_state *state, screen *s);
void monitor_line(const monitor_state *state, screen *s);

// What the steps per second are compared with: the sample rate, times the speed in real time.
double monitor_nominal(const monitor_state *state);

// The refusals' causes and counts; NULL ends the names.
const char *monitor_refusal(const plantbus_Refusals *refused, size_t index, uint64_t *count);

// --- view_members.c ---
void monitor_view_members(const plantbus_PlantStatus *status, screen *s);

// --- view_timing.c ---
void monitor_view_timing(const monitor_state *state, screen *s);

// --- view_json.c --- NULL: out of memory. Owned by the caller (cJSON_Delete).
cJSON *monitor_json(const monitor_state *state);

#endif
