// Live reconfiguration over the bus: patches are checked as a file is, compiled beside the running
// model, swapped at a step boundary, answered, told, kept; what is refused leaves all as it was.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "harness.h"
#include "support/beam.h"

static const char *const paused[] = {"--mode", "paused", NULL};

static char *description_text(const e2e_daemon *daemon, uint32_t *revision) {
  pb_session *session = e2e_open(daemon);
  const pb_description *d = pb_session_description(session);
  char *text = strdup(d->plant_text);
  *revision = d->revision;
  pb_session_close(session);
  return text;
}

static void a_patch_makes_a_revision(void **state) {
  (void)state;
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, paused);
  pb_session *session = e2e_open(&daemon);
  const e2e_raw raw = e2e_raw_join(&daemon);
  const dds_entity_t events = e2e_raw_reader(&raw, PB_TOPIC_EVENT);
  char message[320];
  uint32_t revision;
  assert_true(e2e_change(session, "configure",
                         "{\"patch\":{\"components\":{\"mass\":{\"mass\":25}}},"
                         "\"comment\":\"payload 25 kg\"}",
                         "revision") == 2.0);
  e2e_event_wait(events, "reconfigured", message);
  assert_non_null(strstr(message, "revision 2"));
  assert_non_null(strstr(message, "energy"));
  char *text = description_text(&daemon, &revision);
  assert_int_equal(revision, 2);
  assert_non_null(strstr(text, "\"mass\": 25"));
  free(text);
  char *history = e2e_result(session, "history", NULL);
  assert_non_null(strstr(history, "payload 25 kg"));
  assert_non_null(strstr(history, "\"patch\":{\"components\":{\"mass\":{\"mass\":25}}}"));
  free(history);
  assert_true(e2e_change(session, "revert", "{\"revision\":1}", "revision") == 3.0);
  text = description_text(&daemon, &revision);
  assert_int_equal(revision, 3);
  assert_non_null(strstr(text, "\"mass\": 5"));
  char *kept = e2e_result(session, "get_revision", "{\"revision\":2}");
  assert_non_null(strstr(kept, "\\\"mass\\\": 25"));
  free(kept);
  free(text);
  dds_delete(raw.participant);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

static void what_is_refused_leaves_all_as_it_was(void **state) {
  (void)state;
  static const char *const bad[][3] = {
      {"{\"patch\":{\"models\":{\"apa300ml\":{\"k_1\":-1}}}}", "/models/apa300ml/k_1", ""},
      {"{\"patch\":{\"models\":{\"apa300ml\":{\"k_2\":1}}}}", "/models/apa300ml/k_2", ""},
      {"{\"patch\":{\"connections\":{\"load\":{\"to\":\"nobody\"}}}}", "/connections/load/to", ""},
      {"{\"patch\":{\"name\":\"other\"}}", "/name", "another daemon"},
      {"{\"patch\":{\"sample_rate\":5000}}", "/sample_rate", "another rate"},
      {"{\"patch\":[1]}", "/patch", "expected an object"},
      {"{\"patch\":{},\"extra\":1}", "/extra", ""},
      {"{\"patch\":{},\"at_step\":-1}", "/at_step", ""},
  };
  uint32_t revision, after;
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, paused);
  pb_session *session = e2e_open(&daemon);
  char *before = description_text(&daemon, &revision);
  for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
    e2e_refused(session, "configure", bad[i][0], bad[i][1], bad[i][2]);
  e2e_refused(session, "revert", "{\"revision\":7}", "/revision", "no revision 7");
  char *text = description_text(&daemon, &after);
  assert_string_equal(text, before);
  assert_int_equal(after, revision);
  free(text);
  free(before);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

static void an_input_in_use_stays(void **state) {
  (void)state;
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, paused);
  pb_session *session = e2e_open(&daemon);
  e2e_attach(session, "loop", "F", 60.0);
  static const char without[] =
      "{\"patch\":{\"inputs\":[{\"name\":\"Va\",\"type\":\"actuator_voltage\","
      "\"component\":\"apa\"}]}}";
  e2e_refused(session, "configure", without, "/inputs", "attached to 'F'");
  pb_session_detach(session);
  assert_true(e2e_change(session, "configure", without, "revision") == 2.0);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

static bool change_waits(void *context) {
  pb_error err = {PB_OK, "", ""};
  assert_int_equal(pb_session_request(context, "configure", "{\"patch\":{}}", E2E_CAP, NULL, &err),
                   PB_ERR_STATE);
  return strstr(err.message, "waits for its step") != NULL;
}

