// Block requests: N steps in one exchange are the same steps, bit for bit, as N exchanges.
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "harness.h"

enum { STEPS = 700 };

static double value_at(uint64_t step) {
  return step % 7 < 3 ? 2.0 : -1.0;
}

typedef struct track {
  uint64_t count;
  double y[STEPS + 1][2], u[STEPS + 1][2];
} track;

static bool follow(void *context, const pb_sample *sample, double *command) {
  track *t = context;
  memcpy(t->y[t->count], sample->output, sizeof t->y[0]);
  memcpy(t->u[t->count++], sample->input, sizeof t->u[0]);
  command[0] = value_at(sample->step);
  return t->count <= STEPS;
}

static void by_client(pb_session *session, track *t) {
  const pb_run_options options = {.on_sample = follow, .context = t, .stall = E2E_CAP};
  pb_error err = {PB_OK, "", ""};
  t->count = 0;
  e2e_attach(session, "test", "Va", 0.0);
  if (pb_session_run(session, &options, NULL, &err)) fail_msg("%s", err.message);
  pb_session_detach(session);
}

static void block(pb_session *session, uint64_t first, uint32_t steps, pb_block *out) {
  double *values = malloc(steps * sizeof *values);
  const uint32_t input = 0;
  pb_error err = {PB_OK, "", ""};
  for (uint32_t r = 0; r < steps; r++) values[r] = value_at(first + r);
  if (pb_session_block(session, &input, 1, values, steps, E2E_CAP, out, &err))
    fail_msg("%s: %s", err.where, err.message);
  free(values);
}

static void hash_read(pb_session *session, char hash[17]) {
  char *result = e2e_result(session, "ping", NULL);
  const char *at = strstr(result, "\"hash\":\"");
  assert_non_null(at);
  memcpy(hash, at + 8, 16);
  hash[16] = '\0';
  free(result);
}

static void a_block_is_its_steps(void **state) {
  (void)state;
  static track t;
  char lockstep[17], blocks[17];
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  pb_session *session = e2e_open(&daemon);
  by_client(session, &t);
  hash_read(session, lockstep);
  e2e_request(session, "reset", NULL);
  pb_block a, b;
  block(session, 0, 300, &a);
  block(session, 300, STEPS - 300, &b);
  assert_int_equal(a.step, 0);
  assert_int_equal(b.step, 300);
  assert_int_equal(b.epoch, 2);
  assert_int_equal(b.revision, 1);
  assert_int_equal(b.steps, STEPS - 300);
  assert_memory_equal(a.output, t.y[1], 300 * sizeof t.y[0]);
  assert_memory_equal(b.output, t.y[301], (STEPS - 300) * sizeof t.y[0]);
  assert_memory_equal(a.input, t.u[1], 300 * sizeof t.u[0]);
  hash_read(session, blocks);
  assert_string_equal(blocks, lockstep);
  pb_block_clear(&a);
  pb_block_clear(&b);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

// The hash is of what happened: another input somewhere, and it is another one.
static void the_hash_tells_two_runs_apart(void **state) {
  (void)state;
  char first[17], second[17];
  pb_block out;
  pb_error err;
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  pb_session *session = e2e_open(&daemon);
  block(session, 0, 100, &out);
  pb_block_clear(&out);
  hash_read(session, first);
  e2e_request(session, "reset", NULL);
  double values[100];
  const uint32_t input = 0;
  for (uint32_t r = 0; r < 100; r++) values[r] = value_at(r);
  values[50] = nextafter(values[50], 10.0);
  assert_int_equal(pb_session_block(session, &input, 1, values, 100, E2E_CAP, &out, &err), PB_OK);
  pb_block_clear(&out);
  hash_read(session, second);
  assert_string_not_equal(first, second);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

static void refused(pb_session *session, uint32_t input, double value, uint32_t steps,
                    const char *pointer, const char *words) {
  pb_block out;
  pb_error err = {PB_OK, "", ""};
  double *values = malloc(steps * sizeof *values);
  for (uint32_t r = 0; r < steps; r++) values[r] = value;
  assert_int_equal(pb_session_block(session, &input, 1, values, steps, E2E_CAP, &out, &err),
                   PB_ERR_STATE);
  free(values);
  assert_string_equal(err.where, pointer);
  if (!strstr(err.message, words)) fail_msg("'%s' without '%s'", err.message, words);
}

static void what_a_block_may_not(void **state) {
  (void)state;
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  pb_session *session = e2e_open(&daemon), *other = e2e_open(&daemon);
  refused(session, 2, 1.0, 5, "/inputs", "index 2");
  refused(session, 0, NAN, 5, "/values", "not finite");
  refused(session, 0, 1.0, 70000, "/steps", "70000 steps");
  e2e_attach(other, "loop", "Va", 60.0);
  refused(session, 0, 1.0, 5, "", "attached clients");
  pb_session_detach(other);
  e2e_request(session, "set_mode", "{\"mode\":\"realtime\"}");
  refused(session, 0, 1.0, 5, "", "real time");
  e2e_request(session, "set_mode", "{\"mode\":\"paused\"}");
  pb_block out;
  block(session, 0, 5, &out);
  pb_block_clear(&out);
  pb_session_close(other);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

// The answer of this client's block, once it is there.
static bool block_answered(void *context) {
  void *sample[1] = {NULL};
  dds_sample_info_t info;
  if (dds_take(*(dds_entity_t *)context, sample, &info, 1, 1) != 1) return false;
  const plantbus_BlockReply *r = sample[0];
  const bool ours = info.valid_data && r->id == 1 && r->steps == 3;
  dds_return_loan(*(dds_entity_t *)context, sample, 1);
  return ours;
}

static bool three_steps_taken(void *context) {
  void *sample[1] = {NULL};
  dds_sample_info_t info;
  if (dds_take(*(dds_entity_t *)context, sample, &info, 1, 1) != 1) return false;
  const bool taken = info.valid_data && ((const plantbus_Sample *)sample[0])->step == 3;
  dds_return_loan(*(dds_entity_t *)context, sample, 1);
  return taken;
}

// A block is served once, and the match with its client's reader may be completed after that.
static void an_answer_survives_a_late_match(void **state) {
  (void)state;
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  const e2e_raw raw = e2e_raw_join(&daemon);
  dds_entity_t samples = e2e_raw_reader(&raw, PB_TOPIC_SAMPLE);
  const dds_entity_t writer = e2e_raw_writer(&raw, PB_TOPIC_BLOCK_REQUEST);
  plantbus_BlockRequest request = {.id = 1, .step = UINT64_MAX, .steps = 3};
  memcpy(request.client, raw.client, sizeof request.client);
  assert_int_equal(dds_write(writer, &request), DDS_RETCODE_OK);
  e2e_until(three_steps_taken, &samples, "the block's steps");
  dds_entity_t reader = e2e_raw_reader(&raw, PB_TOPIC_BLOCK_REPLY);
  e2e_until(block_answered, &reader, "the block's answer");
  dds_delete(raw.participant);
  e2e_daemon_end(&daemon);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_block_is_its_steps),
      cmocka_unit_test(the_hash_tells_two_runs_apart),
      cmocka_unit_test(what_a_block_may_not),
      cmocka_unit_test(an_answer_survives_a_late_match),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
