// What runs inside the step: controllers and excitations, each on a channel of its own beside the
// channels of the clients.
//
//   u(k) ← u(k) + Σ over items of K(y(k)) or of the excitation's value for step k
//
// A controller has the timing of a client that answers sample k with command k. The items act in
// the order of their channels' names: in which order they were made does not change a bit of the
// sum. An item begins, at its own step 0, at the first pb_host_run of the set that has it.
//
// A set never changes which items it holds: adding and removing make a new set, which is swapped in
// between two steps and takes over the states of the items that both have. The definitions are
// shared and counted. The states of all items lie in one piece of memory: a snapshot is a memcpy.
//
// One thread at a time runs, saves, loads, resets a set; names and done flags may be read beside
// it. Except where it is written to, a NULL set is one without items.
#ifndef PB_HOST_H
#define PB_HOST_H

#include "base/json.h"
#include "model/model.h"

enum {
  PB_HOST_ITEMS = 16,
  PB_HOST_STATES = 500,      // of one controller
  PB_HOST_VALUES = 4000000,  // in the table of one excitation
  PB_HOST_NAME = 64,         // octets of a channel's name, with its terminator
};

typedef struct pb_host pb_host;

typedef struct pb_host_item_info {
  const char *channel;
  const char *kind;         // "iff", "lti", "white", "noise", "multisine", "chirp", "sine", …
  const char *request;      // "host_controller" or "excite"
  const char *client_name;  // who asked for it
  uint64_t period_steps;    // of an excitation's table; 0: of a controller, or without an end
} pb_host_item_info;

// A new set: the items of host (NULL: none) and the one that a request's body describes, with all
// states at the start. request: "host_controller" or "excite". model: the plant that the set runs
// with, the same as that of host. period_steps may be NULL. Work grows with the table: up to
// seconds for millions of values. [init]
// Fails with PB_ERR_SCHEMA or PB_ERR_REFERENCE (where: JSON pointer into the body), PB_ERR_STATE
// (the set is full), PB_ERR_ARGUMENT, PB_ERR_MEMORY. *out is owned by the caller.
pb_status pb_host_add(const pb_host *host, const cJSON *body, const char *request,
                      const pb_model *model, const char *client_name, pb_host **out,
                      uint64_t *period_steps, pb_error *err);

// A new set without the item on this channel. Fails with PB_ERR_REFERENCE, PB_ERR_MEMORY. [init]
pb_status pb_host_remove(const pb_host *host, const char *channel, pb_host **out, pb_error *err);

// A new set of the same items for another model, in which the signals are looked up by name again.
// Fails with PB_ERR_REFERENCE (where: the channel; a signal is gone), PB_ERR_STATE (another sample
// rate), PB_ERR_ARGUMENT, PB_ERR_MEMORY. [init]
pb_status pb_host_rebind(const pb_host *host, const pb_model *model, pb_host **out, pb_error *err);

// The definitions as a JSON array in order of creation, owned by the caller, and a new set made of
// it. Fails as pb_host_add (the message names the item), and with PB_ERR_SYNTAX. [init]
pb_status pb_host_text(const pb_host *host, char **json, pb_error *err);
pb_status pb_host_parse(const char *json, const pb_model *model, pb_host **out, pb_error *err);

void pb_host_free(pb_host *host);

// Adds the contributions of step k to u [nu], given y(k) [ny]; then every item is at its next step.
// No allocation, no failure. [rt]
void pb_host_run(pb_host *host, const double *y, double *u);

// All states to the start: positions and controllers at zero, generators seeded again. [rt]
void pb_host_reset(pb_host *host);

// The states of the items that old has too (the same item, not only the same channel). [rt]
void pb_host_take_state(pb_host *host, const pb_host *old);

// The states of all items, pb_host_bytes() of them, 64-bit words without padding; to be loaded into
// a set of the same items made in the same order. [rt]
size_t pb_host_bytes(const pb_host *host);
void pb_host_save(const pb_host *host, void *to);
void pb_host_load(pb_host *host, const void *from);

// Items in order of creation; valid as long as the set. [any]
size_t pb_host_count(const pb_host *host);
const pb_host_item_info *pb_host_info(const pb_host *host, size_t i);

// Whether item i is an excitation that has come to its end. [any]
bool pb_host_done(const pb_host *host, size_t i);

#endif
