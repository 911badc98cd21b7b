// Commands and requests that no session would send: counted by cause, answered, harmless.
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "harness.h"

typedef struct probe {
  e2e_daemon daemon;
  pb_session *session;
  e2e_raw raw;
  dds_entity_t command, status, request, reply;
} probe;

static probe probe_open(void) {
  probe p = {.daemon = e2e_daemon_start(E2E_BENCH, NULL)};
  p.session = e2e_open(&p.daemon);
  p.raw = e2e_raw_join(&p.daemon);
  p.command = e2e_raw_writer(&p.raw, PB_TOPIC_COMMAND);
  p.status = e2e_raw_reader(&p.raw, PB_TOPIC_STATUS);
  p.request = e2e_raw_writer(&p.raw, PB_TOPIC_REQUEST);
  p.reply = e2e_raw_reader(&p.raw, PB_TOPIC_REPLY);
  return p;
}

static void probe_close(probe *p) {
  pb_session_close(p->session);
  dds_delete(p->raw.participant);
  e2e_daemon_end(&p->daemon);
}

// The answer to a raw request with this id, as "status pointer message|result".
static void reply_wait(probe *p, const uint8_t client[16], uint64_t id, char *text, size_t size) {
  struct {
    probe *p;
    bool found;
  } w = {p, false};
  for (int i = 0; !w.found; i++) {
    void *sample[1] = {NULL};
    dds_sample_info_t info;
    if (dds_take(p->reply, sample, &info, 1, 1) != 1) {
      if (i > 50000) fail_msg("no reply");
      dds_sleepfor(DDS_USECS(100));
      continue;
    }
    const plantbus_Reply *r = sample[0];
    w.found = info.valid_data && r->id == id && memcmp(r->client, client, 16) == 0;
    if (w.found) snprintf(text, size, "%s %s %s|%s", r->status, r->pointer, r->message, r->result);
    dds_return_loan(p->reply, sample, 1);
  }
}

static void ask(probe *p, const uint8_t client[16], uint64_t id, const char *kind, const char *body,
                char *text, size_t size) {
  plantbus_Request request = {.id = id, .kind = (char *)kind, .body = (char *)body};
  memcpy(request.client, client, 16);
  assert_int_equal(dds_write(p->request, &request), DDS_RETCODE_OK);
  reply_wait(p, p->raw.client, id, text, size);
}

static void command(probe *p, uint64_t session, uint64_t step, uint32_t channel, uint32_t count,
                    double value) {
  const plantbus_Command c = {session, step, channel, count, {value}};
  assert_int_equal(dds_write(p->command, &c), DDS_RETCODE_OK);
}

static bool all_counted(const plantbus_PlantStatus *s) {
  return s->refused.session >= 2 && s->refused.step >= 1 && s->refused.size >= 2 &&
         s->refused.non_finite >= 1;
}

static bool at_step_1(const plantbus_PlantStatus *s) {
  return s->step == 1 && s->refused.duplicate >= 1;
}

static bool at_step_2(const plantbus_PlantStatus *s) {
  return s->step == 2 && s->refused.stale >= 1;
}

static bool is_at_step_1(const plantbus_PlantStatus *s) {
  return s->step == 1;
}

static bool is_at_step_2(const plantbus_PlantStatus *s) {
  return s->step == 2;
}

static void bad_commands_are_counted_and_never_act(void **state) {
  (void)state;
  probe p = probe_open();
  const uint64_t session = e2e_raw_attach(&p.raw, "raw", "Va");
  command(&p, 12345, 0, 0, 1, 9.0);
  command(&p, session, 0, 7, 1, 9.0);
  command(&p, session, 3, 0, 1, 9.0);
  command(&p, session, 0, 0, 2, 9.0);
  command(&p, session, 0, 0, UINT32_MAX, 9.0);
  command(&p, session, 0, 0, 1, (double)NAN);
  plantbus_PlantStatus *status = e2e_status_wait(p.status, all_counted);
  assert_int_equal(status->step, 0);
  assert_int_equal(status->attached._length, 1);
  assert_int_equal(status->attached._buffer[0].commands, 0);
  assert_true(status->attached._buffer[0].waited);
  plantbus_PlantStatus_free(status, DDS_FREE_ALL);
  const dds_entity_t samples = e2e_raw_reader(&p.raw, PB_TOPIC_SAMPLE);
  command(&p, session, 0, 0, 1, 1.5);
  command(&p, session, 0, 0, 1, 9.0);  // again, for the step that is answered
  plantbus_PlantStatus_free(e2e_status_wait(p.status, at_step_1), DDS_FREE_ALL);
  command(&p, session, 1, 0, 1, 1.5);
  command(&p, session, 0, 0, 1, 9.0);
  plantbus_PlantStatus_free(e2e_status_wait(p.status, at_step_2), DDS_FREE_ALL);
  // The sample is published again while an answer to it is missing.
  plantbus_Sample sample = {0};
  for (int i = 0; i < 50000 && sample.step != 2; i++) {
    void *out[1] = {&sample};
    dds_sample_info_t info;
    if (dds_take(samples, out, &info, 1, 1) != 1) dds_sleepfor(DDS_USECS(100));
  }
  assert_int_equal(sample.step, 2);
  assert_true(sample.input[0] == 1.5);
  probe_close(&p);
}

