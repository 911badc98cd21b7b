// See hosts.h. Only the program `ip` (and `tc`) touches the network; each call is a child process.
#include "hosts.h"

#include <errno.h>
#include <fcntl.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#define ADDRESS_A "10.231.7.1"
#define ADDRESS_B "10.231.7.2"
#define LINK "veth0"

static struct {
  char a[48], b[48], middle[48];  // names of the namespaces
  char directory[48];             // of the configurations
  char config[64];
  int guard, gone;  // the guardian ends when guard is closed; then gone ends
} hosts = {.guard = -1, .gone = -1};

enum { WORDS = 24, TEXT = 256 };

// Runs a program; its exit status, and the first line that it says on stderr.
static int run(const char *const argv[], char *said) {
  int fd[2];
  if (pipe2(fd, O_CLOEXEC) != 0) return -1;
  const pid_t pid = fork();
  if (pid == 0) {
    dup2(fd[1], STDERR_FILENO);
    execvp(argv[0], (char *const *)argv);
    dprintf(STDERR_FILENO, "%s: %s\n", argv[0], strerror(errno));
    _exit(127);
  }
  close(fd[1]);
  size_t n = 0;
  for (ssize_t got; (got = read(fd[0], said + n, TEXT - 1 - n)) > 0;) n += (size_t)got;
  said[n] = '\0';
  said[strcspn(said, "\n")] = '\0';
  close(fd[0]);
  int status;
  if (pid < 0 || waitpid(pid, &status, 0) != pid || !WIFEXITED(status)) return -1;
  return WEXITSTATUS(status);
}

// The words of one line as a command; false and what it said when it fails.
static bool command(char *said, const char *line) {
  char text[TEXT];
  const char *argv[WORDS + 1] = {NULL};
  char *rest = NULL;
  size_t n = 0;
  snprintf(text, sizeof text, "%s", line);
  for (char *word = strtok_r(text, " ", &rest); word && n < WORDS;
       word = strtok_r(NULL, " ", &rest))
    argv[n++] = word;
  return run(argv, said) == 0;
}

static void must(const char *line) {
  char said[TEXT];
  if (!command(said, line)) fail_msg("%s: %s", line, said);
}

static void files_remove(void) {
  if (hosts.config[0]) unlink(hosts.config);
  if (hosts.directory[0]) rmdir(hosts.directory);
}

static bool is_there(const char *name) {
  char path[TEXT];
  snprintf(path, sizeof path, "/var/run/netns/%s", name);
  return access(path, F_OK) == 0;
}

static void namespaces_remove(void) {
  char line[TEXT], said[TEXT];
  const char *const name[3] = {hosts.b, hosts.a, hosts.middle};
  for (int i = 0; i < 3; i++) {
    snprintf(line, sizeof line, "ip netns del %s", name[i]);
    if (is_there(name[i]) && !command(said, line)) fprintf(stderr, "%s: %s\n", line, said);
  }
}

// Ends with the process whose end of the pipe it reads. Its parent is not the test: whoever ends
// the test with all its children does not end the guardian.
static void guardian_work(int guard, int gone) {
  char c;
  setsid();
  signal(SIGINT, SIG_IGN);
  signal(SIGTERM, SIG_IGN);
  signal(SIGHUP, SIG_IGN);
  while (read(guard, &c, 1) > 0 || errno == EINTR) errno = 0;
  namespaces_remove();
  files_remove();
  close(gone);
  _exit(0);
}

static bool guardian_start(void) {
  int guard[2], gone[2];
  if (pipe2(guard, O_CLOEXEC) != 0 || pipe2(gone, O_CLOEXEC) != 0) return false;
  const pid_t pid = fork();
  if (pid < 0) return false;
  if (pid == 0) {
    close(guard[1]);
    close(gone[0]);
    if (fork() == 0) guardian_work(guard[0], gone[1]);
    _exit(0);
  }
  waitpid(pid, NULL, 0);
  close(guard[0]);
  close(gone[1]);
  hosts.guard = guard[1];
  hosts.gone = gone[0];
  return true;
}

bool hosts_remove(void) {
  char c;
  if (hosts.guard < 0) return true;
  close(hosts.guard);
  hosts.guard = -1;
  while (read(hosts.gone, &c, 1) > 0) continue;
  close(hosts.gone);
  return !is_there(hosts.a) && !is_there(hosts.b) && !is_there(hosts.middle) &&
         access(hosts.directory, F_OK) != 0;
}

static bool namespaces_make(char *why) {
  static const char *const format[] = {
      "ip netns add %1$s",
      "ip netns add %2$s",
      "ip netns add %3$s",
      "ip -n %3$s link add name switch type bridge mcast_snooping 0",
      "ip -n %3$s link add port-a type veth peer name " LINK " netns %1$s",
      "ip -n %3$s link add port-b type veth peer name " LINK " netns %2$s",
      "ip -n %3$s link set port-a master switch up",
      "ip -n %3$s link set port-b master switch up",
      "ip -n %3$s link set switch up",
      "ip -n %1$s address add " ADDRESS_A "/24 dev " LINK,
      "ip -n %2$s address add " ADDRESS_B "/24 dev " LINK,
      "ip -n %1$s link set lo up",
      "ip -n %2$s link set lo up",
      "ip -n %1$s link set " LINK " up",
      "ip -n %2$s link set " LINK " up"};
  for (size_t i = 0; i < sizeof format / sizeof *format; i++) {
    char line[TEXT], said[TEXT];
    snprintf(line, sizeof line, format[i], hosts.a, hosts.b, hosts.middle);
    if (command(said, line)) continue;
    snprintf(why, TEXT, "%.100s: %.140s", line, said);
    return false;
  }
  return true;
}