// A change that waits for its step keeps others waiting, and can be given up, in every mode.
static void a_waiting_change_can_be_cancelled(void **state) {
  (void)state;
  static const char *const modes[] = {"{\"mode\":\"paused\"}", "{\"mode\":\"realtime\"}"};
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, paused);
  pb_session *session = e2e_open(&daemon);
  const e2e_raw raw = e2e_raw_join(&daemon);
  const dds_entity_t events = e2e_raw_reader(&raw, PB_TOPIC_EVENT);
  char message[320];
  e2e_refused(session, "cancel_configure", "{}", "", "no change of the model");
  for (int i = 0; i < 2; i++) {
    e2e_request(session, "set_mode", modes[i]);
    e2e_request(session, "configure",
                "{\"patch\":{\"components\":{\"mass\":{\"mass\":9}}},\"at_step\":9000000000}");
    e2e_until(change_waits, session, "the change to wait for its step");
    e2e_request(session, "cancel_configure", "{}");
    e2e_event_wait(events, "configure_failed", message);
    assert_non_null(strstr(message, "was cancelled"));
    assert_true(e2e_number(session, "ping", NULL, "revision") == 1.0 + i);
    assert_true(e2e_change(session, "configure", "{\"patch\":{}}", "revision") == 2.0 + i);
  }
  dds_delete(raw.participant);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

enum { STEPS = 400, CHANGE = 150 };

typedef struct track {
  uint64_t count;
  uint32_t revision[STEPS];
  double y[STEPS][2];
  uint64_t step[STEPS];
} track;

static bool follow(void *context, const pb_sample *sample, double *command) {
  track *t = context;
  if (t->count == STEPS) return false;
  t->step[t->count] = sample->step;
  t->revision[t->count] = sample->revision;
  memcpy(t->y[t->count++], sample->output, sizeof t->y[0]);
  command[0] = 10.0;
  return true;
}

