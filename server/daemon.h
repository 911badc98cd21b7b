// The daemon: what its parts share. Threads and what each may touch:
//
//   main      starts and ends everything, waits for signals
//   listener  a thread of the middleware: commands in lockstep (bus_lockstep.c), under `lock`
//   service   requests, events, status, republishing, guards (bus_service.c), mostly under `lock`
//   step      real time only: the stepper (realtime.c), takes no lock
//   receive, publish   real time only: commands in, records out (bus_realtime.c), under `lock`
//
// `lock` is only held for bounded work; writers under it are KEEP_LAST and do not wait for a
// reader.
#ifndef PB_DAEMON_H
#define PB_DAEMON_H

#include <pthread.h>
#include <stdatomic.h>

#include "base/json.h"
#include "bus_qos.h"
#include "engine.h"
#include "realtime.h"
#include "stepper.h"

enum {
  PB_DAEMON_SNAPSHOTS = 16,
  PB_DAEMON_ANSWERED = 256,
  PB_DAEMON_CHUNK = 1000,
  PB_DAEMON_REQUESTS = 32
};

typedef struct pb_daemon_options {
  const char *plant;  // file name
  pb_drive mode;
  uint32_t domain;
  const char *config, *interface;  // of DDS; NULL: the default
  double speed, lease, guard;
  bool allow_shutdown;
  bool lock_memory;
  int priority, cpu;  // of the step thread; 0, −1: none asked for
} pb_daemon_options;

typedef struct pb_snapshot {
  uint32_t id;  // 0: free
  pb_state *state;
} pb_snapshot;

// A request that was answered: the client may send it again when the answer is slow.
typedef struct pb_answered {
  uint8_t client[16];
  uint64_t id;
} pb_answered;

typedef struct pb_daemon {
  pb_daemon_options options;  // never changes
  pb_model *model;            // never changes
  char *plant_text;
  char plant_sha256[65];
  double *packed;  // the model as the description carries it
  size_t packed_count;
  bool memory_locked;

  dds_entity_t participant, publisher, subscriber;
  dds_entity_t topic[PB_TOPIC_COUNT];
  dds_entity_t description, status, sample, reply, event;  // writers
  dds_entity_t command, request;                           // readers
  dds_entity_t wake;                                       // guard condition of the service thread

  pthread_mutex_t lock;
  pb_engine engine;        // under lock
  pb_stepper stepper;      // under lock, except while the step thread runs
  double speed;            // under lock
  pb_record current;       // under lock: what was published last
  int64_t sample_written;  // under lock: wall clock, for republishing
  uint32_t faults;         // under lock: sticky flags of this epoch
  uint64_t fault_step[PB_FLAG_COUNT];
  bool input_owed;  // under lock: the ring to the step thread was full
  bool listening;   // under lock: the daemon is complete

  pb_realtime realtime;
  pthread_t receive_thread, publish_thread;
  bool realtime_threads;  // of the service thread (and main, before and after it)
  dds_entity_t receive_stop;
  atomic_bool publish_stop;
  atomic_bool realtime_mode;  // the listener leaves the commands to the receive thread

  pthread_t service_thread;
  bool service_running;
  atomic_bool stop;
  atomic_bool shutdown_asked;

  // of the service thread
  pb_snapshot snapshot[PB_DAEMON_SNAPSHOTS];
  uint32_t snapshots_made;
  pb_answered answered[PB_DAEMON_ANSWERED];
  uint32_t answered_next;
  bool description_due, status_due;
  int64_t status_written;
  uint64_t status_step;  // for the rate
  uint32_t status_epoch;
} pb_daemon;

// Monotonic wall clock in ns.
int64_t pb_daemon_clock(void);

// --- daemon.c ---

// Loads the plant: seconds for a large one, and nothing that needs an orderly end. On failure
// everything is released. [init]
pb_status pb_daemon_load(pb_daemon *daemon, const pb_daemon_options *options, pb_warnings *warnings,
                         pb_error *err);

// Joins the domain and starts to serve. On failure everything is released. [init]
pb_status pb_daemon_start(pb_daemon *daemon, pb_error *err);
void pb_daemon_stop(pb_daemon *daemon);

// --- bus_entities.c ---
pb_status pb_bus_create(pb_daemon *daemon, pb_error *err);

// True when the writer of a sample (its publication handle) belongs to this client. [any]
bool pb_bus_writer_is(dds_entity_t reader, dds_instance_handle_t writer, const uint8_t client[16],
                      uint8_t actual[16]);

// --- bus_lockstep.c, all under lock ---

// The listener of the command reader. It never creates, deletes or waits.
void pb_bus_on_command(dds_entity_t reader, void *context);

// Takes and judges all commands that are there. True when one was accepted; `for_step` (may be
// NULL) receives the step of the last one.
bool pb_bus_take_commands(pb_daemon *daemon, uint64_t *for_step);

// Steps as long as the engine is ready, at most PB_DAEMON_CHUNK times. True when there is more to
// do.
bool pb_bus_run_ready(pb_daemon *daemon);

// Publishes the current record (again).
void pb_bus_publish_sample(pb_daemon *daemon);

// Keeps the sticky faults; the first of each is told.
void pb_bus_note_faults(pb_daemon *daemon, const pb_record *record);

// --- bus_realtime.c, called by the service thread without the lock ---
pb_status pb_bus_realtime_start(pb_daemon *daemon, pb_error *err);
void pb_bus_realtime_stop(pb_daemon *daemon);

// --- bus_publish.c, by the service thread ---
void pb_bus_publish_description(pb_daemon *daemon);
void pb_bus_publish_status(pb_daemon *daemon);
void pb_bus_publish_events(pb_daemon *daemon);

// --- bus_service.c ---
void *pb_bus_service(void *daemon);

// --- request*.c, by the service thread ---

// Serves requests that are there, PB_DAEMON_REQUESTS at most.
void pb_bus_take_requests(pb_daemon *daemon);

// A request's handler: body is a JSON object; fills result (an empty object) or fails with the
// pointer in err->where. *accepted: the answer is "accepted", an event will tell the end.
typedef struct pb_request {
  const uint8_t *client;
  const cJSON *body;
  cJSON *result;
  bool accepted;
} pb_request;

typedef pb_status (*pb_request_handler)(pb_daemon *daemon, pb_request *request, pb_error *err);

pb_status pb_request_attach(pb_daemon *daemon, pb_request *request, pb_error *err);
pb_status pb_request_detach(pb_daemon *daemon, pb_request *request, pb_error *err);
pb_status pb_request_ping(pb_daemon *daemon, pb_request *request, pb_error *err);
pb_status pb_request_get_description(pb_daemon *daemon, pb_request *request, pb_error *err);
pb_status pb_request_set_mode(pb_daemon *daemon, pb_request *request, pb_error *err);
pb_status pb_request_step(pb_daemon *daemon, pb_request *request, pb_error *err);
pb_status pb_request_reset(pb_daemon *daemon, pb_request *request, pb_error *err);
pb_status pb_request_snapshot(pb_daemon *daemon, pb_request *request, pb_error *err);
pb_status pb_request_restore(pb_daemon *daemon, pb_request *request, pb_error *err);
pb_status pb_request_decimate(pb_daemon *daemon, pb_request *request, pb_error *err);
pb_status pb_request_shutdown(pb_daemon *daemon, pb_request *request, pb_error *err);

// "paused", "lockstep", "realtime"; −1 for anything else.
const char *pb_drive_name(pb_drive drive);
int pb_drive_parse(const char *name);

#endif
