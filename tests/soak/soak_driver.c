// soak_driver --bin DIR --client FILE --directory DIR --seconds S [--seed N] [--slack MB]
//             [--must-configure]
// A daemon with four clients that are killed, stopped and let go on at random; every second the
// plant's joints are changed; modes, resets, snapshots, hosted controllers and hostile acts in
// between. Ends with 0 when the daemon answered everything, took steps all the time, saw no number
// that is not finite, did not grow, and ended in order; what was done and counted is printed.
// The directory holds plant.json of soak_plants; output of daemon and clients is left in it.
#include <fcntl.h>
#include <getopt.h>
#include <limits.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <time.h>
#include <unistd.h>

#include "interrupt.h"
#include "soak.h"

static const double end_within = 15.0;  // s

static int file_make(const soak *s, const char *name) {
  char path[512];
  snprintf(path, sizeof path, "%s/%s", s->directory, name);
  return open(path, O_WRONLY | O_CREAT | O_TRUNC | O_APPEND | O_CLOEXEC, 0666);
}

// Reserved by the same files as those of the other tests; the kernel frees them with the process.
static bool domain_reserve(soak *s) {
  for (s->domain = 60; s->domain < 100; s->domain++) {
    char path[64];
    snprintf(path, sizeof path, "/tmp/plantbus-test-domain-%u", s->domain);
    const int fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    if (fd >= 0 && flock(fd, LOCK_EX | LOCK_NB) == 0) return true;
    if (fd >= 0) close(fd);
  }
  return false;
}

static bool daemon_start(soak *s) {
  char domain[16], plant[512];
  const int out = file_make(s, "daemon.out"), err = file_make(s, "daemon.err");
  snprintf(domain, sizeof domain, "%u", s->domain);
  snprintf(plant, sizeof plant, "%s/plant.json", s->directory);
  const char *const argv[] = {s->daemon, "--plant", plant, "--domain", domain, NULL};
  s->daemon_pid = soak_spawn(argv, out, err);
  close(out);
  close(err);
  return s->daemon_pid > 0;
}

static void client_start(soak *s, soak_client *member) {
  char domain[16], seed[24];
  snprintf(domain, sizeof domain, "%u", s->domain);
  snprintf(seed, sizeof seed, "%llu", (unsigned long long)(s->seed * 1000003 + s->started++));
  const char *const argv[] = {s->client, domain, pb_session_description(s->session)->name, seed,
                              NULL};
  // A signal that comes before the client has its handler waits for it.
  sigset_t end, before;
  sigemptyset(&end);
  sigaddset(&end, SIGTERM);
  sigprocmask(SIG_BLOCK, &end, &before);
  *member = (soak_client){.pid = soak_spawn(argv, s->client_out, s->client_out)};
  sigprocmask(SIG_SETMASK, &before, NULL);
}

// One that ended by itself has found something: its output tells.
static void client_look_after(soak *s, soak_client *member, double now) {
  int status;
  if (member->pid == 0 || soak_ended(member->pid, &status)) {
    s->died += member->pid != 0;
    client_start(s, member);
  }
  if (member->go > 0.0 && now >= member->go) {
    kill(member->pid, SIGCONT);
    member->go = 0.0;
  }
}

static void client_disturb(soak *s, soak_client *member, double now) {
  if (member->pid <= 0) return;
  if (soak_draw(s, 2)) {
    kill(member->pid, SIGKILL);
    soak_reap(member->pid, end_within);
    s->kills++;
    client_start(s, member);
  } else if (member->go <= 0.0) {
    kill(member->pid, SIGSTOP);
    member->go = now + 0.05 + 2.0 * pb_random_uniform(&s->random);
    s->stops++;
  }
}

// True in one of `per_second` · tick calls on average.
static bool chance(soak *s, double per_second, double tick) {
  return pb_random_uniform(&s->random) < per_second * tick;
}

