// What the parts of the session share. Not for tools: they use session.h.
#ifndef PB_CLIENTS_SESSION_INTERNAL_H
#define PB_CLIENTS_SESSION_INTERNAL_H

#include <pthread.h>

#include "bus_qos.h"
#include "session.h"

// How the daemon stands, as a ping tells.
typedef struct pb_standing {
  pb_run_mode mode;
  uint32_t epoch;
  uint64_t step;
  uint64_t event;  // number of the next event
} pb_standing;

// One run; everything under the session's lock, because samples come in a thread of the middleware.
typedef struct pb_run {
  const pb_run_options *options;
  bool active;    // samples are to be answered
  bool listener;  // by the listener (lockstep); else by the calling thread
  bool answered;  // at least one sample was
  bool behind;    // newer samples are at hand: this one needs no answer
  uint64_t first_step, last_step;
  uint32_t epoch;
  uint32_t revision;                 // whose samples are answered
  int64_t answered_at, progress_at;  // monotonic, ns
  uint64_t samples, missed;
  pb_status status;  // why it ended
  pb_error error;
} pb_run;

struct pb_session {
  uint32_t domain;
  const char *config, *interface;  // the caller's: read while the session is opened
  double timeout;
  int history;           // samples that the reader keeps; 0: as its topic says
  uint8_t client[16];    // GUID of the participant
  char client_name[64];  // program[pid]
  uint64_t next_request;

  dds_entity_t participant, publisher, subscriber;
  dds_entity_t topic[PB_TOPIC_COUNT];
  dds_entity_t request, reply, event, sample, command;
  dds_entity_t request_wait, sample_wait;               // waitsets
  dds_entity_t block_request, block_reply, block_wait;  // made with the first block
  plantbus_PlantDescription *received;
  pb_description description;
  pb_model *model;

  bool attached;
  uint64_t session, attach_step, attach_event;
  uint32_t channel, input_count;
  double guard;

  pthread_mutex_t lock;
  pthread_cond_t ended;
  pb_run run;                  // under lock
  plantbus_Command answer;     // under lock: the last one, to be sent again when it was lost
  plantbus_Sample unanswered;  // under lock: ended the last run; the next one begins with it
  bool has_unanswered;
};

int64_t pb_session_clock(void);

// Finds the plant and fills received. session_find.c
pb_status pb_session_find(pb_session *session, const char *plant, pb_error *err);

// Waits until the entity (a writer, or else a reader) has a partner; two are refused when `only`.
pb_status pb_session_match(pb_session *session, dds_entity_t entity, bool writer, bool only,
                           int64_t deadline, pb_error *err);

// Waits until the daemon's reader is among those of a writer.
pb_status pb_session_match_daemon(pb_session *session, dds_entity_t writer, int64_t deadline,
                                  pb_error *err);

// session_request.c
pb_status pb_session_ping(pb_session *session, pb_standing *out, pb_error *err);

// A number of a reply's result; 0 when it is not there.
double pb_session_result(const char *result, const char *key);

// session_run.c: the listener of the sample reader, and that reader.
pb_status pb_session_listen(pb_session *session, pb_error *err);

#endif