static bool enter(const char *name, char *why) {
  char path[TEXT];
  snprintf(path, sizeof path, "/var/run/netns/%s", name);
  const int fd = open(path, O_RDONLY | O_CLOEXEC);
  const bool good = fd >= 0 && setns(fd, CLONE_NEWNET) == 0;
  if (!good) snprintf(why, TEXT, "%.100s: %.140s", path, strerror(errno));
  if (fd >= 0) close(fd);
  return good;
}

bool hosts_make(char *why) {
  snprintf(hosts.a, sizeof hosts.a, "plantbus-%d-a", (int)getpid());
  snprintf(hosts.b, sizeof hosts.b, "plantbus-%d-b", (int)getpid());
  snprintf(hosts.middle, sizeof hosts.middle, "plantbus-%d-switch", (int)getpid());
  snprintf(hosts.directory, sizeof hosts.directory, "/tmp/plantbus-hosts-%d", (int)getpid());
  snprintf(hosts.config, sizeof hosts.config, "%s/dds.xml", hosts.directory);
  if (geteuid() != 0) {
    snprintf(why, TEXT, "network namespaces need the rights of root");
    return false;
  }
  if (!guardian_start() || mkdir(hosts.directory, 0700) != 0) {
    snprintf(why, TEXT, "%.100s: %.140s", hosts.directory, strerror(errno));
    return false;
  }
  return namespaces_make(why) && enter(hosts.a, why);
}

// text with the one place that reads `old` changed to `new`: the test follows the shipped file.
static char *replaced(char *text, const char *old, const char *new) {
  char *at = strstr(text, old);
  if (!at) fail_msg("config/dds-lan.xml has no %s", old);
  const size_t size = strlen(text) + strlen(new) + 1;
  char *out = malloc(size);
  assert_non_null(out);
  snprintf(out, size, "%.*s%s%s", (int)(at - text), text, new, at + strlen(old));
  free(text);
  return out;
}

static char *template_read(void) {
  FILE *file = fopen(PB_CONFIG "/dds-lan.xml", "r");
  char *text = calloc(1, 16384);
  assert_non_null(file);
  assert_non_null(text);
  assert_true(fread(text, 1, 16383, file) > 0);
  fclose(file);
  return text;
}

static char *lossy(char *text, const char *per_thousand) {
  char test[128];
  snprintf(test, sizeof test, "<Internal><Test><XmitLossiness>%s</XmitLossiness></Test>",
           per_thousand);
  return replaced(text, "<Internal>", test);
}

const char *hosts_configure(hosts_discovery discovery) {
  char uri[96];
  char *text = replaced(template_read(), "autodetermine=\"true\"", "name=\"" LINK "\"");
  if (discovery == HOSTS_PEERS) {
    text = replaced(text, "<AllowMulticast>spdp<", "<AllowMulticast>false<");
    text = replaced(text, "<ParticipantIndex>",
                    "<Peers><Peer address=\"" ADDRESS_A "\"/><Peer address=\"" ADDRESS_B
                    "\"/></Peers><ParticipantIndex>");
  }
  if (discovery == HOSTS_LOSSY) text = lossy(text, "10");
  if (discovery == HOSTS_MUTE) text = lossy(text, "1000");
  FILE *file = fopen(hosts.config, "w");
  assert_non_null(file);
  assert_true(fputs(text, file) >= 0);
  assert_int_equal(fclose(file), 0);
  free(text);
  snprintf(uri, sizeof uri, "file://%s", hosts.config);
  assert_int_equal(setenv("CYCLONEDDS_URI", uri, 1), 0);
  return hosts.config;
}

// env and `ip netns exec` become the program: its process id is the client's.
e2e_child hosts_spawn(const char *const argv[]) {
  const char *all[WORDS] = {"/usr/bin/env", "ip", "netns", "exec", hosts.b};
  for (size_t i = 0; argv[i] && i + 6 < WORDS; i++) all[i + 5] = argv[i];
  return e2e_spawn(all);
}

void hosts_link(bool up) {
  char line[TEXT];
  snprintf(line, sizeof line, "ip -n %s link set port-b %s", hosts.middle, up ? "up" : "down");
  must(line);
}

static const char *const port[2] = {"port-a", "port-b"};

bool hosts_disturb(const char *delay, const char *loss) {
  for (int i = 0; i < 2; i++) {
    char line[TEXT], said[TEXT];
    snprintf(line, sizeof line, "tc -n %s qdisc add dev %s root netem delay %s loss %s",
             hosts.middle, port[i], delay, loss);
    if (command(said, line)) continue;
    print_message("netem: %s\n", said);
    return false;
  }
  return true;
}

void hosts_calm(void) {
  for (int i = 0; i < 2; i++) {
    char line[TEXT];
    snprintf(line, sizeof line, "tc -n %s qdisc del dev %s root", hosts.middle, port[i]);
    must(line);
  }
}