static bool run(soak *s) {
  const struct timespec pause = {0, 50000000};
  const double begin = soak_clock();
  double second = begin + 1.0, last = begin;
  int status;
  for (double now = begin; now < begin + s->seconds && !pb_interrupted(); now = soak_clock()) {
    const double tick = now - last < 0.5 ? now - last : 0.5;
    last = now;
    if (soak_ended(s->daemon_pid, &status)) {
      printf("soak: THE DAEMON ENDED with %d after %.1f s\n", status, now - begin);
      s->daemon_pid = 0;
      return false;
    }
    for (int i = 0; i < SOAK_CLIENTS; i++) client_look_after(s, &s->member[i], now);
    if (chance(s, 1.0, tick)) client_disturb(s, &s->member[soak_draw(s, SOAK_CLIENTS)], now);
    if (chance(s, 1.5, tick)) soak_disturb(s);
    if (chance(s, 1.0, tick)) soak_hostile(s);
    if (now >= second) {
      second = now + 1.0;
      soak_configure(s);
      soak_measure(s);
    }
    soak_watch(s);
    nanosleep(&pause, NULL);
  }
  return !pb_interrupted();
}

// Clients end on SIGTERM once they are let go on.
static bool clients_end(soak *s) {
  bool good = true;
  for (int i = 0; i < SOAK_CLIENTS; i++)
    if (s->member[i].pid) kill(s->member[i].pid, SIGTERM), kill(s->member[i].pid, SIGCONT);
  for (int i = 0; i < SOAK_CLIENTS; i++) {
    if (!s->member[i].pid) continue;
    const int status = soak_reap(s->member[i].pid, end_within);
    if (status != 0) printf("soak: A CLIENT ended with %d\n", status);
    good = good && status == 0;
    s->member[i].pid = 0;
  }
  return good;
}

static bool daemon_end(soak *s) {
  if (!s->daemon_pid) return false;
  kill(s->daemon_pid, SIGTERM);
  const int status = soak_reap(s->daemon_pid, end_within);
  s->daemon_pid = 0;
  if (status == INT_MIN) printf("soak: THE DAEMON DID NOT END within %g s\n", end_within);
  if (status != 0 && status != INT_MIN) printf("soak: THE DAEMON ended with %d\n", status);
  return status == 0;
}

static bool soak_all(soak *s) {
  bool good = domain_reserve(s) && daemon_start(s) && soak_join(s);
  if (good) {
    good = run(s);
    good = clients_end(s) && good;
    if (s->daemon_pid) {
      soak_measure(s);
      soak_watch(s);
    }
    good = soak_judge(s) && good;
  }
  pb_session_close(s->session);
  if (s->participant > 0) dds_delete(s->participant);
  return daemon_end(s) && good;
}

int main(int argc, char **argv) {
  static const struct option option[] = {
      {"bin", required_argument, NULL, 'b'},       {"client", required_argument, NULL, 'c'},
      {"directory", required_argument, NULL, 'd'}, {"seconds", required_argument, NULL, 't'},
      {"seed", required_argument, NULL, 's'},      {"slack", required_argument, NULL, 'k'},
      {"must-configure", no_argument, NULL, 'm'},  {NULL, 0, NULL, 0}};
  soak s = {.seed = (uint64_t)time(NULL), .slack = 8e6};
  char daemon[512] = "";
  for (int key; (key = getopt_long(argc, argv, "", option, NULL)) != -1;) {
    if (key == 'b') snprintf(daemon, sizeof daemon, "%s/plantbusd", optarg);
    if (key == 'c') s.client = optarg;
    if (key == 'd') s.directory = optarg;
    if (key == 't') s.seconds = atof(optarg);
    if (key == 's') s.seed = strtoull(optarg, NULL, 10);
    if (key == 'k') s.slack = 1e6 * atof(optarg);
    if (key == 'm') s.must_configure = true;
    if (key == '?') return 2;
  }
  s.daemon = daemon;
  if (!daemon[0] || !s.client || !s.directory || !(s.seconds > 0.0) || optind < argc) return 2;
  setvbuf(stdout, NULL, _IOLBF, 0);
  printf("soak: %g s, seed %llu\n", s.seconds, (unsigned long long)s.seed);
  pb_random_seed(&s.random, s.seed, 0);
  pb_interrupt_install();
  s.client_out = file_make(&s, "clients.out");
  const bool good = s.client_out >= 0 && soak_all(&s);
  free(s.seen.rss);
  return good ? 0 : 1;
}
