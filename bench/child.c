// Processes of a measurement: see child.h.
#include "child.h"

#include <fcntl.h>
#include <math.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "base/text.h"
#include "bench.h"

static void stay_on(int cpu) {
  if (cpu < 0) return;
  cpu_set_t set;
  CPU_ZERO(&set);
  CPU_SET((size_t)cpu, &set);
  sched_setaffinity(0, sizeof set, &set);
}

static void make_pipe(int fd[2]) {
  if (pipe2(fd, O_CLOEXEC)) bench_fail("no pipe could be made");
}

bench_child bench_spawn(const char *const argv[], int cpu) {
  int fd[2];
  make_pipe(fd);
  const pid_t pid = fork();
  if (pid < 0) bench_fail("%s: no process could be made", argv[0]);
  if (pid == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    stay_on(cpu);
    dup2(fd[1], STDOUT_FILENO);
    dup2(fd[1], STDERR_FILENO);
    execvp(argv[0], (char *const *)argv);
    _exit(127);
  }
  close(fd[1]);
  return (bench_child){pid, fd[0], -1};
}

bench_child bench_fork(void (*work)(void *context, int in, int out), void *context, int cpu) {
  int out[2], in[2];
  make_pipe(out);
  make_pipe(in);
  fflush(NULL);
  const pid_t pid = fork();
  if (pid < 0) bench_fail("no process could be made");
  if (pid == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    stay_on(cpu);
    close(out[0]);
    close(in[1]);
    work(context, in[0], out[1]);
    _exit(0);
  }
  close(out[1]);
  close(in[0]);
  return (bench_child){pid, out[0], in[1]};
}

bool bench_child_read(bench_child *child, void *data, size_t size, double seconds) {
  const double end = bench_now() + seconds;
  for (size_t got = 0; got < size;) {
    struct pollfd p = {.fd = child->out, .events = POLLIN};
    const double left = end - bench_now();
    if (left <= 0 || poll(&p, 1, (int)(left * 1e3) + 1) <= 0) return false;
    const ssize_t n = read(child->out, (char *)data + got, size - got);
    if (n <= 0) return false;
    got += (size_t)n;
  }
  return true;
}

char *bench_child_text(bench_child *child, double seconds) {
  const double end = bench_now() + seconds;
  pb_text text = {0};
  for (;;) {
    char part[65536];
    struct pollfd p = {.fd = child->out, .events = POLLIN};
    const double left = end - bench_now();
    const bool more = left > 0 && poll(&p, 1, (int)(left * 1e3) + 1) > 0;
    const ssize_t n = more ? read(child->out, part, sizeof part) : -1;
    if (n == 0) return text.text ? text.text : pb_text_copy("");
    if (n < 0) break;
    pb_text_append_n(&text, part, (size_t)n);
    if (text.failed) bench_fail("out of memory");
  }
  free(text.text);
  return NULL;
}

bool bench_child_line(bench_child *child, const char *part, char *line, double seconds) {
  const double end = bench_now() + seconds;
  size_t n = 0;
  for (char c; bench_child_read(child, &c, 1, end - bench_now());) {
    if (c != '\n' && n < 511) line[n++] = c;
    if (c != '\n') continue;
    line[n] = 0;
    n = 0;
    if (strstr(line, part)) return true;
  }
  return false;
}

void bench_child_order(bench_child *child, char order) {
  if (write(child->in, &order, 1) != 1) bench_fail("a worker has ended before its time");
}

double bench_child_cpu(const bench_child *child) {
  clockid_t clock;
  struct timespec t;
  if (clock_getcpuclockid(child->pid, &clock) || clock_gettime(clock, &t)) return NAN;
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

int bench_child_end(bench_child *child, int signal) {
  int status = 0;
  const double end = bench_now() + 5;
  if (signal) kill(child->pid, signal);
  while (waitpid(child->pid, &status, WNOHANG) == 0) {
    if (bench_now() > end) kill(child->pid, SIGKILL);
    nanosleep(&(struct timespec){0, 1000000}, NULL);
  }
  close(child->out);
  if (child->in >= 0) close(child->in);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

bool bench_program_exists(const char *name) {
  const char *path = getenv("PATH");
  char *copy = strdup(path ? path : ""), *rest = copy, *directory, file[4096];
  bool found = false;
  while (!found && copy && (directory = strsep(&rest, ":"))) {
    snprintf(file, sizeof file, "%s/%s", directory, name);
    found = !access(file, X_OK);
  }
  free(copy);
  return found;
}

// The same locked files as those of the tests; the kernel frees them with the process.
uint32_t bench_domain(void) {
  for (uint32_t domain = 150; domain < 230; domain++) {
    char path[64];
    snprintf(path, sizeof path, "/tmp/plantbus-test-domain-%u", domain);
    const int fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    if (fd < 0) continue;
    if (flock(fd, LOCK_EX | LOCK_NB) == 0) return domain;
    close(fd);
  }
  bench_fail("no DDS domain is free");
}

void bench_loopback(void) {
  setenv("CYCLONEDDS_URI", "file://" PB_CONFIG "/dds-loopback.xml", 1);
}
