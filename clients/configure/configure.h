// plantbus-configure: what its commands share.
#ifndef PB_CLIENTS_CONFIGURE_H
#define PB_CLIENTS_CONFIGURE_H

#include <cjson/cJSON.h>

#include "options.h"
#include "session.h"

typedef struct configure_options {
  pb_common_options common;
  const char *command, *first, *second;  // the words of the command line; NULL: not given
  double timeout;                        // s; 0: the session's
  double wait;                           // s for the event `reconfigured`
  bool at_step_given;
  uint64_t at_step;
  const char *comment;    // NULL: none
  const char *directory;  // of element files, for --dry-run
  bool dry_run, json;
} configure_options;

// change.c: set, patch, revert. Each prints what became of it. plant is the plant file as the
// daemon publishes it.
pb_status configure_set(const configure_options *o, pb_session *session, const cJSON *plant,
                        pb_error *err);
pb_status configure_patch(const configure_options *o, pb_session *session, const cJSON *plant,
                          pb_error *err);
pb_status configure_revert(const configure_options *o, pb_session *session, pb_error *err);

// history.c: the table of revisions.
pb_status configure_history(const configure_options *o, pb_session *session, pb_error *err);

// The history's entry of a revision (0: of the newest), a copy owned by the caller (cJSON_Delete);
// NULL with PB_OK: there is none.
pb_status history_entry(const configure_options *o, pb_session *session, double revision,
                        cJSON **out, pb_error *err);

#endif
