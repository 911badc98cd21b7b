// For the tests with the real daemon and the real middleware on loopback: a DDS domain that no
// other test has, the daemon and helper clients as child processes, and a raw participant for what
// a session would never do. Nothing waits longer than the cap; waiting means waiting for a
// condition.
#ifndef PB_TESTS_E2E_HARNESS_H
#define PB_TESTS_E2E_HARNESS_H

#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

#include <cmocka.h>

#include "bus_qos.h"
#include "session.h"

// Only something that hangs waits so long: far beyond what a busy machine takes under sanitizers.
#define E2E_CAP 30.0  // seconds
#define E2E_BENCH PB_TEST_DATA "/bus-bench.json"

// A child process whose standard output is read line by line.
typedef struct e2e_child {
  pid_t pid;
  int out;
} e2e_child;

// Starts a program; it is killed when the test program ends. argv[0] is the file.
e2e_child e2e_spawn(const char *const argv[]);

// Reads up to a line that starts with `start` into line (256 octets); fails at the cap.
void e2e_expect_line(e2e_child *child, const char *start, char *line);
void e2e_expect_line_within(e2e_child *child, const char *start, char *line, double seconds);

// Waits for the end of the process; its exit status, or −signal. Fails at the cap.
int e2e_reap(e2e_child *child);

// The daemon on a plant file in a domain of its own, with more arguments (NULL-terminated, may be
// NULL).
typedef struct e2e_daemon {
  e2e_child child;
  uint32_t domain;
} e2e_daemon;
e2e_daemon e2e_daemon_start(const char *plant, const char *const *more);

// … in the domain of another one that has ended.
e2e_daemon e2e_daemon_start_on(uint32_t domain, const char *plant, const char *const *more);

// SIGTERM, and the exit status 0 that belongs to it.
void e2e_daemon_end(e2e_daemon *daemon);

// A domain id that no other test program uses at this time.
uint32_t e2e_domain(void);

pb_session *e2e_open(const e2e_daemon *daemon);

// Attaches to a channel for one input as a barrier member.
void e2e_attach(pb_session *session, const char *channel, const char *input, double guard);

// A request that must succeed; its result is thrown away.
void e2e_request(pb_session *session, const char *kind, const char *body);

// A request's result: a number of it (of a history: of its newest entry); or its whole text, owned
// by the caller.
double e2e_number(pb_session *session, const char *kind, const char *body, const char *key);
char *e2e_result(pb_session *session, const char *kind, const char *body);

// "configure" or "revert", until the change is made, however long it is compiled; a number of it.
double e2e_change(pb_session *session, const char *kind, const char *body, const char *key);

// A request that must be refused, at this JSON pointer and with these words in its message.
void e2e_refused(pb_session *session, const char *kind, const char *body, const char *pointer,
                 const char *words);

// Calls the condition until it is true; fails at the cap.
void e2e_until(bool (*condition)(void *context), void *context, const char *what);

// Participant with entities of the table in the partition of the bench.
typedef struct e2e_raw {
  dds_entity_t participant, publisher, subscriber;
  uint8_t client[16];
} e2e_raw;
e2e_raw e2e_raw_join(const e2e_daemon *daemon);
dds_entity_t e2e_raw_writer(const e2e_raw *raw, pb_topic topic);
dds_entity_t e2e_raw_reader(const e2e_raw *raw, pb_topic topic);

// Attaches to a channel for one input as a barrier member with a guard of a minute; the session.
uint64_t e2e_raw_attach(const e2e_raw *raw, const char *channel, const char *input);

// The newest status for which the condition holds is copied out; fails at the cap.
plantbus_PlantStatus *e2e_status_wait(dds_entity_t reader,
                                      bool (*condition)(const plantbus_PlantStatus *));

// Waits for an event of one of these kinds ("lost" or "evicted lost") and copies its message (320
// octets); fails at the cap.
void e2e_event_wait(dds_entity_t reader, const char *kinds, char *message);

#endif
