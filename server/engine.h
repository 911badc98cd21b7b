// Who may act on the plant, and when a step may be taken: sessions, channels, barrier, leases.
//
//   u(k) = Σ over channels of the value of the one member that acts on the channel
//
// Pure logic: no DDS, no threads, no clock (the caller says what time it is), no plant. Everything
// here is guarded by one lock of the caller. After pb_engine_init nothing is allocated.
//
// A member is an attached session. On one channel the member of highest priority acts, from its
// first command on; of equal ones the first attached. When the last one goes, the channel keeps its
// last value, drops it or ramps it down, as that member asked (its silence policy). Channels are
// summed in the order of their names, so that the order of attaching does not change a bit of the
// sum.
//
// Lockstep: the barrier is the set of barrier members; a step is taken when each has its command
// for it in. A member that keeps the others waiting longer than its guard (wall clock) is evicted,
// any member that is silent for longer than its lease (plant time) is dropped. Both are told by an
// event.
#ifndef PB_ENGINE_H
#define PB_ENGINE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/status.h"

enum {
  PB_ENGINE_INPUTS = 32,   // of the plant
  PB_ENGINE_MEMBERS = 64,  // attached at once
  PB_ENGINE_CHANNELS = 64,
  PB_ENGINE_EVENTS = 128,  // kept until taken; then the oldest are lost and counted
  PB_ENGINE_NAME = 64,     // octets of a name, with its terminator
};

typedef enum pb_drive { PB_DRIVE_PAUSED, PB_DRIVE_LOCKSTEP, PB_DRIVE_REALTIME } pb_drive;
typedef enum pb_silence { PB_SILENCE_HOLD, PB_SILENCE_ZERO, PB_SILENCE_RAMP } pb_silence;

// What became of a command: name, as told in `status`. From SESSION on it is refused and never
// acts.
#define PB_VERDICT_LIST(X)            \
  X(ACCEPTED, "accepted")             \
  X(LATE, "late")                     \
  X(REPEATED, "repeated")             \
  X(UNKNOWN_WRITER, "unknown writer") \
  X(SESSION, "session")               \
  X(FOREIGN, "foreign")               \
  X(STEP, "step")                     \
  X(SIZE, "size")                     \
  X(NON_FINITE, "non_finite")         \
  X(DUPLICATE, "duplicate")           \
  X(STALE, "stale")

typedef enum pb_verdict {
#define PB_VERDICT_ENUM(name, text) PB_VERDICT_##name,
  PB_VERDICT_LIST(PB_VERDICT_ENUM)
#undef PB_VERDICT_ENUM
      PB_VERDICT_COUNT
} pb_verdict;

// Kinds of events: name on the bus.
#define PB_EVENT_LIST(X)                                                                           \
  X(ATTACHED, "attached")                                                                          \
  X(DETACHED, "detached")                                                                          \
  X(EVICTED, "evicted")       /* a barrier member was late beyond its guard */                     \
  X(LOST, "lost")             /* a client died, or gave no sign of life */                         \
  X(LEASE_OVER, "lease_over") /* no command for the time of the lease */                           \
  X(TAKEOVER, "takeover")     /* another member acts on the channel now */                         \
  X(MODE, "mode")                                                                                  \
  X(RESET, "reset")                                                                                \
  X(RESTORED, "restored")                                                                          \
  X(STEPPED, "stepped")           /* the steps of an accepted step request are done */             \
  X(FAULT, "fault")               /* a fault bit is set for the first time */                      \
  X(REFUSED, "refused")           /* a command, for the 1st, 10th, 100th … time of its cause */  \
  X(RECONFIGURED, "reconfigured") /* another revision of the model is stepped */                   \
  X(CONFIGURE_FAILED, "configure_failed") /* of a request that was accepted */                     \
  X(HOSTED, "hosted")                     /* a controller or an excitation runs inside the step */ \
  X(UNHOSTED, "unhosted")                 /* … was removed, or has come to its end */            \
  X(UNRECORDED, "unrecorded")             /* samples are lost on recorders, or no longer */        \
  X(OVERRUN, "overrun")                   /* real time was given up: overrun policy "stop" */      \
  X(SHUTDOWN, "shutdown")

typedef enum pb_event_kind {
#define PB_EVENT_ENUM(name, text) PB_EVENT_##name,
  PB_EVENT_LIST(PB_EVENT_ENUM)
#undef PB_EVENT_ENUM
} pb_event_kind;

typedef struct pb_event {
  uint64_t number;  // counts from 0
  pb_event_kind kind;
  uint64_t step;
  uint32_t epoch;
  uint8_t client[16];  // zero: no client
  char client_name[PB_ENGINE_NAME], channel[PB_ENGINE_NAME];
  char message[320];
} pb_event;

typedef struct pb_member {
  uint64_t id;  // the session; 0: this place is free
  uint8_t client[16];
  char client_name[PB_ENGINE_NAME];
  uint32_t channel;                  // index
  uint32_t count;                    // inputs
  uint32_t input[PB_ENGINE_INPUTS];  // index of each in the plant
  bool barrier;
  int32_t priority;
  pb_silence silence;
  uint64_t lease_steps;
  int64_t guard_ns;
  uint64_t order;                  // of attaching
  uint64_t writer;                 // whose commands were checked to be this client's; 0: none yet
  bool in;                         // its command for the current barrier step is in
  bool started;                    // has given a command
  uint64_t last_step;              // of its last command; before that, the step it attached at
  uint64_t heard_step;             // the plant's step when that came
  int64_t waiting_since;           // wall clock: when the current step began, or it attached
  double value[PB_ENGINE_INPUTS];  // last command
  uint64_t commands, late;
  uint64_t age_max;  // steps from the step a command was for to its arrival
} pb_member;

