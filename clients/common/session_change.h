// Changing the plant of a running daemon: requests that make a revision, and the way back.
#ifndef PB_CLIENTS_SESSION_CHANGE_H
#define PB_CLIENTS_SESSION_CHANGE_H

#include <cjson/cJSON.h>

#include "session.h"

typedef struct pb_change_options {
  double timeout, wait;       // seconds: for the answer, which may compile first; for the swap
  bool (*interrupted)(void);  // ends the wait; may be NULL
} pb_change_options;

// What the daemon says. Free with pb_change_clear.
typedef struct pb_change {
  cJSON *result;           // the answer, an object
  pb_session_event event;  // "reconfigured"; kind "": the answer came after the swap
} pb_change;

// Sends the request (configure, revert) and waits until the new revision acts. *out is filled as
// far as it came, also by a failure: with a result the daemon has taken the change on. [init]
// PB_ERR_STATE: refused, failed, not in time, interrupted.
pb_status pb_session_change(pb_session *session, const char *kind, const cJSON *body,
                            const pb_change_options *options, pb_change *out, pb_error *err);
void pb_change_clear(pb_change *change);

// The plant as it was at a revision: cancels a change that is on its way, and reverts where another
// revision acts. Cannot be interrupted. [init]
pb_status pb_session_give_back(const pb_session_options *options, uint32_t revision, double wait,
                               pb_error *err);

#endif
