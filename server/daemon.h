// The daemon: what its parts share. Threads and what each may touch:
//
//   main      starts and ends everything, waits for signals
//   listener  a thread of the middleware: commands in lockstep (bus_lockstep.c), under `lock`
//   service   requests, events, status, republishing, guards (bus_service.c), mostly under `lock`
//   step      real time only: the stepper (realtime.c), takes no lock
//   receive, publish   real time only: commands in, records out (bus_realtime.c), under `lock`
//   compile   a changed model, beside everything else (compile_job.c), takes no lock
//
// `lock` is only held for bounded work; writers under it are KEEP_LAST and do not wait for a
// reader.
#ifndef PB_DAEMON_H
#define PB_DAEMON_H

#include <pthread.h>
#include <stdatomic.h>

#include "base/json.h"
#include "bus_qos.h"
#include "configure.h"
#include "engine.h"
#include "realtime.h"
#include "snapshot.h"
#include "stepper.h"

enum {
  PB_DAEMON_SNAPSHOTS = 16,
  PB_DAEMON_ANSWERED = 256,
  PB_DAEMON_CHUNK = 1000,
  PB_DAEMON_REQUESTS = 32,
  PB_DAEMON_BLOCK = 65536,     // steps of a block request
  PB_DAEMON_BLOCK_SLICE = 200  // of these without giving up the lock
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
  pb_overrun overrun;
  const char *state_directory;  // of snapshot files; NULL: none are written or read by request
  const char *restore;          // snapshot file to start from; NULL: at rest
} pb_daemon_options;

typedef struct pb_snapshot {
  uint32_t id;  // 0: free
  pb_snapshot_data data;
} pb_snapshot;

// A request that was answered: the client may send it again when the answer is slow.
typedef struct pb_answered {
  uint8_t client[16];
  uint64_t id;
} pb_answered;

struct pb_request;

// What recorders are owed. Under lock, but for the number of them.
typedef struct pb_trace {
  dds_entity_t writer;
  atomic_uint followers;
  plantbus_Sample sample;  // offered last
  bool owed;               // there was no room for it
  int64_t since;           // … at that time
  bool cut;                // it was waited for in vain: samples are lost on recorders
  uint64_t lost;           // so many since
} pb_trace;

typedef struct pb_daemon {
  pb_daemon_options options;  // never changes
  char *name;                 // of the plant, and of its partition; never changes
  char *directory;            // of the plant file; never changes
  bool memory_locked;

  dds_entity_t participant, publisher, subscriber;
  dds_entity_t topic[PB_TOPIC_COUNT];
  dds_entity_t description, status, sample, reply, event, block_reply;  // writers
  dds_entity_t command, request, block_request;                         // readers
  dds_entity_t wake;  // guard condition of the service thread

  pthread_mutex_t lock;
  pb_revision *live;       // under lock; freed by the service thread only
  pb_engine engine;        // under lock
  pb_stepper stepper;      // under lock, except while the step thread runs
  double speed;            // under lock
  pb_overrun overrun;      // under lock
  pb_histogram step_time;  // under lock: of steps that are not taken in real time
  pb_record current;       // under lock: what was published last
  int64_t sample_written;  // under lock: wall clock, for republishing
  pb_trace trace;
  uint32_t faults;  // under lock: sticky flags of this epoch
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
  pb_element_store elements;  // read so far; the compile thread's while there is one
  pb_mode_store modes;        // solved for so far; likewise
  pb_pending pending;         // but for what configure.h says is under lock
  const pb_host *host;        // hosted items, as of the last change made
  pb_history_entry history[PB_CONFIGURE_HISTORY];
  uint32_t history_count;
  uint32_t revisions_made;
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

// Releases everything. False: a compile thread still works on a part of it, which is left alone,
// and the process should end.
bool pb_daemon_stop(pb_daemon *daemon);

// The revision that is stepped. Of the service thread: nobody else frees it.
const pb_revision *pb_daemon_live(pb_daemon *daemon);

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

// Makes the armed change when its step has come (never in real time, where the step thread does).
void pb_bus_change_due(pb_daemon *daemon);

// A change was made: revision, engine and those who wait for it follow.
void pb_bus_change_made(pb_daemon *daemon);

// Takes one step with these values (NULL: none) beside the channels; publishes nothing.
void pb_bus_step(pb_daemon *daemon, const double *beside);

// The current record as the bus has it.
plantbus_Sample pb_bus_sample(const pb_daemon *daemon);

// Publishes the current record (again).
void pb_bus_publish_sample(pb_daemon *daemon);

// Keeps the sticky faults; the first of each is told.
void pb_bus_note_faults(pb_daemon *daemon, const pb_record *record);

// --- bus_trace.c, under lock ---

// The writer. [init]
pb_status pb_trace_create(pb_daemon *daemon, pb_error *err);

// True when somebody reads the trace.
bool pb_trace_followed(const pb_daemon *daemon);

// Offers a published sample. What there is no room for is owed in lockstep, and lost in real time.
void pb_trace_put(pb_daemon *daemon, const plantbus_Sample *sample);

// True while the sample offered last is owed and waited for: no further step may be taken. Tries
// again.
bool pb_trace_owed(pb_daemon *daemon);

// --- bus_realtime.c, called by the service thread without the lock ---
pb_status pb_bus_realtime_start(pb_daemon *daemon, pb_error *err);
void pb_bus_realtime_stop(pb_daemon *daemon);

// Ends real time when the step thread has given up.
void pb_bus_realtime_tend(pb_daemon *daemon);

// --- bus_block.c, by the service thread ---

// Serves the block requests that are there.
void pb_bus_take_blocks(pb_daemon *daemon);

// --- configure.c, by the service thread ---

// What is asked for: text, patch and comment are handed over on success and on failure.
typedef struct pb_configure_order {
  char *text;  // of the changed plant file
  char *patch, *comment;
  const char *client_name;
  uint64_t at_step;
} pb_configure_order;

// PB_ERR_STATE while another change is on its way.
pb_status pb_configure_idle(const pb_daemon *daemon, pb_error *err);
pb_status pb_configure_begin(pb_daemon *daemon, struct pb_request *request,
                             const pb_configure_order *order, pb_error *err);
pb_status pb_configure_host(pb_daemon *daemon, struct pb_request *request, pb_host *host,
                            const char *channel, bool removed, uint64_t period);
// Gives up a change of the model that is compiled or waits for its step. PB_ERR_STATE: there is
// none.
pb_status pb_configure_cancel(pb_daemon *daemon, pb_error *err);
void pb_configure_tend(pb_daemon *daemon);
void pb_configure_first(pb_daemon *daemon);  // revision 1 into the history
bool pb_configure_end(pb_daemon *daemon);

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
  uint64_t id;
  const char *kind;
  const cJSON *body;
  cJSON *result;
  bool accepted;
  bool deferred;  // somebody else answers
} pb_request;