typedef struct pb_channel {
  char name[PB_ENGINE_NAME];       // empty: this place is free
  uint64_t acting;                 // session id; 0: none
  double rest[PB_ENGINE_INPUTS];   // plant inputs that a member left behind
  uint32_t ramp_left, ramp_total;  // steps; total 0: rest is held
} pb_channel;

typedef struct pb_engine {
  uint32_t nu;
  double sample_rate;
  pb_drive drive;
  uint32_t decimation;  // steps from one published sample to the next
  uint32_t epoch;
  uint64_t step;      // the current step; its sample is out, its input is not yet held
  uint64_t budget;    // steps that may be taken without lockstep ("step n")
  uint64_t attached;  // members ever
  uint32_t places;    // in use: member[0 .. places), free ones among them
  pb_member member[PB_ENGINE_MEMBERS];
  pb_channel channel[PB_ENGINE_CHANNELS];
  uint8_t sorted[PB_ENGINE_CHANNELS];  // used channels by name
  uint32_t channels;
  uint64_t verdicts[PB_VERDICT_COUNT];
  pb_event event[PB_ENGINE_EVENTS];
  uint64_t events_made, events_taken;
} pb_engine;

typedef struct pb_attach {
  uint8_t client[16];
  const char *client_name, *channel;
  const uint32_t *input;  // [count] indices of plant inputs, each at most once
  uint32_t count;
  bool barrier;
  int32_t priority;
  pb_silence silence;
  double lease;  // s of plant time, > 0
  double guard;  // s of wall clock, > 0
  uint64_t id;   // the session: random, not 0
} pb_attach;

const char *pb_verdict_name(pb_verdict verdict);
const char *pb_event_kind_name(pb_event_kind kind);

// nu ≤ PB_ENGINE_INPUTS inputs, sample_rate in Hz; paused, step 0 of epoch 1.
void pb_engine_init(pb_engine *engine, uint32_t nu, double sample_rate);

// --- engine_member.c ---

// Adds a member; *out points at it. Fails with PB_ERR_STATE (no place), PB_ERR_ARGUMENT (lease,
// guard).
pb_status pb_engine_attach(pb_engine *engine, const pb_attach *attach, int64_t now,
                           const pb_member **out, pb_error *err);

// The member of a session, or NULL.
pb_member *pb_engine_find(pb_engine *engine, uint64_t id);

// Drops a member: kind is the event, why goes into its message after "client … on channel …".
void pb_engine_drop(pb_engine *engine, pb_member *member, pb_event_kind kind, const char *why);

// Drops all members of a client; true when there was one.
bool pb_engine_drop_client(pb_engine *engine, const uint8_t client[16], pb_event_kind kind,
                           const char *why);

uint32_t pb_engine_member_count(const pb_engine *engine);
uint32_t pb_engine_barrier_count(const pb_engine *engine);

// Records an event without a client. message as by printf.
void pb_engine_note(pb_engine *engine, pb_event_kind kind, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

// The oldest event not yet taken; false when there is none.
bool pb_engine_event_take(pb_engine *engine, pb_event *out);

// --- engine_command.c ---

typedef struct pb_command {
  uint64_t session, step;
  uint32_t channel, count;
  const double *input;
  uint64_t writer;  // who wrote it, as the bus tells; compared with the member's checked writer
} pb_command;

// Judges a command and, unless refused, makes it the member's value. UNKNOWN_WRITER: nothing is
// counted; the caller checks the writer's client, sets member->writer and asks again, or calls
// pb_engine_refuse(PB_VERDICT_FOREIGN, …). Refusals are told by an event that names whose command
// it was, at the 1st, 10th, 100th … of each cause: a flood of them does not become a flood of
// events. No allocation. [rt]
pb_verdict pb_engine_command(pb_engine *engine, const pb_command *command);
void pb_engine_refuse(pb_engine *engine, const pb_command *command, pb_verdict cause);

// --- engine_step.c ---

// True when the next step may be taken now: driven by lockstep or a budget, no barrier member out.
// [rt]
bool pb_engine_ready(const pb_engine *engine);

// u[nu] for the current step; held: a started member that the plant heard nothing of for it. [rt]
void pb_engine_input(const pb_engine *engine, double *u, bool *held);

// A step was taken: the engine goes on to `step`; spends budget, runs ramps, ends leases. [rt]
// True when the inputs that act have changed otherwise than by a command.
bool pb_engine_advance(pb_engine *engine, uint64_t step, int64_t now);

// Evicts barrier members that are late beyond their guard. True when one was. [any]
bool pb_engine_guard(pb_engine *engine, int64_t now);

// A new epoch: step count anew, rests gone, members stay and owe a command for `step`. [any]
void pb_engine_restart(pb_engine *engine, uint64_t step, int64_t now);

// The plant's inputs are now nu others: from[nu] says which of the old ones each is (−1: a new
// one). Members and channels keep what they hold by that; a member one of whose inputs is gone is
// dropped. [any]
void pb_engine_relayout(pb_engine *engine, uint32_t nu, const int *from);

// The first member that has an input which the new layout lacks, or NULL; *input is its old index.
// [any]
const pb_member *pb_engine_misses(const pb_engine *engine, uint32_t nu, const int *from,
                                  uint32_t *input);

// Allows n ≥ 1 steps, whoever drives; members' waiting starts anew. [any]
void pb_engine_allow(pb_engine *engine, uint64_t n, int64_t now);

// Changes who drives; members' waiting starts anew. A command that acted in real time is not an
// answer to the sample that lockstep begins with. [any]
void pb_engine_drive(pb_engine *engine, pb_drive drive, int64_t now);

// True when a barrier member's command for this step is awaited (and the plant could go on). [any]
bool pb_engine_waiting(const pb_engine *engine);

#endif
