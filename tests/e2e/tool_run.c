// See tool_run.h.
#include "tool_run.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "harness.h"

enum { WORDS = 24 };
// A tool may wait for several things, each with a cap of its own; under sanitizers it is slower.
#ifdef __SANITIZE_ADDRESS__
static const double cap = 90.0;
#else
static const double cap = 30.0;
#endif

static double clock_seconds(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

// Splits the line in place.
static int words(char *line, const char **word, int most) {
  int count = 0;
  for (char *p = line; *p;) {
    p += strspn(p, " ");
    if (!*p) break;
    const bool quoted = *p == '\'';
    p += quoted;
    assert_true(count < most);
    word[count++] = p;
    p += strcspn(p, quoted ? "'" : " ");
    if (*p) *p++ = '\0';
  }
  return count;
}

tool_process tool_start(const char *name, uint32_t domain, const char *environment,
                        const char *line) {
  char copy[4096], file[512], number[16];
  const char *argv[WORDS + 4];
  snprintf(copy, sizeof copy, "%s", line);
  snprintf(file, sizeof file, "%s/%s", PB_BIN, name);
  snprintf(number, sizeof number, "%u", domain);
  argv[0] = file;
  size_t count = 1 + words(copy, argv + 1, WORDS);  // a command comes before the options
  if (domain != TOOL_NO_DOMAIN) {
    argv[count++] = "--domain";
    argv[count++] = number;
  }
  argv[count] = NULL;
  tool_process t = {.out = memfd_create("out", MFD_CLOEXEC),
                    .err = memfd_create("err", MFD_CLOEXEC)};
  assert_true(t.out >= 0 && t.err >= 0);
  t.pid = fork();
  assert_true(t.pid >= 0);
  if (t.pid == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (environment) putenv((char *)environment);
    dup2(t.out, STDOUT_FILENO);
    dup2(t.err, STDERR_FILENO);
    execv(file, (char *const *)argv);
    _exit(127);
  }
  return t;
}

bool tool_ended(tool_process *t, int *code) {
  int status;
  if (waitpid(t->pid, &status, WNOHANG) == 0) return false;
  *code = WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  return true;
}

static char *content(int fd) {
  struct stat info;
  assert_int_equal(fstat(fd, &info), 0);
  char *text = calloc(1, (size_t)info.st_size + 1);
  assert_non_null(text);
  assert_int_equal(pread(fd, text, (size_t)info.st_size, 0), info.st_size);
  close(fd);
  return text;
}

tool_result tool_collect(tool_process *t, int code) {
  return (tool_result){.code = code, .out = content(t->out), .err = content(t->err)};
}

tool_result tool_run(const char *name, uint32_t domain, const char *environment, const char *line) {
  tool_process t = tool_start(name, domain, environment, line);
  const struct timespec millisecond = {0, 1000000};
  const double end = clock_seconds() + cap;
  int code;
  while (!tool_ended(&t, &code)) {
    if (clock_seconds() > end) {
      kill(t.pid, SIGKILL);
      fail_msg("%s %s did not end within %g s", name, line, cap);
    }
    nanosleep(&millisecond, NULL);
  }
  return tool_collect(&t, code);
}

cJSON *tool_json(const char *name, uint32_t domain, const char *environment, const char *line,
                 int code) {
  tool_result r = tool_run(name, domain, environment, line);
  if (r.code != code) fail_msg("%s %s ended with %d: %s", name, line, r.code, r.err);
  cJSON *json = cJSON_Parse(r.out);
  if (!json) fail_msg("%s %s printed no JSON: %s%s", name, line, r.out, r.err);
  tool_free(&r);
  return json;
}

void tool_free(tool_result *r) {
  free(r->out);
  free(r->err);
  *r = (tool_result){0};
}

void tool_says(const char *text, const char *part) {
  if (!strstr(text, part)) fail_msg("expected '%s' in: %s", part, text);
}

const cJSON *tool_member(const cJSON *object, const char *key) {
  const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, key);
  if (!item) fail_msg("no member '%s'", key);
  return item;
}
