// plantbusd: serves one plant until SIGINT or SIGTERM.
#include <fcntl.h>
#include <malloc.h>
#include <semaphore.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#ifdef PB_HAVE_SYSTEMD
#include <systemd/sd-daemon.h>
#endif

#include "bus_log.h"
#include "options.h"

// Of OpenBLAS, when that is the BLAS in use.
void openblas_set_num_threads(int count) __attribute__((weak));

// Large arrays each have a mapping of their own, which goes back to the system when a revision is
// freed. Left to itself the C library raises its threshold to the size of what was freed last and
// keeps revisions' memory in its heap, ever more scattered.
static void memory_returned(void) {
#ifdef M_MMAP_THRESHOLD
  mallopt(M_MMAP_THRESHOLD, 256 << 10);
  mallopt(M_TRIM_THRESHOLD, 1 << 20);
#endif
}

static void notify(const char *state) {
#ifdef PB_HAVE_SYSTEMD
  sd_notify(0, state);
#else
  (void)state;
#endif
}

// A standard stream that was closed by whoever started the daemon would become a socket of the bus,
// and what is printed would be sent. One whose reader has gone is no reason to end.
static void streams_open(void) {
  int fd;
  signal(SIGPIPE, SIG_IGN);
  do fd = open("/dev/null", O_RDWR);
  while (fd >= 0 && fd <= STDERR_FILENO);
  if (fd >= 0) close(fd);
}

static void tell_warnings(const char *plant, pb_warnings *warnings) {
  for (size_t i = 0; i < warnings->count; i++)
    fprintf(stderr, "plantbusd: %s: warning: %s: %s\n", plant, warnings->item[i].where,
            warnings->item[i].message);
  pb_warnings_clear(warnings);
}

// The health of each element that the plant is made of.
static void tell_elements(const char *plant, pb_warnings *notes) {
  for (size_t i = 0; i < notes->count; i++)
    fprintf(stderr, "plantbusd: %s: element %s: %s\n", plant, notes->item[i].where,
            notes->item[i].message);
  pb_warnings_clear(notes);
}

static void tell_ready(const pb_daemon *daemon) {
  const pb_model *m = daemon->live->model;
  printf("plantbusd: ready: plant '%s', %zu states, %g Hz, %s, domain %u\n", m->name, m->nx,
         m->sample_rate, pb_drive_name(daemon->options.mode), daemon->options.domain);
  fflush(stdout);
}

static sem_t end_asked;

static void on_end(int signal_number) {
  (void)signal_number;
  sem_post(&end_asked);
}

// A handler, not sigwait: the BLAS may have started threads before main, which block nothing, and
// the signal may be given to one of them. The daemon's own threads inherit a mask that leaves it to
// others.
static void signals_prepare(void) {
  sem_init(&end_asked, 0, 0);
  struct sigaction action = {.sa_handler = on_end, .sa_flags = SA_RESTART};
  sigaction(SIGINT, &action, NULL);
  sigaction(SIGTERM, &action, NULL);
}

static void signals_mask(int how) {
  sigset_t set;
  sigemptyset(&set);
  sigaddset(&set, SIGINT);
  sigaddset(&set, SIGTERM);
  pthread_sigmask(how, &set, NULL);
}

static void end_wait(void) {
  while (sem_wait(&end_asked) != 0) {
  }
}

int main(int argc, char **argv) {
  // One BLAS thread: the order of its sums, and so every bit of the model, is the same in each run.
  if (openblas_set_num_threads) openblas_set_num_threads(1);
  memory_returned();
  pb_daemon_options options;
  pb_options_parse(argc, argv, &options);
  streams_open();
  pb_daemon *daemon = calloc(1, sizeof *daemon);
  pb_warnings notes = {0}, warnings = {.notes = &notes};
  pb_error err = {PB_OK, "", ""};
  // Until the plant is loaded a signal ends the process at once: there is nothing to undo.
  pb_status status =
      daemon ? pb_daemon_load(daemon, &options, &warnings, &err) : pb_fail_memory(&err, "daemon");
  tell_warnings(options.plant, &warnings);
  tell_elements(options.plant, &notes);
  signals_prepare();
  signals_mask(SIG_BLOCK);
  if (!status) status = pb_daemon_start(daemon, &err);
  if (status) {
    char text[800];
    if (strcmp(err.where, options.plant) == 0) err.where[0] = '\0';
    pb_error_format(&err, text, sizeof text);
    fprintf(stderr, "plantbusd: %s: %s\n", options.plant, text);
    free(daemon);
    return 1;
  }
  signals_mask(SIG_UNBLOCK);
  tell_ready(daemon);
  notify("READY=1");
  end_wait();
  notify("STOPPING=1");
  // What a compile thread still works on cannot be freed, nor the thread be waited for.
  if (!pb_daemon_stop(daemon)) _exit(0);
  free(daemon);
  return 0;
}
