// What the parts of the soak's driver share. See soak_driver.c.
#ifndef PB_TESTS_SOAK_H
#define PB_TESTS_SOAK_H

#include <stdbool.h>
#include <stdint.h>
#include <sys/types.h>

#include "bus_qos.h"
#include "session.h"
#include "signal/random.h"

enum { SOAK_CLIENTS = 4, SOAK_KINDS = 24 };

// A request of the driver, by kind: what became of it. What the daemon does not know is counted
// apart.
typedef struct soak_count {
  const char *kind;
  uint64_t sent, done, refused, unknown, unanswered;
  char refusal[160];  // the first one
} soak_count;

typedef struct soak_client {
  pid_t pid;  // 0: none
  double go;  // when it is let go on; 0: it is not stopped
} soak_client;

// What was seen on the bus and in /proc.
typedef struct soak_seen {
  uint64_t evicted, lost, reconfigured, configure_failed, statuses, refused_commands;
  uint32_t faults;    // all bits of all statuses
  uint64_t progress;  // steps taken, over all epochs
  uint64_t step;      // newest
  uint32_t epoch, revision;
  double progress_at, longest_stop;  // s, on the driver's clock
  double *rss;                       // [rss_count] octets, one a second
  size_t rss_count, rss_room;
} soak_seen;

typedef struct soak {
  const char *daemon, *client, *directory;
  uint32_t domain;
  uint64_t seed;
  double seconds, slack;  // slack: octets of growth that are allowed in any case
  bool must_configure;

  pb_random random;
  pid_t daemon_pid;
  int client_out;  // file that the clients print to
  soak_client member[SOAK_CLIENTS];
  uint64_t started, kills, stops, died;
  pb_session *session;
  dds_entity_t participant, status, event, command, request;
  soak_count count[SOAK_KINDS];
  uint32_t hostile, patches;
  soak_seen seen;
} soak;

double soak_clock(void);

// A whole number from 0 to below − 1.
uint32_t soak_draw(soak *s, uint32_t below);

// process.c: children die with the driver. out and err are files; −1: the driver's own. 0: failed.
pid_t soak_spawn(const char *const argv[], int out, int err);

// Waits for the end; exit status, −signal, or INT_MIN when it did not end in time (it is killed).
int soak_reap(pid_t pid, double seconds);

// True when it has ended; its status as of soak_reap.
bool soak_ended(pid_t pid, int *status);

// chaos.c
bool soak_join(soak *s);
soak_count *soak_request(soak *s, const char *kind, const char *body, char **result);
void soak_configure(soak *s);
void soak_disturb(soak *s);  // something that any client may ask for
void soak_hostile(soak *s);  // something that no client should do

// watch.c
void soak_watch(soak *s);    // events and statuses that came
void soak_measure(soak *s);  // once a second: memory and a ping
bool soak_judge(soak *s);    // prints what was counted; false: the daemon has failed

#endif