static bool foreign_counted(const plantbus_PlantStatus *s) {
  return s->refused.foreign >= 1;
}

// A session's number does not help who did not attach it.
static void a_stolen_session_is_refused(void **state) {
  (void)state;
  probe p = probe_open();
  const uint64_t session = e2e_raw_attach(&p.raw, "raw", "Va");
  const e2e_raw thief = e2e_raw_join(&p.daemon);
  const dds_entity_t writer = e2e_raw_writer(&thief, PB_TOPIC_COMMAND);
  const plantbus_Command c = {session, 0, 0, 1, {9.0}};
  assert_int_equal(dds_write(writer, &c), DDS_RETCODE_OK);
  plantbus_PlantStatus *status = e2e_status_wait(p.status, foreign_counted);
  assert_int_equal(status->step, 0);
  plantbus_PlantStatus_free(status, DDS_FREE_ALL);
  dds_delete(thief.participant);
  probe_close(&p);
}

// Whoever knows a session or a client can dispose of its instance on the bus. That is not its end.
static void a_session_is_not_ended_by_others(void **state) {
  (void)state;
  probe p = probe_open();
  const uint64_t session = e2e_raw_attach(&p.raw, "raw", "Va");
  command(&p, session, 0, 0, 1, 1.5);
  plantbus_PlantStatus_free(e2e_status_wait(p.status, is_at_step_1), DDS_FREE_ALL);
  const e2e_raw thief = e2e_raw_join(&p.daemon);
  const dds_entity_t writer = e2e_raw_writer(&thief, PB_TOPIC_COMMAND);
  const dds_entity_t requests = e2e_raw_writer(&thief, PB_TOPIC_REQUEST);
  const plantbus_Command c = {.session = session};
  plantbus_Request r = {.kind = "", .body = ""};
  memcpy(r.client, p.raw.client, sizeof r.client);
  assert_int_equal(dds_dispose(writer, &c), DDS_RETCODE_OK);
  assert_int_equal(dds_dispose(requests, &r), DDS_RETCODE_OK);
  // What a stranger writes after the disposals arrives after them.
  const plantbus_Command marker = {.session = session, .count = 1};
  assert_int_equal(dds_write(writer, &marker), DDS_RETCODE_OK);
  plantbus_PlantStatus_free(e2e_status_wait(p.status, foreign_counted), DDS_FREE_ALL);
  r.id = 33;
  assert_int_equal(dds_write(requests, &r), DDS_RETCODE_OK);
  char text[512];
  const dds_entity_t replies = p.reply;
  p.reply = e2e_raw_reader(&thief, PB_TOPIC_REPLY);
  reply_wait(&p, thief.client, 33, text, sizeof text);
  p.reply = replies;
  command(&p, session, 1, 0, 1, 1.5);
  plantbus_PlantStatus *status = e2e_status_wait(p.status, is_at_step_2);
  assert_int_equal(status->attached._length, 1);
  plantbus_PlantStatus_free(status, DDS_FREE_ALL);
  dds_delete(thief.participant);
  probe_close(&p);
}

static bool nobody_attached(const plantbus_PlantStatus *s) {
  return s->attached._length == 0;
}

// A client asks for much (each start of real time at this speed ends with a sleep of the one
// before) and leaves: its last requests are still there when the bus says that it is gone. Its
// session, with a long guard and lease, must not outlive it.
static void a_client_that_leaves_behind_its_requests_is_missed(void **state) {
  (void)state;
  probe p = probe_open();
  const e2e_raw raw = e2e_raw_join(&p.daemon);
  const dds_entity_t requests = e2e_raw_writer(&raw, PB_TOPIC_REQUEST);
  e2e_raw_attach(&raw, "raw", "Va");
  for (uint64_t id = 2; id < 30; id++) {
    plantbus_Request request = {
        .id = id, .kind = "set_mode", .body = "{\"mode\":\"realtime\",\"speed\":0.001}"};
    memcpy(request.client, raw.client, sizeof request.client);
    assert_int_equal(dds_write(requests, &request), DDS_RETCODE_OK);
  }
  dds_delete(raw.participant);
  plantbus_PlantStatus_free(e2e_status_wait(p.status, nobody_attached), DDS_FREE_ALL);
  probe_close(&p);
}

