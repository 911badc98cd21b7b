// The gnuplot process: see plot_gnuplot.h.
//
// Script, picture and messages are files, not pipes: nothing can block, and a gnuplot that ends
// early raises no SIGPIPE here.
#include "plot_gnuplot.h"

#include <errno.h>
#include <fcntl.h>
#include <spawn.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "outfile.h"

extern char **environ;

static int spawn_gnuplot(pid_t *pid, int script, int picture, int messages) {
  posix_spawn_file_actions_t actions;
  int failure = posix_spawn_file_actions_init(&actions);
  if (failure) return failure;
  failure = posix_spawn_file_actions_adddup2(&actions, script, STDIN_FILENO);
  if (!failure) failure = posix_spawn_file_actions_adddup2(&actions, picture, STDOUT_FILENO);
  if (!failure) failure = posix_spawn_file_actions_adddup2(&actions, messages, STDERR_FILENO);
  char *arguments[] = {"gnuplot", "-d", NULL};  // -d: without the user's start-up files
  if (!failure) failure = posix_spawnp(pid, "gnuplot", &actions, NULL, arguments, environ);
  posix_spawn_file_actions_destroy(&actions);
  return failure;
}

// gnuplot's last non-empty line, which holds the reason: "line 12: undefined variable".
static void last_line(FILE *messages, char *text, size_t size) {
  char line[512];
  snprintf(text, size, "no message");
  rewind(messages);
  while (fgets(line, sizeof line, messages)) {
    line[strcspn(line, "\n")] = 0;
    const char *begin = line + strspn(line, " \t^");
    if (*begin) snprintf(text, size, "%s", begin);
  }
}

static pb_status wait_gnuplot(pid_t pid, FILE *messages, const char *path, pb_error *err) {
  int result;
  while (waitpid(pid, &result, 0) < 0) {
    if (errno != EINTR) return pb_fail(err, PB_ERR_IO, path, "gnuplot: %s", strerror(errno));
  }
  if (WIFEXITED(result) && WEXITSTATUS(result) == 0) return PB_OK;
  if (WIFEXITED(result) && WEXITSTATUS(result) == 127) {
    return pb_fail(err, PB_ERR_IO, path, "gnuplot cannot be run");
  }
  char reason[400];
  last_line(messages, reason, sizeof reason);
  return pb_fail(err, PB_ERR_IO, path, "gnuplot failed: %s", reason);
}

static pb_status draw(FILE *script, FILE *messages, const char *temp, const char *path,
                      pb_error *err) {
  int picture = open(temp, O_WRONLY | O_TRUNC | O_CLOEXEC);
  if (picture < 0) return pb_fail(err, PB_ERR_IO, path, "cannot be written: %s", strerror(errno));
  // The child shares the file offset: it must start at the beginning of the script.
  pid_t pid;
  int failure = fflush(script) ? errno : 0;
  if (!failure && lseek(fileno(script), 0, SEEK_SET) < 0) failure = errno;
  if (!failure) failure = spawn_gnuplot(&pid, fileno(script), picture, fileno(messages));
  close(picture);
  if (failure == ENOENT) {
    return pb_fail(err, PB_ERR_IO, path,
                   "gnuplot is not installed (on Debian: apt install gnuplot-nox)");
  }
  if (failure) return pb_fail(err, PB_ERR_IO, path, "gnuplot: %s", strerror(failure));
  pb_status status = wait_gnuplot(pid, messages, path, err);
  struct stat drawn;
  if (!status && (stat(temp, &drawn) || (S_ISREG(drawn.st_mode) && drawn.st_size < 8))) {
    status = pb_fail(err, PB_ERR_IO, path, "gnuplot drew nothing");
  }
  return status;
}

pb_status pb_gnuplot_run(FILE *script, const char *path, pb_error *err) {
  FILE *messages = tmpfile();
  if (!messages) return pb_fail(err, PB_ERR_IO, path, "no temporary file: %s", strerror(errno));
  pb_outfile file;
  pb_status status = pb_outfile_create(path, &file, err);
  if (!status) {
    status = draw(script, messages, file.temp, path, err);
    if (!status) status = pb_outfile_commit(&file, err);
    pb_outfile_discard(&file);
  }
  fclose(messages);
  return status;
}
