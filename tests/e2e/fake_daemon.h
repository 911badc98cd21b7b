// A daemon of the test's own: it describes the bench and answers requests as the test says, so that
// a tool meets replies and events that a real daemon gives only at certain times.
#ifndef PB_TESTS_E2E_FAKE_DAEMON_H
#define PB_TESTS_E2E_FAKE_DAEMON_H

#include "harness.h"
#include "tool_run.h"

// What to answer; texts must outlive the call. event NULL: none; it comes after the reply.
typedef struct fake_answer {
  const char *status, *pointer, *message, *result;
  const char *event, *event_message;
  uint64_t event_step;
} fake_answer;

typedef struct fake_daemon {
  uint32_t domain;
  dds_entity_t participant, request, reply, event;
  uint64_t events;  // made; the ping tells it
  void (*answer)(const char *kind, const char *body, fake_answer *out);
} fake_daemon;

// Joins a domain of its own and describes the bench with its plant file. Pings are answered by
// itself.
fake_daemon fake_daemon_start(void (*answer)(const char *kind, const char *body, fake_answer *out));
void fake_daemon_end(fake_daemon *fake);

// Runs a tool to its end while requests are answered.
tool_result fake_daemon_run(fake_daemon *fake, const char *name, const char *line);

#endif
