// Lockstep over the bus: the description, the same bits as the library in process, channels that
// add up, runs that repeat.
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "fpenv.h"
#include "harness.h"

enum { STEPS = 2000 };

// Deterministic, not a round number, different per step.
static double excitation(uint64_t step) {
  return (double)((step * 7919u) % 1000u) / 333.0 - 1.5;
}

typedef struct recording {
  double scale;
  uint64_t count;
  bool in_order;
  double u[STEPS][2], y[STEPS][2];
} recording;

static bool record(void *context, const pb_sample *sample, double *command) {
  recording *r = context;
  r->in_order =
      r->in_order && sample->step == r->count && sample->time_ns == (int64_t)r->count * 100000;
  if (r->count == STEPS) return false;
  memcpy(r->u[r->count], sample->input, sizeof r->u[0]);
  memcpy(r->y[r->count], sample->output, sizeof r->y[0]);
  r->count++;
  command[0] = r->scale * excitation(sample->step);
  return true;
}

static recording *recording_new(double scale) {
  recording *r = calloc(1, sizeof *r);
  assert_non_null(r);
  r->scale = scale;
  r->in_order = true;
  return r;
}

static pb_status run(pb_session *session, recording *r) {
  const pb_run_options options = {.on_sample = record, .context = r, .stall = E2E_CAP};
  pb_run_report report;
  pb_error err = {PB_OK, "", ""};
  const pb_status status = pb_session_run(session, &options, &report, &err);
  if (status) print_error("%s: %s\n", err.where, err.message);
  return status;
}

static void the_description_carries_the_model(void **state) {
  (void)state;
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  pb_session *session = e2e_open(&daemon);
  const pb_description *d = pb_session_description(session);
  const pb_model *over_bus = pb_session_model(session);
  pb_model *loaded = NULL;
  pb_error err;
  assert_int_equal(pb_model_load(E2E_BENCH, NULL, &loaded, &err), PB_OK);
  assert_string_equal(d->name, "bus-bench");
  assert_string_equal(d->version, PB_VERSION);
  assert_int_equal(strlen(d->plant_sha256), 64);
  assert_non_null(strstr(d->plant_text, "\"plantbus.plant/1\""));
  assert_int_equal(d->mode, PB_LOCKSTEP);
  assert_int_equal(over_bus->nx, loaded->nx);
  assert_string_equal(over_bus->input[1].name, "F");
  assert_string_equal(over_bus->output[1].unit, "m");
  assert_memory_equal(over_bus->bd, loaded->bd, loaded->nx * loaded->nu * sizeof(double));
  assert_memory_equal(over_bus->c, loaded->c, loaded->ny * loaded->nx * sizeof(double));
  pb_model_free(loaded);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

// u[k] as published is what acted over [k−1, k).
static void samples_equal_the_library_bit_for_bit(void **state) {
  (void)state;
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  pb_session *session = e2e_open(&daemon);
  recording *r = recording_new(1.0);
  e2e_attach(session, "test", "Va", 0.0);
  assert_int_equal(run(session, r), PB_OK);
  assert_true(r->in_order);
  const pb_model *model = pb_session_model(session);
  pb_state *here = pb_state_new(model);
  assert_non_null(here);
  const uint64_t saved = pb_flush_denormals();
  double peak = 0.0;
  for (uint64_t k = 0; k < STEPS; k++) {
    double y[2], u[2] = {excitation(k), 0.0};
    pb_step_output(model, here, y);
    assert_memory_equal(r->y[k], y, sizeof y);
    assert_true(r->u[k][0] == (k ? excitation(k - 1) : 0.0) && r->u[k][1] == 0.0);
    pb_step_advance(model, here, u);
    if (y[0] > peak) peak = y[0];
  }
  pb_restore_denormals(saved);
  assert_true(peak > 1e-3);  // the plant did move
  free(here);
  free(r);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

typedef struct partner {
  pb_session *session;
  recording *recording;
  pb_status status;
} partner;

static void *partner_run(void *context) {
  partner *p = context;
  p->status = run(p->session, p->recording);
  pb_session_detach(p->session);
  return NULL;
}

static void two_clients_add_up(void **state) {
  (void)state;
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  pb_session *one = e2e_open(&daemon), *two = e2e_open(&daemon);
  recording *a = recording_new(1.0), *b = recording_new(0.25);
  e2e_attach(one, "first", "Va", 0.0);
  e2e_attach(two, "second", "Va", 0.0);
  partner p = {two, b, PB_ERR_STATE};
  pthread_t thread;
  assert_int_equal(pthread_create(&thread, NULL, partner_run, &p), 0);
  const pb_status status = run(one, a);
  pb_session_detach(one);
  pthread_join(thread, NULL);
  assert_int_equal(status, PB_OK);
  assert_int_equal(p.status, PB_OK);
  assert_true(a->in_order && b->in_order);
  for (uint64_t k = 1; k < STEPS; k++)
    assert_true(a->u[k][0] == excitation(k - 1) + 0.25 * excitation(k - 1));
  assert_memory_equal(a->y, b->y, sizeof a->y);
  free(a);
  free(b);
  pb_session_close(one);
  pb_session_close(two);
  e2e_daemon_end(&daemon);
}

static void two_runs_give_identical_bytes(void **state) {
  (void)state;
  recording *r[2];
  for (int i = 0; i < 2; i++) {
    e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
    pb_session *session = e2e_open(&daemon);
    r[i] = recording_new(1.0);
    e2e_attach(session, "test", "F", 0.0);
    assert_int_equal(run(session, r[i]), PB_OK);
    pb_session_close(session);
    e2e_daemon_end(&daemon);
  }
  assert_memory_equal(r[0], r[1], sizeof *r[0]);
  assert_true(r[0]->y[STEPS - 1][1] != 0.0);
  free(r[0]);
  free(r[1]);
}

// The sample that ended a run begins the next one: nothing is skipped between two runs.
typedef struct counting {
  uint64_t next;  // step expected
  bool gap, repeat;
} counting;

static bool until_fifth(void *context, const pb_sample *sample, double *command) {
  counting *c = context;
  command[0] = 0.0;
  if (sample->step != c->next) c->gap = true;
  if (sample->step % 5 == 0 && sample->step > 0 && !c->repeat) {
    c->repeat = true;
    return false;
  }
  c->repeat = false;
  c->next++;
  return true;
}

static void runs_follow_one_another_without_a_gap(void **state) {
  (void)state;
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  pb_session *session = e2e_open(&daemon);
  e2e_attach(session, "test", "Va", 0.0);
  counting c = {0, false, false};
  const pb_run_options options = {.on_sample = until_fifth, .context = &c, .stall = E2E_CAP};
  for (uint64_t i = 1; i <= 4; i++) {
    pb_error err;
    assert_int_equal(pb_session_run(session, &options, NULL, &err), PB_OK);
    assert_false(c.gap);
    assert_int_equal(c.next, 5 * i);
  }
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(the_description_carries_the_model),
      cmocka_unit_test(samples_equal_the_library_bit_for_bit),
      cmocka_unit_test(two_clients_add_up),
      cmocka_unit_test(two_runs_give_identical_bytes),
      cmocka_unit_test(runs_follow_one_another_without_a_gap),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