// A controller in its loop sees the change at the step that was asked for, without a gap and
// without a jump of what cannot jump; a run that must not mix models ends instead.
static void the_swap_is_at_its_step(void **state) {
  (void)state;
  static track t;
  pb_error err = {PB_OK, "", ""};
  char body[200];
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  pb_session *session = e2e_open(&daemon), *other = e2e_open(&daemon);
  snprintf(body, sizeof body,
           "{\"patch\":{\"components\":{\"mass\":{\"mass\":10}}},\"at_step\":%d}", CHANGE);
  e2e_request(other, "configure", body);  // "accepted": nothing steps yet
  e2e_attach(session, "loop", "Va", 0.0);
  const pb_run_options options = {
      .on_sample = follow, .context = &t, .stall = E2E_CAP, .any_revision = true};
  if (pb_session_run(session, &options, NULL, &err)) fail_msg("%s", err.message);
  for (int i = 0; i < STEPS; i++) {
    assert_int_equal(t.step[i], i);
    assert_int_equal(t.revision[i], i <= CHANGE ? 1 : 2);
  }
  // The displacement goes on with its velocity: what it gains in a step changes by an acceleration
  // times dt², as it did in the step before, or half of that with twice the mass.
  const double first = t.y[CHANGE - 1][1] - t.y[CHANGE - 2][1];
  const double before = t.y[CHANGE][1] - t.y[CHANGE - 1][1];
  const double across = t.y[CHANGE + 1][1] - t.y[CHANGE][1];
  const double change = (across - before) / (before - first);
  if (!(change > 0.4 && change < 1.1)) fail_msg("the velocity changed %g times as much", change);
  pb_session_close(other);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

static bool endless(void *context, const pb_sample *sample, double *command) {
  (void)context;
  (void)sample;
  command[0] = 1.0;
  return true;
}

static void a_run_never_mixes_revisions(void **state) {
  (void)state;
  pb_error err = {PB_OK, "", ""};
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  pb_session *session = e2e_open(&daemon), *other = e2e_open(&daemon);
  e2e_request(other, "configure",
              "{\"patch\":{\"components\":{\"mass\":{\"mass\":10}}},\"at_step\":200}");
  e2e_attach(session, "loop", "Va", 0.0);
  const pb_run_options options = {.on_sample = endless, .stall = E2E_CAP};
  assert_int_equal(pb_session_run(session, &options, NULL, &err), PB_ERR_STATE);
  assert_non_null(strstr(err.message, "revision 1 became 2"));
  pb_session_close(other);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

static bool somebody_attached(const plantbus_PlantStatus *s) {
  return s->attached._length == 1 && s->attached._buffer[0].commands > 0;
}

// The experiment ends with the reason, and no result: nothing was averaged over two models.
static void identify_never_averages_across_revisions(void **state) {
  (void)state;
  char domain[16], csv[96], directory[64];
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  pb_session *session = e2e_open(&daemon);
  const e2e_raw raw = e2e_raw_join(&daemon);
  const dds_entity_t status = e2e_raw_reader(&raw, PB_TOPIC_STATUS);
  snprintf(domain, sizeof domain, "%u", daemon.domain);
  snprintf(directory, sizeof directory, "/tmp/pb-identify-%ld", (long)getpid());
  snprintf(csv, sizeof csv, "%s/identify.csv", directory);
  const char *const argv[] = {
      PB_BIN "/plantbus-identify", "--domain", domain, "--averages", "100000",
      "--most-averages",           "100000",   "-o",   directory,    NULL};
  e2e_child identify = e2e_spawn(argv);
  plantbus_PlantStatus_free(e2e_status_wait(status, somebody_attached), DDS_FREE_ALL);
  assert_true(e2e_change(session, "configure",
                         "{\"patch\":{\"components\":{\"mass\":{\"mass\":6}}}}",
                         "revision") == 2.0);
  assert_int_equal(e2e_reap(&identify), 1);
  assert_int_equal(access(csv, F_OK), -1);
  rmdir(directory);
  dds_delete(raw.participant);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

static bool second_revision(void *context, const pb_sample *sample, double *command) {
  (void)context;
  (void)command;
  return sample->revision < 2;
}

static void real_time_goes_on_with_another_model(void **state) {
  (void)state;
  const char *const realtime[] = {"--mode", "realtime", NULL};
  pb_error err = {PB_OK, "", ""};
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, realtime);
  pb_session *session = e2e_open(&daemon);
  e2e_request(session, "configure",
              "{\"patch\":{\"outputs\":[{\"name\":\"y\",\"type\":\"displacement\","
              "\"frame\":\"mass\",\"direction\":[0,0,1]},{\"name\":\"Vs\",\"type\":"
              "\"sensor_voltage\",\"component\":\"apa\"}]}}");
  const pb_run_options options = {
      .on_sample = second_revision, .stall = E2E_CAP, .any_revision = true};
  if (pb_session_run(session, &options, NULL, &err)) fail_msg("%s", err.message);
  pb_session_close(session);
  session = e2e_open(&daemon);
  assert_string_equal(pb_session_model(session)->output[0].name, "y");
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

// --- the hexapod, its joints as springs or as elements ---

static char element[64];

static int element_make(void **state) {
  (void)state;
  snprintf(element, sizeof element, "/tmp/pb-joint-%ld.mat", (long)getpid());
  return beam_joint_write(element);
}

static int element_remove(void **state) {
  (void)state;
  return unlink(element);
}

static void joints_become_elements_and_back(void **state) {
  (void)state;
  char body[512];
  e2e_daemon daemon = e2e_daemon_start(PB_CONFIG "/plants/nano-hexapod.json", paused);
  pb_session *session = e2e_open(&daemon);
  e2e_request(session, "excite",
              "{\"channel\":\"shaker\",\"inputs\":[\"Va1\",\"Va4\"],\"type\":\"white\","
              "\"rms\":1,\"seed\":1}");
  e2e_request(session, "step", "{\"n\":500}");
  e2e_request(session, "remove_controller", "{\"channel\":\"shaker\"}");
  const double springs = e2e_change(session, "configure", "{\"patch\":{}}", "states");
  snprintf(body, sizeof body,
           "{\"patch\":{\"template\":{\"bottom_joint\":{\"type\":\"super_element\",\"file\":\"%s\","
           "\"nodes\":[3,1],\"modal_damping\":0.01}}}}",
           element);
  assert_true(e2e_change(session, "configure", body, "states") > springs);
  assert_true(e2e_number(session, "history", NULL, "energy_before") > 0.0);
  assert_true(isfinite(e2e_number(session, "history", NULL, "energy_after")));
  e2e_request(session, "step", "{\"n\":500}");
  const double back = e2e_change(session, "revert", "{\"revision\":1}", "states");
  assert_true(back == springs);
  e2e_request(session, "step", "{\"n\":500}");
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

// Who has the answer and looks for the plant anew finds the revision that it tells of.
static void the_description_comes_before_the_answer(void **state) {
  (void)state;
  e2e_daemon daemon = e2e_daemon_start(PB_CONFIG "/plants/nano-hexapod.json", NULL);
  for (uint32_t revision = 2; revision < 12; revision++) {
    pb_session *session = e2e_open(&daemon);
    assert_int_equal(pb_session_description(session)->revision, revision - 1);
    e2e_request(session, "configure", "{\"patch\": {}}");
    pb_session_close(session);
  }
  e2e_daemon_end(&daemon);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_patch_makes_a_revision),
      cmocka_unit_test(what_is_refused_leaves_all_as_it_was),
      cmocka_unit_test(an_input_in_use_stays),
      cmocka_unit_test(a_waiting_change_can_be_cancelled),
      cmocka_unit_test(the_swap_is_at_its_step),
      cmocka_unit_test(a_run_never_mixes_revisions),
      cmocka_unit_test(identify_never_averages_across_revisions),
      cmocka_unit_test(real_time_goes_on_with_another_model),
      cmocka_unit_test(the_description_comes_before_the_answer),
      cmocka_unit_test_setup_teardown(joints_become_elements_and_back, element_make,
                                      element_remove),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
