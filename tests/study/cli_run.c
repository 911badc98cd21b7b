// See cli_run.h.
#include "cli_run.h"

#include <spawn.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/wait.h>

#include "support/check.h"

extern char **environ;

enum { WORDS = 40 };

static char *content(int fd) {
  struct stat info;
  assert_int_equal(fstat(fd, &info), 0);
  char *text = calloc(1, (size_t)info.st_size + 1);
  assert_non_null(text);
  assert_int_equal(pread(fd, text, (size_t)info.st_size, 0), info.st_size);
  close(fd);
  return text;
}

cli_result cli_run(const char *line) {
  char copy[2048], *word[WORDS + 1], *rest = copy, *next;
  int count = 0, status = 0;
  snprintf(copy, sizeof copy, "%s", line);
  while ((next = strsep(&rest, " "))) {
    assert_true(count < WORDS);
    if (*next) word[count++] = next;
  }
  word[count] = NULL;
  int out = memfd_create("out", MFD_CLOEXEC), err = memfd_create("err", MFD_CLOEXEC);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, out, STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, err, STDERR_FILENO);
  pid_t pid;
  assert_int_equal(posix_spawn(&pid, word[0], &actions, NULL, word, environ), 0);
  posix_spawn_file_actions_destroy(&actions);
  assert_int_equal(waitpid(pid, &status, 0), pid);
  return (cli_result){WIFEXITED(status) ? WEXITSTATUS(status) : 128, content(out), content(err)};
}

void cli_free(cli_result *r) {
  free(r->out);
  free(r->err);
  *r = (cli_result){0};
}

void cli_expect(const char *line, int code, const char *words) {
  cli_result r = cli_run(line);
  if (r.code != code || (!strstr(r.err, words) && !strstr(r.out, words)))
    fail_msg("%s: ended with %d and no '%s': %s%s", line, r.code, words, r.out, r.err);
  cli_free(&r);
}
