// See harness.h.
#include "harness.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "base/json.h"
#include "bus_domain.h"

static double clock_seconds(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void pause_briefly(void) {
  const struct timespec millisecond = {0, 1000000};
  nanosleep(&millisecond, NULL);
}

void e2e_until(bool (*condition)(void *context), void *context, const char *what) {
  const double end = clock_seconds() + E2E_CAP;
  while (!condition(context)) {
    if (clock_seconds() > end) fail_msg("waited %g s in vain for %s", E2E_CAP, what);
    pause_briefly();
  }
}

// Domains are reserved by locked files, which the kernel frees with the process.
uint32_t e2e_domain(void) {
  for (uint32_t domain = 60; domain < 150; domain++) {
    char path[64];
    snprintf(path, sizeof path, "/tmp/plantbus-test-domain-%u", domain);
    const int fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    if (fd < 0) continue;
    if (flock(fd, LOCK_EX | LOCK_NB) == 0) return domain;
    close(fd);
  }
  fail_msg("no DDS domain is free");
  return 0;
}

e2e_child e2e_spawn(const char *const argv[]) {
  int fd[2];
  assert_int_equal(pipe(fd), 0);
  const pid_t pid = fork();
  assert_true(pid >= 0);
  if (pid == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    dup2(fd[1], STDOUT_FILENO);
    close(fd[0]);
    close(fd[1]);
    execv(argv[0], (char *const *)argv);
    _exit(127);
  }
  close(fd[1]);
  return (e2e_child){pid, fd[0]};
}

void e2e_expect_line(e2e_child *child, const char *start, char *line) {
  e2e_expect_line_within(child, start, line, E2E_CAP);
}

void e2e_expect_line_within(e2e_child *child, const char *start, char *line, double seconds) {
  const double end = clock_seconds() + seconds;
  size_t n = 0;
  for (;;) {
    struct pollfd p = {.fd = child->out, .events = POLLIN};
    const double left = end - clock_seconds();
    if (left <= 0.0 || poll(&p, 1, (int)(left * 1e3) + 1) <= 0)
      fail_msg("no line '%s…' within %g s", start, seconds);
    char c;
    if (read(child->out, &c, 1) != 1) fail_msg("the process ended before '%s…'", start);
    if (c != '\n' && n < 255) line[n++] = c;
    if (c != '\n') continue;
    line[n] = '\0';
    if (strncmp(line, start, strlen(start)) == 0) return;
    n = 0;
  }
}

int e2e_reap(e2e_child *child) {
  const double end = clock_seconds() + E2E_CAP;
  int status;
  while (waitpid(child->pid, &status, WNOHANG) == 0) {
    if (clock_seconds() > end) {
      kill(child->pid, SIGKILL);
      fail_msg("process %d did not end within %g s", (int)child->pid, E2E_CAP);
    }
    pause_briefly();
  }
  close(child->out);
  child->pid = 0;
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

e2e_daemon e2e_daemon_start(const char *plant, const char *const *more) {
  return e2e_daemon_start_on(e2e_domain(), plant, more);
}

e2e_daemon e2e_daemon_start_on(uint32_t on, const char *plant, const char *const *more) {
  e2e_daemon daemon = {.domain = on};
  char domain[16], line[256];
  snprintf(domain, sizeof domain, "%u", daemon.domain);
  const char *argv[16] = {PB_BIN "/plantbusd", "--plant", plant, "--domain", domain};
  for (int n = 5; more && *more && n < 15; n++) argv[n] = *more++;
  daemon.child = e2e_spawn(argv);
  e2e_expect_line(&daemon.child, "plantbusd: ready", line);
  return daemon;
}

void e2e_daemon_end(e2e_daemon *daemon) {
  assert_int_equal(kill(daemon->child.pid, SIGTERM), 0);
  assert_int_equal(e2e_reap(&daemon->child), 0);
}

pb_session *e2e_open(const e2e_daemon *daemon) {
  const pb_session_options options = {.domain = daemon->domain, .timeout = E2E_CAP};
  pb_session *session = NULL;
  pb_error err = {PB_OK, "", ""};
  if (pb_session_open(&options, &session, &err)) fail_msg("%s: %s", err.where, err.message);
  return session;
}

void e2e_attach(pb_session *session, const char *channel, const char *input, double guard) {
  const pb_attach_options options = {
      .channel = channel, .inputs = &input, .input_count = 1, .barrier = true, .guard = guard};
  pb_error err = {PB_OK, "", ""};
  if (pb_session_attach(session, &options, &err)) fail_msg("%s: %s", err.where, err.message);
}

void e2e_request(pb_session *session, const char *kind, const char *body) {
  pb_error err = {PB_OK, "", ""};
  if (pb_session_request(session, kind, body, E2E_CAP, NULL, &err))
    fail_msg("%s: %s: %s", kind, err.where, err.message);
}

char *e2e_result(pb_session *session, const char *kind, const char *body) {
  char *result = NULL;
  pb_error err = {PB_OK, "", ""};
  if (pb_session_request(session, kind, body, E2E_CAP, &result, &err))
    fail_msg("%s: %s: %s", kind, err.where, err.message);
  return result;
}

// A number of a result, which is freed.
static double number_of(char *result, const char *key) {
  cJSON *json = NULL;
  assert_int_equal(pb_json_parse(result, strlen(result), &json, NULL), PB_OK);
  const cJSON *list = pb_json_member(json, "revisions");  // of a history: the newest
  const cJSON *item =
      pb_json_member(list ? cJSON_GetArrayItem(list, cJSON_GetArraySize(list) - 1) : json, key);
  if (!cJSON_IsNumber(item)) fail_msg("no number '%s' in %s", key, result);
  const double value = item->valuedouble;
  cJSON_Delete(json);
  free(result);
  return value;
}

double e2e_number(pb_session *session, const char *kind, const char *body, const char *key) {
  return number_of(e2e_result(session, kind, body), key);
}

// The daemon answers at the latest within a second: what takes longer is told by an event.
double e2e_change(pb_session *session, const char *kind, const char *body, const char *key) {
  pb_error err = {PB_OK, "", ""};
  pb_session_event event = {0};
  pb_answer answer = {0};
  if (pb_session_ask(session, kind, body, E2E_CAP, &answer, &err))
    fail_msg("%s: %s: %s", kind, err.where, err.message);
  if (answer.accepted && (pb_session_wait_event(session, "reconfigured configure_failed",
                                                answer.event, E2E_CAP, NULL, &event, &err) ||
                          strcmp(event.kind, "reconfigured") != 0))
    fail_msg("%s: %s%s", kind, err.message, event.message);
  if (!answer.accepted) return number_of(answer.result, key);
  pb_answer_clear(&answer);
  return e2e_number(session, "history", NULL, key);
}

void e2e_refused(pb_session *session, const char *kind, const char *body, const char *pointer,
                 const char *words) {
  pb_error err = {PB_OK, "", ""};
  if (pb_session_request(session, kind, body, E2E_CAP, NULL, &err) == PB_OK)
    fail_msg("%s %s was not refused", kind, body);
  if (strcmp(err.where, pointer) != 0 || !strstr(err.message, words))
    fail_msg("%s was refused at '%s' (expected '%s'): %s", kind, err.where, pointer, err.message);
}

e2e_raw e2e_raw_join(const e2e_daemon *daemon) {
  e2e_raw raw;
  const pb_domain_options options = {.domain = daemon->domain};
  pb_error err = {PB_OK, "", ""};
  dds_guid_t guid;
  if (pb_domain_join(&options, &raw.participant, &err)) fail_msg("%s", err.message);
  raw.publisher = pb_partition_create(raw.participant, "bus-bench", true);
  raw.subscriber = pb_partition_create(raw.participant, "bus-bench", false);
  assert_int_equal(dds_get_guid(raw.participant, &guid), DDS_RETCODE_OK);
  memcpy(raw.client, guid.v, sizeof raw.client);
  return raw;
}

static bool writer_matched(void *context) {
  dds_publication_matched_status_t status;
  return dds_get_publication_matched_status(*(dds_entity_t *)context, &status) == DDS_RETCODE_OK &&
         status.current_count > 0;
}

static bool reader_matched(void *context) {
  dds_subscription_matched_status_t status;
  return dds_get_subscription_matched_status(*(dds_entity_t *)context, &status) == DDS_RETCODE_OK &&
         status.current_count > 0;
}

dds_entity_t e2e_raw_writer(const e2e_raw *raw, pb_topic topic) {
  const dds_entity_t t = pb_topic_create(raw->participant, topic);
  dds_entity_t writer = pb_writer_create(raw->publisher, t, topic, 0.0);
  assert_true(writer > 0);
  e2e_until(writer_matched, &writer, "a match of the writer");
  return writer;
}

dds_entity_t e2e_raw_reader(const e2e_raw *raw, pb_topic topic) {
  const dds_entity_t t = pb_topic_create(raw->participant, topic);
  dds_entity_t reader = pb_reader_create(raw->subscriber, t, topic, 0, NULL);
  assert_true(reader > 0);
  e2e_until(reader_matched, &reader, "a match of the reader");
  return reader;
}

// The request's writer stays: its end would be the end of the client.
uint64_t e2e_raw_attach(const e2e_raw *raw, const char *channel, const char *input) {
  const dds_entity_t reply = e2e_raw_reader(raw, PB_TOPIC_REPLY);
  const dds_entity_t writer = e2e_raw_writer(raw, PB_TOPIC_REQUEST);
  const double end = clock_seconds() + E2E_CAP;
  unsigned long long session = 0;
  char body[256];
  snprintf(body, sizeof body,
           "{\"channel\":\"%s\",\"inputs\":[\"%s\"],\"guard\":60,\"name\":\"raw\"}", channel,
           input);
  plantbus_Request request = {.id = 1, .kind = "attach", .body = body};
  memcpy(request.client, raw->client, sizeof request.client);
  assert_int_equal(dds_write(writer, &request), DDS_RETCODE_OK);
  while (session == 0) {
    void *sample[1] = {NULL};
    dds_sample_info_t info;
    if (clock_seconds() > end) fail_msg("no answer to attach within %g s", E2E_CAP);
    pause_briefly();
    if (dds_take(reply, sample, &info, 1, 1) != 1) continue;
    const plantbus_Reply *r = sample[0];
    const char *at = info.valid_data && r->id == 1 && !memcmp(r->client, raw->client, 16)
                         ? strstr(r->result, "\"session\":\"")
                         : NULL;
    if (at) sscanf(at, "\"session\":\"%16llx\"", &session);
    dds_return_loan(reply, sample, 1);
  }
  dds_delete(reply);
  return session;
}

plantbus_PlantStatus *e2e_status_wait(dds_entity_t reader,
                                      bool (*condition)(const plantbus_PlantStatus *)) {
  const double end = clock_seconds() + E2E_CAP;
  plantbus_PlantStatus *status = plantbus_PlantStatus__alloc();
  assert_non_null(status);
  memset(status, 0, sizeof *status);
  for (;;) {
    void *sample[1] = {status};
    dds_sample_info_t info;
    if (dds_take(reader, sample, &info, 1, 1) == 1 && info.valid_data && condition(status))
      return status;
    if (clock_seconds() > end) fail_msg("no status as expected within %g s", E2E_CAP);
    pause_briefly();
  }
}

void e2e_event_wait(dds_entity_t reader, const char *kinds, char *message) {
  const double end = clock_seconds() + E2E_CAP;
  for (bool found = false; !found;) {
    void *sample[1] = {NULL};
    dds_sample_info_t info;
    if (dds_take(reader, sample, &info, 1, 1) == 1) {
      const plantbus_Event *event = sample[0];
      found = info.valid_data && strstr(kinds, event->kind) != NULL;
      if (found) snprintf(message, 320, "%s", event->message);
      dds_return_loan(reader, sample, 1);
      continue;
    }
    if (clock_seconds() > end) fail_msg("no event '%s' within %g s", kinds, E2E_CAP);
    pause_briefly();
  }
}
