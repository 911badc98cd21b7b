// Child processes of the soak. See soak.h.
#include <limits.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "soak.h"

double soak_clock(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

uint32_t soak_draw(soak *s, uint32_t below) {
  return (uint32_t)(pb_random_uniform(&s->random) * below);
}

pid_t soak_spawn(const char *const argv[], int out, int err) {
  const pid_t pid = fork();
  if (pid < 0) return 0;
  if (pid > 0) return pid;
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (out >= 0) dup2(out, STDOUT_FILENO);
  if (err >= 0) dup2(err, STDERR_FILENO);
  execv(argv[0], (char *const *)argv);
  _exit(127);
}

static int status_of(int status) {
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

bool soak_ended(pid_t pid, int *status) {
  int raw;
  if (waitpid(pid, &raw, WNOHANG) != pid) return false;
  *status = status_of(raw);
  return true;
}

int soak_reap(pid_t pid, double seconds) {
  const double end = soak_clock() + seconds;
  const struct timespec pause = {0, 5000000};
  int status;
  while (!soak_ended(pid, &status)) {
    if (soak_clock() > end) {
      kill(pid, SIGKILL);
      waitpid(pid, NULL, 0);
      return INT_MIN;
    }
    nanosleep(&pause, NULL);
  }
  return status;
}