static void a_forged_client_is_refused(void **state) {
  (void)state;
  probe p = probe_open();
  uint8_t forged[16];
  memcpy(forged, p.raw.client, sizeof forged);
  forged[3] ^= 0x55;
  char text[512];
  ask(&p, forged, 7, "reset", "{}", text, sizeof text);  // answered to who it is
  assert_non_null(strstr(text, "refused client"));
  ask(&p, p.raw.client, 8, "ping", "{}", text, sizeof text);
  assert_non_null(strstr(text, "\"epoch\":1"));
  probe_close(&p);
}

static void a_request_sent_twice_is_served_once(void **state) {
  (void)state;
  probe p = probe_open();
  char text[512];
  ask(&p, p.raw.client, 21, "reset", "{}", text, sizeof text);
  assert_non_null(strstr(text, "\"epoch\":2"));
  plantbus_Request again = {.id = 21, .kind = "reset", .body = "{}"};
  memcpy(again.client, p.raw.client, 16);
  assert_int_equal(dds_write(p.request, &again), DDS_RETCODE_OK);
  ask(&p, p.raw.client, 22, "ping", "{}", text, sizeof text);
  assert_non_null(strstr(text, "\"epoch\":2"));
  probe_close(&p);
}

static void requests_are_read_strictly(void **state) {
  (void)state;
  static const struct {
    const char *kind, *body, *answer;
  } list[] = {
      {"explode", "{}", "refused kind 'explode' is not a request"},
      {"ping", "{", "refused"},
      {"ping", "[]", "refused  expected a JSON object"},
      {"ping", "{} {}", "refused"},
      {"ping", "{\"x\":1}", "refused /x"},
      {"set_mode", "{}", "refused /mode"},
      {"set_mode", "{\"mode\":\"fast\"}", "refused /mode"},
      {"set_mode", "{\"mode\":\"paused\",\"mode\":\"paused\"}", "refused /mode"},
      {"set_mode", "{\"mode\":\"paused\",\"speed\":-1}", "refused /speed"},
      {"step", "{\"n\":0}", "refused /n"},
      {"step", "{\"n\":1.5}", "refused /n"},
      {"restore", "{\"snapshot\":77}", "refused /snapshot"},
      {"decimate", "{}", "refused /n"},
      {"attach", "{}", "refused /channel"},
      {"attach", "{\"channel\":\"c\",\"inputs\":[]}", "refused /inputs"},
      {"attach", "{\"channel\":\"c\",\"inputs\":[\"Va\",\"Va\"]}", "refused /inputs/1"},
      {"attach", "{\"channel\":\"c\",\"inputs\":[\"nope\"]}", "refused /inputs/0"},
      {"attach", "{\"channel\":\"c\",\"inputs\":[\"Va\"],\"lease\":0}", "refused /lease"},
      {"attach", "{\"channel\":\"c\",\"inputs\":[\"Va\"],\"silence\":\"loud\"}",
       "refused /silence"},
      {"detach", "{\"session\":\"0000000000000001\"}", "refused /session"},
      {"detach", "{\"session\":1}", "refused /session"},
      {"shutdown", "{}", "refused  the daemon was started without"},
  };
  probe p = probe_open();
  for (size_t i = 0; i < sizeof list / sizeof *list; i++) {
    char text[1024];
    ask(&p, p.raw.client, 100 + i, list[i].kind, list[i].body, text, sizeof text);
    if (strncmp(text, list[i].answer, strlen(list[i].answer)) != 0)
      fail_msg("%s %s: got '%s', expected '%s…'", list[i].kind, list[i].body, text, list[i].answer);
  }
  probe_close(&p);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(bad_commands_are_counted_and_never_act),
      cmocka_unit_test(a_stolen_session_is_refused),
      cmocka_unit_test(a_session_is_not_ended_by_others),
      cmocka_unit_test(a_client_that_leaves_behind_its_requests_is_missed),
      cmocka_unit_test(a_forged_client_is_refused),
      cmocka_unit_test(a_request_sent_twice_is_served_once),
      cmocka_unit_test(requests_are_read_strictly),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
