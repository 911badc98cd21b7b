// Changing the running plant: a patched plant file is compiled beside the running model in a thread
// of its own, and swapped in at a step boundary; hosted items are added and removed the same way.
//
//   request → (compile thread: text → revision, transfer plan) → armed → made by whoever steps
//           → reply, event, description, history
//
// One change at a time. What fails before it is made leaves everything as it was.
#ifndef PB_CONFIGURE_H
#define PB_CONFIGURE_H

#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>

#include "base/json.h"
#include "revision.h"
#include "stepper.h"

enum { PB_CONFIGURE_HISTORY = 256, PB_CONFIGURE_NAME = 64 };

// What the compile thread works on.
typedef struct pb_compile_job {
  char *text;                  // of the changed plant file
  const char *directory;       // of relative element paths
  const pb_revision *before;   // what runs; stays until the job is over
  pb_element_store *elements;  // read so far; the job's until it is over
  pb_mode_store *modes;        // solved for so far; likewise
  uint32_t number;             // of the revision to be made
  pb_revision *next;
  pb_state *state;
  pb_transfer *transfer;
  pb_handover *handover;  // of the transfer, where it is to be spread; until a carrier takes it
  double rate;            // steps a second by the wall clock; 0: lockstep
  pb_warnings warnings, notes;
  pb_status status;
  pb_error err;
  double seconds;
  void (*finished)(void *context);  // called last, in the compile thread
  void *context;
  pthread_t thread;
  atomic_bool done;
} pb_compile_job;

// Starts the thread. Fails with PB_ERR_IO. [init]
pb_status pb_compile_start(pb_compile_job *job, pb_error *err);

// Waits for the end of the thread.
void pb_compile_join(pb_compile_job *job);

// Frees what the job owns and has not handed on.
void pb_compile_clear(pb_compile_job *job);

// A change on its way.
typedef struct pb_pending {
  bool used;
  bool compiling;      // the job runs; of the service thread, as `used` and what follows
  uint8_t client[16];  // who asked, and what for
  uint64_t id;
  char client_name[PB_CONFIGURE_NAME];
  int64_t answer_by;  // wall clock: "accepted" then
  bool answered;
  bool is_model;
  bool cancelled;  // while it was compiled
  uint64_t at_step;
  pb_compile_job job;
  char *patch, *comment;                 // of the request; patch NULL: a revert
  char host_channel[PB_CONFIGURE_NAME];  // of a change of hosted items
  bool host_removed;
  uint64_t host_period;
  const pb_host *host_next;  // the hosted items once the change is made
  pb_change change;          // under lock, or the step thread's, once armed
  pb_carrier carrier;
  bool armed, made;  // under lock
} pb_pending;

// One line of the history; the text of each revision is kept for `revert`.
typedef struct pb_history_entry {
  uint32_t revision;
  int64_t time;  // s since 1970
  uint32_t epoch;
  uint64_t step, states;
  char client_name[PB_CONFIGURE_NAME];
  char *comment, *patch, *text;
  char sha256[65];
  double output_jump, energy_before, energy_after;
  char worst_output[PB_CONFIGURE_NAME], worst_unit[16];
} pb_history_entry;

#endif
