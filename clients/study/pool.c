// Points computed by processes: see pool.h.
#include "pool.h"

#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

typedef struct worker {
  pid_t pid;
  int pipe;  // −1: has ended
} worker;

static pb_status run_point(const study_pool *p, size_t index, study_message *m) {
  *m = (study_message){.index = index};
  m->status = p->compute(p->context, index, &m->point, &m->err);
  return m->status;
}

// ---- in a worker --------------------------------------------------------------------------------

static bool write_all(int fd, const void *bytes, size_t size) {
  const char *at = bytes;
  while (size > 0) {
    ssize_t n = write(fd, at, size);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    at += n;
    size -= (size_t)n;
  }
  return true;
}

static bool send_message(int fd, const study_message *m) {
  void *bytes;
  size_t size;
  pb_error err;
  if (study_message_pack(m, &bytes, &size, &err)) return false;
  bool good = write_all(fd, &size, sizeof size) && write_all(fd, bytes, size);
  free(bytes);
  return good;
}

static void work(const study_pool *p, const size_t *index, size_t count, atomic_size_t *next,
                 int fd) {
  signal(SIGINT, SIG_DFL);
  signal(SIGTERM, SIG_DFL);
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  bool good = true;
  for (size_t k = atomic_fetch_add(next, 1); k < count && good; k = atomic_fetch_add(next, 1)) {
    study_message m;
    run_point(p, index[k], &m);
    good = send_message(fd, &m);
    pb_study_point_clear(&m.point);
  }
  _exit(good ? 0 : 1);
}

// ---- in this process ----------------------------------------------------------------------------

// False at the end of the pipe, or where it breaks off.
static bool read_all(int fd, void *bytes, size_t size) {
  char *at = bytes;
  while (size > 0) {
    ssize_t n = read(fd, at, size);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    at += n;
    size -= (size_t)n;
  }
  return true;
}

static pb_status start(const study_pool *p, const size_t *index, size_t count, atomic_size_t *next,
                       worker *w, pb_error *err) {
  int ends[2];
  if (pipe(ends) != 0) return pb_fail(err, PB_ERR_IO, "worker", "%s", strerror(errno));
  fflush(NULL);
  w->pid = fork();
  if (w->pid == 0) {
    close(ends[0]);
    work(p, index, count, next, ends[1]);
  }
  close(ends[1]);
  w->pipe = ends[0];
  if (w->pid > 0) return PB_OK;
  close(ends[0]);
  w->pipe = -1;
  return pb_fail(err, PB_ERR_IO, "worker", "%s", strerror(errno));
}

// Reads one message of a worker; *ended where it has closed its pipe instead.
static pb_status receive(const study_pool *p, worker *w, size_t *received, pb_error *err) {
  size_t size;
  study_message m;
  if (!read_all(w->pipe, &size, sizeof size)) {
    close(w->pipe);
    w->pipe = -1;
    return PB_OK;
  }
  void *bytes = malloc(size);
  pb_status status = bytes ? PB_OK : pb_fail_memory(err, "worker");
  if (!status && !read_all(w->pipe, bytes, size))
    status = pb_fail(err, PB_ERR_STATE, "worker", "ended within a result");
  if (!status) status = study_message_unpack(bytes, size, &m, err);
  free(bytes);
  if (status) return status;
  (*received)++;
  return p->collect(p->context, &m, err);
}

static pb_status listen_to(const study_pool *p, worker *w, size_t workers, size_t count,
                           pb_error *err) {
  pb_status status = PB_OK;
  size_t received = 0;
  struct pollfd *fds = malloc(workers * sizeof *fds);
  if (!fds) return pb_fail_memory(err, "worker");
  while (!status && received < count) {
    size_t open = 0;
    for (size_t k = 0; k < workers; k++) {
      fds[k] = (struct pollfd){.fd = w[k].pipe, .events = POLLIN};
      open += w[k].pipe >= 0;
    }
    if (open == 0) status = pb_fail(err, PB_ERR_STATE, "worker", "died before its point was done");
    if (!status && poll(fds, workers, 100) < 0 && errno != EINTR)
      status = pb_fail(err, PB_ERR_IO, "worker", "%s", strerror(errno));
    if (!status && p->interrupted && p->interrupted())
      status = pb_fail(err, PB_ERR_STATE, "study", "interrupted");
    for (size_t k = 0; k < workers && !status; k++)
      if (fds[k].fd >= 0 && fds[k].revents) status = receive(p, &w[k], &received, err);
  }
  free(fds);
  return status;
}

static void finish(worker *w, size_t workers, bool stop) {
  for (size_t k = 0; k < workers; k++) {
    if (w[k].pid <= 0) continue;
    if (stop) kill(w[k].pid, SIGTERM);
    if (w[k].pipe >= 0) close(w[k].pipe);
    while (waitpid(w[k].pid, NULL, 0) < 0 && errno == EINTR) {
    }
  }
}

static pb_status run_here(const study_pool *p, const size_t *index, size_t count, pb_error *err) {
  pb_status status = PB_OK;
  for (size_t k = 0; k < count && !status; k++) {
    study_message m;
    if (p->interrupted && p->interrupted())
      return pb_fail(err, PB_ERR_STATE, "study", "interrupted");
    run_point(p, index[k], &m);
    status = p->collect(p->context, &m, err);
  }
  return status;
}

pb_status study_pool_run(const study_pool *p, const size_t *index, size_t count, size_t workers,
                         pb_error *err) {
  if (workers > count) workers = count;
  if (workers <= 1) return run_here(p, index, count, err);
  worker *w = calloc(workers, sizeof *w);
  atomic_size_t *next =
      mmap(NULL, sizeof *next, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  pb_status status = w && next != MAP_FAILED ? PB_OK : pb_fail_memory(err, "worker");
  if (!status) {
    atomic_init(next, 0);
    for (size_t k = 0; k < workers; k++) w[k].pipe = -1;
    for (size_t k = 0; k < workers && !status; k++)
      status = start(p, index, count, next, &w[k], err);
    if (!status) status = listen_to(p, w, workers, count, err);
    finish(w, workers, status != PB_OK);
  }
  if (next != MAP_FAILED) munmap(next, sizeof *next);
  free(w);
  return status;
}