// Whether this client's request came before; remembers it.
bool pb_bus_answered_before(pb_daemon *daemon, const uint8_t client[16], uint64_t id);

// A name for who asks: as it attached, or as it says (may be NULL). request_configure.c
void pb_request_client_name(pb_daemon *daemon, const pb_request *request, const char *said,
                            char name[PB_ENGINE_NAME]);

// Answers a request; a description that is due goes out first.
void pb_bus_reply(pb_daemon *daemon, const uint8_t client[16], uint64_t id, const char *status,
                  const pb_error *err, const char *result);

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
pb_status pb_request_configure(pb_daemon *daemon, pb_request *request, pb_error *err);
pb_status pb_request_cancel(pb_daemon *daemon, pb_request *request, pb_error *err);
pb_status pb_request_revert(pb_daemon *daemon, pb_request *request, pb_error *err);
pb_status pb_request_history(pb_daemon *daemon, pb_request *request, pb_error *err);
pb_status pb_request_get_revision(pb_daemon *daemon, pb_request *request, pb_error *err);
pb_status pb_request_host(pb_daemon *daemon, pb_request *request, pb_error *err);
pb_status pb_request_unhost(pb_daemon *daemon, pb_request *request, pb_error *err);
pb_status pb_request_decimate(pb_daemon *daemon, pb_request *request, pb_error *err);
pb_status pb_request_shutdown(pb_daemon *daemon, pb_request *request, pb_error *err);

// What changes the plant's state stops the step thread for that moment. True when it ran.
bool pb_daemon_halt(pb_daemon *daemon);
pb_status pb_daemon_continue(pb_daemon *daemon, bool ran, pb_error *err);

// A new epoch from rest (from NULL) or from a saved state. Under lock, halted.
void pb_daemon_restart(pb_daemon *daemon, const pb_snapshot_data *from, pb_event_kind kind,
                       const char *text);

// Whether steps may be asked for: nobody else steps the plant. PB_ERR_STATE. request_run.c
pb_status pb_request_may_step(const pb_engine *engine, pb_error *err);

// Goes on from the snapshot file of the options. [init]
pb_status pb_daemon_resume(pb_daemon *daemon, pb_error *err);

// "paused", "lockstep", "realtime"; −1 for anything else.
const char *pb_drive_name(pb_drive drive);
int pb_drive_parse(const char *name);

#endif
