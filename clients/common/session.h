// A client's side of the bus: find a plant, attach to a channel, answer samples with commands.
//
// One pb_session is one DDS participant and one client id. The model comes from the description
// that the daemon publishes, so no element file is needed on the client's host. All calls block at
// most for the timeout given; failures name the plant, topic or request at fault. Not thread-safe:
// one thread uses a session; the sample callback runs in a DDS thread (lockstep) or in the calling
// thread (real time) and never both at once.
#ifndef PB_CLIENTS_SESSION_H
#define PB_CLIENTS_SESSION_H

#include <stdbool.h>
#include <stdint.h>

#include "model/model.h"

typedef struct pb_session pb_session;

typedef struct pb_session_options {
  uint32_t domain;        // DDS domain id
  const char *config;     // file of a Cyclone DDS configuration; NULL: as bus_domain.h says
  const char *interface;  // network interface of the built-in configuration; NULL: lo
  const char
      *plant;  // name of the plant; NULL: the only plant of the domain (several: refused, named)
  double timeout;    // seconds to wait for the daemon; 0: 5 s
  uint32_t history;  // samples kept for a client that is late in real time; 0: the newest only, as
                     // a controller wants it. A recorder asks for more: it sees them all, in order,
                     // and answers the newest
} pb_session_options;

typedef enum pb_run_mode { PB_PAUSED, PB_LOCKSTEP, PB_REALTIME } pb_run_mode;

// What the description says, besides the model. Strings live as long as the session.
typedef struct pb_description {
  const char *name;
  const char *version;       // of the daemon's software
  const char *plant_text;    // the plant file
  const char *plant_sha256;  // of that text, lower-case hexadecimal
  uint32_t revision, epoch;
  pb_run_mode mode;
  double speed;
} pb_description;

// Creates the participant, waits for the description, unpacks the model. options NULL: defaults.
// [init] Fails with PB_ERR_STATE (nothing found in time, several plants), PB_ERR_SYNTAX (a
// description that is not consistent), PB_ERR_IO (DDS), PB_ERR_MEMORY.
pb_status pb_session_open(const pb_session_options *options, pb_session **out, pb_error *err);

// Detaches when attached, disposes of everything. NULL is allowed.
void pb_session_close(pb_session *session);

const pb_model *pb_session_model(const pb_session *session);
const pb_description *pb_session_description(const pb_session *session);

// Sends a request and waits for its reply: body and *result are JSON objects as text (body may be
// NULL; *result may be NULL when not wanted, else owned by the caller). A refusal becomes
// PB_ERR_STATE with the daemon's JSON pointer and message. [init]
pb_status pb_session_request(pb_session *session, const char *kind, const char *body,
                             double timeout, char **result, pb_error *err);

// The daemon's answer to a request. Zero-initialise; free with pb_answer_clear.
typedef struct pb_answer {
  bool accepted;   // the work goes on, an event tells the end; else it is done
  uint64_t event;  // number of the first event that can tell it: for pb_session_wait_event
  char *result;    // a JSON object as text
} pb_answer;

// As pb_session_request, and tells whether the work is done or goes on. Pings first, so that an
// event of an earlier request cannot be taken for this one's. [init]
pb_status pb_session_ask(pb_session *session, const char *kind, const char *body, double timeout,
                         pb_answer *out, pb_error *err);
void pb_answer_clear(pb_answer *answer);

typedef struct pb_session_event {
  uint64_t number;
  uint32_t epoch;
  uint64_t step;
  char kind[32], client_name[64], channel[64];
  char message[512];
} pb_session_event;

// Waits for an event of one of these kinds (words, separated by blanks) with this number or a later
// one that concerns this client or none, and copies it. Events that come before it are thrown away.
// timeout 0: the session's. Fails with PB_ERR_STATE:
// none came in time, the daemon has gone, `interrupted` (may be NULL) became true. [init]
pb_status pb_session_wait_event(pb_session *session, const char *kinds, uint64_t first,
                                double timeout, bool (*interrupted)(void), pb_session_event *out,
                                pb_error *err);

typedef struct pb_attach_options {
  const char *channel;        // name; channels add up on an input
  const char *const *inputs;  // names of the wanted inputs, in the order of the commands
  uint32_t input_count;
  bool barrier;         // lockstep waits for this client
  int32_t priority;     // on one channel only the highest acts
  const char *silence;  // "hold", "zero" or "ramp"; NULL: "zero"
  double lease;         // plant time in seconds without a command; 0: the daemon's default
  double guard;         // wall-clock seconds a barrier may wait for this client; 0: default
} pb_attach_options;

// Attaches: creates writer and reader, waits until both are matched and the request is answered.
pb_status pb_session_attach(pb_session *session, const pb_attach_options *options, pb_error *err);
void pb_session_detach(pb_session *session);

// The sample as the client sees it. input: what was applied over the interval ending at this step.
typedef struct pb_sample {
  uint64_t step;
  int64_t time_ns;
  uint32_t epoch, revision, flags;
  uint32_t input_count, output_count;
  const double *input, *output;
} pb_sample;

// Called for each sample. Fills command[input_count of the attach] for step sample->step and
// returns true, or returns false to end the run (no command is sent for this sample). Must not
// block.
typedef bool (*pb_sample_callback)(void *context, const pb_sample *sample, double *command);

typedef struct pb_run_report {
  uint64_t samples;  // received
  uint64_t missed;   // steps never seen (real time)
  double seconds;    // wall clock
} pb_run_report;

// Runs until the callback returns false; the sample for which it did begins the next run. Between
// two runs an attached client is silent, and is evicted when that lasts longer than its guard. A
// session that is not attached may run too: it sees samples and commands nothing. In lockstep every
// sample is answered from the DDS listener and none is missed; in real time the newest sample is
// taken from a waitset. Fails with PB_ERR_STATE when the daemon goes away, changes epoch or
// revision, evicts this client, or sends no new sample within `stall` wall-clock seconds.
// interrupted (may be NULL) is polled: true ends the run with PB_ERR_STATE "interrupted". progress
// (may be NULL) is called about 5 times a second with the number of samples. [init]
typedef struct pb_run_options {
  pb_sample_callback on_sample;
  void *context;
  double stall;
  bool (*interrupted)(void);
  void (*progress)(void *context, uint64_t samples);
  bool any_revision;  // go on when the model is changed, as long as the numbers of inputs and
                      // outputs stay; without it the run ends: two models are never mixed
} pb_run_options;

pb_status pb_session_run(pb_session *session, const pb_run_options *options, pb_run_report *report,
                         pb_error *err);

// A block: `steps` rows of values for these inputs (indices into the model's; none: NULL, 0) are
// held over as many steps in one exchange, on a plant that nobody else steps (paused, or lockstep
// without barrier members).
typedef struct pb_block {
  uint64_t step;  // the step that the first row was held over
  uint32_t epoch, revision, steps, input_count, output_count;
  uint32_t *flags;  // [steps]; row r of all three is sample step + 1 + r
  double *input;    // [steps][input_count], of the plant, as applied
  double *output;   // [steps][output_count]
} pb_block;

// values: [steps][input_count]. *out is freed with pb_block_clear. [init] Fails with PB_ERR_STATE
// (refused, with the daemon's reason, or no answer in time), PB_ERR_ARGUMENT, PB_ERR_MEMORY.
pb_status pb_session_block(pb_session *session, const uint32_t *inputs, uint32_t input_count,
                           const double *values, uint32_t steps, double timeout, pb_block *out,
                           pb_error *err);
void pb_block_clear(pb_block *block);

#endif
