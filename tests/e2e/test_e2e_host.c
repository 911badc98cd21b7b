// What runs inside the step: the same bits as a client on the bus, and experiments without a round
// trip a step.
#include <stdlib.h>
#include <string.h>

#include "control/iff.h"
#include "control/lti_ops.h"
#include "harness.h"

enum { STEPS = 2000 };
static const double gain = 100.0;

typedef struct loop {
  pb_lti controller;
  double x[2], scratch[2];
  double y[STEPS + 1][2];
  uint64_t count;
} loop;

static bool answer(void *context, const pb_sample *sample, double *command) {
  loop *l = context;
  memcpy(l->y[l->count++], sample->output, sizeof l->y[0]);
  pb_lti_step(&l->controller, l->x, l->scratch, sample->output, command);
  return l->count <= STEPS;
}

// The disturbance is hosted in both runs: it excites the loop from the first step on.
static const char disturbance[] =
    "{\"channel\":\"shaker\",\"inputs\":[\"F\"],\"type\":\"white\",\"rms\":1,\"seed\":7}";
static const char iff[] =
    "{\"channel\":\"iff\",\"type\":\"iff\",\"inputs\":[\"Va\"],\"outputs\":[\"Vs\"],\"gain\":100}";

static void a_hosted_loop_is_the_clients_loop(void **state) {
  (void)state;
  static loop l;
  pb_error err = {PB_OK, "", ""};
  const pb_iff k = pb_iff_default(gain);
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  pb_session *session = e2e_open(&daemon);
  assert_int_equal(pb_iff_discrete(&k, 1, 10000.0, &l.controller, &err), PB_OK);
  e2e_request(session, "excite", disturbance);
  e2e_attach(session, "iff", "Va", 0.0);
  const pb_run_options options = {.on_sample = answer, .context = &l, .stall = E2E_CAP};
  if (pb_session_run(session, &options, NULL, &err)) fail_msg("%s", err.message);
  pb_session_detach(session);
  e2e_request(session, "reset", NULL);
  e2e_request(session, "host_controller", iff);
  pb_block block;
  if (pb_session_block(session, NULL, 0, NULL, STEPS, E2E_CAP, &block, &err))
    fail_msg("%s: %s", err.where, err.message);
  assert_memory_equal(block.output, l.y[1], STEPS * sizeof l.y[0]);
  double largest = 0.0;
  for (int i = 0; i < STEPS; i++)
    if (block.input[2 * i] > largest) largest = block.input[2 * i];
  assert_true(largest > 0.0);
  pb_block_clear(&block);
  pb_lti_free(&l.controller);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

static bool two_hosted(const plantbus_PlantStatus *s) {
  return s->hosted._length == 2;
}
static bool one_hosted(const plantbus_PlantStatus *s) {
  return s->hosted._length == 1;
}
static bool is_done(const plantbus_PlantStatus *s) {
  return s->hosted._length == 1 && s->hosted._buffer[0].done;
}

static void the_status_names_what_is_hosted(void **state) {
  (void)state;
  const char *const paused[] = {"--mode", "paused", NULL};
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, paused);
  pb_session *session = e2e_open(&daemon);
  const e2e_raw raw = e2e_raw_join(&daemon);
  const dds_entity_t status = e2e_raw_reader(&raw, PB_TOPIC_STATUS);
  e2e_request(session, "host_controller", iff);
  const double steps = e2e_number(session, "excite",
                                  "{\"channel\":\"sweep\",\"inputs\":[\"Va\"],\"type\":\"chirp\","
                                  "\"amplitude\":1,\"f1\":10,\"f2\":1000,\"seconds\":0.05}",
                                  "steps");
  assert_true(steps == 500.0);
  plantbus_PlantStatus *s = e2e_status_wait(status, two_hosted);
  assert_string_equal(s->hosted._buffer[0].channel, "iff");
  assert_string_equal(s->hosted._buffer[0].kind, "iff");
  assert_string_equal(s->hosted._buffer[1].kind, "chirp");
  plantbus_PlantStatus_free(s, DDS_FREE_ALL);
  e2e_request(session, "remove_controller", "{\"channel\":\"iff\"}");
  plantbus_PlantStatus_free(e2e_status_wait(status, one_hosted), DDS_FREE_ALL);
  e2e_request(session, "step", "{\"n\":501}");
  plantbus_PlantStatus_free(e2e_status_wait(status, is_done), DDS_FREE_ALL);
  dds_delete(raw.participant);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

static void what_cannot_be_hosted(void **state) {
  (void)state;
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  pb_session *session = e2e_open(&daemon);
  e2e_request(session, "host_controller", iff);
  e2e_refused(session, "host_controller", iff, "/channel", "iff");
  e2e_refused(session, "host_controller",
              "{\"channel\":\"a\",\"type\":\"iff\",\"inputs\":[\"Vb\"],\"outputs\":[\"Vs\"],"
              "\"gain\":1}",
              "/inputs/0", "Vb");
  e2e_refused(session, "remove_controller", "{\"channel\":\"nobody\"}", "/channel", "nobody");
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

// In real time the set of hosted items is changed while the step thread runs.
static bool seen(void *context, const pb_sample *sample, double *command) {
  static uint64_t count;
  bool *moved = context;
  (void)command;
  *moved = sample->input[0] == 3.0;
  return !*moved && ++count < 50000;
}

static void real_time_takes_hosted_items_too(void **state) {
  (void)state;
  const char *const realtime[] = {"--mode", "realtime", NULL};
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, realtime);
  pb_session *session = e2e_open(&daemon);
  pb_error err = {PB_OK, "", ""};
  bool moved = false;
  e2e_request(session, "excite",
              "{\"channel\":\"dc\",\"inputs\":[\"Va\"],\"type\":\"step\",\"amplitude\":3}");
  const pb_run_options options = {.on_sample = seen, .context = &moved, .stall = E2E_CAP};
  if (pb_session_run(session, &options, NULL, &err)) fail_msg("%s", err.message);
  assert_true(moved);
  e2e_request(session, "remove_controller", "{\"channel\":\"dc\"}");
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_hosted_loop_is_the_clients_loop),
      cmocka_unit_test(the_status_names_what_is_hosted),
      cmocka_unit_test(what_cannot_be_hosted),
      cmocka_unit_test(real_time_takes_hosted_items_too),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
